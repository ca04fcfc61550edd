// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "cairn/experiments/run.hpp"

namespace cairn {

/// Runs as rows of two tables (docs/experiments.md): `runs.csv`, which is reproducible, and `timings.csv`
/// with the same keys and the durations.
///
/// Rows end with LF, without which a row is incomplete.
std::string runs_header();
std::string runs_row(const TrialResult& run);
std::string timings_header();
std::string timings_row(const TrialResult& run);

/// The runs of a `runs.csv`, without durations. Leaves out a truncated last row.
/// @throws Error (input) naming line, column and constraint
std::vector<TrialResult> parse_runs(std::string_view text, std::string_view name);

}  // namespace cairn
