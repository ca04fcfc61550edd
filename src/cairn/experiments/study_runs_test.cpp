// SPDX-License-Identifier: BSD-3-Clause
#include <barrier>
#include <filesystem>
#include <memory>
#include <string>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/detail/processor.hpp"
#include "cairn/core/error.hpp"
#include "cairn/core/file.hpp"
#include "cairn/experiments/detail/runs_file.hpp"
#include "cairn/experiments/study.hpp"
#include "cairn/map/synthetic.hpp"

#include "support/temporary_folder.hpp"

namespace cairn {
namespace {

using ::testing::UnorderedElementsAre;

using ::testing::HasSubstr;

namespace fs = std::filesystem;

std::string content(const fs::path& path) {
  FileReader file(path);
  return read_all(file);
}

MapPair load(const StudyPair& pair) {
  SyntheticPair synthetic = synthetic_pair(
      {.seed = std::get<PairSimulation>(pair.maps).seed, .landmarks = 150, .frames = 8});
  return {pair.name, std::move(synthetic.source), std::move(synthetic.target),
          synthetic.target_from_source};
}

Study small_study() {
  Study study;
  study.name = "s";
  study.seed = 3;
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    study.pairs.push_back(
        {"p" + std::to_string(seed), PairSimulation{.environment = "-", .seed = seed}});
  }
  study.initial_count = 4;
  study.initial = {{.x_m = -0.2, .yaw_deg = -20}, {.x_m = 0.2, .yaw_deg = 20}};
  study.strategies = {"base", "observations"};
  study.align.max_iterations = 10;
  return study;
}

class StudyRunsTest : public ::testing::Test {
 protected:
  void run(const fs::path& folder, const Shard& shard = {}, unsigned threads = 1) const {
    StudyFolder rows(folder, plan_, shard);
    run_study(plan_, shard, rows, load, {}, {.executor = Executor(threads)});
  }

  // The message of a refusal; the folder must be what it was.
  static std::string refusal(const fs::path& folder, const StudyPlan& plan,
                             const Shard& shard = {}) {
    const std::string before = content(folder / "runs.csv");
    std::string message;
    try {
      StudyFolder rows(folder, plan, shard);
    } catch (const Error& error) {
      message = error.what();
    }
    EXPECT_EQ(content(folder / "runs.csv"), before);
    return message;
  }

