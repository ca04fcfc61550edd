// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>
#include <string>
#include <vector>

#include "cairn/experiments/paper.hpp"
#include "cairn/experiments/result_table.hpp"
#include "cairn/experiments/study.hpp"
#include "cairn/report/report.hpp"

/// Experiments as sections of a report.
namespace cairn::report {

Section table_section(const ResultTable& source);

/// The paper's Figures 3 to 5 for these results and the published ones, score versus pose error if the
/// truth is known, and all tables.
std::vector<Section> paper_sections(const PaperResults& results, const PoseTolerance& tolerance);

/// Success by strategy, kind of place and pair, basins of convergence, score versus pose error, and all tables.
/// @param runs those of the summary
std::vector<Section> study_sections(const Study& study, const StudySummary& summary,
                                    std::span<const TrialResult> runs);

}  // namespace cairn::report
