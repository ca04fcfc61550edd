// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "cairn/experiments/result_table.hpp"
#include "cairn/experiments/study_analysis.hpp"

namespace cairn {

/// What a study says, as tables: success by strategy, by kind of place and by pair; comparisons;
/// basins of convergence; whether the score can judge.
std::vector<ResultTable> study_tables(const Study& study, const StudyAnalysis& analysis);

/// The same in sentences, one a line, with their numbers: do the confidences help, where, does the number
/// of observations stand in for the covariance, can the score judge.
std::vector<std::string> study_answers(const Study& study, const StudyAnalysis& analysis);

/// The findings among them, for people who read no more: what was done, which strategies succeed most and
/// least often, which of them differ by more than chance, whether the score can judge. At most a handful of
/// sentences, however many strategies there are.
std::vector<std::string> study_findings(const Study& study, const StudyAnalysis& analysis);

}  // namespace cairn
