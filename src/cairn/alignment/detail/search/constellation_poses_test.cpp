// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "cairn/alignment/detail/search/poses.hpp"
#include "cairn/geometry/detail/pose_distance.hpp"

namespace cairn::detail {
namespace {

using Eigen::Vector3d;
using Points = std::vector<Vector3d>;

constexpr double kFine = 0.16;
constexpr std::size_t kDraws = 192;

// Two strips of one hilly ground that share a third of their length. Of the landmarks there, seven in
// ten are in both, a twentieth of the fine scale off.
struct Ground {
  explicit Ground(std::uint64_t seed) : random(seed) {
    for (int i = 0; i < 5000; ++i) {
      const double x = random.uniform(-4.0, 3.0);
      const double y = random.uniform(-1.5, 1.5);
      const Vector3d point(x, y, 0.3 * std::sin(2.3 * x + y) + 0.2 * std::sin(3.1 * y - x));
      if (x < 0.8 && (x < -0.8 || random.chance(0.84)))
        source.push_back(truth.inverse() * noisy(point));
      if (x > -0.8 && (x > 0.8 || random.chance(0.84))) target.push_back(noisy(point));
    }
  }
  Vector3d noisy(const Vector3d& point) {
    const double deviation = 0.05 * kFine / std::sqrt(3.0);
    return point + deviation * Vector3d(random.normal(), random.normal(), random.normal());
  }

  Random random;
  Rigid3 truth = Rigid3::from_roll_pitch_yaw({0.4, -0.7, 0.2}, 0.8, -0.5, 2.1);
  Points source;
  Points target;
};

// Points come in random order.
Points shuffled(Points points, Random random) {
  for (std::size_t i = points.size(); i > 1; --i) {
    std::swap(points[i - 1], points[random.index(i)]);
  }
  return points;
}

std::vector<ConstellationPose> poses_of(const Ground& ground, const Execution& execution = {}) {
  return constellation_poses(shuffled(ground.source, Random(1)), shuffled(ground.target, Random(2)),
                             Random(3), kFine, kDraws, execution);
}

TEST(ConstellationPoses, FindsThePoseOfMapsThatShareAThird) {
  for (const std::uint64_t seed : {1, 2, 3}) {
    const Ground ground(seed);
    const auto found = poses_of(ground);
    ASSERT_FALSE(found.empty());
    const PoseDistance distance = PoseDistance::of(ground.source);
    EXPECT_LT(distance(found.front().target_from_source, ground.truth), kFine) << seed;
  }
}

TEST(ConstellationPoses, WhatStandsTwiceHasTwoPoses) {
  Ground ground(1);
  const Vector3d apart(0.0, 0.0, 5.0);
  const Points once = ground.target;
  for (const Vector3d& point : once) ground.target.push_back(point + apart);
  const auto found = poses_of(ground);
  ASSERT_GE(found.size(), 2U);
  EXPECT_LE(found.size(), kMostConstellationPoses);
  const PoseDistance distance = PoseDistance::of(ground.source);
  const Rigid3 twin = Rigid3(Eigen::Quaterniond::Identity(), apart) * ground.truth;
  for (const Rigid3& pose : {ground.truth, twin}) {
    EXPECT_LT(std::min(distance(found[0].target_from_source, pose),
                       distance(found[1].target_from_source, pose)),
              kFine);
  }
  for (std::size_t i = 1; i < found.size(); ++i) {
    EXPECT_GE(found[i - 1].evidence, found[i].evidence);
    for (std::size_t j = 0; j < i; ++j) {
      EXPECT_GE(distance(found[i].target_from_source, found[j].target_from_source), 0.5 * kFine);
    }
  }
}

// Distances alone do not tell a map from its mirror image; the landmarks about a constellation do.
TEST(ConstellationPoses, AMirrorImageHasLittleEvidence) {
  Ground ground(1);
  const double direct = poses_of(ground).front().evidence;
  for (Vector3d& point : ground.target) point.x() = -point.x();
  const auto mirrored = poses_of(ground);
  EXPECT_LT(mirrored.empty() ? 0.0 : mirrored.front().evidence, 0.5 * direct);
}

TEST(ConstellationPoses, SameWithAnyNumberOfThreads) {
  const Ground ground(2);
  const auto one = poses_of(ground);
  const auto many = poses_of(ground, {.executor = Executor(0)});
  ASSERT_EQ(one.size(), many.size());
  for (std::size_t i = 0; i < one.size(); ++i) {
    EXPECT_EQ(one[i].target_from_source.matrix(), many[i].target_from_source.matrix());
    EXPECT_EQ(one[i].evidence, many[i].evidence);
  }
}

TEST(ConstellationPoses, ThereAreNoneWhereNothingCanTell) {
  const Ground ground(1);
  EXPECT_TRUE(constellation_poses({}, ground.target, Random(1), kFine, kDraws).empty());
  EXPECT_TRUE(constellation_poses(ground.source, {}, Random(1), kFine, kDraws).empty());
  const Points same(200, Vector3d(1.0, 2.0, 3.0));
  EXPECT_TRUE(constellation_poses(same, ground.target, Random(1), kFine, kDraws).empty());
  EXPECT_TRUE(constellation_poses(ground.source, same, Random(1), kFine, kDraws).empty());
  const Points line = [] {
    Points points;
    for (int i = 0; i < 400; ++i) points.emplace_back(0.01 * i, 0.0, 0.0);
    return points;
  }();
  EXPECT_TRUE(constellation_poses(line, ground.target, Random(1), kFine, kDraws).empty());
}

TEST(ConstellationPoses, AStrayLandmarkFarAwayCostsNoMemory) {
  Ground ground(1);
  ground.target.emplace_back(1e7, -1e7, 1e7);
  const auto found = poses_of(ground);
  for (const ConstellationPose& pose : found) {
    EXPECT_TRUE(pose.target_from_source.matrix().allFinite());
  }
}

TEST(ConstellationPoses, StopWhenAsked) {
  std::stop_source source;
  source.request_stop();
  EXPECT_TRUE(poses_of(Ground(1), {.stop = source.get_token()}).empty());
}

}  // namespace
}  // namespace cairn::detail
