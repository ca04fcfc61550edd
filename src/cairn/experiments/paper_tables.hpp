// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "cairn/experiments/paper.hpp"
#include "cairn/experiments/result_table.hpp"

namespace cairn {

/// The tables of the paper and its supplement, with the published numbers next to ours: a table of scores
/// for each experiment (that of k is the paper's Table 1), then iterations, pose errors if the truth is
/// known, and success counts. No times.
/// @param tolerance of a success by the true pose
std::vector<ResultTable> paper_tables(const PaperResults& results, const PoseTolerance& tolerance);

/// Duration of each run, next to the published one.
ResultTable paper_durations(const PaperResults& results);

/// Displacement at which each quadrant failed; for results with a search.
ResultTable search_table(const PaperResults& results);

/// From where the runs start: "the true pose, displaced" or "the maps as they lie, displaced".
std::string_view start_text(const PaperResults& results);

/// "x 0.5 y -0.5 yaw 10": the nonzero parts of a displacement, in metres and degrees; "none" for zero.
std::string describe(const Displacement& displacement);

}  // namespace cairn
