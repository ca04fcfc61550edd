// SPDX-License-Identifier: BSD-3-Clause
// cairn map, on a short sequence that cairn simulate made, and on real ones.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <limits>
#include <regex>
#include <string>
#include <thread>
#include <vector>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "cairn/core/detail/output_folder.hpp"
#include "cairn/core/file.hpp"
#include "cairn/evaluation/trajectory_evaluation.hpp"
#include "cairn/formats/map_file.hpp"
#include "cairn/formats/pose_graph_file.hpp"
#include "cairn/formats/trajectory_file.hpp"
#include "cairn/map/operations.hpp"

#include "cli.hpp"
#include "support/real_data.hpp"
#ifdef CAIRN_HAS_BAGS
#include "support/recorded_sequence.hpp"
#endif

namespace cairn::testing {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

class MapCliTest : public CliTest {
 protected:
  void SetUp() override {
#ifdef CAIRN_HAS_SIMULATION
    // Made once, and copied: most tests damage theirs.
    static const TemporaryFolder made;
    static const CommandResult result = [] {
      made.write("small.yaml",
                 "model: PINHOLE\nwidth: 320\nheight: 240\nparameters: [262, 262, 159.5, 119.5]\n");
      return run_command(
          command({"simulate", "s", "--camera", "small.yaml", "--frames", "16", "--rate", "8"}),
          {.folder = made.path()});
    }();
    ASSERT_EQ(result.exit_code, kDone) << result.errors;
    fs::copy(made / "s", path("s"), fs::copy_options::recursive);
#else
    GTEST_SKIP() << "built without the simulation: cairn map was not tested on a made sequence";
#endif
  }

  Trajectory trajectory(const std::string& name) const {
    FileReader file(path(name));
    return read_trajectory(file);
  }

  // The line of a list that names a file, without its end.
  std::string line_of(const std::string& list, const std::string& file) const {
    const std::string text = content(list);
    const std::size_t at = text.find(file);
    const std::size_t begin = text.rfind('\n', at) + 1;
    return text.substr(begin, text.find('\n', at) - begin);
  }

  void replace(const std::string& name, const std::string& what, const std::string& by) const {
    std::string text = content(name);
    const std::size_t at = text.find(what);
    ASSERT_NE(at, std::string::npos) << what;
    write(name, text.replace(at, what.size(), by));
  }

