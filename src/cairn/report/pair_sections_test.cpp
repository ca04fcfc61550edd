// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/geometry/angles.hpp"
#include "cairn/map/synthetic.hpp"
#include "cairn/report/sections.hpp"

namespace cairn::report {
namespace {

using ::testing::ElementsAre;
using ::testing::StartsWith;

std::vector<std::string> ids(const Report& report) {
  std::vector<std::string> all;
  for (const Section& section : report.sections) all.push_back(section.id);
  return all;
}

class PairSections : public ::testing::Test {
 protected:
  PairSections() {
    AlignOptions options;
    options.method = AlignMethod::kIcp;
    options.prior = PosePrior{.target_from_source = maps_.target_from_source};
    options.trace = true;
    alignment_ = align(maps_.source, maps_.target, options);
    pair_.source = &maps_.source;
    pair_.target = &maps_.target;
    pair_.truth = maps_.target_from_source;
    pair_.alignments = {{&alignment_, "icp", 1}};
  }

  const SyntheticPair maps_ = synthetic_pair({.seed = 3});
  Alignment alignment_;
  ShownPair pair_;
};

TEST_F(PairSections, ShowSceneResultsAndCurves) {
  Report report;
  add_pair(report, pair_, runs_of(pair_));
  EXPECT_THAT(ids(report), ElementsAre("answer", "scene", "strategies", "convergence",
                                       "translation-error", "rotation-error"));
  ASSERT_EQ(report.maps.size(), 2U);
  EXPECT_EQ(report.maps[0].id, "source");
  const auto& scene = std::get<Scene>(report.sections[1].content);
  EXPECT_EQ(scene.target, "target");
  ASSERT_EQ(scene.runs.size(), 1U);
  EXPECT_EQ(scene.runs[0].name, "icp");
}

TEST_F(PairSections, OfSeveralPairsHaveIdsOfTheirOwn) {
  Report report;
  pair_.source_name = "monday.map";
  pair_.target_name = "tuesday.map";
  add_pair(report, pair_, runs_of(pair_), "r2-");
  EXPECT_EQ(report.sections[0].title, "monday.map to tuesday.map");
  for (const std::string& id : ids(report)) EXPECT_THAT(id, StartsWith("r2-"));
  EXPECT_EQ(std::get<Answer>(report.sections[0].content).scene, "r2-scene");
  EXPECT_EQ(std::get<Scene>(report.sections[1].content).source, "r2-source");
  EXPECT_EQ(report.maps[0].id, "r2-source");
}

TEST_F(PairSections, WithoutMapsHaveNoSceneAndNoErrors) {
  pair_.source = nullptr;
  pair_.target = nullptr;
  Report report;
  add_pair(report, pair_, runs_of(pair_));
  EXPECT_THAT(ids(report), ElementsAre("answer", "strategies", "convergence"));
  EXPECT_EQ(std::get<Answer>(report.sections[0].content).scene, std::nullopt);
  EXPECT_TRUE(report.maps.empty());
}

TEST_F(PairSections, LeadWithWhatTheAlignmentCameTo) {
  Report report;
  add_pair(report, pair_, runs_of(pair_));
  const auto& answer = std::get<Answer>(report.sections[0].content);
  EXPECT_EQ(answer.scene, "scene");
  ASSERT_EQ(answer.alignments.size(), 1U);
  const AlignmentAnswer& one = answer.alignments[0];
  EXPECT_EQ(one.name, "icp");
  EXPECT_EQ(one.status, "aligned");
  EXPECT_TRUE(one.judged);
  EXPECT_EQ(one.probability, alignment_.probability);
  EXPECT_EQ(one.reason, alignment_.reason);
  ASSERT_TRUE(one.target_from_source && one.deviations);
  EXPECT_EQ(one.target_from_source->matrix(), alignment_.estimate->matrix());
  ASSERT_TRUE(alignment_.centre);
  EXPECT_EQ(one.deviations->translation, deviations_of(alignment_)->translation);
  const Matrix6d& covariance = *alignment_.registration.covariance;
  for (int i = 0; i < 3; ++i) {
    EXPECT_DOUBLE_EQ(one.deviations->rotation_rad[i], std::sqrt(covariance(i + 3, i + 3)));
  }
  EXPECT_EQ(one.deviations->log_scale, std::nullopt);
  ASSERT_EQ(one.candidates.size(), alignment_.candidates.size());
  EXPECT_EQ(one.candidates[0].probability, alignment_.candidates[0].probability);
  EXPECT_EQ(one.candidates[0].matches, alignment_.candidates[0].support.matches());
  EXPECT_EQ(one.candidates[0].share, alignment_.candidates[0].support.share);
  EXPECT_FALSE(one.candidates[0].evidence.empty());
}

TEST_F(PairSections, NameTheDirectionsThatAreOpen) {
  Alignment open = alignment_;
  open.registration.covariance.reset();
  open.registration.unobservable = {{.translation = {0, 1, 0}, .rotation = {0, 0, 0.5}}};
  pair_.alignments = {{&open, "icp", 1}};
  Report report;
  add_pair(report, pair_, runs_of(pair_));
  const AlignmentAnswer answer = std::get<Answer>(report.sections.front().content).alignments.at(0);
  EXPECT_FALSE(answer.deviations);
  ASSERT_EQ(answer.open.size(), 1U);
  EXPECT_EQ(answer.open[0].translation, Eigen::Vector3d(0, 1, 0));
  EXPECT_EQ(answer.open[0].rotation, Eigen::Vector3d(0, 0, 0.5));
}

TEST_F(PairSections, LeaveTheAnswerOutWhereItStandsElsewhere) {
  pair_.answer = false;
  Report report;
  add_pair(report, pair_, runs_of(pair_));
  EXPECT_EQ(ids(report).front(), "scene");
}

TEST_F(PairSections, ARunSaysTheVerdictNotWhatTheMethodThinksOfItself) {
  Alignment rejected = alignment_;
  rejected.verdict = Verdict::kRejected;
  rejected.reason = "too little in common";
  pair_.alignments = {{&rejected, "icp", 1}};
  const AlignmentRun run = runs_of(pair_).at(0);
  const auto status = std::find_if(run.summary.begin(), run.summary.end(),
                                   [](const auto& entry) { return entry.first == "status"; });
  ASSERT_NE(status, run.summary.end());
  EXPECT_EQ(std::get<std::string>(status->second), "rejected");
}

TEST_F(PairSections, AVerdictIsASentenceAndSeveralAreWords) {
  Alignment rejected = alignment_;
  rejected.verdict = Verdict::kRejected;
  rejected.reason = "too little in common";
  const ShownAlignment one = {&rejected, strategy_name(AlignMethod::kIcp, "base"), 1};
  EXPECT_EQ(verdict_sentence({{one}}), "Rejected: too little in common.");
  Alignment aligned = alignment_;
  aligned.verdict = Verdict::kAligned;
  const ShownAlignment other = {&aligned, strategy_name(AlignMethod::kRobust, "distance"), 1};
  EXPECT_EQ(verdict_sentence({{one, other}}), "base rejected, robust distance aligned.");
}

TEST_F(PairSections, LeaveOutCurvesThatStayFlat) {
  const auto with_scores = [&](double first, double last) {
    Alignment alignment = alignment_;
    RegistrationResult& result = alignment.registration;
    result.initial_score = first;
    for (IterationRecord& iteration : result.history) iteration.score = last;
    result.score = last;
    pair_.alignments = {{&alignment, "base", 1}};
    Report report;
    add_pair(report, pair_, runs_of(pair_));
    const auto all = ids(report);
    return std::find(all.begin(), all.end(), "convergence") != all.end();
  };
  EXPECT_TRUE(with_scores(0.02, 0.01));
  EXPECT_FALSE(with_scores(0.010001, 0.01));
}

TEST(MapSection, ShowsAMapAlone) {
  Report report;
  const SyntheticPair maps = synthetic_pair({.seed = 4});
  add_map(report, maps.source, "desk.map", "r1-");
  ASSERT_EQ(report.sections.size(), 1U);
  EXPECT_EQ(report.sections[0].title, "desk.map");
  EXPECT_EQ(std::get<Scene>(report.sections[0].content).target, "r1-map");
  EXPECT_EQ(report.maps.at(0).name, "desk.map");
}

}  // namespace
}  // namespace cairn::report
