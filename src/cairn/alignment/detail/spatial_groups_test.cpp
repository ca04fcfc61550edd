// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/alignment/detail/spatial_groups.hpp"

#include <algorithm>

#include <gtest/gtest.h>

#include "cairn/core/random.hpp"

namespace cairn::detail {
namespace {

TEST(SpatialGroups, AreOfEqualSizeAndApart) {
  Random random(1);
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < 1024; ++i) {
    points.emplace_back(random.uniform(0, 8), random.uniform(0, 1), random.uniform(0, 1));
  }
  const std::vector<std::size_t> groups = spatial_groups(points, 8);
  for (std::size_t group = 0; group < 8; ++group) {
    EXPECT_EQ(std::count(groups.begin(), groups.end(), group), 128);
    // The long axis is cut three times: an eighth of it each.
    double low = 8.0;
    double high = 0.0;
    for (std::size_t i = 0; i < points.size(); ++i) {
      if (groups[i] != group) continue;
      low = std::min(low, points[i].x());
      high = std::max(high, points[i].x());
    }
    EXPECT_LT(high - low, 1.5);
  }
}

TEST(SpatialGroups, TakeFewAndEqualPoints) {
  EXPECT_TRUE(spatial_groups({}, 4).empty());
  const std::vector<Eigen::Vector3d> same(7, Eigen::Vector3d::Ones());
  for (const std::size_t group : spatial_groups(same, 16)) EXPECT_LT(group, 16U);
}

}  // namespace
}  // namespace cairn::detail
