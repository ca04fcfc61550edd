// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/core/statistics.hpp"

#include "support/documents.hpp"

namespace cairn::cli {

/// As documents hold them: count, rmse, mean, median, std, min, percentile_95, max.
Json to_json(const ErrorStatistics& statistics);

/// Statistics of angles, from radians.
ErrorStatistics in_degrees(ErrorStatistics radians);

}  // namespace cairn::cli
