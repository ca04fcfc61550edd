// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>
#include <string>
#include <vector>

#include "cairn/experiments/paper.hpp"
#include "cairn/experiments/result_table.hpp"
#include "cairn/experiments/study_analysis.hpp"
#include "cairn/report/figures/figures.hpp"
#include "cairn/report/report.hpp"

/// Experiments as sections of a report. A section that is a chart is a figure too: its id is the name of
/// a file, `chart_svg` of its chart what belongs into it.
namespace cairn::report {

Section table_section(const ResultTable& source);

/// The paper's Figures 3 to 5 of these results and of the published ones, score against pose error where
/// the truth is known, and all tables.
std::vector<Section> paper_sections(const PaperResults& results, const PoseTolerance& tolerance);

/// Success by strategy and by kind of place, basins of convergence, score against pose error, and all
/// tables.
/// @param runs as the analysis was made of
std::vector<Section> study_sections(const Study& study, const StudyAnalysis& analysis,
                                    std::span<const TrialResult> runs);

/// The density that violins are drawn with: a kernel estimate within the range of the values.
DensityFunction violin_density();

}  // namespace cairn::report
