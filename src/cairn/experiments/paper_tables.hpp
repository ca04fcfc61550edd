// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "cairn/experiments/paper.hpp"
#include "cairn/experiments/result_table.hpp"

namespace cairn {

/// What the paper and its supplement tabulate, the published numbers beside ours: a table of scores
/// for each experiment (that of k is the paper's Table 1), then iterations, pose errors where the truth
/// is known, and a count of successes. They hold no times.
/// @param tolerance what counts as a success by the true pose
std::vector<ResultTable> paper_tables(const PaperResults& results, const PoseTolerance& tolerance);

/// How long each run took, beside what is published.
ResultTable paper_durations(const PaperResults& results);

/// Where each quadrant began to fail; for results of a search.
ResultTable search_table(const PaperResults& results);

/// "x 0.5 y -0.5 yaw 10": what is not zero of a displacement, in metres and degrees; "none" of none.
std::string describe(const Displacement& displacement);

}  // namespace cairn
