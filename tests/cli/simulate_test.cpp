// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <chrono>
#include <cmath>
#include <csignal>
#include <string>
#include <thread>

#include "cairn/formats/camera_file.hpp"
#include "cairn/formats/trajectory_file.hpp"
#include "cairn/vision/sequence.hpp"

#include "cli.hpp"

namespace cairn::testing {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

class SimulateTest : public CliTest {
 protected:
  void SetUp() override {
    write("small.yaml",
          "model: PINHOLE\nwidth: 160\nheight: 120\nparameters: [131, 131, 79.5, 59.5]\n");
  }

  // A sequence of a few small frames.
  std::string simulate(const std::string& folder, Words more = {}) const {
    Words words = {"simulate", folder, "--camera", "small.yaml"};
    if (std::find(more.begin(), more.end(), "--duration") == more.end()) {
      words.insert(words.end(), {"--frames", "4"});
    }
    words.insert(words.end(), more.begin(), more.end());
    return answer(words);
  }

  Trajectory truth(const std::string& folder) const {
    FileReader file(path(folder + "/groundtruth.txt"));
    return read_trajectory(file);
  }
};

std::ptrdiff_t known_depths(const DepthImage& depth) {
  return std::count_if(depth.values.begin(), depth.values.end(),
                       [](float depth_m) { return depth_m > 0.0F; });
}

TEST_F(SimulateTest, WritesASequenceThatReadsBack) {
  EXPECT_THAT(simulate("s"), HasSubstr("s: 4 frames of 160 x 120"));
  const ImageSequence sequence(path("s"));
  ASSERT_EQ(sequence.frames().size(), 4U);
  EXPECT_EQ(sequence.frames_without_depth(), 0U);
  const Trajectory poses = truth("s");
  ASSERT_EQ(poses.size(), 4U);
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_EQ(sequence.frames()[i].timestamp_s, poses.poses()[i].timestamp_s);
    EXPECT_NEAR(poses.poses()[i].timestamp_s, static_cast<double>(i) / 30.0, 1e-6);
    const ImageSequence::Images images = sequence.read(i);
    EXPECT_EQ(images.gray.width, 160U);
    EXPECT_EQ(images.gray.height, 120U);
    EXPECT_GT(known_depths(images.depth), 160 * 120 / 2);
  }
  FileReader file(path("s/camera.yaml"));
  const CameraFile camera = read_camera_file(file);
  EXPECT_EQ(camera.camera.width, 160U);
  EXPECT_THAT(camera.camera.parameters, ElementsAre(131, 131, 79.5, 59.5));
  EXPECT_EQ(camera.depth_units_per_metre, 5000.0);
}

TEST_F(SimulateTest, AStereoPairDiffersByItsBaseline) {
  EXPECT_THAT(simulate("s", {"--sensor", "stereo", "--baseline", "0.2"}), HasSubstr("s: 4 frames"));
  const ImageSequence sequence(path("s"));
  ASSERT_EQ(sequence.frames().size(), 4U);
  EXPECT_TRUE(sequence.is_stereo());
  EXPECT_DOUBLE_EQ(sequence.baseline_m(), 0.2);
  EXPECT_EQ(sequence.frames_without_depth(), 0U);
  EXPECT_THAT(sequence.camera(std::nullopt).parameters, ElementsAre(131, 131, 79.5, 59.5));
  // The left images are those of an RGB-D camera on that path.
  simulate("d");
  EXPECT_EQ(sequence.read(2).gray, ImageSequence(path("d")).read(2).gray);
  EXPECT_NE(sequence.read(2).gray, sequence.read(2).right);
  expect_refusal({"simulate", "t", "--baseline", "0.2"}, kWrongUsage,
                 {"--baseline: given for an RGB-D sensor"});
  expect_refusal({"simulate", "t", "--sensor", "lidar"}, kWrongUsage, {"--sensor: 'lidar'"});
}

