// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "cairn/alignment/detail/prepared_cloud.hpp"
#include "cairn/alignment/detail/search/poses.hpp"
#include "cairn/geometry/detail/pose_distance.hpp"

namespace cairn::detail {
namespace {

using Eigen::Vector3d;

// Two strips of one hilly ground that share a third of their length, the target larger by any factor. Of the landmarks
// there, seven in ten are in both.
struct ScaledGround {
  explicit ScaledGround(std::uint64_t seed, double scale = 2.7) {
    Random random(seed);
    const Rigid3 pose = Rigid3::from_roll_pitch_yaw({0.4, -0.7, 0.2}, 0.8, -0.5, 2.1);
    truth = Similarity3(scale, pose);
    const auto noisy = [&](const Vector3d& point) {
      return Vector3d(point + 0.002 * Vector3d(random.normal(), random.normal(), random.normal()));
    };
    for (int i = 0; i < 5000; ++i) {
      const double x = random.uniform(-4.0, 3.0);
      const double y = random.uniform(-1.5, 1.5);
      const Vector3d point(x, y, 0.3 * std::sin(2.3 * x + y) + 0.2 * std::sin(3.1 * y - x));
      if (x < 0.8 && (x < -0.8 || random.chance(0.84))) {
        source.positions.push_back(truth.inverse() * noisy(point));
      }
      if (x > -0.8 && (x > 0.8 || random.chance(0.84))) target.positions.push_back(noisy(point));
    }
  }

  Similarity3 truth;
  LandmarkCloud source;
  LandmarkCloud target;
};

struct Found {
  std::vector<QuadPose> poses;
  std::vector<double> off;  // of each pose from the truth, in the target's unit
};

Found poses_of(const ScaledGround& ground, const ScaleRange& scales = {},
               const Execution& execution = {}) {
  constexpr double kGroundFine = 0.16;
  const PreparedCloud source(ground.source, 1);
  const PreparedCloud target(ground.target, 2);
  Found found{quad_poses(source, target, scales, kGroundFine, execution), {}};
  const PoseDistance distance = PoseDistance::of(ground.source.positions);
  for (const QuadPose& one : found.poses) {
    found.off.push_back(
        distance(uncentred_pose(source, target, one.target_from_source), ground.truth));
  }
  return found;
}

TEST(QuadPoses, FindThePoseAndTheScaleOfMapsThatShareAThird) {
  for (const double scale : {0.001, 0.4, 1.0, 2.7, 300.0}) {
    const Found found = poses_of(ScaledGround(1, scale), {1e-4, 1e4});
    ASSERT_FALSE(found.poses.empty()) << scale;
    EXPECT_LT(found.off.front(), 0.1) << scale;
    EXPECT_NEAR(found.poses.front().target_from_source.scale() / scale, 1.0, 0.02);
  }
}

TEST(QuadPoses, MostEvidenceFirstAndEachPoseOnce) {
  const ScaledGround ground(2);
  const Found found = poses_of(ground);
  const PoseDistance distance = PoseDistance::of(ground.source.positions);
  EXPECT_LE(found.poses.size(), kMostQuadPoses);
  for (std::size_t i = 1; i < found.poses.size(); ++i) {
    EXPECT_GE(found.poses[i - 1].evidence, found.poses[i].evidence);
    for (std::size_t j = 0; j < i; ++j) {
      EXPECT_GE(distance(found.poses[i].target_from_source, found.poses[j].target_from_source),
                0.08);
    }
  }
}

TEST(QuadPoses, KeepToTheRangeOfScales) {
  const Found found = poses_of(ScaledGround(1), {0.5, 2.0});
  for (const double off : found.off) EXPECT_GT(off, 0.5);
}

// Chance gives a mirror image some; how much differs from one ground to another.
TEST(QuadPoses, AMirrorImageHasLittleEvidence) {
  double direct = 0.0;
  double mirrored = 0.0;
  for (const std::uint64_t seed : {1, 2, 3, 4, 5}) {
    ScaledGround ground(seed);
    direct += poses_of(ground).poses.front().evidence;
    for (Vector3d& point : ground.target.positions) point.x() = -point.x();
    const Found found = poses_of(ground);
    if (!found.poses.empty()) mirrored += found.poses.front().evidence;
  }
  EXPECT_LT(mirrored, 0.6 * direct);
}

TEST(QuadPoses, SameWithAnyNumberOfThreads) {
  const ScaledGround ground(2);
  const Found one = poses_of(ground);
  const Found many = poses_of(ground, {}, {.executor = Executor(0)});
  ASSERT_EQ(one.poses.size(), many.poses.size());
  for (std::size_t i = 0; i < one.poses.size(); ++i) {
    EXPECT_EQ(one.poses[i].target_from_source.matrix(), many.poses[i].target_from_source.matrix());
    EXPECT_EQ(one.poses[i].evidence, many.poses[i].evidence);
  }
}

TEST(QuadPoses, ThereAreNoneWhereNothingCanTell) {
  ScaledGround ground(1);
  ScaledGround other(1);
  other.source.positions.assign(200, Vector3d(1.0, 2.0, 3.0));
  EXPECT_TRUE(poses_of(other).poses.empty());
  other.source.positions.clear();
  for (int i = 0; i < 400; ++i) other.source.positions.emplace_back(0.01 * i, 0.0, 0.0);
  EXPECT_TRUE(poses_of(other).poses.empty());
  ground.target.positions.resize(9);
  EXPECT_TRUE(poses_of(ground).poses.empty());
}

TEST(QuadPoses, StopWhenAsked) {
  std::stop_source source;
  source.request_stop();
  EXPECT_TRUE(poses_of(ScaledGround(1), {}, {.stop = source.get_token()}).poses.empty());
}

}  // namespace
}  // namespace cairn::detail
