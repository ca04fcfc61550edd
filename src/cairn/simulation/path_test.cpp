// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/simulation/path.hpp"

#include <string>
#include <tuple>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/error.hpp"

namespace cairn {
namespace {

using Eigen::Vector3d;
using ::testing::HasSubstr;

class PathTest : public ::testing::TestWithParam<std::tuple<std::string_view, std::string_view>> {
 protected:
  static Environment place(std::uint64_t seed) {
    return make_environment(
        {.kind = environment_kind(std::get<0>(GetParam())), .seed = seed, .texture_scale = 0.02});
  }
  static PathOptions options(std::uint64_t seed, std::size_t frames = 900) {
    return {.kind = path_kind(std::get<1>(GetParam())), .seed = seed, .frames = frames};
  }
};
INSTANTIATE_TEST_SUITE_P(All, PathTest,
                         ::testing::Combine(::testing::ValuesIn(environment_names()),
                                            ::testing::Values("sweep", "orbit", "walk")),
                         [](const auto& names) {
                           return std::string(std::get<0>(names.param)) + "_" +
                                  std::string(std::get<1>(names.param));
                         });

TEST_P(PathTest, KeepsItsDistanceFromEverything) {
  for (const std::uint64_t seed : {1, 2, 3, 4, 5, 6}) {
    const Environment environment = place(seed);
    const Trajectory path = make_path(environment, options(seed));
    ASSERT_EQ(path.size(), 900U);
    for (const TimedPose& pose : path.poses()) {
      ASSERT_GE(environment.scene.distance(pose.world_from_camera.translation()), 0.15);
    }
  }
}

TEST_P(PathTest, IsSmoothAndGoesSomewhere) {
  const Trajectory path = make_path(place(1), options(1));
  EXPECT_GT(path.length(), 3.0);
  const auto poses = path.poses();
  for (std::size_t i = 1; i < poses.size(); ++i) {
    const Rigid3 step = poses[i - 1].world_from_camera.inverse() * poses[i].world_from_camera;
    EXPECT_LT(step.translation().norm(), 1.8 / 30.0);                 // m a frame
    EXPECT_LT(step.angle() * 180.0 / 3.14159265, 130.0 / 30.0) << i;  // degrees a frame
  }
}

TEST_P(PathTest, HoldsTheCameraUpright) {
  const Trajectory path = make_path(place(1), options(1));
  for (const TimedPose& pose : path.poses()) {
    EXPECT_LT((pose.world_from_camera.rotation() * Vector3d::UnitY()).z(), -0.3);
  }
}

TEST_P(PathTest, DependsOnTheSeedAlone) {
  const Environment environment = place(1);
  const Trajectory a = make_path(environment, options(5, 20));
  const Trajectory b = make_path(environment, options(5, 40));
  const Trajectory c = make_path(environment, options(6, 20));
  for (std::size_t i = 0; i < a.size(); ++i) {
    EXPECT_EQ(a.poses()[i].world_from_camera.matrix(), b.poses()[i].world_from_camera.matrix());
    EXPECT_NE(a.poses()[i].world_from_camera.matrix(), c.poses()[i].world_from_camera.matrix());
  }
}

TEST(Path, LooksAtThePointAskedFor) {
  const Vector3d eye(1.0, -2.0, 1.5);
  const Vector3d target(0.2, 0.4, 0.7);
  const Rigid3 pose = looking_at(eye, target);
  const Vector3d seen = pose.inverse() * target;
  EXPECT_NEAR(seen.x(), 0.0, 1e-12);
  EXPECT_NEAR(seen.y(), 0.0, 1e-12);
  EXPECT_NEAR(seen.z(), (target - eye).norm(), 1e-12);
  EXPECT_NEAR((pose.rotation() * Vector3d::UnitX()).z(), 0.0, 1e-12);
  EXPECT_LT((pose.rotation() * Vector3d::UnitY()).z(), 0.0);
}

Trajectory quarter_turn() {
  return Trajectory(
      {{10.0, Rigid3()}, {11.0, Rigid3::from_roll_pitch_yaw({2.0, 0.0, 4.0}, 0.0, 0.0, 1.0)}});
}

TEST(Path, PoseBetweenTwoIsInterpolated) {
  const Rigid3 pose = pose_at(quarter_turn(), 10.25);
  EXPECT_LT((pose.translation() - Vector3d(0.5, 0.0, 1.0)).norm(), 1e-12);
  EXPECT_NEAR(pose.roll_pitch_yaw().z(), 0.25, 1e-12);
  EXPECT_EQ(pose_at(quarter_turn(), 3.0).matrix(), Rigid3().matrix());
  EXPECT_NEAR(pose_at(quarter_turn(), 30.0).roll_pitch_yaw().z(), 1.0, 1e-12);
}

TEST(Path, ResamplingKeepsStartAndRate) {
  const Trajectory path = resampled(quarter_turn(), 4.0);
  ASSERT_EQ(path.size(), 5U);
  EXPECT_EQ(path.poses()[0].timestamp_s, 10.0);
  EXPECT_EQ(path.poses()[3].timestamp_s, 10.75);
  EXPECT_NEAR(path.poses()[3].world_from_camera.roll_pitch_yaw().z(), 0.75, 1e-12);
  EXPECT_EQ(resampled(quarter_turn(), 4.0, 2).size(), 2U);
}

TEST(Path, RefusesWhatIsWrongByName) {
  EXPECT_THROW(path_kind("fly"), Error);
  EXPECT_THROW(resampled(Trajectory(), 30.0), Error);
  EXPECT_THROW(resampled(quarter_turn(), 0.0), Error);
  const auto refused = [](const PathOptions& options, const char* field) {
    try {
      options.validate();
      ADD_FAILURE() << field;
    } catch (const Error& error) {
      EXPECT_THAT(error.what(), HasSubstr(field));
    }
  };
  refused({.frames = 0}, "PathOptions.frames");
  refused({.rate_hz = 0.0}, "PathOptions.rate_hz");
  refused({.pace = -1.0}, "PathOptions.pace");
  refused({.shake = -1.0}, "PathOptions.shake");
  refused({.clearance_m = 2.0}, "PathOptions.clearance_m");
}

}  // namespace
}  // namespace cairn