// Depth, poses and camera of the files fit together: what one frame sees, the other sees there.
TEST_F(SimulateTest, GroundTruthFitsTheImages) {
  simulate("s", {"--no-depth-noise", "--rate", "3"});
  const ImageSequence sequence(path("s"));
  const Trajectory poses = truth("s");
  const DepthImage a = sequence.read(0).depth;
  const DepthImage b = sequence.read(1).depth;
  const Rigid3 b_from_a =
      poses.poses()[1].world_from_camera.inverse() * poses.poses()[0].world_from_camera;
  int compared = 0;
  int agreed = 0;
  for (int row = 0; row < 120; row += 3) {
    for (int column = 0; column < 160; column += 3) {
      const double z = a.at(static_cast<std::size_t>(column), static_cast<std::size_t>(row));
      if (z <= 0.0) continue;
      const Eigen::Vector3d in_b =
          b_from_a * Eigen::Vector3d((column - 79.5) / 131 * z, (row - 59.5) / 131 * z, z);
      const int u = static_cast<int>(std::lround(131 * in_b.x() / in_b.z() + 79.5));
      const int v = static_cast<int>(std::lround(131 * in_b.y() / in_b.z() + 59.5));
      if (u < 0 || v < 0 || u >= 160 || v >= 120 || in_b.z() <= 0.0) continue;
      ++compared;
      agreed += std::abs(b.at(static_cast<std::size_t>(u), static_cast<std::size_t>(v)) -
                         in_b.z()) < 0.03 * in_b.z()
                    ? 1
                    : 0;
    }
  }
  EXPECT_GT(compared, 500);
  EXPECT_GT(agreed, 0.9 * compared);
}

TEST_F(SimulateTest, SameCommandSameBytesForAnyNumberOfThreads) {
  simulate("a", {"--threads", "1"});
  simulate("b", {"--threads", "2"});
  simulate("c", {"--seed", "2"});
  for (const char* const file : {"rgb.txt", "depth.txt", "groundtruth.txt", "camera.yaml",
                                 "rgb/0.066667.jpg", "depth/0.066667.png"}) {
    const std::string bytes = content(std::string("a/") + file);
    EXPECT_FALSE(bytes.empty()) << file;
    EXPECT_EQ(bytes, content(std::string("b/") + file)) << file;
  }
  EXPECT_NE(content("a/groundtruth.txt"), content("c/groundtruth.txt"));
  EXPECT_NE(content("a/rgb/0.066667.jpg"), content("c/rgb/0.066667.jpg"));
}

TEST_F(SimulateTest, ATrajectoryFileIsFollowed) {
  write("path.txt",
        "# timestamp tx ty tz qx qy qz qw\n"
        "100.0 1.3 0.0 1.5 0.7317 0.5466 -0.3131 -0.2604\n"
        "101.0 1.4 0.1 1.5 0.7317 0.5466 -0.3131 -0.2604\n");
  Words words = {"simulate", "s", "--camera", "small.yaml", "--path", "path.txt", "--rate", "5"};
  answer(words);
  const Trajectory poses = truth("s");
  ASSERT_EQ(poses.size(), 6U);
  EXPECT_EQ(poses.poses()[2].timestamp_s, 100.4);
  EXPECT_NEAR(poses.poses()[2].world_from_camera.translation().x(), 1.34, 1e-12);
  EXPECT_EQ(ImageSequence(path("s")).frames().size(), 6U);
}

TEST_F(SimulateTest, SessionsDifferInPathAndChanges) {
  const Json first = Json::parse(simulate("a", {"--json", "-"}));
  const Json second =
      Json::parse(simulate("b", {"--session", "1", "--changed", "0.5", "--json", "-"}));
  EXPECT_EQ(first.at("schema").at("name"), "cairn.simulate");
  EXPECT_EQ(first.at("sequence").at("frames"), 4);
  EXPECT_EQ(first.at("objects").at("moved"), 0);
  EXPECT_GT(second.at("objects").at("moved"), 5);
  EXPECT_EQ(second.at("options").at("changed"), 0.5);
  EXPECT_NE(content("a/groundtruth.txt"), content("b/groundtruth.txt"));
}

