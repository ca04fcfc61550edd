// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/alignment/detail/cloud_scales.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "cairn/core/random.hpp"

namespace cairn::detail {
namespace {

LandmarkCloud ball(std::size_t count, double radius, std::uint64_t seed) {
  Random random(seed);
  LandmarkCloud cloud;
  while (cloud.size() < count) {
    const Eigen::Vector3d at(random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1));
    if (at.norm() <= 1.0) cloud.positions.push_back(radius * at);
  }
  return cloud;
}

CloudScales scales_of(const LandmarkCloud& cloud) {
  return cloud_scales(cloud, BatchTree(cloud.positions), Executor());
}

TEST(CloudScales, AreThoseOfABallAndGrowWithIt) {
  const CloudScales one = scales_of(ball(3000, 1.0, 1));
  // Half of a ball's volume is within this share of its radius.
  EXPECT_NEAR(one.extent, std::cbrt(0.5), 0.02);
  EXPECT_EQ(one.noise, 0.0);
  const CloudScales seven = scales_of(ball(3000, 7.0, 1));
  EXPECT_NEAR(seven.extent, 7.0 * one.extent, 1e-9);
  EXPECT_NEAR(seven.spacing, 7.0 * one.spacing, 1e-9);
}

TEST(CloudScales, ExtentDoesNotSeeAFewStrays) {
  LandmarkCloud cloud = ball(1000, 1.0, 2);
  const double extent = cloud_extent(cloud);
  for (int i = 0; i < 5; ++i) cloud.positions.emplace_back(1e6 + i, 0.0, 0.0);
  EXPECT_NEAR(cloud_extent(cloud), extent, 0.02 * extent);
}

TEST(CloudScales, AreTheSameWhereverTheCloudIs) {
  LandmarkCloud cloud = ball(1000, 1.0, 5);
  const CloudScales here = scales_of(cloud);
  for (Eigen::Vector3d& position : cloud.positions) position += Eigen::Vector3d(5.0, -3.0, 20.0);
  const CloudScales there = scales_of(cloud);
  EXPECT_NEAR(there.extent, here.extent, 1e-9);
  EXPECT_NEAR(there.spacing, here.spacing, 1e-9);
}

TEST(CloudScales, NoiseIsAlongOneAxis) {
  LandmarkCloud cloud = ball(500, 1.0, 3);
  cloud.covariances.assign(500, 0.04 * 0.04 * Eigen::Matrix3d::Identity());
  EXPECT_NEAR(scales_of(cloud).noise, 0.04, 1e-12);
}

TEST(CloudScales, CovariancesArePlaceholdersFromATenthOfTheExtentOn) {
  LandmarkCloud cloud = ball(500, 1.0, 3);
  EXPECT_FALSE(has_placeholder_covariances(cloud));
  const double tenth = 0.1 * cloud_extent(cloud);
  cloud.covariances.assign(500, 0.99 * tenth * tenth * Eigen::Matrix3d::Identity());
  EXPECT_FALSE(has_placeholder_covariances(cloud));
  cloud.covariances.assign(500, 1.01 * tenth * tenth * Eigen::Matrix3d::Identity());
  EXPECT_TRUE(has_placeholder_covariances(cloud));
  // A few bad landmarks make no bad map.
  cloud.covariances.assign(500, 1e-6 * Eigen::Matrix3d::Identity());
  std::fill_n(cloud.covariances.begin(), 200, Eigen::Matrix3d::Identity());
  EXPECT_FALSE(has_placeholder_covariances(cloud));
}

TEST(LandmarkSpacings, ReachTheEighthNeighbourAsBruteForceDoes) {
  const LandmarkCloud cloud = ball(200, 1.0, 4);
  const auto spacings = landmark_spacings(cloud.positions, BatchTree(cloud.positions), Executor(2));
  ASSERT_EQ(spacings.size(), cloud.size());
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    std::vector<double> distances;
    for (const auto& other : cloud.positions) {
      distances.push_back((other - cloud.positions[i]).norm());
    }
    std::sort(distances.begin(), distances.end());
    EXPECT_NEAR(spacings[i], distances[kSpacingNeighbors], 1e-12);
  }
}

TEST(LandmarkSpacings, ReachTheFarthestWhereThereAreFewer) {
  const std::vector<Eigen::Vector3d> three = {{0, 0, 0}, {1, 0, 0}, {0, 3, 0}};
  const auto spacings = landmark_spacings(three, BatchTree(three), Executor());
  EXPECT_NEAR(spacings[0], 3.0, 1e-12);
  EXPECT_NEAR(spacings[1], std::sqrt(10.0), 1e-12);
}

TEST(KernelScales, BeginWithTheSmallerCloudAndEndWithTheFinerSpacingOrTheNoise) {
  const CloudScales wide{.extent = 10.0, .spacing = 0.2, .noise = 0.0};
  const CloudScales narrow{.extent = 2.0, .spacing = 0.5, .noise = 0.0};
  const KernelScales scales = kernel_scales(wide, narrow);
  EXPECT_DOUBLE_EQ(scales.coarse, 1.0);
  EXPECT_DOUBLE_EQ(scales.fine, 0.3);
  EXPECT_DOUBLE_EQ(kernel_scales(narrow, wide).fine, scales.fine);
  const CloudScales dense{.extent = 2.0, .spacing = 0.05, .noise = 0.0};
  const CloudScales blurred{.extent = 10.0, .spacing = 0.2, .noise = 0.15};
  EXPECT_DOUBLE_EQ(kernel_scales(dense, blurred).fine, 1.5 * 0.15);
}

TEST(KernelScales, DoNotBelieveNoiseOfMoreThanATenthOfTheSmallerExtent) {
  const CloudScales room{.extent = 3.0, .spacing = 0.1, .noise = 0.0};
  CloudScales table{.extent = 1.5, .spacing = 0.05, .noise = 0.15};
  EXPECT_DOUBLE_EQ(kernel_scales(room, table).fine, 1.5 * 0.15);
  table.noise = 0.16;
  EXPECT_DOUBLE_EQ(kernel_scales(room, table).fine, 1.5 * 0.05);
  EXPECT_DOUBLE_EQ(kernel_scales(table, room).fine, 1.5 * 0.05);
}

TEST(KernelScales, AreUsableWhereLandmarksCoincide) {
  const KernelScales scales = kernel_scales({}, {});
  EXPECT_EQ(scales.coarse, 1.0);
  EXPECT_EQ(scales.fine, 1e-3);
}

TEST(KernelScales, AreThreeDecadesApartAtMost) {
  for (const double extent : {0.4, 40.0}) {
    const CloudScales copies{.extent = extent, .spacing = 0.0, .noise = 0.0};
    EXPECT_DOUBLE_EQ(kernel_scales(copies, copies).coarse, 0.5 * extent);
    EXPECT_DOUBLE_EQ(kernel_scales(copies, copies).fine, 0.5e-3 * extent);
  }
}

}  // namespace
}  // namespace cairn::detail
