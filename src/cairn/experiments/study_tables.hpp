// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "cairn/experiments/result_table.hpp"
#include "cairn/experiments/study_analysis.hpp"

namespace cairn {

/// Results of a study as tables: success by strategy, kind of place and pair; comparisons; basins of
/// convergence; whether the score predicts success.
std::vector<ResultTable> study_tables(const Study& study, const StudyAnalysis& analysis);

/// The same in sentences, one per line, with their numbers: whether and where the confidences help, whether
/// observation counts can replace covariances, whether the score predicts success.
std::vector<std::string> study_answers(const Study& study, const StudyAnalysis& analysis);

/// The main findings: what was done, which strategies succeed most and least often, which differ
/// significantly, whether the score predicts success. A handful of sentences for any number of strategies.
std::vector<std::string> study_findings(const Study& study, const StudyAnalysis& analysis);

}  // namespace cairn
