// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/geometry/similarity3.hpp"

#include <cmath>

#include <gtest/gtest.h>

#include "cairn/core/error.hpp"
#include "cairn/core/random.hpp"

namespace cairn {
namespace {

Similarity3 random_similarity(Random& random) {
  return {std::exp(random.normal()), Rigid3(Eigen::Quaterniond(random.normal(), random.normal(),
                                                               random.normal(), random.normal()),
                                            {random.normal(), random.normal(), random.normal()})};
}

TEST(Similarity3, IsAGroupThatActsOnPoints) {
  Random random(1);
  for (int i = 0; i < 100; ++i) {
    const Similarity3 a = random_similarity(random);
    const Similarity3 b = random_similarity(random);
    const Eigen::Vector3d x(random.normal(), random.normal(), random.normal());
    EXPECT_LT(((a * b) * x - a * (b * x)).norm(), 1e-11);
    EXPECT_LT((a.inverse() * (a * x) - x).norm(), 1e-11);
    EXPECT_LT(((a.matrix() * x.homogeneous()).head<3>() - a * x).norm(), 1e-11);
  }
}

TEST(Similarity3, ScalesBeforeItTranslates) {
  const Similarity3 a(2.0, Rigid3(Eigen::Quaterniond::Identity(), {10, 0, 0}));
  EXPECT_EQ(a * Eigen::Vector3d(1, 1, 1), Eigen::Vector3d(12, 2, 2));
}

TEST(Similarity3, RefusesScalesThatAreNotPositive) {
  for (const double scale : {0.0, -1.0, std::nan(""), HUGE_VAL}) {
    EXPECT_THROW(Similarity3(scale, Rigid3()), Error);
  }
}

}  // namespace
}  // namespace cairn
