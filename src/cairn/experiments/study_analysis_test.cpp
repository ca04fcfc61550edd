// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/experiments/study_analysis.hpp"

#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/error.hpp"
#include "cairn/experiments/study_tables.hpp"

namespace cairn {
namespace {

using ::testing::HasSubstr;

constexpr std::size_t kPairs = 12;
constexpr std::size_t kStarts = 40;

Study study_of(std::vector<std::string> strategies) {
  Study study;
  study.name = "s";
  for (std::size_t i = 0; i < kPairs; ++i) {
    study.pairs.push_back({(i < kPairs / 2 ? "desk_" : "room_") + std::to_string(i),
                           PairSimulation{.environment = "-"}});
  }
  study.initial_count = kStarts;
  study.initial = {{.x_m = -1.0, .yaw_deg = -80}, {.x_m = 1.0, .yaw_deg = 80}};
  study.strategies = std::move(strategies);
  return study;
}

// Runs whose success is what the function says; the score is low where it says so.
template <class Success, class Score>
std::vector<TrialResult> runs_of(const Study& study, const Success& success, const Score& score) {
  const StudyPlan plan(study);
  std::vector<TrialResult> runs;
  for (std::size_t i = 0; i < plan.size(); ++i) {
    TrialResult run;
    run.trial = plan.trial(i);
    run.status = RegistrationStatus::kConverged;
    run.stop_reason = StopReason::kMseChange;
    run.iterations = 10;
    run.target_from_source = Rigid3();
    run.error = success(run.trial) ? PoseError{0.01, 0.002} : PoseError{1.0, 1.0};
    run.score = score(run);
    runs.push_back(run);
  }
  return runs;
}

double yaw(const Trial& trial) {
  return std::abs(trial.initial.yaw_deg);
}

double honest_score(const TrialResult& run) {
  return run.error->translation < 0.1 ? 0.001 : 0.1;
}

TEST(StudyAnalysis, MeasuresTheBasinOfConvergence) {
  const Study study = study_of({"base", "observations"});
  const auto runs = runs_of(
      study,
      [](const Trial& trial) { return yaw(trial) < (trial.strategy == "base" ? 30.0 : 60.0); },
      honest_score);
  const StudyAnalysis analysis = analyse_study(study, runs);
  ASSERT_EQ(analysis.strategies.size(), 2U);
  EXPECT_EQ(analysis.pairs_with_truth.size(), kPairs);
  EXPECT_THAT(analysis.groups, ::testing::ElementsAre("desk", "room"));
  EXPECT_NEAR(*analysis.strategies[0].success.estimate, 30.0 / 80.0, 0.06);
  EXPECT_NEAR(*analysis.strategies[1].success.estimate, 60.0 / 80.0, 0.06);
  EXPECT_TRUE(analysis.strategies[0].interval->contains(*analysis.strategies[0].success.estimate));
  // Eight bins of 10 degrees; translation says nothing.
  EXPECT_NEAR(*analysis.strategies[0].rotation_radius_rad * 180 / std::numbers::pi, 30.0, 1.0);
  EXPECT_NEAR(*analysis.strategies[1].rotation_radius_rad * 180 / std::numbers::pi, 60.0, 1.0);
  EXPECT_FALSE(analysis.strategies[0].translation_radius);
  EXPECT_NEAR(*analysis.strategies[0].median_translation, 0.002, 1e-15);
}

TEST(StudyAnalysis, TellsABetterStrategyFromAnEqualOne) {
  const Study study = study_of({"base", "covariance", "observations"});
  const auto runs = runs_of(
      study,
      [](const Trial& trial) { return yaw(trial) < (trial.strategy == "base" ? 30.0 : 60.0); },
      honest_score);
  const StudyAnalysis analysis = analyse_study(study, runs);
  ASSERT_EQ(analysis.comparisons.size(), 3U);
  const StrategyComparison& base_covariance = analysis.comparisons[0];
  EXPECT_LT(base_covariance.difference.difference.estimate, -0.3);
  EXPECT_LT(base_covariance.difference.difference.percentile->high, -0.2);
  EXPECT_LT(base_covariance.by_pair_adjusted, 0.01);
  EXPECT_GE(base_covariance.by_pair_adjusted, base_covariance.by_pair.p_value);
  EXPECT_LT(base_covariance.mcnemar_mid_p, 1e-6);
  EXPECT_FALSE(base_covariance.equivalence->equivalent);
  EXPECT_EQ(base_covariance.counts.first_only, 0U);
  const StrategyComparison& covariance_observations = analysis.comparisons[2];
  EXPECT_EQ(covariance_observations.difference.difference.estimate, 0.0);
  EXPECT_EQ(covariance_observations.by_pair_adjusted, 1.0);
  EXPECT_TRUE(covariance_observations.equivalence->equivalent);
  EXPECT_LT(analysis.friedman->p_value, 0.001);
}

TEST(StudyAnalysis, SaysWhetherTheScoreCanJudge) {
  const Study study = study_of({"base"});
  const auto near = [](const Trial& trial) { return yaw(trial) < 40.0; };
  const StudyAnalysis honest = analyse_study(study, runs_of(study, near, honest_score));
  EXPECT_EQ(honest.judgement.median_auc, 1.0);
  EXPECT_EQ(honest.judgement.lowest_is_wrong.count.successes, 0U);
  EXPECT_EQ(honest.judgement.passed_wrong.count.successes, 0U);
  EXPECT_EQ(honest.judgement.refused_right.count.successes, 0U);
  const StudyAnalysis liar = analyse_study(
      study, runs_of(study, near, [](const TrialResult& run) { return 1.0 - honest_score(run); }));
  EXPECT_EQ(liar.judgement.median_auc, 0.0);
  EXPECT_EQ(liar.judgement.lowest_is_wrong.count.successes, kPairs);
}

TEST(StudyAnalysis, WithoutTruthCountsByScoreOnly) {
  Study study = study_of({"base", "observations"});
  for (StudyPair& pair : study.pairs) pair.maps = PairFiles{"a", "b", {}};
  auto runs = runs_of(
      study, [](const Trial& trial) { return yaw(trial) < 40.0; }, honest_score);
  EXPECT_THROW(analyse_study(study, runs), Error) << "errors without a truth";
  for (TrialResult& run : runs) run.error.reset();
  const StudyAnalysis analysis = analyse_study(study, runs);
  EXPECT_TRUE(analysis.pairs_with_truth.empty());
  EXPECT_NEAR(*analysis.strategies[0].score_success.estimate, 0.5, 0.1);
  EXPECT_FALSE(analysis.strategies[0].success.estimate);
  EXPECT_TRUE(analysis.comparisons.empty());
  EXPECT_EQ(study_tables(study, analysis).size(), 1U);
}

// A truth is known or not, whatever the runs come to.
TEST(StudyAnalysis, CountsAPairThatNoRunFindsAPoseFor) {
  Study study = study_of({"base", "observations"});
  study.pairs[1].maps = PairFiles{"a", "b", {}};  // without a truth
  auto runs = runs_of(
      study, [](const Trial&) { return true; }, honest_score);
  for (TrialResult& run : runs) {
    if (run.trial.pair == study.pairs[1].name) run.error.reset();
    if (run.trial.pair != study.pairs[0].name) continue;
    run.status = RegistrationStatus::kFailed;
    run.target_from_source.reset();
    run.error.reset();
    run.score.reset();
  }
  const StudyAnalysis analysis = analyse_study(study, runs, {.bootstrap_resamples = 200});
  EXPECT_EQ(analysis.pairs_with_truth.size(), kPairs - 1);
  const Proportion& success = analysis.strategies[0].success;
  EXPECT_EQ(success.count.trials, kStarts * (kPairs - 1));
  EXPECT_EQ(success.count.successes, kStarts * (kPairs - 2));
  EXPECT_EQ(analysis.strategies[0].pair_rates.front(), 0.0);
  EXPECT_THAT(study_answers(study, analysis).front(),
              HasSubstr("12 pairs of maps (11 with a known truth)"));
  for (const ResultTable& table : study_tables(study, analysis)) {
    if (table.name != "pairs") continue;
    ASSERT_EQ(table.rows.size(), kPairs - 1);
    EXPECT_EQ(table.rows[0][0], ResultTable::Cell("desk_0"));
    EXPECT_EQ(table.rows[1][0], ResultTable::Cell("desk_2"));
  }
}

TEST(StudyAnalysis, IsTheSameWithAnyNumberOfThreads) {
  const Study study = study_of({"base", "observations"});
  const auto runs = runs_of(
      study, [](const Trial& trial) { return (trial.number * 7 + trial.pair.size()) % 3 == 0; },
      honest_score);
  const auto text = [&](unsigned threads) {
    const StudyAnalysis analysis =
        analyse_study(study, runs, {.bootstrap_resamples = 500, .executor = Executor(threads)});
    std::string all;
    for (const ResultTable& table : study_tables(study, analysis)) all += table.csv();
    return all;
  };
  EXPECT_EQ(text(1), text(2));
}

TEST(StudyAnalysis, RefusesTheRunsOfAnotherStudy) {
  const Study study = study_of({"base"});
  auto runs = runs_of(
      study, [](const Trial&) { return true; }, honest_score);
  runs.pop_back();
  EXPECT_THROW(analyse_study(study, runs), Error);
  runs.push_back(runs.front());
  EXPECT_THROW(analyse_study(study, runs), Error);
}

TEST(StudyTables, HaveACellForEachColumn) {
  const Study study = study_of({"base", "observations", "distance"});
  const auto runs = runs_of(
      study, [](const Trial& trial) { return yaw(trial) < 40.0; }, honest_score);
  const StudyAnalysis analysis = analyse_study(study, runs, {.bootstrap_resamples = 200});
  for (const ResultTable& table : study_tables(study, analysis)) {
    SCOPED_TRACE(table.name);
    EXPECT_FALSE(table.rows.empty());
    for (const auto& row : table.rows) EXPECT_EQ(row.size(), table.columns.size());
  }
  const std::vector<std::string> answers = study_answers(study, analysis);
  EXPECT_THAT(answers.front(), HasSubstr("12 pairs of maps"));
  EXPECT_THAT(answers.back(), HasSubstr("0 of 12 pairs"));
}

TEST(StudyTables, LeadWithWhatDiffersHoweverManyComparisonsThereAre) {
  const Study study = study_of({"base", "observations", "distance"});
  const auto same = runs_of(
      study, [](const Trial& trial) { return yaw(trial) < 40.0; }, honest_score);
  const auto findings =
      study_findings(study, analyse_study(study, same, {.bootstrap_resamples = 200}));
  ASSERT_EQ(findings.size(), 4U);
  EXPECT_THAT(findings[0], HasSubstr("Success, highest: "));
  EXPECT_THAT(findings[1],
              HasSubstr("No difference between strategies is significant (3 comparisons"));
  EXPECT_THAT(findings[2], HasSubstr("0 of 12 pairs"));
  EXPECT_THAT(findings[3], HasSubstr("12 pairs of maps"));

  const auto worse = runs_of(
      study, [](const Trial& trial) { return trial.strategy != "distance" && yaw(trial) < 40.0; },
      honest_score);
  const auto different =
      study_findings(study, analyse_study(study, worse, {.bootstrap_resamples = 200}));
  EXPECT_THAT(different[0], HasSubstr("lowest: distance 0.0 %"));
  EXPECT_THAT(different[1], HasSubstr("2 of 3 differences between strategies are significant"));
  EXPECT_THAT(different[1], HasSubstr("base over distance +"));
  EXPECT_THAT(different[1], HasSubstr("observations over distance +"));
}

}  // namespace
}  // namespace cairn
