// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/detail/csv.hpp"
#include "cairn/experiments/paper.hpp"

namespace cairn {
namespace {

using ::testing::HasSubstr;

// As if every run had ended with the published outcome.
PaperResults published_as_results() {
  PaperResults results;
  results.success_score = kPublishedSuccessScore;
  for (const PublishedExperiment& experiment : published_experiments()) {
    for (std::size_t s = 0; s < 4; ++s) {
      TrialResult run;
      run.trial.k = experiment.k;
      run.trial.initial = experiment.initial;
      run.score = experiment.outcomes[s].score;
      run.iterations = experiment.outcomes[s].iterations;
      run.duration_s = experiment.outcomes[s].duration_s;
      results.runs.push_back(run);
    }
  }
  return results;
}

TEST(PaperTables, PutPublishedBesideOurs) {
  for (const ResultTable& table : paper_tables(published_as_results(), {})) {
    SCOPED_TRACE(table.name);
    for (const auto& row : table.rows) {
      ASSERT_EQ(row.size(), table.columns.size());
      if (table.name == "successes") {
        EXPECT_EQ(row[2], row[3]);
        continue;
      }
      for (std::size_t s = 0; s < 4; ++s) EXPECT_EQ(row[3 + s], row[7 + s]);
    }
  }
}

TEST(PaperTables, CountThePublishedSuccesses) {
  const auto tables = paper_tables(published_as_results(), {});
  const std::string csv = tables.front().csv();
  // Table 1: base never, "with k = 5 seems to yield the best results" for all three others.
  EXPECT_THAT(csv, HasSubstr("k,base,0 of 7"));
  EXPECT_THAT(csv, HasSubstr("yaw,distance,8 of 8"));
  EXPECT_THAT(csv, HasSubstr("yaw,covariance,7 of 8"));
  EXPECT_THAT(csv, HasSubstr("xy_yaw,covariance,15 of 16"));
  EXPECT_THAT(csv, HasSubstr("xy_yaw,observations,16 of 16"));
}

TEST(PaperTables, HavePoseErrorsWhereThereIsATruthAlsoIfEveryRunFailed) {
  const auto names = [](const PaperResults& results) {
    std::vector<std::string> all;
    for (const ResultTable& table : paper_tables(results, {})) all.push_back(table.name);
    return all;
  };
  PaperResults results = published_as_results();
  EXPECT_THAT(names(results), ::testing::Not(::testing::Contains("rotation_errors")));
  results.has_truth = true;
  EXPECT_THAT(names(results), ::testing::IsSupersetOf({"rotation_errors", "translation_errors"}));
  EXPECT_THAT(paper_tables(results, {}).front().csv(), HasSubstr("0 of 7,0 of 7,0 of 7,0 of 7\n"));
}

TEST(PaperTables, ShowThePublishedDigits) {
  const auto tables = paper_tables(published_as_results(), {});
  EXPECT_THAT(tables[1].csv(), HasSubstr(",4.58499,"));
  for (const ResultTable& table : tables) {
    EXPECT_THAT(table.csv(), ::testing::Not(::testing::ContainsRegex("\\.[0-9]{9}"))) << table.name;
  }
}

TEST(PaperTables, WriteMarkdownAndCsv) {
  const ResultTable table{
      "t", "Title.", {{"name"}, {"value", "m"}}, {{"a|b", 1.0 / 3.0}, {"c", {}}}};
  EXPECT_EQ(table.markdown(), "| name | value (m) |\n|---|--:|\n| a\\|b | 0.3333 |\n| c | - |\n");
  const auto rows = detail::parse_csv(table.csv(), "t.csv");
  ASSERT_EQ(rows.size(), 3U);
  EXPECT_THAT(rows[1].cells, ::testing::ElementsAre("a|b", "0.3333333333333333"));
  EXPECT_THAT(rows[2].cells, ::testing::ElementsAre("c", ""));
}

TEST(PaperTables, WriteLatexWithThePublishedDigits) {
  const ResultTable table{"t",
                          "Title.",
                          {{"a_name"}, {"value", "10^-3 m^2", 6}},
                          {{"50 % & more", 4.58499}, {"c", {}}}};
  EXPECT_EQ(table.latex(), R"(\begin{tabular}{lr}
\toprule
a\_name & value \\
 & 10$^{-3}$ m$^{2}$ \\
\midrule
50 \% \& more & 4.58499 \\
c & - \\
\bottomrule
\end{tabular}
)");
}

// The paper's own conclusions, from its own numbers.
TEST(PaperFindings, SayWhatConvergesFromWhere) {
  PaperResults results = published_as_results();
  results.has_truth = true;  // whose poses pass as the scores do, but for two runs
  for (TrialResult& run : results.runs) {
    run.error.emplace();
    if (!results.score_success(run)) run.error->translation = 1.0;
  }
  results.runs[0].error->translation = 0.0;  // base, k = 1, whose score fails
  results.runs.back().error->translation = 1.0;
  const auto findings = paper_findings(results, {});
  EXPECT_EQ(findings.front(), fmt::format("{} of 180 runs end at the true pose.",
                                          std::count_if(results.runs.begin(), results.runs.end(),
                                                        [](const TrialResult& run) {
                                                          return run.error->translation == 0.0;
                                                        })));
  const std::string all = fmt::format("{}", fmt::join(findings, "\n"));
  EXPECT_THAT(all, HasSubstr("By k, at that pose: base 1 of 7 (up to k = 1), "));
  EXPECT_THAT(all, HasSubstr("published, by the score: base 0 of 7, "));
  EXPECT_THAT(all, HasSubstr("base 4 of 8"));
  EXPECT_THAT(all, HasSubstr("disagree in 2 of 180 runs: 1 pass by the score and do not end at the "
                             "true pose, 1 end there and fail by the score"));
}

TEST(PaperTables, DescribeADisplacementByWhatIsNotZero) {
  EXPECT_EQ(describe(Displacement{}), "none");
  EXPECT_EQ(describe(Displacement{.y_m = -0.5, .yaw_deg = 22.5}), "y -0.5 yaw 22.5");
}

}  // namespace
}  // namespace cairn