  testing::TemporaryFolder folder_;
  StudyPlan plan_ = StudyPlan(small_study());
};

TEST_F(StudyRunsTest, WriteOneRowARunInTheirOrder) {
  run(folder_ / "a");
  const auto runs = parse_runs(content(folder_ / "a/runs.csv"), "runs.csv");
  ASSERT_EQ(runs.size(), plan_.size());
  for (std::size_t i = 0; i < runs.size(); ++i) EXPECT_EQ(runs[i].trial, plan_.trial(i));
}

TEST_F(StudyRunsTest, AreTheSameBytesWithAnyNumberOfThreads) {
  run(folder_ / "a", {}, 1);
  run(folder_ / "b", {}, 2);
  EXPECT_EQ(content(folder_ / "a/runs.csv"), content(folder_ / "b/runs.csv"));
}

TEST_F(StudyRunsTest, LoseAndDoubleNothingWhereverTheyWereCut) {
  run(folder_ / "whole");
  const std::string runs = content(folder_ / "whole/runs.csv");
  const std::string timings = content(folder_ / "whole/timings.csv");
  const std::string identity = content(folder_ / "whole/study.txt");
  for (const std::size_t size : {std::size_t{0}, std::size_t{7}, runs_header().size(),
                                 runs.size() / 3, runs.size() - 1, runs.size()}) {
    for (const std::size_t other : {std::size_t{0}, timings.size() / 2, timings.size()}) {
      const fs::path folder =
          folder_ / ("cut" + std::to_string(size) + "_" + std::to_string(other));
      fs::create_directories(folder);
      write_file(folder / "study.txt", [&](const ByteSink& sink) { sink(identity); });
      write_file(folder / "runs.csv", [&](const ByteSink& sink) { sink(runs.substr(0, size)); });
      write_file(folder / "timings.csv",
                 [&](const ByteSink& sink) { sink(timings.substr(0, other)); });
      run(folder);
      EXPECT_EQ(content(folder / "runs.csv"), runs) << size << " " << other;
      EXPECT_EQ(std::ranges::count(content(folder / "timings.csv"), '\n'), plan_.size() + 1);
    }
  }
}

TEST_F(StudyRunsTest, RunAgainFromADamagedRowOn) {
  run(folder_ / "whole");
  for (const char* const name : {"runs.csv", "timings.csv"}) {
    fs::remove_all(folder_ / "a");
    fs::copy(folder_ / "whole", folder_ / "a");
    std::string text = content(folder_ / "a" / name);
    // As a lost sector leaves it.
    std::fill_n(text.begin() + static_cast<std::ptrdiff_t>(text.size() / 2), 40, '\0');
    write_file(folder_ / "a" / name, [&](const ByteSink& sink) { sink(text); });
    EXPECT_GT(StudyFolder(folder_ / "a", plan_, {}).done(), plan_.size() / 4);
    run(folder_ / "a");
    EXPECT_EQ(content(folder_ / "a/runs.csv"), content(folder_ / "whole/runs.csv"));
  }
}

TEST_F(StudyRunsTest, NameTheKindsOfProcessorTheyAreFrom) {
  run(folder_ / "a");
  EXPECT_EQ(StudyFolder(folder_ / "a", plan_, {}).processors(),
            std::vector<std::string>{detail::processor_kind()});
  write_file(folder_ / "a/processors.txt", [](const ByteSink& sink) { sink("abacus\n"); });
  EXPECT_THAT(StudyFolder(folder_ / "a", plan_, {}).processors(),
              UnorderedElementsAre("abacus", detail::processor_kind()));
  EXPECT_THAT(merge_study({folder_ / "a"}, folder_ / "merged"),
              UnorderedElementsAre("abacus", detail::processor_kind()));
}

TEST_F(StudyRunsTest, GoOnAfterTheyWereStopped) {
  run(folder_ / "whole");
  std::stop_source stop;
  {
    StudyFolder rows(folder_ / "a", plan_, {});
    const auto stop_after_five = [&](double) {
      if (rows.done() == 5) stop.request_stop();
    };
    const Execution execution{.stop = stop.get_token(), .progress = stop_after_five};
    EXPECT_THROW(run_study(plan_, {}, rows, load, {}, execution), Error);
    EXPECT_LT(rows.done(), plan_.size());
  }
  run(folder_ / "a");
  EXPECT_EQ(content(folder_ / "a/runs.csv"), content(folder_ / "whole/runs.csv"));
}

TEST_F(StudyRunsTest, AskForNoMapsOfWhatIsDone) {
  run(folder_ / "a");
  StudyFolder rows(folder_ / "a", plan_, {});
  run_study(plan_, {}, rows,
            [](const StudyPair&) -> MapPair { throw std::runtime_error("asked"); });
}

TEST_F(StudyRunsTest, MergeToWhatOneProcessWrites) {
  run(folder_ / "whole");
  for (const std::size_t count : {std::size_t{1}, std::size_t{5}, std::size_t{30}}) {
    const std::string name = std::to_string(count);
    std::vector<fs::path> shards;
    for (std::size_t i = count; i >= 1; --i) {
      shards.push_back(folder_ / (name + "_" + std::to_string(i)));
      run(shards.back(), {i, count});
    }
    merge_study(shards, folder_ / name);
    EXPECT_EQ(content(folder_ / name / "runs.csv"), content(folder_ / "whole/runs.csv"));
    EXPECT_EQ(content(folder_ / name / "study.txt"), content(folder_ / "whole/study.txt"));
    // It is a folder as any other.
    StudyFolder rows(folder_ / name, plan_, {});
    EXPECT_EQ(rows.done(), plan_.size());
  }
}

TEST_F(StudyRunsTest, MergeRefusesWhatIsNotTheWholeOfOneStudy) {
  const auto message = [&](const std::vector<fs::path>& shards) -> std::string {
    try {
      merge_study(shards, folder_ / "merged");
    } catch (const Error& error) {
      EXPECT_FALSE(fs::exists(folder_ / "merged"));
      return error.what();
    }
    return "";
  };
  const fs::path one = folder_ / "1";
  const fs::path two = folder_ / "2";
  run(one, {1, 2});
  run(two, {2, 2});
  EXPECT_THAT(message({one}), HasSubstr("shard 2 of 2 is missing"));
  EXPECT_THAT(message({one, two, one}), HasSubstr("is shard 1 as "));
  run(folder_ / "third", {2, 3});
  EXPECT_THAT(message({one, folder_ / "third"}), HasSubstr("one of 3 shards"));
  Study other = small_study();
  other.seed = 4;
  {
    const StudyPlan plan(other);
    StudyFolder rows(folder_ / "other", plan, {2, 2});
  }
  EXPECT_THAT(message({one, folder_ / "other"}), HasSubstr("'seed 4'; expected 'seed 3'"));
  fs::resize_file(two / "runs.csv", fs::file_size(two / "runs.csv") - 3);
  EXPECT_THAT(message({one, two}), HasSubstr("run the shard again to complete it"));
  EXPECT_THAT(message({folder_ / "none"}), HasSubstr("study.txt"));
}

TEST_F(StudyRunsTest, MergeClearsWhatAKilledMergeLeft) {
  run(folder_ / "a");
  fs::create_directories(folder_ / ".m.cairn-unfinished/m");
  folder_.write(".m.cairn-unfinished/.lock", "");
  folder_.write(".m.cairn-unfinished/m/.runs.csv.cairn-unfinished", "half");
  merge_study({folder_ / "a"}, folder_ / "m");
  EXPECT_EQ(content(folder_ / "m/runs.csv"), content(folder_ / "a/runs.csv"));
  EXPECT_FALSE(fs::exists(folder_ / ".m.cairn-unfinished"));
  EXPECT_THROW(merge_study({folder_ / "a"}, folder_ / "m"), Error) << "it is there";
}

TEST_F(StudyRunsTest, AreCompleteOnlyIfAllAreThereAndSound) {
  EXPECT_FALSE(is_complete(folder_ / "none", plan_, {}));
  EXPECT_FALSE(fs::exists(folder_ / "none"));
  run(folder_ / "a");
  EXPECT_TRUE(is_complete(folder_ / "a", plan_, {}));
  for (const char* const name : {"runs.csv", "timings.csv"}) {
    const fs::path path = folder_ / "a" / name;
    const std::string whole = content(path);
    std::string damaged = whole;
    damaged[whole.size() / 2] ^= 1;
    for (const std::string& text :
         {damaged, whole + "more", whole.substr(0, whole.size() - 1), std::string()}) {
      write_file(path, [&](const ByteSink& sink) { sink(text); });
      EXPECT_FALSE(is_complete(folder_ / "a", plan_, {})) << name;
      EXPECT_EQ(content(path), text);
    }
    write_file(path, [&](const ByteSink& sink) { sink(whole); });
  }
  EXPECT_THROW(is_complete(folder_ / "a", plan_, {}, {"input x 1"}), Error);
  EXPECT_THROW(is_complete(folder_ / "a", plan_, {1, 2}), Error);
}

TEST_F(StudyRunsTest, AreOfTheStudyThatTheyWereMadeFrom) {
  { const StudyFolder rows(folder_ / "a", plan_, {}, {"input x 1"}); }
  require_runs_of(folder_ / "a", small_study(), "study.yaml");
  Study judged_otherwise = small_study();
  judged_otherwise.success.rotation_deg *= 2.0;
  require_runs_of(folder_ / "a", judged_otherwise, "study.yaml");
  Study other = small_study();
  other.seed = 4;
  try {
    require_runs_of(folder_ / "a", other, "study.yaml");
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::kInput);
    EXPECT_THAT(error.what(), HasSubstr("study.yaml: is not the study of the runs beside it: "
                                        "'seed 4'; expected 'seed 3'"));
  }
}

