// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>

#include "cairn/merging/merge.hpp"
#include "cairn/report/report.hpp"

namespace cairn::cli {

/// Title, answer, and the sections that a merge has.
void add_merge(report::Report& report, std::span<const MergeInput> maps, const MergeResult& result);

}  // namespace cairn::cli
