// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/experiments/detail/runs_file.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/detail/csv.hpp"
#include "cairn/core/error.hpp"
#include "cairn/experiments/run.hpp"

namespace cairn {
namespace {

using ::testing::HasSubstr;

TrialResult full_run() {
  TrialResult run;
  run.trial = {.pair = "a, \"b\"",
               .experiment = "xy",
               .number = 12,
               .method = Method::kFast,
               .strategy = "covariance",
               .k = 7,
               .initial = {0.1, -0.2, 1e-9, 10, -20, 22.5}};
  run.status = RegistrationStatus::kConverged;
  run.stop_reason = StopReason::kMseChange;
  run.iterations = 87;
  run.cycle_length = 3;
  run.initial_score = 1.0 / 3.0;
  run.score = 0.0034319;
  run.target_from_source = Rigid3(Eigen::Quaterniond(0.9, 0.1, -0.2, 0.3), {1, 2, 1.0 / 7.0});
  run.error = PoseError{0.5, 0.25};
  run.duration_s = 0.125;
  return run;
}

TrialResult failed_run() {
  TrialResult run;
  run.trial = {.pair = "p", .experiment = "k", .number = 1, .strategy = "base"};
  return run;
}

TEST(RunsFile, ReadsBackWhatItWrote) {
  const std::string text = runs_header() + runs_row(full_run()) + runs_row(failed_run());
  const std::vector<TrialResult> runs = parse_runs(text, "runs.csv");
  ASSERT_EQ(runs.size(), 2U);
  EXPECT_EQ(runs[0].trial, full_run().trial);
  EXPECT_EQ(runs[0].status, RegistrationStatus::kConverged);
  EXPECT_EQ(runs[0].stop_reason, StopReason::kMseChange);
  EXPECT_EQ(runs[0].iterations, 87);
  EXPECT_EQ(runs[0].cycle_length, 3);
  EXPECT_EQ(runs[0].score, full_run().score);
  EXPECT_EQ(runs[0].initial_score, full_run().initial_score);
  EXPECT_TRUE(runs[0].target_from_source->matrix().isApprox(full_run().target_from_source->matrix(),
                                                            1e-15));
  EXPECT_NEAR(runs[0].error->rotation_rad, 0.5, 1e-15);
  EXPECT_EQ(runs[0].error->translation, 0.25);
  EXPECT_EQ(runs[1].trial, failed_run().trial);
  EXPECT_FALSE(runs[1].cycle_length);
  EXPECT_FALSE(runs[1].score);
  EXPECT_FALSE(runs[1].target_from_source);
  EXPECT_FALSE(runs[1].error);
}

// A row whose text was changed, with the checksum of the new text.
std::string resealed(std::string row, std::string_view from, std::string_view to) {
  row.replace(row.find(from), from.size(), to);
  row.resize(row.rfind(',') + 1);
  return row + detail::row_checksum(row) + "\n";
}

TEST(RunsFile, NoticesEveryChangedByteOfARow) {
  const std::string row = runs_row(full_run());
  const std::string other = runs_row(failed_run());
  for (std::size_t i = 0; i + 1 < row.size(); ++i) {
    std::string table = runs_header() + other + row + other;
    table[runs_header().size() + other.size() + i] ^= 1;
    // A quote that is not closed makes the rest a truncated row, which is left out.
    try {
      EXPECT_EQ(parse_runs(table, "runs.csv").size(), 1U) << i;
      EXPECT_EQ(row[i], '"') << i;
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::kInput);
    }
    EXPECT_EQ(detail::sound_size(table, runs_header(), "runs.csv"),
              runs_header().size() + other.size())
        << i;
  }
}

TEST(RunsFile, IsSoundUpToARowThatIsNotComplete) {
  const std::string whole = timings_header() + timings_row(full_run()) + timings_row(failed_run());
  EXPECT_EQ(detail::sound_size(whole, timings_header(), "t"), whole.size());
  EXPECT_EQ(detail::sound_size(whole.substr(0, whole.size() - 1), timings_header(), "t"),
            timings_header().size() + timings_row(full_run()).size());
  EXPECT_EQ(detail::sound_size(timings_header().substr(0, 9), timings_header(), "t"), 0U);
  EXPECT_THROW(detail::sound_size("a,b\n", timings_header(), "t"), Error);
  // The power failed before the header was on the disk.
  std::string lost = timings_header() + timings_row(full_run());
  std::fill_n(lost.begin() + 3, lost.size() - 3, '\0');
  EXPECT_EQ(detail::sound_size(lost, timings_header(), "t"), 0U);
  lost[0] ^= 1;
  EXPECT_THROW(detail::sound_size(lost, timings_header(), "t"), Error);
}

TEST(RunsFile, IsSoundWhereAPairsNameHasQuotesAndLineEnds) {
  TrialResult run = full_run();
  run.trial.pair = "a\n\"b\"\nc";
  const std::string table = runs_header() + runs_row(run) + runs_row(full_run());
  EXPECT_EQ(detail::sound_size(table, runs_header(), "runs.csv"), table.size());
  EXPECT_EQ(parse_runs(table, "runs.csv")[0].trial.pair, run.trial.pair);
}

TEST(RunsFile, HoldsNoTimesButTheTimingsFileDoes) {
  TrialResult other = full_run();
  other.duration_s = 99.0;
  EXPECT_EQ(runs_row(full_run()), runs_row(other));
  EXPECT_NE(timings_row(full_run()), timings_row(other));
  EXPECT_EQ(detail::parse_csv(timings_header(), "t")[0].cells.size(),
            detail::parse_csv(timings_row(other), "t")[0].cells.size());
}

TEST(RunsFile, NamesLineAndColumnOfADefect) {
  const auto message = [](const std::string& text) -> std::string {
    try {
      parse_runs(text, "runs.csv");
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_THAT(message(""), HasSubstr("runs.csv:1: no header of a table of runs"));
  EXPECT_THAT(message("a,b\n1,2\n"), HasSubstr("expected pair,experiment,number"));
  EXPECT_THAT(message(runs_header() + "a,b\n"), HasSubstr("runs.csv:2: 2 cells"));
  EXPECT_THAT(
      message(runs_header() + resealed(runs_row(failed_run()), "failed", "fallen")),
      HasSubstr("runs.csv:2: status: 'fallen'; expected converged, stopped, failed, cancelled"));
  EXPECT_THAT(message(runs_header() + resealed(runs_row(full_run()), "22.5", "nan")),
              HasSubstr("yaw_deg: 'nan'; expected a number"));
  std::string row = runs_row(full_run());
  row.replace(row.find("22.5"), 4, "23.5");
  EXPECT_THAT(message(runs_header() + row),
              HasSubstr("expected the checksum of the row; the row is damaged"));
}

}  // namespace
}  // namespace cairn