  void cut_off(const std::string& name) const {
    fs::resize_file(path(name), fs::file_size(path(name)) / 2);
  }
};

constexpr const char* kFifthColor = "s/rgb/0.500000.jpg";

TEST_F(MapCliTest, WritesAMapAndATrajectoryThatReadBack) {
  const std::string text = answer({"map", "s", "-o", "out.map", "--trajectory", "out.tum",
                                   "--start-from", "s/groundtruth.txt"});
  EXPECT_THAT(text, HasSubstr("out.map: "));
  EXPECT_THAT(text, HasSubstr("16 of 16 frames tracked"));
  EXPECT_THAT(text, Not(HasSubstr("LOST")));
  const Trajectory estimate = trajectory("out.tum");
  const Trajectory truth = trajectory("s/groundtruth.txt");
  ASSERT_EQ(estimate.size(), 16U);
  const auto error =
      absolute_error(estimate, truth, associate(estimate, truth), TrajectoryAlignment::kNone);
  ASSERT_TRUE(error);
  EXPECT_LT(error->translation.highest, 0.015);
  EXPECT_LT(error->translations.front(), 1e-5) << "the start pose";

  const Json info = document({"info", "out.map"});
  EXPECT_GT(info.at("inputs").at("map").at("landmarks"), 300);
  EXPECT_GT(info.at("observed_twice_or_more"), 100);
  const Json evaluated = document({"evaluate", "trajectory", "out.tum", "s/groundtruth.txt"});
  EXPECT_EQ(evaluated.at("schema").at("name"), "cairn.evaluate_trajectory");
  EXPECT_EQ(document({"align", "out.map", "out.map", "--initial", "0 0 0 0 0 0", "--no-verdict"})
                .at("results")
                .at(0)
                .at("status"),
            "converged");
}

TEST_F(MapCliTest, JsonSaysWhatBecameOfTheFrames) {
  const Json json = document({"map", "s", "-o", "out.map"});
  EXPECT_EQ(json.at("schema").at("name"), "cairn.map");
  EXPECT_EQ(json.at("inputs").at("sequence").at("frames"), 16);
  EXPECT_EQ(json.at("frames").at("all"), 16);
  EXPECT_EQ(json.at("frames").at("tracked"), 16);
  EXPECT_EQ(json.at("frames").at("lost"), 0);
  EXPECT_EQ(json.at("frames").at("unreadable"), 0);
  EXPECT_EQ(json.at("frames").at("without_depth"), 0);
  EXPECT_TRUE(json.at("lost").empty());
  EXPECT_EQ(json.at("maps"), 1);
  EXPECT_EQ(json.at("options").at("camera").at("width"), 320);
  EXPECT_EQ(json.at("options").at("depth_units_per_metre"), 5000);
  EXPECT_TRUE(json.at("options").at("start_pose").is_null());
  EXPECT_EQ(json.at("output").at("path"), "out.map");
  EXPECT_TRUE(json.at("output").at("trajectory").is_null());
  const LandmarkMap map = read_map(path("out.map"));
  EXPECT_EQ(json.at("keyframes"), map.frame_count());
  EXPECT_EQ(json.at("landmarks").at("all"), map.landmark_count());
  EXPECT_GT(json.at("landmarks").at("observed_again"), 100);
  EXPECT_LT(json.at("median_reprojection_error_px"), 1.0);
  EXPECT_GT(json.at("path_length_m"), 0.01);
}

TEST_F(MapCliTest, SameBytesForAnyNumberOfThreads) {
  answer({"map", "s", "-o", "a.map", "--trajectory", "a.tum", "--threads", "1"});
  answer({"map", "s", "-o", "b.map", "--trajectory", "b.tum", "--threads", "2"});
  EXPECT_EQ(content("a.map"), content("b.map"));
  EXPECT_EQ(content("a.tum"), content("b.tum"));
}

// The sequence in two other layouts, whose times are the numbers of the frames, with poses as these state them.
TEST_F(MapCliTest, LayoutsOfBenchmarksHaveCamerasAndPoses) {
  const Trajectory truth = trajectory("s/groundtruth.txt");
  const ImageSequence sequence(path("s"));
  fs::create_directories(path("icl/rgb"));
  fs::create_directories(path("icl/depth"));
  fs::create_directories(path("seven"));
  std::string associations;
  std::string poses;
  for (std::size_t i = 0; i < sequence.frames().size(); ++i) {
    const SequenceFrame& frame = sequence.frames()[i];
    const Matrix4d pose = truth.poses()[i].world_from_camera.matrix();
    fs::copy(frame.color, path(fmt::format("icl/rgb/{}.png", i)));
    fs::copy(*frame.depth, path(fmt::format("icl/depth/{}.png", i)));
    associations += fmt::format("{0} depth/{0}.png {0} rgb/{0}.png\n", i);
    const Eigen::Matrix3d mirror = Eigen::Vector3d(1, -1, 1).asDiagonal();
    const Eigen::Matrix3d rotation = mirror * pose.topLeftCorner<3, 3>() * mirror;
    const Eigen::Quaterniond q(rotation);
    poses += fmt::format("{} {} {} {} {} {} {} {}\n", i, pose(0, 3), -pose(1, 3), pose(2, 3), q.x(),
                         q.y(), q.z(), q.w());
    const std::string name = fmt::format("seven/frame-{:06}.", i);
    write_png(path(name + "color.png"), read_color_image(frame.color));
    StoredDepthImage depth = read_depth_image(*frame.depth);
    for (auto& value : depth.values) {
      value = value == 0 ? 65535 : static_cast<std::uint16_t>(std::lround(value / 5.0));
    }
    write_png(path(name + "depth.png"), depth);
    std::string rows;
    for (int row = 0; row < 4; ++row) {
      rows +=
          fmt::format("{}\t{}\t{}\t{}\t\n", pose(row, 0), pose(row, 1), pose(row, 2), pose(row, 3));
    }
    write(name + "pose.txt", rows);
  }
  write("icl/associations.txt", associations);
  write("icl/livingRoom0.gt.freiburg", poses);
  expect_refusal({"map", "icl", "-o", "no.map"}, kBadInput, {"expected 640 x 480, as the camera"});
  for (const auto& [folder, stated] :
       {std::pair{"icl", "icl/livingRoom0.gt.freiburg"}, {"seven", "seven"}}) {
    const std::string units = std::string(folder) == "icl" ? "5000" : "1000";
    const auto map = [&](const std::string& output, const std::vector<std::string>& more) {
      std::vector<std::string> words = {"map",           folder,          "-o", output, "--camera",
                                        "s/camera.yaml", "--depth-units", units};
      words.insert(words.end(), more.begin(), more.end());
      answer(words);
    };
    map("out.map", {"--trajectory", "out.tum", "--start-from", stated});
    const Trajectory estimate = trajectory("out.tum");
    ASSERT_EQ(estimate.size(), truth.size());
    for (std::size_t i = 0; i < truth.size(); ++i) {
      const Rigid3 error =
          truth.poses()[i].world_from_camera.inverse() * estimate.poses()[i].world_from_camera;
      EXPECT_LT(error.translation().norm(), 0.02) << folder << i;
      EXPECT_LT(error.angle(), 0.02) << folder << i;
    }
    map("posed.map", {"--poses", stated});
    EXPECT_EQ(read_map(path("posed.map")).frames().timestamps_s.back().value(),
              static_cast<double>(truth.size() - 1));
  }
}

#ifdef CAIRN_HAS_BAGS
// One map whatever the images are in: the images, times and camera are all that counts.
TEST_F(MapCliTest, ARecordingGivesTheMapOfTheFolder) {
  answer({"map", "s", "-o", "folder.map"});
  const ImageSequence sequence(path("s"));
  const Camera camera{CameraId{0}, "PINHOLE", 320, 240, {262, 262, 159.5, 119.5}};
  const std::string expected = content("folder.map");
  const auto expect_same = [&](const std::string& file, const std::vector<std::string>& more) {
    std::vector<std::string> words = {"map", file, "-o", "bag.map"};
    words.insert(words.end(), more.begin(), more.end());
    answer(words);
    EXPECT_EQ(content("bag.map"), expected) << file;
    fs::remove(path("bag.map"));
  };
  const auto compressed = recorded(sequence, camera, "cdr", Recorded::kCompressed);
  write("compressed.mcap", mcap_bytes(compressed, {"lz4"}));
  expect_same("compressed.mcap", {"--depth-units", "5000"});
  // Grey by libjpeg is not grey of its colours, so raw images are those of PNG.
  for (const SequenceFrame& frame : sequence.frames()) {
    const fs::path png = fs::path(frame.color).replace_extension(".png");
    write_png(png, read_color_image(frame.color));
    replace("s/rgb.txt", frame.color.filename().string(), png.filename().string());
  }
  const ImageSequence of_pngs(path("s"));
  answer({"map", "s", "-o", "png.map"});
  const std::string of_png = content("png.map");
  for (const auto& file : write_all_containers(path("."), [&](const std::string& encoding) {
         return recorded(of_pngs, camera, encoding);
       })) {
    answer({"map", file.string(), "-o", "bag.map"});
    EXPECT_EQ(content("bag.map"), of_png) << file;
    fs::remove(path("bag.map"));
  }
}

// Without foreign data: what is simulated into a recording gives the map of what is simulated into a folder.
TEST_F(MapCliTest, ASimulatedRecordingGivesTheMapOfTheSimulatedFolder) {
  write("mm.yaml",
        "model: PINHOLE\nwidth: 320\nheight: 240\nparameters: [262, 262, 159.5, 119.5]\n"
        "depth_units_per_metre: 1000\n");
  // EuRoC's layout names images by nanoseconds, a recording by seconds; the map's UUID depends on the names.
  const auto unnamed = [&](const std::string& map) {
    return std::regex_replace(content(map), std::regex("(META uuid|IMAGE \\d+) .*"), "$1");
  };
  const std::vector<std::vector<std::string>> sensors = {
      {"--color-format", "jpeg"},
      {"--color-format", "png"},
      {"--sensor", "stereo", "--baseline", "0.125"}};
  for (std::size_t i = 0; i < sensors.size(); ++i) {
    const std::string folder = fmt::format("f{}", i);
    const std::string recording = folder + ".mcap";
    for (const std::string& name : {folder, recording}) {
      std::vector<std::string> words = {"simulate", name, "--camera", "mm.yaml",
                                        "--frames", "8",  "--rate",   "8"};
      words.insert(words.end(), sensors[i].begin(), sensors[i].end());
      answer(words);
      answer({"map", name, "-o", name + ".map"});
    }
    const bool has_same_names = i < 2;
    const auto text = [&](const std::string& map) {
      return has_same_names ? content(map) : unnamed(map);
    };
    EXPECT_EQ(text(recording + ".map"), text(folder + ".map")) << i;
    answer({"map", folder, "-o", "a.map", "--poses", folder + "/groundtruth.txt"});
    answer({"map", recording, "-o", "b.map", "--poses", "topic:/ground_truth,camera"});
    EXPECT_EQ(text("a.map"), text("b.map")) << i;
  }
  expect_refusal({"simulate", "r.mcap", "--camera", "s/camera.yaml"}, kWrongUsage,
                 {"depth units of a recording"});
}

// As from a file: the poses count, not where they stand.
TEST_F(MapCliTest, ARecordingBringsKnownPoses) {
  const ImageSequence sequence(path("s"));
  const Camera camera{CameraId{0}, "PINHOLE", 320, 240, {262, 262, 159.5, 119.5}};
  auto messages = recorded(sequence, camera, "cdr", Recorded::kCompressed);
  const Trajectory truth = trajectory("s/groundtruth.txt");
  for (const TimedPose& timed : truth.poses()) {
    const auto time_ns = 1000 * static_cast<std::uint64_t>(std::llround(1e6 * timed.timestamp_s));
    const Eigen::Vector3d& t = timed.world_from_camera.translation();
    const Eigen::Quaterniond q = timed.world_from_camera.quaternion();
    MessageFields fields("cdr");
    fields.header(time_ns, "odom").text("/cam/left/image");
    fields.doubles(std::array{t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w()});
    messages.push_back({"/odom", "nav_msgs/Odometry", time_ns, fields.bytes()});
  }
  write("a.mcap", mcap_bytes(messages));
  EXPECT_THAT(answer({"info", "a.mcap"}), HasSubstr("--poses topic:/odom"));
  const Json info = document({"info", "a.mcap"});
  EXPECT_EQ(info.at("pose_topics").at(0).at("name"), "/odom");
  answer({"map", "a.mcap", "-o", "topic.map", "--depth-units", "5000", "--poses", "topic:/odom"});
  answer(
      {"map", "a.mcap", "-o", "file.map", "--depth-units", "5000", "--poses", "s/groundtruth.txt"});
  EXPECT_EQ(content("topic.map"), content("file.map"));
  expect_refusal({"map", "a.mcap", "-o", "no.map", "--poses", "topic:/odom,base"}, kBadInput,
                 {"/odom", "tf_static does not say"});
  expect_refusal({"map", "s", "-o", "no.map", "--poses", "topic:/odom"}, kWrongUsage,
                 {"'/odom' of a folder"});
}
#endif

TEST_F(MapCliTest, OptionsChooseWhatTheMapHolds) {
  answer({"map", "s", "-o", "all.map"});
  answer({"map", "s", "-o", "few.map", "--min-observations", "2", "--no-descriptors",
          "--covariance", "marginal", "--start-pose", "1 2 3 1 0 0 0"});
  const LandmarkMap all = read_map(path("all.map"));
  const LandmarkMap few = read_map(path("few.map"));
  EXPECT_TRUE(all.landmarks().descriptors);
  EXPECT_FALSE(few.landmarks().descriptors);
  EXPECT_LT(few.landmark_count(), all.landmark_count());
  EXPECT_EQ(few.frames().translations.front(), Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(all.frames().translations.front(), Eigen::Vector3d::Zero());
}

TEST_F(MapCliTest, AtGivenPosesOnlyLandmarksAreEstimated) {
  const std::string text = answer({"map", "s", "-o", "out.map", "--poses", "s/groundtruth.txt",
                                   "--trajectory", "out.tum", "--json", "out.json"});
  EXPECT_THAT(text, HasSubstr("16 of 16 frames have a pose"));
  const Json json = Json::parse(content("out.json"));
  EXPECT_EQ(json.at("schema").at("name"), "cairn.map");
  EXPECT_EQ(json.at("options").at("poses"), "s/groundtruth.txt");
  EXPECT_EQ(json.at("frames").at("all"), 16);
  EXPECT_EQ(json.at("frames").at("without_pose"), 0);
  EXPECT_EQ(json.at("frames").at("without_depth"), 0);
  EXPECT_EQ(json.at("frames").at("unreadable"), 0);
  const LandmarkMap map = read_map(path("out.map"));
  EXPECT_EQ(json.at("landmarks").at("all"), map.landmark_count());
  EXPECT_EQ(json.at("keyframes"), map.frame_count());
  EXPECT_GT(json.at("landmarks").at("observed_again"), 100);
  EXPECT_TRUE(map.landmarks().descriptors);
  EXPECT_TRUE(map.has_covariances());
  const Trajectory truth = trajectory("s/groundtruth.txt");
  const Trajectory taken = trajectory("out.tum");
  const auto error =
      absolute_error(taken, truth, associate(taken, truth), TrajectoryAlignment::kNone);
  ASSERT_TRUE(error);
  EXPECT_LT(error->translation.highest, 1e-9);
  answer({"map", "s", "-o", "one.map", "--poses", "s/groundtruth.txt", "--threads", "1"});
  EXPECT_EQ(content("one.map"), content("out.map"));
}

TEST_F(MapCliTest, FramesWithoutAGivenPoseAreCounted) {
  const Trajectory truth = trajectory("s/groundtruth.txt");
  const std::vector<TimedPose> some(truth.poses().begin(), truth.poses().begin() + 10);
  write_file(path("some.tum"), [&](const ByteSink& sink) {
    write_trajectory(Trajectory(some), TrajectoryFormat::kTum, sink);
  });
  const std::string text = answer({"map", "s", "-o", "out.map", "--poses", "some.tum"});
  EXPECT_THAT(text, HasSubstr("10 of 16 frames have a pose"));
  EXPECT_THAT(text, HasSubstr("6 frames have no pose near in time"));
}

TEST_F(MapCliTest, PosesThatDoNotServeAreRefused) {
  write("late.txt", "100.0 0 0 0 0 0 0 1\n101.0 0 0 0 0 0 0 1\n");
  expect_refusal({"map", "s", "-o", "out.map", "--poses", "late.txt"}, kBadInput,
                 {"late.txt", "poses from 100.000000 to 101.000000 s", "frames from 0.000000"});
  write("none.txt", "# nothing\n");
  expect_refusal({"map", "s", "-o", "out.map", "--poses", "none.txt"}, kBadInput,
                 {"none.txt", "no poses"});
  expect_refusal({"map", "s", "-o", "out.map", "--poses", "missing.txt"}, kBadInput,
                 {"missing.txt"});
  expect_refusal(
      {"map", "s", "-o", "out.map", "--poses", "s/groundtruth.txt", "--covariance", "marginal"},
      kWrongUsage, {"--covariance", "recursive"});
  for (const auto& [option, value] : {std::pair{"--start-pose", "0 0 0 1 0 0 0"},
                                      {"--start-from", "s/groundtruth.txt"},
                                      {"--mini-map-length", "1m"}}) {
    expect_refusal({"map", "s", "-o", "out.map", "--poses", "s/groundtruth.txt", option, value},
                   kWrongUsage, {"--poses", option});
  }
  EXPECT_FALSE(fs::exists(path("out.map")));
}

TEST_F(MapCliTest, MiniMapsComeAsAFolderWithAnIndex) {
  const std::string text = answer({"map", "s", "-o", "minis", "--mini-map-length", "6f"});
  EXPECT_THAT(text, HasSubstr("3 mini-maps"));
  const Json index = Json::parse(content("minis/mini_maps.json"));
  EXPECT_EQ(index.at("schema").at("name"), "cairn.mini_maps");
  ASSERT_EQ(index.at("mini_maps").size(), 3U);
  ASSERT_EQ(index.at("links").size(), 2U);
  for (std::size_t i = 0; i < 3; ++i) {
    const Json& entry = index.at("mini_maps").at(i);
    const LandmarkMap map = read_map(path("minis/" + entry.at("file").get<std::string>()));
    EXPECT_EQ(entry.at("landmarks"), map.landmark_count());
    EXPECT_EQ(entry.at("keyframes"), map.frame_count());
    EXPECT_EQ(entry.at("first_timestamp"), map.frames().timestamps_s.front().value());
  }
  const Trajectory truth = trajectory("s/groundtruth.txt");
  for (std::size_t i = 0; i < 2; ++i) {
    const Json& link = index.at("links").at(i);
    EXPECT_EQ(link.at("source"), index.at("mini_maps").at(i + 1).at("file"));
    EXPECT_EQ(link.at("target"), index.at("mini_maps").at(i).at("file"));
    EXPECT_EQ(link.at("covariance").size(), 6U);
    const auto at = [&](std::size_t map) {
      return interpolated(truth, index.at("mini_maps").at(map).at("first_timestamp").get<double>())
          .value();
    };
    const Rigid3 truly = at(i).inverse() * at(i + 1);
    EXPECT_LT(truly.difference_to(pose_of(link.at("target_from_source"))).norm(), 0.015);
  }
  EXPECT_THAT(files(), ElementsAre("minis", "s"));
  FileReader graph_file(path("minis/" + index.at("pose_graph").get<std::string>()));
  const PoseGraph graph = read_pose_graph(graph_file);
  ASSERT_EQ(graph.nodes.size(), 3U);
  ASSERT_EQ(graph.links.size(), 2U);
  Similarity3 world_from_map;
  for (std::size_t i = 0; i < 3; ++i) {
    const PoseNode& node = graph.nodes[i];
    EXPECT_EQ(node.name, index.at("mini_maps").at(i).at("file").get<std::string>());
    EXPECT_EQ(node.session, index.at("session").get<std::string>());
    EXPECT_EQ(read_map(path("minis/" + node.name)).info().uuid,
              index.at("mini_maps").at(i).at("uuid"));
    EXPECT_TRUE(node.world_from_node.matrix().isApprox(world_from_map.matrix(), 1e-9));
    if (i == 2) break;
    EXPECT_EQ(graph.links[i].kind, LinkKind::kOdometry);
    EXPECT_GT((*graph.links[i].covariance)(0, 0), 1.6e-5);  // 4 mm, whatever was stated
    world_from_map = world_from_map * *graph.links[i].target_from_source;
  }
  FileReader g2o_file(path("minis/pose_graph.g2o"));
  EXPECT_EQ(pose_graph(read_g2o(g2o_file)).links.size(), 2U);
  expect_refusal({"map", "s", "-o", "minis", "--mini-map-length", "6f"}, kWrongUsage,
                 {"minis", "exists already"});
}

TEST_F(MapCliTest, WhereNoLoopClosesTheMapIsAsWithoutLookingForAny) {
  answer({"map", "s", "-o", "plain.map", "--trajectory", "plain.tum"});
  const std::string text =
      answer({"map", "s", "-o", "closed.map", "--trajectory", "closed.tum", "--close-loops"});
  EXPECT_THAT(text, HasSubstr("no loop closed between "));
  EXPECT_EQ(content("closed.map"), content("plain.map"));
  EXPECT_EQ(content("closed.tum"), content("plain.tum"));
  const Json json = document({"map", "s", "-o", "closed.map", "--close-loops"});
  EXPECT_EQ(json.at("options").at("close_loops"), true);
  EXPECT_EQ(json.at("loops").at("closed"), 0);
  EXPECT_TRUE(json.at("loops").at("adjustment").is_null());
  EXPECT_TRUE(document({"map", "s", "-o", "plain.map"}).at("loops").is_null());
}

TEST_F(MapCliTest, LoopsAreClosedInOneMapOfNewPosesOnly) {
  expect_refusal({"map", "s", "-o", "out.map", "--close-loops", "--mini-map-length", "1m"},
                 kWrongUsage, {"--close-loops", "--mini-map-length"});
  expect_refusal({"map", "s", "-o", "out.map", "--close-loops", "--poses", "s/groundtruth.txt"},
                 kWrongUsage, {"--close-loops", "--poses"});
  expect_refusal({"map", "s", "-o", "out.map", "--refine-intrinsics"}, kWrongUsage,
                 {"--refine-intrinsics", "--close-loops"});
  EXPECT_THAT(files(), ElementsAre("s"));
}

TEST_F(MapCliTest, UnfinishedMiniMapsOfAProcessAtWorkAreLeftAlone) {
  const cairn::detail::OutputFolder at_work(path("minis"));
  write_file(at_work.unfinished() / "0000.map", [](const ByteSink& sink) { sink("half a map"); });
  answer({"map", "s", "-o", "minis", "--mini-map-length", "6f"});
  EXPECT_EQ(read_text(at_work.unfinished() / "0000.map"), "half a map");
  EXPECT_TRUE(fs::exists(path("minis/mini_maps.json")));
}

TEST_F(MapCliTest, WhatAKilledRunLeftOfMiniMapsIsCleared) {
  fs::create_directories(path(".minis.cairn-unfinished/minis"));
  write(".minis.cairn-unfinished/.lock", "");
  write(".minis.cairn-unfinished/minis/9999.map", "half a map");
  answer({"map", "s", "-o", "minis", "--mini-map-length", "6f"});
  EXPECT_THAT(files(), ElementsAre("minis", "s"));
  EXPECT_FALSE(fs::exists(path("minis/9999.map")));
}

TEST_F(MapCliTest, DepthInTheWrongUnitIsRemarkedOn) {
  EXPECT_THAT(cairn({"map", "s", "-o", "right.map"}).errors, Not(HasSubstr("units per metre")));
  // 25000 as if millimetres were taken for fifths of them.
  for (const auto& [units, said] :
       {std::pair{"500", "the depth images reach"}, {"25000", "half of all depths are below"}}) {
    const CommandResult mini =
        cairn({"map", "s", "-o", "minis", "--mini-map-length", "1m", "--depth-units", units});
    EXPECT_THAT(mini.errors, HasSubstr(said));
    EXPECT_THAT(mini.errors, HasSubstr("check the depth images' units per metre (--depth-units"));
    fs::remove_all(path("minis"));
  }
}

TEST_F(MapCliTest, CovariancesHoldAgainstExactDepth) {
  write("small.yaml",
        "model: PINHOLE\nwidth: 320\nheight: 240\nparameters: [262, 262, 159.5, 119.5]\n");
  const Words made = {"simulate", "noisy", "--camera", "small.yaml",
                      "--frames", "90",    "--seed",   "7"};
  Words exact = made;
  exact[1] = "exact";
  exact.emplace_back("--no-depth-noise");
  answer(made);
  answer(exact);
  for (const char* const covariance : {"recursive", "marginal"}) {
    answer({"map", "noisy", "-o", "noisy.map", "--covariance", covariance});
    const Json all = document({"evaluate", "map", "noisy.map", "--truth-depth", "exact"})
                         .at("calibration")
                         .at("all");
    EXPECT_GT(all.at("count"), 200);
    EXPECT_GT(all.at("inside_95"), 0.94) << covariance;
    // Nor are they merely large: half of the errors are not far below what they say.
    EXPECT_GT(all.at("median"), 0.43) << covariance;
    EXPECT_LT(all.at("median"), 1.73) << covariance;
  }
  expect_refusal({"evaluate", "map", "noisy.map", "--truth-depth", "missing"}, kBadInput,
                 {"missing"});
  expect_refusal(
      {"evaluate", "map", "noisy.map", "--truth-depth", "exact", "--truth-map", "noisy.map"},
      kWrongUsage, {"--truth-depth", "--truth-map"});
}

TEST_F(MapCliTest, TheCameraMustBeKnown) {
  fs::remove(path("s/camera.yaml"));
  expect_refusal({"map", "s", "-o", "out.map"}, kWrongUsage,
                 {"--camera", "not given", "fr1, fr2 or fr3"});
  expect_refusal({"map", "s", "-o", "out.map", "--camera", "fr4"}, kWrongUsage, {"fr4"});
  expect_refusal({"map", "s", "-o", "out.map", "--camera", "FISH 640 480 1"}, kWrongUsage,
                 {"'FISH'", "PINHOLE"});
  answer({"map", "s", "-o", "out.map", "--camera", "PINHOLE 320 240 262 262 159.5 119.5"});
}

TEST_F(MapCliTest, AStereoSequenceHasItsCameras) {
  answer({"simulate", "pair", "--camera", "s/camera.yaml", "--frames", "12", "--rate", "8",
          "--sensor", "stereo"});
  answer({"map", "pair", "-o", "out.map", "--trajectory", "out.tum", "--json", "out.json"});
  const Json json = Json::parse(content("out.json"));
  EXPECT_EQ(json.at("frames").at("tracked"), 12);
  EXPECT_EQ(json.at("options").at("camera").at("model"), "PINHOLE");
  const Trajectory truth = trajectory("pair/groundtruth.txt");
  const Trajectory estimate = trajectory("out.tum");
  const auto error =
      absolute_error(estimate, truth, associate(estimate, truth), TrajectoryAlignment::kSe3);
  EXPECT_LT(error.value().translation.rmse, 0.01);
  expect_refusal({"map", "pair", "-o", "no.map", "--camera", "s/camera.yaml"}, kWrongUsage,
                 {"--camera", "has its calibration"});
  const std::string chain =
      "cam0:\n  camera_model: pinhole\n  intrinsics: [262, 262, 159.5, 119.5]\n"
      "  distortion_model: none\n  resolution: [320, 240]\ncam1:\n  camera_model: pinhole\n"
      "  intrinsics: [262, 262, 159.5, 119.5]\n  distortion_model: none\n"
      "  resolution: [320, 240]\n  T_cn_cnm1:\n  - [1, 0, 0, -0.11]\n  - [0, 1, 0, 0]\n"
      "  - [0, 0, 1, 0]\n  - [0, 0, 0, 1]\n";
  write("chain.yaml", chain);
  write("millimetres.yaml", std::string(chain).replace(chain.find("-0.11"), 5, "-110"));
  write("swapped.yaml", std::string(chain).replace(chain.find("-0.11"), 5, "0.11"));
  answer({"map", "pair", "-o", "given.map", "--camera", "chain.yaml"});
  EXPECT_EQ(content("given.map"), content("out.map"));
  expect_refusal({"map", "pair", "-o", "no.map", "--camera", "millimetres.yaml"}, kBadInput,
                 {"millimetres.yaml: a baseline of 110 m", "metres"});
  expect_refusal({"map", "pair", "-o", "no.map", "--camera", "swapped.yaml"}, kBadInput,
                 {"swapped.yaml: ", "left and right are swapped"});
  expect_refusal({"map", "s", "-o", "no.map", "--camera", "chain.yaml"}, kWrongUsage,
                 {"chain.yaml", "RGB-D"});
  fs::rename(path("pair/mav0/cam0/data"), path("pair/mav0/kept"));
  fs::rename(path("pair/mav0/cam1/data"), path("pair/mav0/cam0/data"));
  fs::rename(path("pair/mav0/kept"), path("pair/mav0/cam1/data"));
  expect_refusal({"map", "pair", "-o", "no.map"}, kBadInput, {"left and right are swapped"});
  fs::remove(path("pair/mav0/cam1/sensor.yaml"));
  expect_refusal({"map", "pair", "-o", "no.map"}, kBadInput,
                 {"mav0/cam1/sensor.yaml is missing", "EuRoC"});
}

TEST_F(MapCliTest, MiniMapsOfASequenceWhoseNameIsNoTextAreWritten) {
  fs::rename(path("s"), path("s\xff"));
  answer({"map", "s\xff", "-o", "minis", "--mini-map-length", "8f"});
  const Json index = Json::parse(content("minis/mini_maps.json"));
  EXPECT_EQ(index.at("inputs").at("sequence"), "s\xef\xbf\xbd") << "the replacement character";
  EXPECT_TRUE(
      fs::exists(path("minis") / index.at("mini_maps").at(0).at("file").get<std::string>()));
}

TEST_F(MapCliTest, OutputThatIsAFileOfTheSequenceIsRefused) {
  const std::string list = content("s/rgb.txt");
  const std::string image =
      "s/" + list.substr(list.rfind("rgb/"), list.rfind('\n') - list.rfind("rgb/"));
  for (const auto& [option, output] :
       {std::pair<std::string, std::string>{"--trajectory", "s/rgb.txt"},
        {"--json", "s/depth.txt"},
        {"--json", "s/camera.yaml"},
        {"--json", image}}) {
    const std::string before = content(output);
    expect_refusal({"map", "s", "-o", "out.map", option, output}, kWrongUsage,
                   {option, output + " is an input too"});
    EXPECT_TRUE(content(output) == before) << output;
  }
  EXPECT_THAT(files(), ElementsAre("s"));
}

TEST_F(MapCliTest, MistakesInTheCommandAreNamed) {
  expect_refusal({"map"}, kWrongUsage, {"sequence"});
  expect_refusal({"map", "s"}, kWrongUsage, {"--output"});
  expect_refusal({"map", "s", "-o", "out.foo"}, kWrongUsage, {"out.foo", ".map"});
  expect_refusal({"map", "s", "-o", "no/out.map"}, kSystemError, {"no/out.map"});
  expect_refusal({"map", "s", "-o", "out.map", "--trajectory", "no/out.tum"}, kSystemError,
                 {"no/out.tum"});
  expect_refusal({"map", "s", "-o", "out.map", "--start-pose", "0 0 0 1 0 0 0", "--start-from",
                  "s/groundtruth.txt"},
                 kWrongUsage, {"--start-pose", "--start-from"});
  for (const char* const length : {"5", "m", "0m", "-1m", "1f", "2.5f", "1km", "nanm", "f"}) {
    expect_refusal({"map", "s", "-o", "minis", "--mini-map-length", length}, kWrongUsage,
                   {"--mini-map-length", std::string("'") + length + "'", "50f"});
  }
  for (const auto& [pose, fragment] : {std::pair{"0 0 0", "3 numbers"},
                                       {"0 0 0 0 0 0 0", "norm"},
                                       {"0 0 0 2 0 0 0", "norm is 2"},
                                       {"0 0 0 one 0 0 0", "'one'"}}) {
    expect_refusal({"map", "s", "-o", "out.map", "--start-pose", pose}, kWrongUsage,
                   {"--start-pose", fragment});
  }
  for (const auto& [option, value] : {std::pair{"--covariance", "exact"},
                                      {"--min-observations", "0"},
                                      {"--features", "10"},
                                      {"--depth-units", "0"},
                                      {"--max-time-difference", "-1"}}) {
    expect_refusal({"map", "s", "-o", "out.map", option, value}, kWrongUsage, {option, "expected"});
  }
  EXPECT_THAT(files(), ElementsAre("s"));
}

TEST_F(MapCliTest, AStartThatTheTrajectoryDoesNotCoverIsRefused) {
  expect_refusal({"map", "s", "-o", "out.map", "--start-from", "missing.txt"}, kBadInput,
                 {"missing.txt"});
  write("late.txt", "100.0 0 0 0 0 0 0 1\n101.0 0 0 0 0 0 0 1\n");
  expect_refusal({"map", "s", "-o", "out.map", "--start-from", "late.txt"}, kBadInput,
                 {"late.txt", "no pose near"});
  EXPECT_FALSE(fs::exists(path("out.map")));
}

TEST_F(MapCliTest, ASequenceThatIsNoneIsRefused) {
  expect_refusal({"map", "missing", "-o", "out.map", "--camera", "fr1"}, kBadInput,
                 {"missing", "does not exist"});
  fs::create_directory(path("empty"));
  expect_refusal({"map", "empty", "-o", "out.map", "--camera", "fr1"}, kBadInput, {"rgb.txt"});
  expect_refusal({"map", "s/rgb", "-o", "out.map"}, kBadInput, {"s/rgb", "the sequence, s/"});
  fs::remove(path("s/depth.txt"));
  expect_refusal({"map", "s", "-o", "out.map"}, kBadInput, {"depth.txt"});
}

TEST_F(MapCliTest, MissingAndTruncatedImagesAreNamed) {
  cut_off(kFifthColor);
  expect_refusal({"map", "s", "-o", "out.map"}, kBadInput, {kFifthColor});
  fs::remove(path(kFifthColor));
  expect_refusal({"map", "s", "-o", "out.map"}, kBadInput, {kFifthColor, "No such file"});
  EXPECT_THAT(files(), ElementsAre("s"));
}

TEST_F(MapCliTest, TruncatedDepthIsNamed) {
  cut_off("s/depth/0.500000.png");
  expect_refusal({"map", "s", "-o", "out.map"}, kBadInput, {"s/depth/0.500000.png"});
}

TEST_F(MapCliTest, UnreadableImagesCanBeSkippedAndAreCounted) {
  fs::remove(path(kFifthColor));
  cut_off("s/rgb/0.750000.jpg");
  cut_off("s/depth/1.000000.png");
  const CommandResult result =
      cairn({"map", "s", "-o", "out.map", "--skip-unreadable", "--json", "-"});
  ASSERT_EQ(result.exit_code, kDone) << result.errors;
  EXPECT_THAT(result.errors, HasSubstr(kFifthColor));
  const Json json = Json::parse(result.output);
  EXPECT_EQ(json.at("frames").at("unreadable"), 3);
  EXPECT_EQ(json.at("frames").at("tracked"), 13);
  EXPECT_EQ(json.at("frames").at("all"), 16);
}

TEST_F(MapCliTest, ListsOutOfOrderAreSortedAndDoubleTimesRefused) {
  const std::string a = line_of("s/rgb.txt", "rgb/0.500000.jpg");
  const std::string b = line_of("s/rgb.txt", "rgb/0.625000.jpg");
  answer({"map", "s", "-o", "sorted.map"});
  replace("s/rgb.txt", a + "\n" + b, b + "\n" + a);
  const CommandResult result = cairn({"map", "s", "-o", "out.map"});
  EXPECT_EQ(result.exit_code, kDone);
  EXPECT_THAT(result.errors, HasSubstr("not in the order of time; sorted"));
  EXPECT_EQ(content("out.map"), content("sorted.map"));
  replace("s/rgb.txt", b, a);
  expect_refusal({"map", "s", "-o", "none.map"}, kBadInput, {"s/rgb.txt:", "each timestamp once"});
}

TEST_F(MapCliTest, ImagesWithoutPartnerAreTrackedWithoutDepth) {
  replace("s/depth.txt", line_of("s/depth.txt", "depth/0.500000.png"), "");
  const Json json = document({"map", "s", "-o", "out.map"});
  EXPECT_EQ(json.at("frames").at("without_depth"), 1);
  EXPECT_EQ(json.at("frames").at("tracked"), 16);
}

TEST_F(MapCliTest, ImagesOfAnotherSizeThanTheCameraAreRefused) {
  expect_refusal({"map", "s", "-o", "out.map", "--camera", "fr1"}, kBadInput,
                 {"s/rgb/", "320 x 240", "640 x 480"});
  EXPECT_THAT(files(), ElementsAre("s"));
}

TEST_F(MapCliTest, ASequenceWithoutDepthHasNoMap) {
  write("s/depth.txt", "# timestamp filename\n");
  const CommandResult result = cairn({"map", "s", "-o", "out.map"});
  EXPECT_EQ(result.exit_code, kBadInput);
  EXPECT_FALSE(fs::exists(path("out.map")));
}

TEST_F(MapCliTest, AFullDiskLeavesNothingHalfWritten) {
  if (!fs::exists("/dev/full")) GTEST_SKIP() << "no /dev/full: a full disk was not tested";
  fs::create_symlink("/dev/full", path("full.map"));
  const CommandResult result = cairn({"map", "s", "-o", "out.map", "--trajectory", "/dev/full"});
  EXPECT_EQ(result.exit_code, kSystemError);
  EXPECT_THAT(result.errors, HasSubstr("/dev/full"));
  const CommandResult piped =
      cairn({"map", "s", "-o", "other.map", "--json", "-"}, {.output_to = "/dev/full"});
  EXPECT_EQ(piped.exit_code, kSystemError);
  for (const std::string& name : files()) EXPECT_THAT(name, Not(HasSubstr("unfinished")));
}

TEST_F(MapCliTest, InterruptedItLeavesNoFile) {
  // Long enough to be caught: the same images over and over.
  std::string color;
  std::string depth;
  for (int i = 0; i < 4000; ++i) {
    color += fmt::format("{:.3f} rgb/0.500000.jpg\n", i * 0.1);
    depth += fmt::format("{:.3f} depth/0.500000.png\n", i * 0.1);
  }
  write("s/rgb.txt", color);
  write("s/depth.txt", depth);
  Command running(command({"map", "s", "-o", "out.map", "--trajectory", "out.tum"}),
                  {.folder = path(".")});
  std::this_thread::sleep_for(std::chrono::milliseconds(1500));
  running.send(SIGINT);
  const CommandResult result = running.wait();
  EXPECT_EQ(result.exit_code, 130);
  EXPECT_THAT(result.errors, HasSubstr("interrupted"));
  EXPECT_THAT(files(), ElementsAre("s"));
}

class RealMapTest : public CliTest {
 protected:
  void SetUp() override {
    const auto folder = real_data();
    if (!folder) GTEST_SKIP() << kNoRealData;
    data_ = folder->string();
  }

  Json map_sequence(const std::string& name, Words more = {}) const {
    sequence_ = data_ + "/" + name;
    Words words = {"map", sequence_, "--camera", "fr1", "-o", "out.map", "--trajectory", "out.tum"};
    words.insert(words.end(), more.begin(), more.end());
    words.insert(words.end(), {"--json", "-"});
    const CommandResult result = cairn(words, {.limit = std::chrono::seconds(400)});
    EXPECT_EQ(result.exit_code, kDone) << result.errors;
    return Json::parse(result.output);
  }

  AbsoluteError error(TrajectoryAlignment alignment) const {
    FileReader estimate_file(path("out.tum"));
    FileReader truth_file(sequence_ + "/groundtruth.txt");
    const Trajectory estimate = read_trajectory(estimate_file);
    const Trajectory truth = read_trajectory(truth_file);
    return absolute_error(estimate, truth, associate(estimate, truth), alignment).value();
  }

  std::size_t trajectory_size() const {
    FileReader file(path("out.tum"));
    return read_trajectory(file).size();
  }

  std::string data_;
  mutable std::string sequence_;
};

TEST_F(RealMapTest, DeskIsTrackedWholeAndNearTheTruth) {
  const Json json =
      map_sequence("tum_fr1_desk", {"--start-from", data_ + "/tum_fr1_desk/groundtruth.txt"});
  const double ate = error(TrajectoryAlignment::kSe3).translation.rmse;
  RecordProperty("ate_m", std::to_string(ate));
  EXPECT_LE(ate, 0.0213);
  EXPECT_EQ(json.at("frames").at("lost"), 0);
  EXPECT_GE(json.at("landmarks").at("observed_again"), 5000);
  EXPECT_GE(json.at("landmarks").at("mean_observations"), 5.0);
  EXPECT_LT(json.at("median_reprojection_error_px"), 1.0);
  // The aim is 0.04 m, which is not reached: 0.063 m when this was written.
  const double last = error(TrajectoryAlignment::kNone).translations.back();
  RecordProperty("last_m", std::to_string(last));
  EXPECT_LE(last, 0.036);
}

// The benchmark's measure: the mean error of the motion over all stretches of a length, as a share of it.
double drift_of(const std::vector<Rigid3>& estimate, const std::vector<Rigid3>& truth,
                double length_m) {
  double sum = 0.0;
  int stretches = 0;
  for (std::size_t first = 0; first < truth.size(); ++first) {
    double path = 0.0;
    for (std::size_t last = first + 1; last < truth.size(); ++last) {
      path += (truth[last].translation() - truth[last - 1].translation()).norm();
      if (path < length_m) continue;
      const Rigid3 moved = estimate[first].inverse() * estimate[last];
      const Rigid3 truly = truth[first].inverse() * truth[last];
      sum += (moved.inverse() * truly).translation().norm() / length_m;
      ++stretches;
      break;
    }
  }
  EXPECT_GT(stretches, 5) << length_m;
  return sum / stretches;
}

// Its length is 0.8 % too long whatever the constants, which is as well as the ground truth is known over 60 m.
TEST_F(RealMapTest, AStereoDriveIsNearTheTruth) {
  const std::string drive = data_ + "/kitti_stereo";
  answer({"map", drive, "-o", "out.map", "--trajectory", "out.tum"});
  FileReader file(path("out.tum"));
  const Trajectory mapped = read_trajectory(file);
  std::vector<Rigid3> estimate;
  for (const TimedPose& pose : mapped.poses()) estimate.push_back(pose.world_from_camera);
  std::vector<Rigid3> truth;
  std::ifstream rows(drive + "/poses.txt");
  Matrix4d matrix = Matrix4d::Identity();
  for (;;) {
    for (int i = 0; i < 12; ++i) rows >> matrix(i / 4, i % 4);
    if (!rows) break;
    truth.push_back(Rigid3::from_matrix(matrix));
  }
  ASSERT_EQ(truth.size(), 51U);
  ASSERT_EQ(estimate.size(), truth.size()) << "all are tracked";
  RecordProperty("drift_20_m", std::to_string(drift_of(estimate, truth, 20.0)));
  RecordProperty("drift_50_m", std::to_string(drift_of(estimate, truth, 50.0)));
  EXPECT_LT(drift_of(estimate, truth, 20.0), 0.015);
  EXPECT_LT(drift_of(estimate, truth, 50.0), 0.012);
}

TEST_F(RealMapTest, XyzIsNearTheTruth) {
  const Json json = map_sequence("tum_fr1_xyz");
  const double ate = error(TrajectoryAlignment::kSe3).translation.rmse;
  RecordProperty("ate_m", std::to_string(ate));
  EXPECT_LE(ate, 0.0093);
  EXPECT_EQ(json.at("frames").at("lost"), 0);
}

TEST_F(RealMapTest, LoopsOfAShortSessionAreClosedAndEveryFrameIsCorrected) {
  // The first 200 images of fr1/desk.
  const fs::path whole = fs::path(data_) / "tum_fr1_desk";
  fs::create_directory(path("desk"));
  for (const char* const folder : {"rgb", "depth"}) {
    fs::create_directory_symlink(whole / folder, path("desk") / folder);
  }
  for (const char* const list : {"depth.txt", "groundtruth.txt"}) {
    fs::copy_file(whole / list, path("desk") / list);
  }
  const std::string images = read_text(whole / "rgb.txt");
  std::size_t end = 0;
  for (int line = 0; line < 201; ++line) end = images.find('\n', end) + 1;
  write("desk/rgb.txt", images.substr(0, end));
  data_ = path("").string();

  const Json plain = map_sequence("desk");
  const double before = error(TrajectoryAlignment::kSe3).translation.rmse;
  const std::size_t tracked = trajectory_size();
  const Json closed = map_sequence("desk", {"--close-loops"});
  const double after = error(TrajectoryAlignment::kSe3).translation.rmse;
  RecordProperty("ate_m", std::to_string(before));
  RecordProperty("ate_closed_m", std::to_string(after));
  EXPECT_EQ(plain.at("frames").at("tracked"), tracked);
  EXPECT_EQ(trajectory_size(), tracked);
  EXPECT_EQ(closed.at("frames"), plain.at("frames"));
  const Json& loops = closed.at("loops");
  EXPECT_GE(loops.at("mini_maps"), 3);
  EXPECT_GE(loops.at("closed"), 1);
  EXPECT_GT(loops.at("largest_shift_m"), 0.001);
  EXPECT_TRUE(loops.at("adjustment").at("converged").get<bool>());
  EXPECT_LE(after, before + 0.0005);
}

// How far the landmarks of one map are from the nearest of another, in the middle; metres.
double median_distance(const LandmarkMap& from, const LandmarkMap& to) {
  const auto positions_of = [](const LandmarkMap& map) {
    std::vector<Eigen::Vector3d> positions;
    for (std::uint32_t i = 0; i < map.landmark_count(); ++i) {
      if (map.observation_count(LandmarkIndex{i}) < 3) continue;
      positions.push_back(map.landmarks().positions[i]);
    }
    return positions;
  };
  const auto targets = positions_of(to);
  std::vector<double> distances;
  for (const Eigen::Vector3d& position : positions_of(from)) {
    double nearest = std::numeric_limits<double>::infinity();
    for (const Eigen::Vector3d& target : targets) {
      nearest = std::min(nearest, (target - position).squaredNorm());
    }
    distances.push_back(std::sqrt(nearest));
  }
  const auto middle = distances.begin() + static_cast<std::ptrdiff_t>(distances.size() / 2);
  std::nth_element(distances.begin(), middle, distances.end());
  return *middle;
}

// Both sequences are in the motion capture's world, so their maps lie on each other as they are.
TEST_F(RealMapTest, MapsAtThePosesOfMotionCaptureCoincide) {
  std::vector<LandmarkMap> maps;
  for (const std::string name : {"tum_fr1_xyz", "tum_fr1_desk"}) {
    const Json json = map_sequence(name, {"--poses", data_ + "/" + name + "/groundtruth.txt"});
    RecordProperty(name + "_observed_again", json.at("landmarks").at("observed_again").get<int>());
    EXPECT_GE(json.at("landmarks").at("observed_again"), 1000) << name;
    EXPECT_LT(json.at("frames").at("without_pose"), 40) << name;
    maps.push_back(read_map(path("out.map")));
  }
  const double there = median_distance(maps[0], maps[1]);
  const double aside = median_distance(
      maps[0], transformed(maps[1], Rigid3::from_roll_pitch_yaw({0.1, 0.1, 0.1}, 0, 0, 0)));
  RecordProperty("median_m", std::to_string(there));
  RecordProperty("median_aside_m", std::to_string(aside));
  EXPECT_LT(there, 0.02);
  EXPECT_LT(there, 0.7 * aside);
}

}  // namespace
}  // namespace cairn::testing
