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

/// Experiments as sections of a report. A chart section is also a figure: its id is the name of a file with
/// the `chart_svg` of its chart.
namespace cairn::report {

Section table_section(const ResultTable& source);

/// The paper's Figures 3 to 5 for these results and the published ones, score versus pose error if the
/// truth is known, and all tables.
std::vector<Section> paper_sections(const PaperResults& results, const PoseTolerance& tolerance);

/// Success by strategy and kind of place, basins of convergence, score versus pose error, and all tables but the
/// basins, whose numbers the chart shows.
/// @param runs those of the analysis
std::vector<Section> study_sections(const Study& study, const StudyAnalysis& analysis,
                                    std::span<const TrialResult> runs);

/// Density estimate for violins: a kernel estimate within the range of the values.
DensityFunction violin_density();

}  // namespace cairn::report
