// SPDX-License-Identifier: BSD-3-Clause
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/error.hpp"
#include "cairn/experiments/study.hpp"
#include "cairn/geometry/angles.hpp"

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

TEST(StudySummary, MeasuresTheBasinOfConvergence) {
  const Study study = study_of({"base", "observations"});
  const auto runs = runs_of(
      study,
      [](const Trial& trial) { return yaw(trial) < (trial.strategy == "base" ? 30.0 : 60.0); },
      honest_score);
  const StudySummary summary = summarise_study(study, runs);
  ASSERT_EQ(summary.strategies.size(), 2U);
  EXPECT_EQ(summary.pairs_with_truth.size(), kPairs);
  EXPECT_THAT(summary.groups, ::testing::ElementsAre("desk", "room"));
  EXPECT_NEAR(*summary.strategies[0].success.share(), 30.0 / 80.0, 0.06);
  EXPECT_NEAR(*summary.strategies[1].success.share(), 60.0 / 80.0, 0.06);
  EXPECT_LT(summary.strategies[0].success.low, *summary.strategies[0].success.share());
  EXPECT_GT(summary.strategies[0].success.high, *summary.strategies[0].success.share());
  // Eight bins of 10 degrees by eight of translation, which says nothing.
  const std::vector<SuccessCount>& of_offset = summary.strategies[0].of_offset;
  ASSERT_EQ(of_offset.size(), 64U);
  std::size_t trials = 0;
  for (std::size_t i = 0; i < of_offset.size(); ++i) {
    trials += of_offset[i].trials;
    const double lower = summary.rotation_edges_rad[i / 8];
    if (of_offset[i].trials == 0 || (lower > radians(29.0) && lower < radians(30.0))) continue;
    EXPECT_EQ(*of_offset[i].share(), lower < radians(25.0) ? 1.0 : 0.0) << i;
  }
  EXPECT_EQ(trials, kPairs * kStarts);
  EXPECT_NEAR(*summary.strategies[0].median_translation, 0.002, 1e-15);
}

TEST(StudySummary, SaysWhetherTheScoreCanJudge) {
  const Study study = study_of({"base"});
  const auto near = [](const Trial& trial) { return yaw(trial) < 40.0; };
  const StudySummary honest = summarise_study(study, runs_of(study, near, honest_score));
  EXPECT_EQ(honest.judgement.median_auc, 1.0);
  EXPECT_EQ(honest.judgement.lowest_is_wrong.successes, 0U);
  EXPECT_EQ(honest.judgement.passed_wrong.successes, 0U);
  EXPECT_EQ(honest.judgement.refused_right.successes, 0U);
  const StudySummary liar = summarise_study(
      study, runs_of(study, near, [](const TrialResult& run) { return 1.0 - honest_score(run); }));
  EXPECT_EQ(liar.judgement.median_auc, 0.0);
  EXPECT_EQ(liar.judgement.lowest_is_wrong.successes, kPairs);
}

TEST(StudySummary, WithoutTruthCountsByScoreOnly) {
  Study study = study_of({"base", "observations"});
  for (StudyPair& pair : study.pairs) pair.maps = PairFiles{"a", "b", {}};
  auto runs = runs_of(
      study, [](const Trial& trial) { return yaw(trial) < 40.0; }, honest_score);
  EXPECT_THROW(summarise_study(study, runs), Error) << "errors without a truth";
  for (TrialResult& run : runs) run.error.reset();
  const StudySummary summary = summarise_study(study, runs);
  EXPECT_TRUE(summary.pairs_with_truth.empty());
  EXPECT_NEAR(static_cast<double>(summary.strategies[0].score_successes), 0.5 * kPairs * kStarts,
              0.1 * kPairs * kStarts);
  EXPECT_FALSE(summary.strategies[0].success.share());
  EXPECT_EQ(study_tables(study, summary).size(), 1U);
}

// A truth is known or not, whatever the runs come to.
TEST(StudySummary, CountsAPairThatNoRunFindsAPoseFor) {
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
  const StudySummary summary = summarise_study(study, runs);
  EXPECT_EQ(summary.pairs_with_truth.size(), kPairs - 1);
  const SuccessRate& success = summary.strategies[0].success;
  EXPECT_EQ(success.trials, kStarts * (kPairs - 1));
  EXPECT_EQ(success.successes, kStarts * (kPairs - 2));
  EXPECT_EQ(summary.strategies[0].pair_rates.front(), 0.0);
  EXPECT_THAT(study_findings(study, summary).back(),
              HasSubstr("12 pairs of maps (11 with a known truth)"));
  for (const ResultTable& table : study_tables(study, summary)) {
    if (table.name != "pairs") continue;
    ASSERT_EQ(table.rows.size(), kPairs - 1);
    EXPECT_EQ(table.rows[0][0], ResultTable::Cell("desk_0"));
    EXPECT_EQ(table.rows[1][0], ResultTable::Cell("desk_2"));
  }
}

TEST(StudySummary, RefusesTheRunsOfAnotherStudy) {
  const Study study = study_of({"base"});
  auto runs = runs_of(
      study, [](const Trial&) { return true; }, honest_score);
  runs.pop_back();
  EXPECT_THROW(summarise_study(study, runs), Error);
  runs.push_back(runs.front());
  EXPECT_THROW(summarise_study(study, runs), Error);
}

TEST(StudyTables, HaveACellForEachColumn) {
  const Study study = study_of({"base", "observations", "distance"});
  const auto runs = runs_of(
      study, [](const Trial& trial) { return yaw(trial) < 40.0; }, honest_score);
  const StudySummary summary = summarise_study(study, runs);
  for (const ResultTable& table : study_tables(study, summary)) {
    SCOPED_TRACE(table.name);
    EXPECT_FALSE(table.rows.empty());
    for (const auto& row : table.rows) EXPECT_EQ(row.size(), table.columns.size());
  }
}

TEST(StudyFindings, LeadWithTheHighestAndTheLowestRate) {
  const Study study = study_of({"base", "observations", "distance"});
  const auto runs = runs_of(
      study, [](const Trial& trial) { return trial.strategy != "distance" && yaw(trial) < 40.0; },
      honest_score);
  const auto findings = study_findings(study, summarise_study(study, runs));
  ASSERT_EQ(findings.size(), 3U);
  EXPECT_THAT(findings[0], HasSubstr("Success, highest: observations "));
  EXPECT_THAT(findings[0], HasSubstr("lowest: distance 0.0 % (0.0 to "));
  EXPECT_THAT(findings[1], HasSubstr("0 of 12 pairs"));
  EXPECT_THAT(findings[2], HasSubstr("12 pairs of maps"));
}

}  // namespace
}  // namespace cairn
