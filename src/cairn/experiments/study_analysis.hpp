// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "cairn/core/executor.hpp"
#include "cairn/experiments/statistics/bootstrap.hpp"
#include "cairn/experiments/statistics/equivalence.hpp"
#include "cairn/experiments/statistics/friedman.hpp"
#include "cairn/experiments/statistics/paired_proportions.hpp"
#include "cairn/experiments/statistics/proportion.hpp"
#include "cairn/experiments/statistics/roc.hpp"
#include "cairn/experiments/statistics/signed_rank.hpp"
#include "cairn/experiments/statistics/success_table.hpp"
#include "cairn/experiments/study.hpp"

namespace cairn {

/// Results of one strategy with one method and k. Intervals take the pairs for independent, not their starts; those of
/// proportions are clustered_proportion()'s.
struct StrategySummary {
  /// "observations", after the method's name if that is not ICP, with k if the study has several
  std::string name;
  Proportion success;                     ///< by the true pose, over runs of pairs with truth
  std::optional<Interval> interval;       ///< of the same, by resampling the pairs; of two and more
  Proportion score_success;               ///< by the paper's measure
  std::vector<double> pair_rates;         ///< success by the true pose, as pairs_with_truth
  std::vector<Proportion> group_success;  ///< the same per group, as StudyAnalysis::groups
  double median_iterations = 0.0;
  Proportion at_limit;  ///< runs that ended at the iteration limit
  /// Median errors of the successes; std::nullopt if there are none.
  std::optional<double> median_rotation_rad;
  std::optional<double> median_translation;
  SuccessTable basin;
  /// Largest offset up to which at least 90 % succeed, over all values of the other offset. std::nullopt:
  /// not even the smallest offset reaches that.
  std::optional<double> rotation_radius_rad;
  std::optional<double> translation_radius;
};

/// Two strategies on the same initial poses. The pair of maps is the independent unit; tests over single
/// initial poses, also given, treat those of one pair as independent, which they are not.
struct StrategyComparison {
  std::size_t first = 0;  ///< index into StudyAnalysis::strategies
  std::size_t second = 0;
  PairedCounts counts;             ///< over single initial poses
  ClusteredDifference difference;  ///< of success rates, first - second, by resampling the pairs
  double cohens_h = 0.0;
  std::optional<DiscordantOdds> odds;
  double mcnemar_mid_p = 1.0;              ///< over single initial poses
  SignedRank by_pair;                      ///< Wilcoxon test of the pairs' success rates
  double by_pair_adjusted = 1.0;           ///< its p-value, Holm-adjusted over all comparisons
  std::optional<Equivalence> equivalence;  ///< TOST of the pairs' success rates within the margin
};

/// Whether the score predicts success: is a lower score a better pose?
struct ScoreJudgement {
  std::size_t pairs = 0;    ///< with both successes and failures
  double median_auc = 0.5;  ///< over those pairs, each with its own scores
  double lowest_auc = 0.5;
  std::optional<Roc> pooled;  ///< over all runs; scores relative to the lowest of their pair
  Proportion passed_wrong;    ///< share of the runs with a wrong pose that pass by score
  Proportion refused_right;   ///< share of the runs with a right pose that fail by score
  /// Share of the pairs whose lowest score belongs to a wrong pose.
  Proportion lowest_is_wrong;
};

struct StudyAnalysis {
  std::vector<std::string> pairs;             ///< with runs
  std::vector<std::size_t> pairs_with_truth;  ///< indices into pairs
  std::vector<std::string> groups;     ///< kinds of place: pairs' names without a trailing number
  std::vector<double> lowest_scores;   ///< over all runs of each pair, m²; 0 without runs
  std::vector<double> success_scores;  ///< one per pair, m²
  std::vector<StrategySummary> strategies;
  std::vector<StrategyComparison> comparisons;  ///< of every two strategies
  std::optional<Friedman>
      friedman;              ///< of the pairs' success rates; with at least three strategies
  ScoreJudgement judgement;  ///< only meaningful with truth
};

struct AnalysisOptions {
  std::size_t bootstrap_resamples = 10'000;
  Executor executor = Executor();
};

/// Analysis of a study's runs. Depends only on its arguments, not on the number of threads.
/// @param runs all of the study's, in order
/// @throws Error (misuse) if they are not, or if poses have an error without a truth, or none with one
StudyAnalysis analyse_study(const Study& study, std::span<const TrialResult> runs,
                            const AnalysisOptions& options = {});

}  // namespace cairn
