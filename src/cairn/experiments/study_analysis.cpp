// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/experiments/study_analysis.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/core/statistics.hpp"
#include "cairn/experiments/published.hpp"
#include "cairn/experiments/statistics/multiple_comparisons.hpp"

namespace cairn {
namespace {

constexpr std::size_t kBasinBins = 8;
constexpr double kRadiusLevel = 0.9;

double median(std::span<const double> values) {
  return quantile(values, 0.5);
}

// A pair's name without the number that tells places of one kind apart.
std::string group_of(const std::string& pair) {
  const std::size_t end = pair.find_last_not_of("0123456789");
  if (end == std::string::npos || end + 1 == pair.size() || pair[end] != '_' || end == 0)
    return pair;
  return pair.substr(0, end);
}

// The runs by strategy; all strategies have the same starts in the same order.
class Runs {
 public:
  Runs(const Study& study, std::span<const TrialResult> runs) : study_(study), runs_(runs) {
    const StudyPlan plan(study);
    if (runs.size() != plan.size()) {
      throw Error(ErrorKind::kMisuse, "analyse_study", fmt::format("{} runs", runs.size()),
                  fmt::format("the study's {}", plan.size()));
    }
    strategies_ = plan.runs_per_pair() / study.initial_count;
    for (std::size_t i = 0; i < runs.size(); ++i) {
      // A run that found no pose has no error, though there is a truth.
      const bool with_truth = study.pairs[plan.pair_of(i)].has_truth();
      const bool may_have_error = !runs[i].target_from_source || with_truth == !!runs[i].error;
      if (runs[i].trial == plan.trial(i) && may_have_error) continue;
      throw Error(ErrorKind::kMisuse, "analyse_study", fmt::format("run {} is another", i),
                  "the study's runs in their order");
    }
    for (std::size_t pair = 0; pair < pairs(); ++pair) {
      const auto of_pair = runs.subspan(pair * plan.runs_per_pair(), plan.runs_per_pair());
      std::optional<double> lowest;
      for (const TrialResult& run : of_pair) {
        if (run.score && (!lowest || *run.score < *lowest)) lowest = run.score;
      }
      lowest_scores_.push_back(lowest.value_or(0.0));
    }
  }

  std::size_t strategies() const { return strategies_; }
  std::size_t pairs() const { return study_.pairs.size(); }
  std::size_t starts() const { return study_.initial_count; }  // of each pair
  const std::string& pair_name(std::size_t pair) const { return study_.pairs[pair].name; }
  bool with_truth(std::size_t pair) const { return study_.pairs[pair].has_truth(); }
  double lowest_score(std::size_t pair) const { return lowest_scores_[pair]; }

  const TrialResult& run(std::size_t pair, std::size_t start, std::size_t strategy) const {
    return runs_[(pair * starts() + start) * strategies_ + strategy];
  }

  bool success(const TrialResult& run) const {
    return run.error && study_.success.holds(*run.error);
  }

  double success_score(std::size_t pair) const {
    return study_.success_score.value_or(success_score_above(lowest_scores_[pair]));
  }
  bool score_success(std::size_t pair, const TrialResult& run) const {
    return run.score && *run.score < success_score(pair);
  }

  std::string name(std::size_t strategy) const {
    const Trial& trial = runs_[strategy].trial;
    if (study_.k.size() == 1 || trial.strategy == "base" || !uses_k(trial.method)) {
      return approach_name(trial.method, trial.strategy);
    }
    return fmt::format("{} k={}", approach_name(trial.method, trial.strategy), trial.k);
  }

