// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/report/pair_sections.hpp"

#include <algorithm>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/map/synthetic.hpp"

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
  EXPECT_THAT(ids(report), ElementsAre("scene", "strategies", "convergence", "translation-error",
                                       "rotation-error"));
  ASSERT_EQ(report.maps.size(), 2U);
  EXPECT_EQ(report.maps[0].id, "source");
  const auto& scene = std::get<Scene>(report.sections[0].content);
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
  EXPECT_EQ(std::get<Scene>(report.sections[0].content).source, "r2-source");
  EXPECT_EQ(report.maps[0].id, "r2-source");
}

TEST_F(PairSections, WithoutMapsHaveNoSceneAndNoErrors) {
  pair_.source = nullptr;
  pair_.target = nullptr;
  Report report;
  add_pair(report, pair_, runs_of(pair_));
  EXPECT_THAT(ids(report), ElementsAre("strategies", "convergence"));
  EXPECT_TRUE(report.maps.empty());
}

TEST_F(PairSections, ARunSaysTheVerdictNotWhatTheMethodThinksOfItself) {
  Alignment rejected = alignment_;
  rejected.verdict = Verdict::kRejected;
  rejected.reason = "too little in common";
  const AlignmentRun run = make_run(rejected, ShownPoints::only_aligned(maps_.source, {}),
                                    ShownPoints::only_aligned(maps_.target, {}), {});
  const auto status = std::find_if(run.summary.begin(), run.summary.end(),
                                   [](const auto& entry) { return entry.first == "status"; });
  ASSERT_NE(status, run.summary.end());
  EXPECT_EQ(std::get<std::string>(status->second), "rejected");
  EXPECT_EQ(verdict_sentence(rejected), "Rejected: too little in common.");
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
