// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/geometry/trajectory.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/error.hpp"

namespace cairn {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::Pair;

Trajectory at(const std::vector<double>& times) {
  std::vector<TimedPose> poses;
  for (const double time : times) {
    poses.push_back({time, Rigid3(Eigen::Quaterniond::Identity(), {time, 0, 0})});
  }
  return Trajectory(std::move(poses));
}

TEST(Trajectory, KnowsItsDurationAndLength) {
  const Trajectory trajectory = at({1.0, 2.5, 4.0});
  EXPECT_EQ(trajectory.duration_s(), 3.0);
  EXPECT_DOUBLE_EQ(trajectory.length(), 3.0);
  EXPECT_EQ(Trajectory().duration_s(), 0.0);
  EXPECT_EQ(Trajectory().length(), 0.0);
}

TEST(Trajectory, RefusesTimesThatDoNotAscend) {
  EXPECT_THROW(at({1.0, 1.0}), Error);
  EXPECT_THROW(at({2.0, 1.0}), Error);
  EXPECT_THROW(at({std::nan("")}), Error);
}

TEST(Trajectory, RefusesNumbersBeyondTheLimits) {
  const auto trajectory = [](double time, double x) {
    return Trajectory({{time, Rigid3(Eigen::Quaterniond::Identity(), {x, 0, 0})}});
  };
  EXPECT_NO_THROW(trajectory(1.7e18, -1e9));
  EXPECT_THROW(trajectory(1e21, 0.0), Error);
  EXPECT_THROW(trajectory(0.0, 1.1e9), Error);
}

TEST(NearestPose, IsTheNearestInTimeAndTheEarlierOfTwo) {
  const Trajectory trajectory = at({1.0, 2.0, 4.0});
  const auto nearest = [&](double time) { return nearest_pose(trajectory, time)->timestamp_s; };
  EXPECT_EQ(nearest(-5.0), 1.0);
  EXPECT_EQ(nearest(1.4), 1.0);
  EXPECT_EQ(nearest(1.5), 1.0);
  EXPECT_EQ(nearest(1.6), 2.0);
  EXPECT_EQ(nearest(2.0), 2.0);
  EXPECT_EQ(nearest(3.1), 4.0);
  EXPECT_EQ(nearest(9.0), 4.0);
  EXPECT_EQ(nearest_pose(Trajectory(), 1.0), nullptr);
}

TEST(Interpolated, LiesOnTheWayBetweenTheNeighbours) {
  const Rigid3 turned(rotation_exp({0.0, 0.0, 0.4}), {2.0, 0.0, 1.0});
  const Trajectory trajectory({{10.0, Rigid3()}, {10.1, turned}});
  const auto quarter = interpolated(trajectory, 10.025);
  ASSERT_TRUE(quarter);
  EXPECT_NEAR((quarter->translation() - Eigen::Vector3d(0.5, 0.0, 0.25)).norm(), 0.0, 1e-6);
  EXPECT_NEAR(quarter->angle(), 0.1, 1e-6);
  EXPECT_EQ(interpolated(trajectory, 10.1)->translation(), turned.translation());
}

TEST(Interpolated, InventsNothing) {
  const Trajectory trajectory = at({1.0, 1.05, 3.0});
  EXPECT_FALSE(interpolated(trajectory, 0.9)) << "before the first";
  EXPECT_FALSE(interpolated(trajectory, 3.1)) << "after the last";
  EXPECT_FALSE(interpolated(trajectory, 2.0)) << "in a gap";
  EXPECT_TRUE(interpolated(trajectory, 2.0, 5.0));
  EXPECT_FALSE(interpolated(Trajectory(), 1.0));
}

TEST(Associate, PairsTheClosestInTimeFirst) {
  // 1.01 is nearer to 1.012 than 1.0 is; 1.0 then has no partner left.
  EXPECT_THAT(associate(at({1.0, 1.01}), at({1.012}), 0.02), ElementsAre(Pair(1, 0)));
  EXPECT_THAT(associate(at({1.0, 1.01}), at({0.99, 1.012}), 0.02),
              ElementsAre(Pair(0, 0), Pair(1, 1)));
}

TEST(Associate, PairsOnlyWithinTheDifference) {
  EXPECT_THAT(associate(at({1.0}), at({1.5}), 0.5), IsEmpty()) << "less than, not equal";
  EXPECT_THAT(associate(at({1.0}), at({1.5}), 0.51), ElementsAre(Pair(0, 0)));
  EXPECT_THAT(associate(Trajectory(), at({1.0})), IsEmpty());
}

}  // namespace
}  // namespace cairn
