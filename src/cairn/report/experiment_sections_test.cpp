// SPDX-License-Identifier: BSD-3-Clause
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/report/sections.hpp"

namespace cairn::report {
namespace {

PaperResults some_results(bool with_truth) {
  PaperResults results;
  results.success_score = 0.01;
  double score = 0.001;
  for (const PublishedExperiment& experiment : published_experiments()) {
    for (const std::string_view strategy : kPaperStrategies) {
      TrialResult run;
      run.trial.strategy = strategy;
      run.trial.k = experiment.k;
      run.trial.initial = experiment.initial;
      run.score = score *= 1.02;
      results.has_truth = with_truth;
      if (with_truth) run.error = PoseError{score, score};
      results.runs.push_back(run);
    }
  }
  return results;
}

std::set<std::string> ids(const std::vector<Section>& sections) {
  std::set<std::string> result;
  for (const Section& section : sections) {
    EXPECT_TRUE(result.insert(section.id).second) << section.id << " twice";
    EXPECT_EQ(section.id.find_first_not_of("abcdefghijklmnopqrstuvwxyz0123456789-"),
              std::string::npos)
        << section.id;
  }
  return result;
}

TEST(PaperSections, HoldThePapersFiguresWithAllRuns) {
  const auto sections = paper_sections(some_results(false), {});
  ids(sections);
  std::size_t violins = 0;
  for (const Section& section : sections) {
    const auto* chart = std::get_if<Chart>(&section.content);
    if (chart == nullptr) continue;
    const auto* distribution = std::get_if<DistributionChart>(chart);
    ASSERT_NE(distribution, nullptr);
    ++violins;
    EXPECT_EQ(distribution->groups.size(), 4U);
    const std::size_t count = section.id.starts_with("figure3")   ? 8
                              : section.id.starts_with("figure4") ? 14
                                                                  : 16;
    for (const Distribution& group : distribution->groups) {
      EXPECT_EQ(group.values.size(), count);
      EXPECT_EQ(group.labels.size(), count);
    }
  }
  EXPECT_EQ(violins, 6U);
}

TEST(PaperSections, HoldScoreAgainstErrorWhereTheTruthIsKnown) {
  EXPECT_FALSE(ids(paper_sections(some_results(false), {})).contains("score-against-error"));
  EXPECT_TRUE(ids(paper_sections(some_results(true), {})).contains("score-against-error"));
}

TEST(TableSection, KeepsCellsAndUnits) {
  const Section section = table_section({"some_table",
                                         "Heading. It explains.",
                                         {{"name"}, {"value", "m"}},
                                         {{"a", 1.5}, {"b", std::monostate()}}});
  EXPECT_EQ(section.id, "table-some-table");
  EXPECT_EQ(section.title, "Heading");
  EXPECT_EQ(section.text, "It explains.");
  EXPECT_EQ(table_section({"t", "Heading.", {{"name"}}, {}}).text, std::nullopt);
  const auto& table = std::get<Table>(section.content);
  EXPECT_EQ(table.columns[0].type, CellType::kText);
  EXPECT_EQ(table.columns[1].type, CellType::kNumber);
  EXPECT_EQ(table.columns[1].unit, "m");
  ASSERT_EQ(table.rows.size(), 2U);
  EXPECT_EQ(std::get<double>(table.rows[0][1]), 1.5);
  EXPECT_TRUE(std::holds_alternative<std::monostate>(table.rows[1][1]));
}

TEST(StudySections, ShowSuccessByPairAndBasins) {
  Study study;
  study.name = std::string(1, 's');  // GCC 12 sees an overlap in a literal
  study.pairs = {
      {"desk_1", PairSimulation{}}, {"desk_2", PairSimulation{}}, {"room_1", PairSimulation{}}};
  study.initial_count = 20;
  study.initial = {{.x_m = -1, .yaw_deg = -50}, {.x_m = 1, .yaw_deg = 50}};
  study.strategies = {"base", "observations", "distance"};
  const StudyPlan plan(study);
  std::vector<TrialResult> runs;
  for (std::size_t i = 0; i < plan.size(); ++i) {
    TrialResult run;
    run.trial = plan.trial(i);
    run.status = RegistrationStatus::kConverged;
    run.target_from_source = Rigid3();
    const bool good = std::abs(run.trial.initial.yaw_deg) < 30;
    run.error = good ? PoseError{0.001, 0.001} : PoseError{0.5, 0.5};
    run.score = good ? 0.01 : 0.02;
    runs.push_back(run);
  }
  const auto sections = study_sections(study, summarise_study(study, runs), runs);
  for (const char* const id : {"success", "success-by-place", "success-by-pair", "basins",
                               "score-against-error", "table-strategies", "table-score"}) {
    EXPECT_TRUE(ids(sections).contains(id)) << id;
  }
  for (const Section& section : sections) {
    const auto* chart = std::get_if<Chart>(&section.content);
    if (chart == nullptr || section.id != "success-by-pair") continue;
    const auto& violin = std::get<DistributionChart>(*chart);
    ASSERT_EQ(violin.groups.size(), 3U);
    EXPECT_EQ(violin.groups[0].labels, (std::vector<std::string>{"desk_1", "desk_2", "room_1"}));
  }
}

}  // namespace
}  // namespace cairn::report
