// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "cairn/alignment/detail/search/poses.hpp"
#include "cairn/core/random.hpp"

namespace cairn::detail {
namespace {

Eigen::Quaterniond any_rotation(Random& random) {
  return Eigen::Quaterniond(random.normal(), random.normal(), random.normal(), random.normal())
      .normalized();
}

TEST(Rotations, LeaveNoneFarFromTheNearest) {
  for (const std::size_t count : {500U, 4608U}) {
    const auto rotations = all_rotations(count);
    ASSERT_EQ(rotations.size(), count);
    Random random(1);
    double farthest = 0.0;
    for (int i = 0; i < 300; ++i) {
      const Eigen::Quaterniond query = any_rotation(random);
      double nearest = 10.0;
      for (const auto& rotation : rotations) {
        nearest = std::min(nearest, query.angularDistance(rotation));
      }
      farthest = std::max(farthest, nearest);
    }
    EXPECT_LT(farthest, 4.5 / std::cbrt(count));
  }
}

TEST(Rotations, AreUnitQuaternions) {
  for (const auto& rotation : all_rotations(100)) EXPECT_NEAR(rotation.norm(), 1.0, 1e-12);
}

TEST(Rotations, AboutADirectionKeepItAndTurnEvenly) {
  const Eigen::Vector3d from = Eigen::Vector3d(1, 2, 3).normalized();
  const Eigen::Vector3d to = -Eigen::Vector3d(0.3, -1, 0.2).normalized();
  const auto rotations = rotations_about(from, to, 8);
  ASSERT_EQ(rotations.size(), 8U);
  for (std::size_t i = 0; i < rotations.size(); ++i) {
    EXPECT_LT((rotations[i] * from - to).norm(), 1e-12);
    const auto& next = rotations[(i + 1) % rotations.size()];
    EXPECT_NEAR(rotations[i].angularDistance(next), M_PI / 4, 1e-9);
  }
}

}  // namespace
}  // namespace cairn::detail
