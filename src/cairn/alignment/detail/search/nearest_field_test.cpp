// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/alignment/detail/search/nearest_field.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "cairn/core/random.hpp"

namespace cairn::detail {
namespace {

Eigen::Vector3f point_in(const Box& box, Random& random) {
  Eigen::Vector3f point;
  for (int axis = 0; axis < 3; ++axis) {
    point[axis] = static_cast<float>(random.uniform(box.low[axis], box.high[axis]));
  }
  return point;
}

constexpr std::size_t kPlenty = 1 << 20;

TEST(NearestField, NamesAPointNoFartherThanAVoxelBeyondTheNearest) {
  const Box box{{-1, 0, 2}, {1, 3, 2.5}};
  const float voxel = 0.05F;
  Random random(3);
  std::vector<Eigen::Vector3f> points;
  for (int i = 0; i < 200; ++i) points.push_back(point_in(box, random));
  const NearestField field(points, box, voxel, kPlenty);
  for (int i = 0; i < 2000; ++i) {
    const Eigen::Vector3f query = point_in(box, random);
    float nearest = std::numeric_limits<float>::infinity();
    for (const auto& point : points) nearest = std::min(nearest, (point - query).norm());
    const std::uint32_t found = field.nearest(query);
    ASSERT_NE(found, NearestField::kNone);
    // The query is half a diagonal from its voxel's centre, the points as much from theirs.
    EXPECT_LE((points[found] - query).norm(), nearest + 2.0F * std::sqrt(3.0F) * voxel);
  }
}

TEST(NearestField, KnowsNothingOutsideItsBox) {
  const NearestField field(std::vector<Eigen::Vector3f>{{0, 0, 0}}, {{-1, -1, -1}, {1, 1, 1}}, 0.1F,
                           kPlenty);
  EXPECT_EQ(field.nearest({0.9F, -0.9F, 0}), 0U);
  const float nan = std::numeric_limits<float>::quiet_NaN();
  for (const Eigen::Vector3f& outside :
       {Eigen::Vector3f(1.5F, 0, 0), Eigen::Vector3f(0, -1.5F, 0), Eigen::Vector3f(0, 0, 1e30F),
        Eigen::Vector3f(nan, 0, 0)}) {
    EXPECT_EQ(field.nearest(outside), NearestField::kNone);
  }
}

TEST(NearestField, WithoutPointsInsideNamesNone) {
  const NearestField field(std::vector<Eigen::Vector3f>{{5, 5, 5}}, {{-1, -1, -1}, {1, 1, 1}}, 0.5F,
                           kPlenty);
  EXPECT_EQ(field.nearest({0, 0, 0}), NearestField::kNone);
}

TEST(NearestField, StaysWithinItsVoxelsByMakingThemLonger) {
  const Box box{{0, 0, 0}, {1000, 1, 1}};
  const NearestField field(std::vector<Eigen::Vector3f>{{0, 0, 0}, {999, 0.5F, 0.5F}}, box, 1e-3F,
                           1000);
  EXPECT_EQ(field.nearest({10, 0.5F, 0.5F}), 0U);
  EXPECT_EQ(field.nearest({990, 0.5F, 0.5F}), 1U);
}

}  // namespace
}  // namespace cairn::detail