 private:
  const Study& study_;
  std::span<const TrialResult> runs_;
  std::size_t strategies_ = 0;
  std::vector<double> lowest_scores_;
};

struct Edges {
  std::vector<double> rotation;
  std::vector<double> translation;
};

Edges basin_edges(const Runs& runs) {
  double rotation = 0.0;
  double translation = 0.0;
  for (std::size_t pair = 0; pair < runs.pairs(); ++pair) {
    for (std::size_t start = 0; start < runs.starts(); ++start) {
      const Rigid3 pose = runs.run(pair, start, 0).trial.initial.pose();
      rotation = std::max(rotation, pose.angle());
      translation = std::max(translation, pose.translation().norm());
    }
  }
  const auto even = [](double end) {
    std::vector<double> edges;
    for (std::size_t i = 0; i <= kBasinBins; ++i) {
      edges.push_back((end > 0.0 ? end : 1.0) * static_cast<double>(i) / kBasinBins);
    }
    return edges;
  };
  return {even(rotation), even(translation)};
}

StrategySummary summarise(const Study& study, const Runs& runs, std::size_t strategy,
                          const std::vector<std::string>& groups, const Edges& edges,
                          const AnalysisOptions& options) {
  StrategySummary summary;
  summary.name = runs.name(strategy);
  std::vector<SuccessCount> success;                               // one a pair
  std::vector<std::vector<SuccessCount>> in_group(groups.size());  // the same
  SuccessCount score_success;
  SuccessCount at_limit;
  std::vector<double> iterations;
  std::vector<double> rotations;
  std::vector<double> translations;
  std::vector<DisplacedTrial> displaced;
  std::vector<SuccessTable> basins;  // one a pair
  std::vector<std::vector<double>> clusters;
  for (std::size_t pair = 0; pair < runs.pairs(); ++pair) {
    SuccessCount of_pair;
    std::vector<double> cluster;
    const std::size_t before = displaced.size();
    for (std::size_t start = 0; start < runs.starts(); ++start) {
      const TrialResult& run = runs.run(pair, start, strategy);
      iterations.push_back(run.iterations);
      ++at_limit.trials;
      if (run.stop_reason == StopReason::kIterationLimit) ++at_limit.successes;
      ++score_success.trials;
      if (runs.score_success(pair, run)) ++score_success.successes;
      if (!runs.with_truth(pair)) continue;
      const bool succeeded = runs.success(run);
      ++of_pair.trials;
      if (succeeded) {
        ++of_pair.successes;
        rotations.push_back(run.error->rotation_rad);
        translations.push_back(run.error->translation);
      }
      cluster.push_back(succeeded ? 1.0 : 0.0);
      const Rigid3 offset = run.trial.initial.pose();
      displaced.push_back({offset.angle(), offset.translation().norm(), succeeded});
    }
    if (!runs.with_truth(pair)) continue;
    success.push_back(of_pair);
    summary.pair_rates.push_back(*of_pair.rate());
    clusters.push_back(std::move(cluster));
    const auto group = std::find(groups.begin(), groups.end(), group_of(runs.pair_name(pair)));
    in_group[static_cast<std::size_t>(group - groups.begin())].push_back(of_pair);
    basins.push_back(success_table(std::span(displaced).subspan(before), edges.rotation,
                                   edges.translation, study.confidence_level));
  }
  summary.success = clustered_proportion(success, study.confidence_level);
  for (const auto& pairs : in_group) {
    summary.group_success.push_back(clustered_proportion(pairs, study.confidence_level));
  }
  summary.score_success = estimate_proportion(score_success, study.confidence_level);
  summary.at_limit = estimate_proportion(at_limit, study.confidence_level);
  summary.median_iterations = median(iterations);
  if (!rotations.empty()) {
    summary.median_rotation_rad = median(rotations);
    summary.median_translation = median(translations);
  }
  summary.basin =
      success_table(displaced, edges.rotation, edges.translation, study.confidence_level);
  for (std::size_t cell = 0; cell < summary.basin.cells.size(); ++cell) {
    std::vector<SuccessCount> counts;
    for (const SuccessTable& of_pair : basins) counts.push_back(of_pair.cells[cell].count);
    summary.basin.cells[cell] = clustered_proportion(counts, study.confidence_level);
  }
  std::vector<bool> successes;
  std::vector<double> rotation_offsets;
  std::vector<double> translation_offsets;
  for (const DisplacedTrial& trial : displaced) {
    successes.push_back(trial.success);
    rotation_offsets.push_back(trial.rotation);
    translation_offsets.push_back(trial.translation);
  }
  const auto radius = [&](const std::vector<double>& offsets, const std::vector<double>& bins) {
    return convergence_radius(success_bins(offsets, successes, bins, study.confidence_level),
                              kRadiusLevel);
  };
  summary.rotation_radius_rad = radius(rotation_offsets, edges.rotation);
  summary.translation_radius = radius(translation_offsets, edges.translation);
  if (clusters.size() > 1) {
    const auto mean = [](std::span<const double> values) {
      double sum = 0.0;
      for (const double value : values) sum += value;
      return sum / static_cast<double>(values.size());
    };
    const BootstrapResult bootstrapped =
        bootstrap_clusters(clusters, mean,
                           {.resamples = options.bootstrap_resamples,
                            .confidence = study.confidence_level,
                            .seed = study.seed,
                            .executor = options.executor});
    summary.interval = bootstrapped.bca ? bootstrapped.bca : bootstrapped.percentile;
    // Pairs that are all alike show too little, not certainty.
    if (!summary.interval || summary.interval->low == summary.interval->high) {
      summary.interval = summary.success.interval;
    }
  }
  return summary;
}

StrategyComparison compare(const Study& study, const Runs& runs,
                           const std::vector<StrategySummary>& strategies, std::size_t first,
                           std::size_t second, const AnalysisOptions& options) {
  StrategyComparison comparison;
  comparison.first = first;
  comparison.second = second;
  std::vector<PairedTrial> trials;
  std::vector<bool> firsts;
  std::vector<bool> seconds;
  for (std::size_t pair = 0; pair < runs.pairs(); ++pair) {
    if (!runs.with_truth(pair)) continue;
    for (std::size_t start = 0; start < runs.starts(); ++start) {
      const bool a = runs.success(runs.run(pair, start, first));
      const bool b = runs.success(runs.run(pair, start, second));
      trials.push_back({pair, a, b});
      firsts.push_back(a);
      seconds.push_back(b);
    }
  }
  comparison.counts = count_pairs(firsts, seconds);
  comparison.difference =
      clustered_success_difference(trials, {.resamples = options.bootstrap_resamples,
                                            .confidence = study.confidence_level,
                                            .seed = study.seed,
                                            .executor = options.executor});
  comparison.cohens_h =
      cohens_h(comparison.difference.first_rate, comparison.difference.second_rate);
  comparison.odds = discordant_odds(comparison.counts, study.confidence_level);
  comparison.mcnemar_mid_p = mcnemar_mid_p(comparison.counts);
  std::vector<double> differences;
  for (std::size_t i = 0; i < strategies[first].pair_rates.size(); ++i) {
    differences.push_back(strategies[first].pair_rates[i] - strategies[second].pair_rates[i]);
  }
  comparison.by_pair = wilcoxon_signed_rank(differences);
  comparison.equivalence = tost_paired_means(std::span<const double>(differences),
                                             {-study.equivalence_margin, study.equivalence_margin});
  return comparison;
}

ScoreJudgement judge_score(const Study& study, const Runs& runs) {
  ScoreJudgement judgement;
  std::vector<double> areas;
  std::vector<double> pooled_scores;
  std::vector<bool> pooled_success;
  std::vector<SuccessCount> passed_wrong;  // one a pair
  std::vector<SuccessCount> refused_right;
  SuccessCount lowest_is_wrong;
  for (std::size_t pair = 0; pair < runs.pairs(); ++pair) {
    if (!runs.with_truth(pair)) continue;
    std::vector<double> scores;
    std::vector<bool> success;
    passed_wrong.emplace_back();
    refused_right.emplace_back();
    for (std::size_t start = 0; start < runs.starts(); ++start) {
      for (std::size_t strategy = 0; strategy < runs.strategies(); ++strategy) {
        const TrialResult& run = runs.run(pair, start, strategy);
        if (!run.score || !run.error) continue;
        scores.push_back(*run.score);
        success.push_back(runs.success(run));
        pooled_scores.push_back(*run.score / std::max(runs.lowest_score(pair), 1e-300));
        pooled_success.push_back(success.back());
        SuccessCount& count = success.back() ? refused_right.back() : passed_wrong.back();
        ++count.trials;
        if (runs.score_success(pair, run) != success.back()) ++count.successes;
      }
    }
    if (scores.empty()) continue;
    const auto lowest = std::min_element(scores.begin(), scores.end()) - scores.begin();
    ++lowest_is_wrong.trials;
    if (!success[static_cast<std::size_t>(lowest)]) ++lowest_is_wrong.successes;
    if (const auto roc = roc_analysis(scores, success, ScoreMeaning::kLowerIsBetter)) {
      areas.push_back(roc->auc);
    }
  }
  judgement.pairs = areas.size();
  if (!areas.empty()) {
    judgement.lowest_auc = *std::min_element(areas.begin(), areas.end());
    judgement.median_auc = median(areas);
  }
  judgement.pooled = roc_analysis(pooled_scores, pooled_success, ScoreMeaning::kLowerIsBetter,
                                  study.confidence_level);
  judgement.passed_wrong = clustered_proportion(passed_wrong, study.confidence_level);
  judgement.refused_right = clustered_proportion(refused_right, study.confidence_level);
  judgement.lowest_is_wrong = estimate_proportion(lowest_is_wrong, study.confidence_level);
  return judgement;
}

}  // namespace

StudyAnalysis analyse_study(const Study& study, std::span<const TrialResult> runs_in_order,
                            const AnalysisOptions& options) {
  const Runs runs(study, runs_in_order);
  StudyAnalysis analysis;
  for (std::size_t pair = 0; pair < runs.pairs(); ++pair) {
    analysis.pairs.push_back(runs.pair_name(pair));
    analysis.lowest_scores.push_back(runs.lowest_score(pair));
    analysis.success_scores.push_back(runs.success_score(pair));
    if (!runs.with_truth(pair)) continue;
    analysis.pairs_with_truth.push_back(pair);
    const std::string group = group_of(runs.pair_name(pair));
    if (std::find(analysis.groups.begin(), analysis.groups.end(), group) == analysis.groups.end()) {
      analysis.groups.push_back(group);
    }
  }
  const Edges edges = basin_edges(runs);
  for (std::size_t strategy = 0; strategy < runs.strategies(); ++strategy) {
    analysis.strategies.push_back(
        summarise(study, runs, strategy, analysis.groups, edges, options));
  }
  if (analysis.pairs_with_truth.empty()) return analysis;

  std::vector<double> p_values;
  for (std::size_t first = 0; first < runs.strategies(); ++first) {
    for (std::size_t second = first + 1; second < runs.strategies(); ++second) {
      analysis.comparisons.push_back(
          compare(study, runs, analysis.strategies, first, second, options));
      p_values.push_back(analysis.comparisons.back().by_pair.p_value);
    }
  }
  const std::vector<double> adjusted = holm_adjusted(p_values);
  for (std::size_t i = 0; i < adjusted.size(); ++i) {
    analysis.comparisons[i].by_pair_adjusted = adjusted[i];
  }
  if (runs.strategies() > 2) {
    std::vector<std::vector<double>> blocks(analysis.pairs_with_truth.size());
    for (std::size_t i = 0; i < blocks.size(); ++i) {
      for (const StrategySummary& strategy : analysis.strategies) {
        blocks[i].push_back(strategy.pair_rates[i]);
      }
    }
    analysis.friedman = friedman_test(blocks);
  }
  analysis.judgement = judge_score(study, runs);
  return analysis;
}

}  // namespace cairn