TEST_F(SimulateTest, TheLayoutIsTheSeedsOwnUnlessItIsGiven) {
  const auto layout = [&](const char* folder, const Words& more) {
    Words words = {"--json", "-"};
    words.insert(words.end(), more.begin(), more.end());
    return Json::parse(simulate(folder, words)).at("options").at("layout").get<int>();
  };
  EXPECT_EQ(layout("drawn", {}), 1);
  EXPECT_EQ(layout("own", {"--seed", "4"}), 4);
  EXPECT_EQ(layout("twin", {"--seed", "4", "--layout", "1"}), 1);
  EXPECT_NE(content("drawn/groundtruth.txt"), content("own/groundtruth.txt"));
}

TEST_F(SimulateTest, PngKeepsColoursAndDurationCountsFrames) {
  simulate("s", {"--color-format", "png", "--duration", "0.1"});
  EXPECT_THAT(content("s/rgb.txt"), HasSubstr("rgb/0.066667.png"));
  EXPECT_EQ(ImageSequence(path("s")).frames().size(), 3U);
}

TEST_F(SimulateTest, AnExistingSequenceIsNotTouched) {
  simulate("s");
  const std::string before = content("s/rgb/0.000000.jpg");
  expect_refusal({"simulate", "s", "--seed", "5"}, kWrongUsage, {"s:", "holds rgb.txt already"});
  EXPECT_EQ(content("s/rgb/0.000000.jpg"), before);
  std::filesystem::create_directory(path("t"));
  write("t/groundtruth.txt", "mine");
  expect_refusal({"simulate", "t"}, kWrongUsage, {"t:", "groundtruth.txt"});
}

TEST_F(SimulateTest, MistakesAreNamedBeforeAnythingIsWritten) {
  expect_refusal({"simulate"}, kWrongUsage, {"folder"});
  expect_refusal({"simulate", "s", "--environment", "cellar"}, kWrongUsage,
                 {"'cellar'", "desk, office, corridor, warehouse, room, kitchen"});
  expect_refusal({"simulate", "s", "--path", "missing.txt"}, kBadInput, {"missing.txt"});
  expect_refusal({"simulate", "s", "--camera", "missing.yaml"}, kWrongUsage, {"missing.yaml"});
  expect_refusal({"simulate", "s", "--color-format", "gif"}, kWrongUsage, {"'gif'", "png or jpeg"});
  expect_refusal({"simulate", "s", "--frames", "3", "--duration", "1"}, kWrongUsage,
                 {"--frames", "--duration"});
  for (const auto& [option, value] : {std::pair{"--frames", "0"},
                                      {"--duration", "0"},
                                      {"--rate", "0"},
                                      {"--changed", "1.5"},
                                      {"--exposure", "0"},
                                      {"--noise", "-1"},
                                      {"--depth-noise", "5"},
                                      {"--max-depth", "0.1"},
                                      {"--motion-blur", "-1"}}) {
    expect_refusal({"simulate", "s", option, value}, kWrongUsage, {option, "expected"});
  }
  EXPECT_THAT(files(), ElementsAre("small.yaml"));
}

TEST_F(SimulateTest, InterruptedItLeavesNothing) {
  Command running(command({"simulate", "s", "--camera", "small.yaml", "--frames", "100000"}),
                  {.folder = path(".")});
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(60);
  while (!std::filesystem::exists(path("s/depth/0.000000.png")) &&
         std::chrono::steady_clock::now() < deadline) {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  running.send(SIGINT);
  const CommandResult result = running.wait();
  EXPECT_EQ(result.exit_code, 130);
  EXPECT_THAT(result.errors, HasSubstr("interrupted"));
  EXPECT_THAT(files(), ElementsAre("small.yaml"));
}

}  // namespace
}  // namespace cairn::testing
