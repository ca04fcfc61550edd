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

/// How one strategy (with one method and k) did.
struct StrategySummary {
  std::string name;    ///< "observations", after the method if that is not ICP, and its k where the
                       ///< study has several
  Proportion success;  ///< by the true pose; runs of pairs without truth do not count
  std::optional<Interval> interval;         ///< of the same, from resampling the pairs
  Proportion score_success;                 ///< by the paper's measure
  std::vector<double> pair_rates;           ///< success by the true pose, one a pair with truth
  std::vector<SuccessCount> group_success;  ///< the same by group, as StudyAnalysis::groups
  double median_iterations = 0.0;
  Proportion at_limit;  ///< runs that the limit of iterations ended
  /// Median errors of the successes: how precise they are. Nothing without successes.
  std::optional<double> median_rotation_rad;
  std::optional<double> median_translation;
  SuccessTable basin;
  /// Up to which offset at least 90 % succeed, whatever the other offset was. Nothing: not even the
  /// nearest.
  std::optional<double> rotation_radius_rad;
  std::optional<double> translation_radius;
};

/// Two strategies on the same starts. The pair of maps is the independent unit: tests over single
/// starts, given beside, take the 200 starts of one pair for as many observations, which they are not.
struct StrategyComparison {
  std::size_t first = 0;  ///< index into StudyAnalysis::strategies
  std::size_t second = 0;
  PairedCounts counts;             ///< over single starts
  ClusteredDifference difference;  ///< of success rates, first - second, resampling the pairs
  double cohens_h = 0.0;
  std::optional<DiscordantOdds> odds;
  double mcnemar_mid_p = 1.0;              ///< over single starts
  SignedRank by_pair;                      ///< Wilcoxon's test of the pairs' success rates
  double by_pair_adjusted = 1.0;           ///< its p-value, by Holm among all comparisons
  std::optional<Equivalence> equivalence;  ///< TOST of the pairs' success rates within the margin
};

/// Whether the score can judge the pose: does a lower score mean success?
struct ScoreJudgement {
  std::size_t pairs = 0;    ///< that had successes and failures
  double median_auc = 0.5;  ///< over those pairs, each with its own scores
  double lowest_auc = 0.5;
  std::optional<Roc> pooled;  ///< of all runs; scores relative to the lowest of their pair
  Proportion passed_wrong;    ///< of the runs that fail by pose, those that pass by score
  Proportion refused_right;   ///< of the runs that succeed by pose, those that fail by score
  /// Of the pairs, those whose lowest score of all runs belongs to a pose that is wrong.
  Proportion lowest_is_wrong;
};

struct StudyAnalysis {
  std::vector<std::string> pairs;  ///< with runs
  std::size_t pairs_with_truth = 0;
  std::vector<std::string>
      groups;  ///< pairs' names without a number at the end: the kinds of place
  std::vector<double> lowest_scores;   ///< of all runs of each pair, m²; 0 of none
  std::vector<double> success_scores;  ///< one a pair, m²
  std::vector<StrategySummary> strategies;
  std::vector<StrategyComparison> comparisons;  ///< of each two strategies
  std::optional<Friedman> friedman;  ///< of the pairs' success rates; with three strategies or more
  ScoreJudgement judgement;          ///< meaningful with truth only
};

struct AnalysisOptions {
  std::size_t bootstrap_resamples = 10'000;
  Executor executor = Executor();
};

/// What a study's runs say. Depends on nothing but its arguments, not on the number of threads.
/// @param runs all of the study's, in its order
/// @throws Error (misuse) if they are not
StudyAnalysis analyse_study(const Study& study, std::span<const TrialResult> runs,
                            const AnalysisOptions& options = {});

}  // namespace cairn
