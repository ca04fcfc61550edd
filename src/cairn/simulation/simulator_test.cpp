// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/simulation/simulator.hpp"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/error.hpp"
#include "cairn/simulation/detail/renderer.hpp"
#include "cairn/simulation/environment.hpp"
#include "cairn/simulation/path.hpp"

namespace cairn {
namespace {

using ::testing::HasSubstr;

SimulatorOptions small(std::uint64_t seed = 1) {
  SimulatorOptions options;
  options.camera = {CameraId{0}, "PINHOLE", 80, 60, {65.6, 65.6, 39.5, 29.5}};
  options.light_grid_m = 1.0;
  options.seed = seed;
  return options;
}

RgbdSimulator desk(const SimulatorOptions& options, const Executor& executor = Executor()) {
  Environment place = make_environment({.texture_scale = 0.1}, executor);
  Trajectory path = make_path(place, {.frames = 6});
  return {std::move(place.scene), std::move(path), options, executor};
}

void expect_same(const RgbdFrame& a, const RgbdFrame& b) {
  EXPECT_EQ(a.timestamp_s, b.timestamp_s);
  EXPECT_EQ(a.world_from_camera.matrix(), b.world_from_camera.matrix());
  EXPECT_EQ(a.bgr, b.bgr);
  EXPECT_EQ(a.depth_m, b.depth_m);
  EXPECT_EQ(a.exact_depth_m, b.exact_depth_m);
}

TEST(RgbdSimulator, SameSeedSameBytesForAnyThreadsAndOrder) {
  const RgbdSimulator one = desk(small());
  const RgbdSimulator two = desk(small(), Executor(2));
  ASSERT_EQ(one.frame_count(), 6U);
  const RgbdFrame late = two.frame(5, Executor(2));
  for (const std::size_t i : {0, 2}) expect_same(one.frame(i), two.frame(i, Executor(2)));
  expect_same(one.frame(5), late);
}

TEST(RgbdSimulator, SeedsAndFramesHaveNoiseOfTheirOwn) {
  const RgbdSimulator one = desk(small(1));
  const RgbdSimulator two = desk(small(2));
  const RgbdFrame a = one.frame(0);
  const RgbdFrame b = two.frame(0);
  EXPECT_EQ(a.exact_depth_m, b.exact_depth_m);
  EXPECT_NE(a.bgr, b.bgr);
  EXPECT_NE(a.depth_m, b.depth_m);
  EXPECT_NE(one.frame(1).bgr, a.bgr);
}

// A point seen in one frame lies, by depth and pose, where the other frame sees it: poses, depth and
// camera mean the same thing.
TEST(RgbdSimulator, FramesAgreeWithEachOthersDepthAndPose) {
  SimulatorOptions options = small();
  options.camera = {CameraId{0}, "SIMPLE_RADIAL", 160, 120, {131.0, 79.5, 59.5, 0.05}};
  const RgbdSimulator simulator = desk(options);
  const RgbdFrame a = simulator.frame(0);
  const RgbdFrame b = simulator.frame(5);
  const detail::RayTable rays = detail::ray_table(options.camera);
  std::size_t compared = 0;
  std::size_t agreed = 0;
  for (std::size_t i = 0; i < a.exact_depth_m.size(); i += 7) {
    const double z = a.exact_depth_m[i];
    const Eigen::Vector3d in_a(rays.x[i] * z, rays.y[i] * z, z);
    const Eigen::Vector3d in_b = b.world_from_camera.inverse() * (a.world_from_camera * in_a);
    const auto pixel = project(options.camera, in_b);
    if (!pixel || pixel->u < 1.0 || pixel->v < 1.0 || pixel->u > 158.0 || pixel->v > 118.0)
      continue;
    const auto column = static_cast<std::size_t>(std::lround(pixel->u));
    const auto row = static_cast<std::size_t>(std::lround(pixel->v));
    ++compared;
    agreed += std::abs(b.exact_depth_m[row * 160 + column] - in_b.z()) < 0.03 * in_b.z() ? 1 : 0;
  }
  EXPECT_GT(compared, 1000U);
  EXPECT_GT(static_cast<double>(agreed), 0.93 * static_cast<double>(compared));
}

TEST(RgbdSimulator, MostPixelsHaveAReadingNearTheTruth) {
  const RgbdFrame frame = desk(small()).frame(3);
  std::size_t near = 0;
  for (std::size_t i = 0; i < frame.depth_m.size(); ++i) {
    if (frame.depth_m[i] == 0.0F) continue;
    const double z = frame.exact_depth_m[i];
    EXPECT_NEAR(frame.depth_m[i], z, 6.0 * 1.425e-3 * z * z);
    ++near;
  }
  EXPECT_GT(near, frame.depth_m.size() / 2);
}

TEST(RgbdSimulator, MotionBlurSmoothsTheImageButNotTheDepth) {
  SimulatorOptions options = small();
  options.sensor.color_noise = 0.0;
  const RgbdFrame sharp = desk(options).frame(3);
  options.shutter_s = 0.1;
  const RgbdFrame blurred = desk(options).frame(3);
  EXPECT_EQ(sharp.depth_m, blurred.depth_m);
  const auto roughness = [](const RgbdFrame& frame) {
    double sum = 0.0;
    for (std::size_t i = 3; i < frame.bgr.size(); ++i) {
      sum += std::abs(static_cast<double>(frame.bgr[i]) - frame.bgr[i - 3]);
    }
    return sum;
  };
  EXPECT_LT(roughness(blurred), 0.95 * roughness(sharp));
}

// Rows are rendered four at a time, from where the camera is at the middle of the four.
TEST(RgbdSimulator, ARollingShutterTakesRowsOneAfterTheOther) {
  SimulatorOptions options = small();
  options.readout_s = 0.1;
  const RgbdSimulator rolling = desk(options);
  const RgbdFrame frame = rolling.frame(3);
  const auto still_at = [&](double time) {
    return RgbdSimulator(rolling.scene(), Trajectory({{time, pose_at(rolling.trajectory(), time)}}),
                         small())
        .frame(0)
        .exact_depth_m;
  };
  constexpr std::size_t kBand = 4 * 80;  // pixels
  for (const std::size_t first : {0U, 28U, 56U}) {
    const double share = (static_cast<double>(first) + 2.0) / 60.0 - 0.5;
    const auto still = still_at(frame.timestamp_s + share * options.readout_s);
    std::size_t same = 0;
    for (std::size_t i = first * 80; i < first * 80 + kBand; ++i) {
      same += std::abs(frame.exact_depth_m[i] - still[i]) < 1e-5F ? 1 : 0;
    }
    EXPECT_GT(same, kBand * 98 / 100) << "row " << first;
  }
  EXPECT_NE(frame.exact_depth_m, still_at(frame.timestamp_s));
}

TEST(RgbdSimulator, RefusesNonsenseByName) {
  const auto refused = [](const SimulatorOptions& options, const char* field) {
    try {
      options.validate();
      ADD_FAILURE() << field;
    } catch (const Error& error) {
      EXPECT_THAT(error.what(), HasSubstr(field));
    }
  };
  SimulatorOptions options = small();
  options.shutter_s = -1.0;
  refused(options, "SimulatorOptions.shutter_s");
  options = small();
  options.readout_s = 1.5;
  refused(options, "SimulatorOptions.readout_s");
  options = small();
  options.blur_samples = 1;
  refused(options, "SimulatorOptions.blur_samples");
  options = small();
  options.camera.model = "PINHOLES";
  refused(options, "SimulatorOptions.camera");
  options.camera = {CameraId{0}, "PINHOLE", 100000, 60, {65.6, 65.6, 39.5, 29.5}};
  refused(options, "SimulatorOptions.camera");
  EXPECT_THROW(desk(small()).frame(6), Error);
}

}  // namespace
}  // namespace cairn
