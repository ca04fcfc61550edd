// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "cairn/experiments/run.hpp"

namespace cairn {

/// Runs as rows of two tables (docs/experiments.md): `runs.csv`, which is the same whenever the same is
/// run, and `timings.csv` with the same keys and how long each took.
///
/// Rows end with LF; a row is complete once that is there.
std::string runs_header();
std::string runs_row(const TrialResult& run);
std::string timings_header();
std::string timings_row(const TrialResult& run);

/// The runs of a `runs.csv`, without durations. A last row that was cut is left out.
/// @throws Error (input) naming line, column and what was expected
std::vector<TrialResult> parse_runs(std::string_view text, std::string_view name);

}  // namespace cairn
