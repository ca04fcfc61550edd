// SPDX-License-Identifier: BSD-3-Clause
#include <chrono>
#include <filesystem>
#include <string>
#include <thread>
#include <tuple>

#include "cairn/core/detail/csv.hpp"
#include "cairn/experiments/run.hpp"
#include "cairn/map/operations.hpp"
#include "cairn/report/report.hpp"

#include "cli.hpp"
#include "support/real_data.hpp"

namespace cairn::testing {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

class ExperimentTest : public CliTest {
 protected:
  // Two small maps in one frame, so that the truth is the identity.
  void SetUp() override {
    SyntheticPair pair =
        synthetic_pair({.seed = 5, .landmarks = 200, .frames = 10, .overlap = 0.9});
    write_map(transformed(pair.source, pair.target_from_source), path("source.map"));
    write_map(pair.target, path("target.map"));
    write("truth.txt", "1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n");
  }

  std::vector<TrialResult> runs(const std::string& folder) const {
    return parse_runs(content(folder + "/runs.csv"), "runs.csv");
  }
};

TEST_F(ExperimentTest, PaperWritesAllOfItsResults) {
  const std::string text = answer({"experiment", "paper", "source.map", "target.map", "--truth",
                                   "truth.txt", "-o", "results", "--search-xy"});
  EXPECT_THAT(text, HasSubstr("180 runs"));
  EXPECT_THAT(text, HasSubstr("runs end at the true pose.\nBy k, at that pose: base "));
  EXPECT_THAT(text, HasSubstr("start from the true pose, displaced"));
  EXPECT_THAT(content("results/summary.md"), HasSubstr("runs end at the true pose.\n- By k, "));
  EXPECT_EQ(runs("results").size(), 180U);
  EXPECT_EQ(cairn::detail::parse_csv(content("results/timings.csv"), "t").size(), 181U);
  EXPECT_THAT(content("results/summary.md"), HasSubstr("| k | 5 | y 1 z 0.4 roll 10 yaw 22.5 |"));
  for (const char* const name :
       {"table1_k", "yaw", "xy", "xy_yaw", "iterations", "durations", "successes",
        "rotation_errors", "translation_errors", "xy_search"}) {
    EXPECT_FALSE(content(std::string("results/tables/") + name + ".csv").empty()) << name;
    EXPECT_THAT(content(std::string("results/tables/") + name + ".tex"), HasSubstr("toprule"));
  }
  const Json json = Json::parse(content("results/experiment.json"));
  EXPECT_EQ(json["schema"]["name"], "cairn.experiment");
  EXPECT_THAT(text, HasSubstr(json["findings"][0].get<std::string>()));
  EXPECT_THAT(json["inputs"]["source"]["hash"].get<std::string>(), ::testing::StartsWith("xxh3:"));
  EXPECT_THAT(content("results/experiment.json"), Not(HasSubstr("duration")));
}

TEST_F(ExperimentTest, PaperSaysFromWhereItStarts) {
  const std::string text = answer({"experiment", "paper", "source.map", "target.map", "-o", "r"});
  EXPECT_THAT(text, HasSubstr("start from the maps as they lie, displaced"));
  EXPECT_THAT(content("r/summary.md"), HasSubstr("start from the maps as they lie, displaced"));
  EXPECT_EQ(Json::parse(content("r/experiment.json"))["options"]["start"], "as_read");
}

// The moved one is near enough to its inverse that runs of a study reach the right pose.
TEST_F(ExperimentTest, SaysThatTheTruthIsOfSwappedMaps) {
  const Rigid3 moved = Rigid3::from_roll_pitch_yaw({0.2, 0.1, 0}, 0, 0, 0.1);
  write_map(transformed(read_map(path("source.map")), moved), path("moved.map"));
  write("swapped.txt", matrix_text(moved));
  const Rigid3 far = Rigid3::from_roll_pitch_yaw({2.0, 1.0, 0}, 0, 0, 1.0);
  write_map(transformed(read_map(path("source.map")), far), path("far.map"));
  for (const auto& [map, truth, is_swapped] : {std::tuple{"moved.map", moved, true},
                                               {"far.map", far, true},
                                               {"far.map", far.inverse(), false}}) {
    write("truth_of.txt", matrix_text(truth));
    const std::string folder = std::string(map) + (is_swapped ? "_swapped" : "_right");
    const CommandResult paper =
        cairn({"experiment", "paper", map, "target.map", "--truth", "truth_of.txt", "-o", folder});
    EXPECT_EQ(paper.exit_code, kDone);
    for (const std::string& text : {paper.output, paper.errors, content(folder + "/summary.md")}) {
      EXPECT_EQ(text.find("the inverse of the truth fits the maps better") != text.npos,
                is_swapped);
    }
  }
  write("truth_of.txt", matrix_text(Rigid3::from_roll_pitch_yaw({-3.0, 2.0, 0}, 0, 0, 2.5)));
  EXPECT_THAT(answer({"experiment", "paper", "far.map", "target.map", "--truth", "truth_of.txt",
                      "-o", "wrong"}),
              HasSubstr("hint: No run ends at the true pose, even without displacement"));
  write("study.yaml",
        "name: s\npairs: [{name: a, source: moved.map, target: target.map, truth: swapped.txt}]\n"
        "initial_poses: {count: 5}\nstrategies: [base]\n");
  EXPECT_THAT(cairn({"experiment", "sweep", "study.yaml", "-o", "s"}).errors,
              HasSubstr("a: the inverse of the truth fits 5 poses"));
}

TEST_F(ExperimentTest, PaperAndSweepWriteReports) {
  if (!report::has_viewer()) GTEST_SKIP() << "built without the viewer: no report was written";
  answer({"experiment", "paper", "source.map", "target.map", "-o", "r", "--report", "paper.html"});
  write("study.yaml",
        "name: s\npairs: [{name: a, source: source.map, target: target.map, truth: truth.txt}]\n"
        "initial_poses: {count: 5, yaw_deg: [-20, 20]}\n");
  answer({"experiment", "sweep", "study.yaml", "-o", "s", "--report", "sweep.html"});
  for (const char* const page : {"paper.html", "sweep.html"}) {
    EXPECT_THAT(content(page), HasSubstr("id=\"cairn-report\"")) << page;
  }
  // Later, from what lies in the folders.
  answer({"report", "r", "-o", "r.html"});
  answer({"report", "r", "s", "-o", "both.html"});
  EXPECT_GT(content("both.html").size(), content("r.html").size());
  EXPECT_THAT(content("r.html"), HasSubstr("<title>The paper&#39;s experiments"));
  expect_refusal({"report", ".", "-o", "no.html"}, kBadInput, {"holds no experiment.json"});
  std::string broken = content("r/experiment.json");
  broken.replace(broken.find(R"("success_score_m2": )"), 20, R"("success_score_m2": "x", "_":)");
  write("r/experiment.json", broken);
  expect_refusal({"report", "r", "-o", "no.html"}, kBadInput, {"success_score_m2 is \"x\""});
  EXPECT_FALSE(std::filesystem::exists(path("no.html")));
}

TEST_F(ExperimentTest, PaperGivesTheSameBytesWithAnyNumberOfThreads) {
  for (const char* const threads : {"1", "2"}) {
    answer(
        {"experiment", "paper", "source.map", "target.map", "-o", threads, "--threads", threads});
  }
  for (const char* const name : {"runs.csv", "experiment.json", "tables/iterations.csv"}) {
    EXPECT_EQ(content("1/" + std::string(name)), content("2/" + std::string(name))) << name;
  }
}

TEST_F(ExperimentTest, PaperOverwritesNothing) {
  write("full/notes.txt", "");
  std::filesystem::create_directory(path("full"));
  write("full/notes.txt", "mine");
  expect_refusal({"experiment", "paper", "source.map", "target.map", "-o", "full"}, kWrongUsage,
                 {"full", "is not empty", "a new or an empty folder"});
  EXPECT_EQ(content("full/notes.txt"), "mine");
}

TEST_F(ExperimentTest, PaperClearsWhatAKilledRunLeft) {
  std::filesystem::create_directories(path(".r.cairn-unfinished/r/tables"));
  write(".r.cairn-unfinished/.lock", "");
  write(".r.cairn-unfinished/r/tables/old.csv", "half a table");
  answer({"experiment", "paper", "source.map", "target.map", "-o", "r"});
  EXPECT_TRUE(std::filesystem::exists(path("r/experiment.json")));
  EXPECT_FALSE(std::filesystem::exists(path("r/tables/old.csv")));
  EXPECT_FALSE(std::filesystem::exists(path(".r.cairn-unfinished")));
}

TEST_F(ExperimentTest, PaperNamesABadOption) {
  expect_refusal(
      {"experiment", "paper", "source.map", "target.map", "-o", "r", "--success-score", "-1"},
      kWrongUsage, {"--success-score", "-1"});
  expect_refusal({"experiment", "paper", "source.map", "none.map", "-o", "r"}, kBadInput,
                 {"none.map"});
  EXPECT_FALSE(std::filesystem::exists(path("r")));
}

TEST_F(ExperimentTest, ExperimentAloneNamesItsVerbs) {
  expect_refusal({"experiment"}, kWrongUsage, {"paper", "sweep", "merge"});
}

class SweepTest : public ExperimentTest {
 protected:
  void SetUp() override {
    ExperimentTest::SetUp();
    write("study.yaml",
          "name: small\nseed: 3\npairs:\n"
          "  - {name: a, source: source.map, target: target.map, truth: truth.txt}\n"
          "  - {name: b, source: target.map, target: source.map, truth: truth.txt}\n"
          "initial_poses: {count: 12, x_m: [-0.3, 0.3], yaw_deg: [-40, 40]}\n"
          "align: {max_iterations: 20}\n");
  }
};

TEST_F(SweepTest, AnswersAndKeepsItsRuns) {
  const std::string text = answer({"experiment", "sweep", "study.yaml", "-o", "results"});
  EXPECT_THAT(text, HasSubstr("2 pairs of maps (2 with a known truth), 12 starts each"));
  EXPECT_THAT(text, HasSubstr("Success, highest: "));
  EXPECT_EQ(runs("results").size(), 2U * 12U * 4U);
  EXPECT_THAT(content("results/summary.md"), HasSubstr("## strategies"));
  EXPECT_EQ(content("results/study.yaml"), content("study.yaml"));
  EXPECT_EQ(Json::parse(content("results/experiment.json"))["experiment"], "sweep");
}

// Without a common landmark no run of the pair has a pose, nor an error.
TEST_F(SweepTest, CountsPairsThatFailFromAllStarts) {
  write_map(synthetic_map({.seed = 9, .landmarks = 2, .frames = 5}), path("empty.map"));
  std::string study = content("study.yaml");
  study.replace(study.find("b, source: target.map"), 21, "b, source: empty.map");
  write("study.yaml", study);
  const std::string text = answer({"experiment", "sweep", "study.yaml", "-o", "results"});
  for (const TrialResult& run : runs("results")) EXPECT_EQ(run.trial.pair == "b", !run.error);
  EXPECT_THAT(text, HasSubstr("2 pairs of maps (2 with a known truth)"));
  EXPECT_THAT(content("results/tables/pairs.csv"), HasSubstr("\nb,0,0,0,0\n"));
}

#ifdef CAIRN_HAS_SIMULATION
TEST_F(SweepTest, SimulatesPlacesAndReadsThemLater) {
  write("study.yaml",
        "name: s\npairs:\n"
        "  - {name: desk, simulate: {environment: desk, frames: 12}}\n"
        "initial_poses: {count: 2, x_m: [-0.02, 0.02]}\nstrategies: [base]\n");
  const std::string text = answer({"experiment", "sweep", "study.yaml", "-o", "results"});
  EXPECT_THAT(text, HasSubstr("1 pair of maps (1 with a known truth), 2 starts each"));
  for (const TrialResult& run : runs("results")) EXPECT_TRUE(run.error);
  // All that the sessions saw, several descriptors of a landmark among it.
  const LandmarkMap map = read_map(path("results/maps/desk_source.map"));
  EXPECT_FALSE(map.landmarks().descriptors.value().further.empty());
  const std::string before = content("results/runs.csv");
  std::filesystem::remove(path("results/runs.csv"));
  answer({"experiment", "sweep", "study.yaml", "-o", "results"});
  EXPECT_EQ(content("results/runs.csv"), before);
}
#endif

TEST_F(SweepTest, ShardsMergeToTheSameBytes) {
  answer({"experiment", "sweep", "study.yaml", "-o", "whole"});
  for (const char* const shard : {"1/3", "2/3", "3/3"}) {
    answer({"experiment", "sweep", "study.yaml", "--shard", shard, "-o",
            std::string("part") + shard[0]});
  }
  answer({"experiment", "merge", "part3", "part1", "part2", "-o", "merged"});
  for (const char* const name : {"runs.csv", "summary.md", "tables/strategies.csv"}) {
    EXPECT_EQ(content("merged/" + std::string(name)), content("whole/" + std::string(name)))
        << name;
  }
}

TEST_F(SweepTest, KilledItLosesAndDoublesNothing) {
  answer({"experiment", "sweep", "study.yaml", "-o", "whole"});
  for (int attempt = 0; attempt < 3; ++attempt) {
    Command sweep(command({"experiment", "sweep", "study.yaml", "-o", "killed", "--threads", "1"}),
                  {.folder = path("")});
    const auto limit = std::chrono::steady_clock::now() + std::chrono::seconds(20);
    const auto rows = [&] {
      std::error_code none;
      return std::filesystem::file_size(path("killed/runs.csv"), none);
    };
    const auto before = std::filesystem::exists(path("killed/runs.csv")) ? rows() : 0;
    while (std::chrono::steady_clock::now() < limit &&
           (!std::filesystem::exists(path("killed/runs.csv")) || rows() <= before + 500)) {
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    sweep.send(SIGKILL);
    sweep.wait();
  }
  answer({"experiment", "sweep", "study.yaml", "-o", "killed"});
  EXPECT_EQ(content("killed/runs.csv"), content("whole/runs.csv"));
  EXPECT_EQ(content("killed/summary.md"), content("whole/summary.md"));
}

TEST_F(SweepTest, RefusesMapsThatChangedMeanwhile) {
  answer({"experiment", "sweep", "study.yaml", "-o", "results"});
  const std::string before = content("results/runs.csv");
  write_map(synthetic_map({.seed = 9, .landmarks = 100, .frames = 5}), path("source.map"));
  expect_refusal({"experiment", "sweep", "study.yaml", "-o", "results"}, kBadInput,
                 {"another study", "input a source"});
  EXPECT_EQ(content("results/runs.csv"), before);
}

TEST_F(SweepTest, RefusesAMapThatIsReplacedWhileItRuns) {
  std::string study = content("study.yaml");
  study.replace(study.find("count: 12"), 9, "count: 400");
  // Only the second pair reads it.
  study.replace(study.find("b, source: target.map"), 21, "b, source: third.map");
  write("study.yaml", study);
  std::filesystem::copy_file(path("target.map"), path("third.map"));
  Command sweep(command({"experiment", "sweep", "study.yaml", "-o", "r", "--threads", "1"}),
                {.folder = path("")});
  const auto limit = std::chrono::steady_clock::now() + std::chrono::seconds(20);
  while (std::chrono::steady_clock::now() < limit && !std::filesystem::exists(path("r/runs.csv"))) {
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  write_map(synthetic_map({.seed = 9, .landmarks = 100, .frames = 5}), path("third.map"));
  const CommandResult result = sweep.wait();
  EXPECT_EQ(result.exit_code, kBadInput);
  EXPECT_THAT(result.errors, HasSubstr("third.map: was changed while the study ran"));
  for (const TrialResult& run : runs("r")) EXPECT_EQ(run.trial.pair, "a");
}

TEST_F(SweepTest, CheckTellsWhetherAShardIsCompleteAndChangesNothing) {
  const auto check = [&] {
    return cairn({"experiment", "sweep", "study.yaml", "--shard", "1/2", "-o", "part1", "--check"})
        .exit_code;
  };
  EXPECT_EQ(check(), kNoAlignment);
  EXPECT_FALSE(std::filesystem::exists(path("part1")));
  answer({"experiment", "sweep", "study.yaml", "--shard", "1/2", "-o", "part1"});
  EXPECT_EQ(check(), kDone);
  std::string damaged = content("part1/runs.csv");
  damaged[damaged.size() / 2] ^= 1;
  write("part1/runs.csv", damaged);
  EXPECT_EQ(check(), kNoAlignment);
  EXPECT_EQ(content("part1/runs.csv"), damaged);
  write_map(synthetic_map({.seed = 9, .landmarks = 100, .frames = 5}), path("source.map"));
  EXPECT_EQ(check(), kBadInput);
}

TEST_F(SweepTest, NamesWhatIsWrongWithAStudy) {
  write("bad.yaml",
        "name: x\npairs: [{name: a, source: nowhere.map, target: target.map}]\n"
        "initial_poses: {}\n");
  expect_refusal({"experiment", "sweep", "bad.yaml", "-o", "r"}, kBadInput,
                 {"bad.yaml: pair a", "nowhere.map"});
  write("bad.yaml",
        "name: x\npairs: [{name: a, simulate: {environment: moon}}]\ninitial_poses: {}\n");
  expect_refusal({"experiment", "sweep", "bad.yaml", "-o", "r"}, kBadInput, {"bad.yaml: pair a"});
  expect_refusal({"experiment", "sweep", "study.yaml", "--shard", "4/3", "-o", "r"}, kWrongUsage,
                 {"--shard", "'4/3'", "i/n"});
  expect_refusal({"experiment", "sweep", "study.yaml"}, kWrongUsage, {"--output"});
  EXPECT_FALSE(std::filesystem::exists(path("r")));
}

TEST_F(SweepTest, MergeRefusesAPartThatIsMissing) {
  answer({"experiment", "sweep", "study.yaml", "--shard", "1/2", "-o", "part1"});
  expect_refusal({"experiment", "merge", "part1", "-o", "m"}, kBadInput,
                 {"shard 2 of 2 is missing"});
  EXPECT_FALSE(std::filesystem::exists(path("m")));
}

TEST_F(SweepTest, MergeRefusesAStudyFileThatIsNotThatOfTheRuns) {
  for (const char* const shard : {"1/2", "2/2"}) {
    answer({"experiment", "sweep", "study.yaml", "--shard", shard, "-o",
            std::string("part") + shard[0]});
  }
  const std::string study = content("study.yaml");
  std::string other = study;
  other.replace(other.find("seed: 3"), 7, "seed: 4");
  write("part1/study.yaml", other);
  expect_refusal({"experiment", "merge", "part1", "part2", "-o", "m"}, kBadInput,
                 {"part1/study.yaml", "'seed 4'", "'seed 3'"});
  write("part1/study.yaml", study);
  write("part2/study.yaml", study + "success: {rotation_deg: 1}\n");
  expect_refusal({"experiment", "merge", "part1", "part2", "-o", "m"}, kBadInput,
                 {"part2/study.yaml: success within 1 degrees", "part1/study.yaml"});
  EXPECT_FALSE(std::filesystem::exists(path("m")));
  write("part2/study.yaml", study + "# A comment changes nothing.\n");
  answer({"experiment", "merge", "part1", "part2", "-o", "m"});
}

// The authors' own map, cut in two as nobody knows the truth of: what agrees is all there is to see.
TEST(RealExperiment, TheAuthorsMapCutInTwo) {
  const auto data = real_data();
  if (!data) GTEST_SKIP() << kNoRealData;
  const TemporaryFolder folder;
  const auto cairn = [&](Words words) {
    words.insert(words.begin(), CAIRN_TOOL);
    const CommandResult result =
        run_command(words, {.folder = folder.path(), .limit = std::chrono::seconds(500)});
    EXPECT_EQ(result.exit_code, kDone) << result.errors;
    return result.output;
  };
  const std::string map = (*data / "map_fr1_desk.txt").string();
  cairn({"convert", map, "earlier.map", "--frames", "0:120"});
  cairn({"convert", map, "later.map", "--frames", "120:100000"});
  EXPECT_THAT(cairn({"experiment", "paper", "later.map", "earlier.map", "-o", "results"}),
              HasSubstr("180 runs"));
  const auto runs = parse_runs(read_text(folder / "results/runs.csv"), "runs.csv");
  ASSERT_EQ(runs.size(), 180U);
  for (const TrialResult& run : runs) {
    ASSERT_TRUE(run.score);
    EXPECT_LT(*run.score, *run.initial_score);
    EXPECT_GT(*run.score, 0.01);  // far above the threshold of the paper's own pair
  }
}

}  // namespace
}  // namespace cairn::testing
