// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <span>
#include <utility>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/core/statistics.hpp"
#include "cairn/experiments/detail/success_rate.hpp"
#include "cairn/experiments/paper.hpp"
#include "cairn/experiments/study.hpp"

namespace cairn {
namespace {

constexpr std::size_t kOffsetBins = 8;

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
class RunsByStrategy {
 public:
  RunsByStrategy(const Study& study, std::span<const TrialResult> runs)
      : study_(study), runs_(runs) {
    const StudyPlan plan(study);
    refuse_if(runs.size() != plan.size(), "summarise_study", fmt::format("{} runs", runs.size()),
              fmt::format("the study's {}", plan.size()));
    strategies_ = plan.runs_per_pair() / study.initial_count;
    for (std::size_t i = 0; i < runs.size(); ++i) {
      // A run that found no pose has no error, though there is a truth.
      const bool with_truth = study.pairs[plan.pair_of(i)].has_truth();
      const bool may_have_error = !runs[i].target_from_source || with_truth == !!runs[i].error;
      if (runs[i].trial == plan.trial(i) && may_have_error) continue;
      throw Error(ErrorKind::kMisuse, "summarise_study", fmt::format("run {} is another", i),
                  "the study's runs in their order");
    }
    for (std::size_t pair = 0; pair < pairs(); ++pair) {
      std::optional<double> lowest;
      for (const TrialResult& run :
           runs.subspan(pair * plan.runs_per_pair(), plan.runs_per_pair())) {
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
  const std::vector<double>& lowest_scores() const { return lowest_scores_; }

  const TrialResult& run(std::size_t pair, std::size_t start, std::size_t strategy) const {
    return runs_[(pair * starts() + start) * strategies_ + strategy];
  }

  bool success(const TrialResult& run) const {
    return run.error && study_.success.holds(*run.error);
  }

  bool score_success(std::size_t pair, const TrialResult& run) const {
    return run.score &&
           *run.score < study_.success_score.value_or(success_score_above(lowest_scores_[pair]));
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

// Bins of the initial poses' offsets.
void set_edges(StudySummary& summary, const RunsByStrategy& runs) {
  double rotation = 0.0;
  double translation = 0.0;
  for (std::size_t pair = 0; pair < runs.pairs(); ++pair) {
    for (std::size_t start = 0; start < runs.starts(); ++start) {
      const Rigid3 pose = runs.run(pair, start, 0).trial.initial.pose();
      rotation = std::max(rotation, pose.angle());
      translation = std::max(translation, pose.translation().norm());
    }
  }
  for (auto [end, edges] : {std::pair{rotation, &summary.rotation_edges_rad},
                            std::pair{translation, &summary.translation_edges_m}}) {
    for (std::size_t i = 0; i <= kOffsetBins; ++i) {
      edges->push_back((end > 0.0 ? end : 1.0) * static_cast<double>(i) / kOffsetBins);
    }
  }
}

// Which bin holds a value between its lower and, for the last only, its upper edge.
std::size_t bin_of(double value, const std::vector<double>& edges) {
  const auto above = std::upper_bound(edges.begin(), edges.end(), value) - edges.begin();
  return std::min(static_cast<std::size_t>(above), edges.size() - 1) - 1;
}

StrategySummary summarise(const RunsByStrategy& runs, std::size_t strategy,
                          const StudySummary& whole, detail::RateEstimator& rates) {
  StrategySummary summary;
  summary.name = runs.name(strategy);
  summary.of_offset.resize(kOffsetBins * kOffsetBins);
  // Each with one entry a pair.
  std::vector<SuccessCount> success;
  std::vector<std::vector<SuccessCount>> of_group(whole.groups.size());
  std::vector<double> iterations;
  std::vector<double> rotations;
  std::vector<double> translations;
  for (std::size_t pair = 0; pair < runs.pairs(); ++pair) {
    SuccessCount of_pair;
    for (std::size_t start = 0; start < runs.starts(); ++start) {
      const TrialResult& run = runs.run(pair, start, strategy);
      ++summary.runs;
      iterations.push_back(run.iterations);
      if (run.stop_reason == StopReason::kIterationLimit) ++summary.at_limit;
      if (runs.score_success(pair, run)) ++summary.score_successes;
      if (!runs.with_truth(pair)) continue;
      const bool succeeded = runs.success(run);
      if (succeeded) {
        rotations.push_back(run.error->rotation_rad);
        translations.push_back(run.error->translation);
      }
      of_pair.add(succeeded);
      const Rigid3 offset = run.trial.initial.pose();
      const std::size_t row = bin_of(offset.angle(), whole.rotation_edges_rad);
      const std::size_t column = bin_of(offset.translation().norm(), whole.translation_edges_m);
      summary.of_offset[row * kOffsetBins + column].add(succeeded);
    }
    if (!runs.with_truth(pair)) continue;
    success.push_back(of_pair);
    summary.pair_rates.push_back(static_cast<double>(of_pair.successes) /
                                 static_cast<double>(of_pair.trials));
    const auto group =
        std::find(whole.groups.begin(), whole.groups.end(), group_of(runs.pair_name(pair)));
    of_group[static_cast<std::size_t>(group - whole.groups.begin())].push_back(of_pair);
  }
  summary.success = rates.clustered(success);
  for (const auto& counts : of_group) summary.of_group.push_back(rates.clustered(counts));
  summary.median_iterations = median(iterations);
  if (!rotations.empty()) {
    summary.median_rotation_rad = median(rotations);
    summary.median_translation = median(translations);
  }
  return summary;
}

struct JudgedScore {
  double score = 0.0;
  bool is_right = false;
};

// The probability that of a right and a wrong pose the right one has the lower score, equal ones counting half;
// std::nullopt without both.
std::optional<double> area_under_roc(std::vector<JudgedScore> poses) {
  std::sort(poses.begin(), poses.end(),
            [](const JudgedScore& a, const JudgedScore& b) { return a.score < b.score; });
  double right = 0.0;  // below the score
  double wrong = 0.0;
  double area = 0.0;
  for (std::size_t begin = 0; begin < poses.size();) {
    double equal_right = 0.0;
    double equal_wrong = 0.0;
    const double score = poses[begin].score;
    for (; begin < poses.size() && poses[begin].score == score; ++begin) {
      (poses[begin].is_right ? equal_right : equal_wrong) += 1.0;
    }
    area += equal_wrong * (right + 0.5 * equal_right);
    right += equal_right;
    wrong += equal_wrong;
  }
  if (right == 0.0 || wrong == 0.0) return std::nullopt;
  return area / (right * wrong);
}

ScoreJudgement judge_score(const RunsByStrategy& runs, detail::RateEstimator& rates) {
  ScoreJudgement judgement;
  std::vector<double> areas;
  std::vector<SuccessCount> passed_wrong;  // one a pair
  std::vector<SuccessCount> refused_right;
  SuccessCount lowest_is_wrong;
  for (std::size_t pair = 0; pair < runs.pairs(); ++pair) {
    if (!runs.with_truth(pair)) continue;
    std::vector<JudgedScore> poses;
    passed_wrong.emplace_back();
    refused_right.emplace_back();
    for (std::size_t start = 0; start < runs.starts(); ++start) {
      for (std::size_t strategy = 0; strategy < runs.strategies(); ++strategy) {
        const TrialResult& run = runs.run(pair, start, strategy);
        if (!run.score || !run.error) continue;
        const bool is_right = runs.success(run);
        poses.push_back({*run.score, is_right});
        SuccessCount& count = is_right ? refused_right.back() : passed_wrong.back();
        count.add(runs.score_success(pair, run) != is_right);
      }
    }
    if (poses.empty()) continue;
    const auto lowest = std::min_element(
        poses.begin(), poses.end(),
        [](const JudgedScore& a, const JudgedScore& b) { return a.score < b.score; });
    lowest_is_wrong.add(!lowest->is_right);
    if (const auto area = area_under_roc(std::move(poses))) areas.push_back(*area);
  }
  judgement.pairs = areas.size();
  if (!areas.empty()) {
    judgement.lowest_auc = *std::min_element(areas.begin(), areas.end());
    judgement.median_auc = median(areas);
  }
  judgement.passed_wrong = rates.clustered(passed_wrong);
  judgement.refused_right = rates.clustered(refused_right);
  judgement.lowest_is_wrong = rates.independent(lowest_is_wrong);
  return judgement;
}

}  // namespace

std::optional<double> SuccessCount::share() const {
  if (trials == 0) return std::nullopt;
  return static_cast<double>(successes) / static_cast<double>(trials);
}

StudySummary summarise_study(const Study& study, std::span<const TrialResult> runs_in_order) {
  refuse_if(study.confidence_level <= 0.0 || study.confidence_level >= 1.0,
            "Study.confidence_level", fmt::format("{}", study.confidence_level), "within 0 and 1");
  const RunsByStrategy runs(study, runs_in_order);
  StudySummary summary;
  summary.lowest_scores = runs.lowest_scores();
  for (std::size_t pair = 0; pair < runs.pairs(); ++pair) {
    summary.pairs.push_back(runs.pair_name(pair));
    if (!runs.with_truth(pair)) continue;
    summary.pairs_with_truth.push_back(pair);
    const std::string group = group_of(runs.pair_name(pair));
    if (std::find(summary.groups.begin(), summary.groups.end(), group) == summary.groups.end()) {
      summary.groups.push_back(group);
    }
  }
  set_edges(summary, runs);
  detail::RateEstimator rates(study.confidence_level);
  for (std::size_t strategy = 0; strategy < runs.strategies(); ++strategy) {
    summary.strategies.push_back(summarise(runs, strategy, summary, rates));
  }
  if (!summary.pairs_with_truth.empty()) summary.judgement = judge_score(runs, rates);
  return summary;
}

}  // namespace cairn
