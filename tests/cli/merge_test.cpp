// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <vector>

#include "cairn/geometry/angles.hpp"
#include "cairn/map/operations.hpp"
#include "cairn/report/report.hpp"

#include "cli.hpp"
#include "support/real_data.hpp"
#include "support/report_page.hpp"
#include "support/splats.hpp"

namespace cairn::testing {
namespace {

namespace fs = std::filesystem;

using ::testing::AllOf;
using ::testing::ContainsRegex;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

class MergeTest : public CliTest {
 protected:
  void write_stranger() const {
    write_map(synthetic_map({.seed = 77, .landmarks = 900, .frames = 20}), path("stranger.map"));
  }
};

TEST_F(MergeTest, MakesOneMapOfTwo) {
  const SyntheticPair pair = write_pair(900);
  const CommandResult result = cairn({"merge", "target.map", "source.map", "-o", "both.map"});
  EXPECT_EQ(result.exit_code, kDone);
  EXPECT_THAT(result.errors, IsEmpty());
  EXPECT_THAT(result.output,
              ContainsRegex("^placed 2 of 2: target <- source >?99\\.[0-9]+ %\n"
                            "1,800 landmarks became 1,[0-9][0-9][0-9]\nwrote both.map\n$"));
  const LandmarkMap map = read_map(path("both.map"));
  EXPECT_EQ(map.frame_count(), 40U);
  EXPECT_EQ(map.observation_count(),
            pair.source.observation_count() + pair.target.observation_count());
  EXPECT_LT(map.landmark_count(), 1400U);
  EXPECT_EQ(map.frames().translations[0], pair.target.frames().translations[0]);
}

TEST_F(MergeTest, JoinsSplatsAndThinsThemUnlessToldNotTo) {
  LandmarkMap splats = random_splats(500, 1, 1);
  splats = with_column(splats, "opacity", std::vector<double>(500, 2.0));
  write_map(splats, path("a.ply"));
  const Similarity3 moved(3.0, Rigid3::from_roll_pitch_yaw({1, 2, 3}, 0.3, 0.2, 2.0));
  write_map(transformed(splats, moved), path("b.ply"));
  answer({"merge", "a.ply", "b.ply", "-o", "both.ply"});
  answer({"merge", "a.ply", "b.ply", "-o", "all.ply", "--no-thin-splats"});
  const LandmarkMap both = read_map(path("both.ply"));
  const LandmarkMap all = read_map(path("all.ply"));
  EXPECT_EQ(both.landmark_count(), 500U);
  ASSERT_EQ(all.landmark_count(), 1000U);
  EXPECT_EQ(all.landmarks().columns.size(), splats.landmarks().columns.size());
  for (std::size_t i = 0; i < 500; ++i) {
    EXPECT_EQ(all.landmarks().positions[i], splats.landmarks().positions[i]);
    EXPECT_LT((all.landmarks().positions[500 + i] - splats.landmarks().positions[i]).norm(), 1e-4);
    EXPECT_NEAR(all.column("f_rest_1")->values[500 + i], splats.column("f_rest_1")->values[i],
                1e-4);
  }
}

TEST_F(MergeTest, PageSaysWhichSplatsAreLeftOut) {
  if (!report::has_viewer()) GTEST_SKIP() << "built without the viewer: no report is written";
  const LandmarkMap splats =
      with_column(random_splats(500, 1, 1), "opacity", std::vector<double>(500, 2.0));
  write_map(splats, path("a.ply"));
  write_map(transformed(splats, Rigid3::from_roll_pitch_yaw({1, 2, 3}, 0.1, 0.2, 0.3)),
            path("b.ply"));
  answer({"merge", "a.ply", "b.ply", "-o", "both.ply", "--report", "page.html"});
  const Json section = ReportPage(content("page.html")).document.at("sections").at(0);
  ASSERT_EQ(section.at("nodes").size(), 2U);
  EXPECT_TRUE(section.at("nodes").at(0).at("reason").is_null());
  EXPECT_EQ(section.at("nodes").at(1).at("reason"), "500 duplicates");
}

// Splats too transparent to serve as landmarks, at the landmarks of two models; nerfstudio trained the second in a frame
// of its own.
TEST_F(MergeTest, AlignsTheModelsThatSplatsWereTrainedOn) {
  const SyntheticPair pair = write_pair(900);
  const Similarity3 training(0.25, Rigid3::from_roll_pitch_yaw({0.5, -1, 2}, 0.1, 0.2, 1.0));
  fs::create_directories(path("first"));
  fs::create_directories(path("second"));
  const auto write_splat = [&](const LandmarkMap& model, const Similarity3& pose,
                               const std::string& file) {
    const std::size_t count = model.landmark_count();
    LandmarkMap copy = random_splats(count, 1, count);
    MapTables tables = std::move(copy).tables();
    tables.landmarks.positions = model.landmarks().positions;
    LandmarkMap splats(std::move(tables));
    splats = with_column(splats, "opacity", std::vector<double>(count, -3.0));
    write_map(transformed(splats, pose), path(file));
  };
  write_splat(pair.target, Similarity3(), "first/splat.ply");
  write_splat(pair.source, training, "second/splat.ply");
  const std::vector<std::string> command = {"merge",      "first/splat.ply", "second/splat.ply",
                                            "-o",         "both.ply",        "--models",
                                            "target.map", "source.map",      "--no-thin-splats"};
  EXPECT_THAT(cairn({"merge", "first/splat.ply", "second/splat.ply", "-o", "both.ply"}).exit_code,
              ::testing::Ne(kDone));
  const CommandResult elsewhere = cairn(command);
  EXPECT_EQ(elsewhere.exit_code, kBadInput);
  EXPECT_THAT(elsewhere.errors, HasSubstr("a model in the same frame and unit"));
  const Eigen::Matrix4d matrix = training.matrix();
  Json rows = Json::array();
  for (int i = 0; i < 3; ++i) {
    rows.push_back(Json::array());
    for (int k = 0; k < 4; ++k) rows.back().push_back(matrix(i, k) / training.scale());
  }
  write("second/dataparser_transforms.json",
        Json{{"transform", rows}, {"scale", training.scale()}}.dump());
  answer(command);
  const LandmarkMap both = read_map(path("both.ply"));
  const std::size_t first = pair.target.landmark_count();
  EXPECT_EQ(both.landmark_count(), first + pair.source.landmark_count());
  for (std::size_t i = 0; i < pair.source.landmark_count(); ++i) {
    const Eigen::Vector3d truth = pair.target_from_source * pair.source.landmarks().positions[i];
    EXPECT_LT((both.landmarks().positions[first + i] - truth).norm(), 0.02);
  }
  EXPECT_THAT(cairn({"merge", "first/splat.ply", "second/splat.ply", "-o", "both.ply", "--models",
                     "target.map"})
                  .errors,
              HasSubstr("--models: 1 given; expected one for each of the 2 maps"));

  const CommandResult aligned = cairn({"align", "second/splat.ply", "first/splat.ply", "--models",
                                       "source.map", "target.map", "-o", "moved.ply"});
  EXPECT_EQ(aligned.exit_code, kDone) << aligned.errors;
  EXPECT_THAT(aligned.output, HasSubstr("source  source.map (model of second/splat.ply)"));
  const LandmarkMap moved = read_map(path("moved.ply"));
  ASSERT_EQ(moved.landmark_count(), pair.source.landmark_count());
  EXPECT_NE(moved.column("rot_0"), nullptr) << "the splat is written, and not its model";
  for (std::size_t i = 0; i < pair.source.landmark_count(); ++i) {
    const Eigen::Vector3d truth = pair.target_from_source * pair.source.landmarks().positions[i];
    EXPECT_LT((moved.landmarks().positions[i] - truth).norm(), 0.02);
  }
  EXPECT_THAT(
      cairn({"align", "second/splat.ply", "first/splat.ply", "--models", "source.map"}).errors,
      HasSubstr("--models: 1 given; expected two: of the source and of the target"));
}

// A splat with floaters between the first model's images and what they show.
TEST_F(MergeTest, NamesAndDropsFloatersOfSplats) {
  const SyntheticPair pair = write_pair(900);
  constexpr std::size_t kFloaters = 5;
  const auto write_splat = [&](const std::vector<Eigen::Vector3d>& positions,
                               const std::string& file) {
    LandmarkMap splats = random_splats(positions.size(), 0, positions.size());
    for (const char* name : {"scale_0", "scale_1", "scale_2"}) {
      splats = with_column(splats, name, std::vector<double>(positions.size(), std::log(0.01)));
    }
    MapTables tables = std::move(splats).tables();
    tables.landmarks.positions = positions;
    write_map(LandmarkMap(std::move(tables)), path(file));
  };
  write_splat(pair.target.landmarks().positions, "first.ply");
  std::vector<Eigen::Vector3d> positions = pair.source.landmarks().positions;
  const Eigen::Vector3d camera = pair.target.world_from_camera(FrameIndex{10}).translation();
  for (std::size_t i = 0; i < kFloaters; ++i) {
    positions.emplace_back(pair.target_from_source.inverse() *
                           (0.5 * (camera + pair.target.landmarks().positions[100 * i])));
  }
  write_splat(positions, "second.ply");
  std::vector<std::string> command = {"merge",      "first.ply",  "second.ply",
                                      "-o",         "both.ply",   "--models",
                                      "target.map", "source.map", "--no-thin-splats"};
  EXPECT_THAT(answer(command), HasSubstr("hint: --drop-floaters"));
  const Json maps = document(command)["maps"];
  const auto of_first = maps[0]["floaters"].get<std::size_t>();
  const auto of_second = maps[1]["floaters"].get<std::size_t>();
  EXPECT_GE(of_second, kFloaters / 2) << "few images show much behind them";
  EXPECT_LT(of_first + of_second, 3 * kFloaters);
  const std::size_t all = read_map(path("both.ply")).landmark_count();
  command.emplace_back("--drop-floaters");
  EXPECT_THAT(answer(command),
              ContainsRegex("second: 0 duplicates left out, [0-9]+ floaters left out\n"));
  EXPECT_EQ(read_map(path("both.ply")).landmark_count(), all - of_first - of_second);
  EXPECT_THAT(
      cairn({"merge", "first.ply", "second.ply", "-o", "both.ply", "--drop-floaters"}).errors,
      HasSubstr("--drop-floaters requires --models"));
}

TEST_F(MergeTest, JsonHasEveryMapAndEveryPair) {
  const SyntheticPair pair = write_pair(900);
  write_stranger();
  const Json json = document(
      {"merge", "source.map", "stranger.map", "target.map", "-o", "all.cairn"}, kNoAlignment);
  EXPECT_EQ(json.at("schema"), Json({{"name", "cairn.merge"}, {"version", 1}}));
  EXPECT_EQ(json.at("inputs").at("maps").size(), 3U);
  EXPECT_EQ(json.at("inputs").at("maps").at(1).at("path"), "stranger.map");
  EXPECT_EQ(json.at("placed"), 2);
  EXPECT_EQ(json.at("maps").at(0).at("name"), "source");
  EXPECT_TRUE(json.at("maps").at(1).at("world_from_map").is_null());
  EXPECT_THAT(json.at("maps").at(1).at("reason").get<std::string>(),
              HasSubstr("aligned with no other map; likeliest with "));
  const Rigid3 source_from_target = pose_of(json.at("maps").at(2).at("world_from_map"));
  const Rigid3 error = source_from_target * pair.target_from_source;
  EXPECT_LT(error.angle(), 0.003);
  ASSERT_EQ(json.at("links").size(), 3U);
  EXPECT_EQ(json.at("links").at(0).at("status"), "rejected");
  EXPECT_EQ(json.at("links").at(0).at("used"), false);
  EXPECT_TRUE(json.at("links").at(0).at("target_from_source").is_null());
  EXPECT_EQ(json.at("links").at(1).at("status"), "aligned");
  EXPECT_EQ(json.at("links").at(1).at("used"), true);
  EXPECT_EQ(json.at("links").at(1).at("covariance").size(), 6U);
  EXPECT_EQ(json.at("output").at("landmarks_before"), 1800);
  EXPECT_EQ(json.at("output").at("landmarks"), read_map(path("all.cairn")).landmark_count());
}

TEST_F(MergeTest, MiniMapsOfARunAreJoinedByItsOdometry) {
  const Similarity3 first_from_second = write_mini_maps("run");
  const CommandResult result = cairn({"merge", "run/", "-o", "all.map", "--json", "all.json"});
  EXPECT_EQ(result.exit_code, kDone);
  EXPECT_THAT(result.output, HasSubstr("placed 2 of 2: run/1 <- run/2 odometry\n"));
  const Json json = Json::parse(content("all.json"));
  EXPECT_TRUE(pose_of(json.at("maps").at(1).at("world_from_map"))
                  .matrix()
                  .isApprox(first_from_second.matrix(), 1e-9));
  ASSERT_EQ(json.at("links").size(), 2U);  // the alignment that failed, and odometry's
  EXPECT_EQ(json.at("links").at(0).at("kind"), "placement");
  EXPECT_EQ(json.at("links").at(0).at("used"), false);
  EXPECT_EQ(json.at("links").at(1).at("kind"), "odometry");
  EXPECT_EQ(json.at("links").at(1).at("status"), "stated");
  EXPECT_EQ(json.at("links").at(1).at("used"), true);
  EXPECT_TRUE(json.at("links").at(1).at("probability").is_null());
  // Converted or removed since: by name, and what is there.
  answer({"convert", "run/2.map", "run/2.cairn"});
  fs::remove(path("run/2.map"));
  EXPECT_THAT(answer({"merge", "run", "-o", "again.map"}), HasSubstr("placed 2 of 2"));
  write("run/pose_graph.json", "{}");
  expect_refusal({"merge", "run", "-o", "again.map"}, kBadInput, {"pose_graph.json"});
  fs::remove(path("run/pose_graph.json"));
  EXPECT_EQ(cairn({"merge", "run", "-o", "again.map"}).exit_code, kNoAlignment);
}

TEST_F(MergeTest, AdjustsTheMergedMapIfAsked) {
  write_pair(900);
  const Json json = document({"merge", "target.map", "source.map", "-o", "both.map", "--adjust"});
  const Json& adjustment = json.at("adjustment");
  EXPECT_TRUE(adjustment.at("converged").get<bool>());
  EXPECT_LT(adjustment.at("final_rms_px").get<double>(),
            adjustment.at("initial_rms_px").get<double>());
  const LandmarkMap map = read_map(path("both.map"));
  EXPECT_TRUE(map.info().uuid);
  EXPECT_THAT(map.info().provenance.back(), HasSubstr("adjusted: "));
  answer({"merge", "target.map", "source.map", "-o", "again.map", "--adjust", "--threads", "1"});
  EXPECT_EQ(content("again.map"), content("both.map"));
  expect_refusal({"merge", "target.map", "source.map", "-o", "x.map", "--refine-intrinsics"},
                 kWrongUsage, {"--refine-intrinsics", "--adjust"});
  EXPECT_TRUE(document({"merge", "target.map", "source.map", "-o", "plain.map", "--no-adjust"})
                  .at("adjustment")
                  .is_null());
}

TEST_F(MergeTest, NamesWhatIsLeftOut) {
  write_pair(900);
  write_stranger();
  const CommandResult result =
      cairn({"merge", "stranger.map", "target.map", "source.map", "-o", "all.map"});
  EXPECT_EQ(result.exit_code, kNoAlignment);
  EXPECT_THAT(result.output,
              AllOf(ContainsRegex("placed 2 of 3: target <- source >?99\\."),
                    ContainsRegex("left out stranger: aligned with no other map; likeliest with "
                                  "[a-z]+ \\(rejected, [<0-9.]+ %\\)\n"),
                    ContainsRegex("\nrejected: [a-z]+ <- [a-z]+: probability [<0-9.]+ %, below the "
                                  "required 99 %: "),
                    HasSubstr("1,800 landmarks became ")));
  EXPECT_EQ(read_map(path("all.map")).frame_count(), 40U);
}

TEST_F(MergeTest, WritesNothingWhereNothingBelongsTogether) {
  write_pair(900);
  write_stranger();
  write("both.map", "what was there");
  const CommandResult result = cairn({"merge", "stranger.map", "target.map", "-o", "both.map"});
  EXPECT_EQ(result.exit_code, kNoAlignment);
  EXPECT_THAT(result.output,
              AllOf(HasSubstr("placed 0 of 2\n"), HasSubstr("left out stranger: "),
                    HasSubstr("left out target: "), HasSubstr("hint: Align the maps of one"),
                    HasSubstr("both.map is not written")));
  EXPECT_EQ(content("both.map"), "what was there");
}

TEST_F(MergeTest, TakesAFolderOfMapsAndCallsThemByTheirPlaceWhereNamesAreAlike) {
  const SyntheticPair pair = write_pair(900);
  fs::create_directory(path("robot"));
  fs::rename(path("source.map"), path("robot") / "target.map");
  fs::rename(path("truth.txt"), path("robot") / "notes.md");
  const CommandResult result = cairn({"merge", "target.map", "robot", "-o", "both.map"});
  EXPECT_EQ(result.exit_code, kDone) << result.errors;
  EXPECT_THAT(result.output, ContainsRegex("placed 2 of 2: target <- robot/target >?99\\."));
}

TEST_F(MergeTest, TakesProjectsByTheirFoldersAndTellsTheirImagesApart) {
  const SyntheticPair pair = write_pair(900);
  fs::create_directories(path("one/sparse"));
  fs::create_directories(path("two/colmap_sparse"));
  answer({"convert", "target.map", "one/sparse/0/"});
  answer({"convert", "source.map", "two/colmap_sparse/0/"});
  const CommandResult result =
      cairn({"merge", "one", "two/colmap_sparse/0", "-o", "merged/", "--json", "merge.json"});
  EXPECT_EQ(result.exit_code, kDone) << result.errors;
  EXPECT_THAT(result.output, HasSubstr("placed 2 of 2: one <- two "));
  EXPECT_THAT(result.errors, HasSubstr("one: the map in one/sparse/0 is read"));
  EXPECT_THAT(result.errors, HasSubstr("'frame_0' of one and two"));
  EXPECT_THAT(result.errors, HasSubstr("copied into a folder of that name: one/, two/"));
  answer({"convert", "merged", "merged.map"});
  const LandmarkMap merged = read_map(path("merged.map"));
  EXPECT_EQ(merged.frames().image_names[0], "one/frame_0");
  EXPECT_EQ(merged.frames().image_names[20], "two/frame_0");
  const Json json = Json::parse(content("merge.json"));
  EXPECT_THAT(json.at("inputs").at("maps").at(0).at("hash").get<std::string>(),
              ::testing::StartsWith("xxh3:"));

  for (const char* by : {"merge.json#two", "merge.json#two/colmap_sparse/0/"}) {
    answer({"convert", "two", "moved.map", "--apply", by});
    const LandmarkMap moved = read_map(path("moved.map"));
    EXPECT_LT((moved.frames().translations[0] - merged.frames().translations[20]).norm(), 1e-9);
  }
  expect_refusal({"convert", "two", "moved.map", "--apply", "merge.json"}, kBadInput,
                 {"merge.json: places 2 maps", "merge.json#MAP with one of one, two"});
  expect_refusal({"convert", "two", "moved.map", "--apply", "merge.json#three"}, kBadInput,
                 {"merge.json: places no map 'three'"});
  write("by.txt", "1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1\n");
  expect_refusal({"convert", "two", "moved.map", "--apply", "by.txt#two"}, kBadInput,
                 {"by.txt#two: names a map, but the file places none"});

  fs::rename(path("two/colmap_sparse/0"), path("one/sparse/1"));
  expect_refusal({"merge", "one", "target.map", "-o", "again/"}, kBadInput,
                 {"one: holds 2 maps in folders", "one/sparse/0 or one/sparse/1"});
  EXPECT_EQ(document({"merge", "one/sparse/0", "one/sparse/1", "-o", "again/"})
                .at("maps")
                .at(1)
                .at("name"),
            "one/sparse/1");
}

TEST_F(MergeTest, WritesTheSameBytesForAnyNumberOfThreads) {
  write_pair(900);
  answer({"merge", "target.map", "source.map", "-o", "one.cairn", "--threads", "1", "--json",
          "one.json"});
  answer({"merge", "target.map", "source.map", "-o", "two.cairn", "--threads", "2", "--json",
          "two.json"});
  EXPECT_EQ(content("one.cairn"), content("two.cairn"));
  Json one = Json::parse(content("one.json"));
  Json two = Json::parse(content("two.json"));
  one.at("output").erase("path");
  two.at("output").erase("path");
  EXPECT_EQ(one, two);
}

TEST_F(MergeTest, RefusesWhatCannotBeMerged) {
  write_pair(100);
  expect_refusal({"merge", "target.map", "source.map"}, kWrongUsage, {"--output"});
  expect_refusal({"merge", "target.map", "-o", "a.map"}, kWrongUsage, {"at least two maps"});
  expect_refusal({"merge", "target.map", "./target.map", "-o", "a.map"}, kWrongUsage,
                 {"are one map", "would count as independent evidence"});
  expect_refusal({"merge", "target.map", "source.map", "-o", "source.map"}, kWrongUsage,
                 {"source.map is one of the maps"});
  expect_refusal({"merge", "target.map", "source.map", "-o", "a.foo"}, kWrongUsage,
                 {"--output", "a.foo names no map format"});
  expect_refusal({"merge", "target.map", "gone.map", "-o", "a.map"}, kBadInput, {"gone.map"});
  expect_refusal({"merge", "target.map", "source.map", "-o", "a.map", "--min-probability", "0.3"},
                 kWrongUsage, {"--min-probability: 0.3"});
  fs::create_directory(path("empty"));
  expect_refusal({"merge", "target.map", "empty", "-o", "a.map"}, kBadInput,
                 {"empty", "no map in a known format"});
  EXPECT_FALSE(fs::exists(path("a.map")));
}

TEST_F(MergeTest, CountsAMapAndWhatWasMadeOfItOnce) {
  const SyntheticPair pair = write_pair(900);
  answer({"convert", "target.map", "copy.cairn"});
  expect_refusal({"merge", "target.map", "copy.cairn", "source.map", "-o", "a.map"}, kWrongUsage,
                 {"target and copy are one map"});
  answer({"convert", "target.map", "part.map", "--frames", "0:12"});
  answer({"align", "target.map", "source.map", "-o", "moved.map"});
  answer({"merge", "target.map", "source.map", "-o", "both.map"});
  for (const char* const related : {"part.map", "moved.map", "both.map"}) {
    const CommandResult result = cairn({"merge", "target.map", related, "-o", "a.map"});
    EXPECT_EQ(result.exit_code, kDone) << related;
    EXPECT_THAT(result.errors, HasSubstr("and count once")) << related;
    const std::size_t frames = read_map(path(related)).frame_count();
    EXPECT_EQ(read_map(path("a.map")).frame_count(), std::max<std::size_t>(frames, 20)) << related;
    const std::size_t once =
        pair.target.observation_count() +
        (related == std::string("both.map") ? pair.source.observation_count() : 0);
    const std::size_t merged = read_map(path("a.map")).observation_count();
    EXPECT_GE(merged, once) << related;
    // A few landmarks that the larger map moved are not recognised.
    EXPECT_LT(static_cast<double>(merged), 1.005 * static_cast<double>(once)) << related;
  }
}

// The commands of docs/guide.md, "Merge maps".
TEST_F(MergeTest, RunsWhatTheGuideShows) {
  answer({"demo", "--synthetic", "--save", "desk"});  // the same files, sooner
  EXPECT_THAT(answer({"merge", "desk/target.map", "desk/source.map", "-o", "merged.map"}),
              HasSubstr("placed 2 of 2: target <- source "));
  answer({"merge", "desk/target.map", "desk/source.map", "-o", "merged.cairn", "--json",
          "merge.json"});
  EXPECT_EQ(Json::parse(content("merge.json")).at("placed"), 2);
  answer({"info", "merged.map"});
}

#ifdef CAIRN_HAS_ODOMETRY
// Pose of the keyframe with that time.
Rigid3 pose_at(const LandmarkMap& map, double time) {
  for (std::uint32_t i = 0; i < map.frame_count(); ++i) {
    if (map.frames().timestamps_s[i] == time) return map.world_from_camera(FrameIndex{i});
  }
  throw std::runtime_error("no such keyframe");
}

// Two sessions of one office, whose ground truths are in one frame: after one rigid alignment the keyframes of
// both must be where they were. The page shows two keyframes that saw the same.
TEST_F(MergeTest, PutsTwoRealSessionsIntoOneFrame) {
  const auto data = real_data();
  if (!data) GTEST_SKIP() << kNoRealData;
  std::string truth;
  Words merge = {"merge", "xyz.map", "desk.map", "-o", "office.cairn"};
  if (report::has_viewer()) merge.insert(merge.end(), {"--report", "r.html", "--images"});
  for (const std::string name : {"xyz", "desk"}) {
    const fs::path sequence = *data / ("tum_fr1_" + name);
    if (report::has_viewer()) merge.push_back(sequence.string());
    answer({"map", sequence.string(), "--camera", "fr1", "-o", name + ".map"});
    truth += read_text(sequence / "groundtruth.txt");  // xyz was recorded first
  }
  EXPECT_THAT(answer(merge), HasSubstr("placed 2 of 2: xyz <- desk "));
  const LandmarkMap map = read_map(path("office.cairn"));
  EXPECT_EQ(map.frame_count(),
            read_map(path("xyz.map")).frame_count() + read_map(path("desk.map")).frame_count());
  std::string keyframes;
  for (std::uint32_t i = 0; i < map.frame_count(); ++i) {
    const Rigid3 pose = map.world_from_camera(FrameIndex{i});
    const Eigen::Vector3d& t = pose.translation();
    const Eigen::Quaterniond q = pose.quaternion();
    keyframes += fmt::format("{:.6f} {} {} {} {} {} {} {}\n", *map.frames().timestamps_s[i], t.x(),
                             t.y(), t.z(), q.x(), q.y(), q.z(), q.w());
  }
  write("keyframes.tum", keyframes);
  write("truth.tum", truth);
  const Json errors = document({"evaluate", "trajectory", "keyframes.tum", "truth.tum"});
  EXPECT_LT(errors.at("absolute").at("translation_m").at("rmse"), 0.03);
  if (!report::has_viewer()) return;
  const Json page = ReportPage(content("r.html")).document;
  const Json& link = page.at("sections").at(0).at("links").at(0);
  Rigid3 poses[2];
  for (const std::size_t side : {0U, 1U}) {
    const std::string name = side == 0 ? "target" : "source";
    const LandmarkMap one = read_map(path(link.at(name) == 0 ? "xyz.map" : "desk.map"));
    const auto frame = link.at("view").at(name + "_frame").get<std::size_t>();
    poses[side] = pose_at(map, one.frames().timestamps_s[frame].value());
  }
  EXPECT_GE(link.at("view").at("matches"), 50);
  const Rigid3 between = poses[0].inverse() * poses[1];
  EXPECT_LT(between.translation().norm(), 0.5);
  EXPECT_GT(between.rotation()(2, 2), std::cos(radians(30.0))) << "they look the same way";
}
#endif

}  // namespace
}  // namespace cairn::testing