TEST_F(StudyRunsTest, KeepTheRowsOfAnotherStudy) {
  run(folder_ / "a");
  Study other = small_study();
  other.initial_count = 5;
  EXPECT_THAT(refusal(folder_ / "a", StudyPlan(other)),
              HasSubstr("holds the runs of another study"));
  EXPECT_THAT(refusal(folder_ / "a", plan_, {1, 2}), HasSubstr("'shard 1 of 1'"));
  try {
    StudyFolder rows(folder_ / "a", plan_, {}, {"input x 1"});
    FAIL();
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("input x 1"));
  }
  // A row of another run, with its right checksum.
  std::string text = content(folder_ / "a/runs.csv");
  const std::size_t second = text.find('\n', text.find('\n') + 1) + 1;
  const std::size_t third = text.find('\n', second) + 1;
  std::string row = text.substr(second, text.rfind(',', third) + 1 - second);
  row.replace(row.find("observations"), 12, "covariance");
  text.replace(second, third - second, row + detail::row_checksum(row) + "\n");
  write_file(folder_ / "a/runs.csv", [&](const ByteSink& sink) { sink(text); });
  EXPECT_THAT(refusal(folder_ / "a", plan_), HasSubstr("runs.csv:3: is not the study's run"));
}

TEST_F(StudyRunsTest, AreWrittenByOneProcessAtATime) {
  run(folder_ / "a");
  const StudyFolder rows(folder_ / "a", plan_, {});
  EXPECT_THAT(refusal(folder_ / "a", plan_), HasSubstr("another process is writing it"));
}

TEST_F(StudyRunsTest, OfTwoStudiesStartedTogetherOneIsRefused) {
  Study other = small_study();
  other.seed = 4;
  const StudyPlan plans[] = {plan_, StudyPlan(other)};
  for (int i = 0; i < 20; ++i) {
    const fs::path folder = folder_ / std::to_string(i);
    std::unique_ptr<StudyFolder> opened[2];
    std::barrier start(2);
    const auto open = [&](int which) {
      start.arrive_and_wait();
      try {
        opened[which] = std::make_unique<StudyFolder>(folder, plans[which], Shard());
      } catch (const Error&) {
      }
    };
    std::thread thread(open, 1);
    open(0);
    thread.join();
    ASSERT_NE(opened[0] == nullptr, opened[1] == nullptr);
    EXPECT_THAT(content(folder / "study.txt"), HasSubstr(opened[0] ? "seed 3\n" : "seed 4\n"));
  }
}

TEST(Shard, CoversEachRunOnce) {
  for (const std::size_t runs : {0U, 1U, 7U, 24U, 100U}) {
    for (const std::size_t count : {1U, 2U, 5U, 24U, 30U}) {
      std::size_t next = 0;
      for (std::size_t i = 1; i <= count; ++i) {
        const Shard shard{i, count};
        EXPECT_EQ(shard.begin(runs), next);
        EXPECT_LE(shard.end(runs) - shard.begin(runs), runs / count + 1);
        next = shard.end(runs);
      }
      EXPECT_EQ(next, runs);
    }
  }
  EXPECT_THROW((Shard{0, 2}.validate()), Error);
  EXPECT_THROW((Shard{3, 2}.validate()), Error);
}

}  // namespace
}  // namespace cairn
