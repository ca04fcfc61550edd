// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/alignment/detail/bends/deformation.hpp"

#include <vector>

#include <gtest/gtest.h>

#include "cairn/core/random.hpp"
#include "cairn/geometry/angles.hpp"

namespace cairn::detail {
namespace {

Eigen::Vector3d anywhere(Random& random) {
  return {random.uniform(-1.0, 1.0), random.uniform(-2.0, 2.0), random.uniform(-0.5, 0.5)};
}

// Bends and stretches by about a tenth.
Eigen::Vector3d deformed(const Eigen::Vector3d& x) {
  const double angle = 0.08 * x.y();
  const double stretch = 1.0 + 0.06 * x.y() + 0.02 * x.x() * x.x();
  return Eigen::Vector3d(0.01, -0.02, 0.03) +
         stretch * (Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitZ()) * x);
}

struct Pairs {
  std::vector<Eigen::Vector3d> from;
  std::vector<Eigen::Vector3d> to;
};

// @param outliers one of so many pairs is wrong; 0: none
Pairs pairs(std::size_t count, double noise, std::size_t outliers, std::uint64_t seed) {
  Random random(seed);
  Pairs result;
  for (std::size_t i = 0; i < count; ++i) {
    result.from.push_back(anywhere(random));
    const bool wrong = outliers != 0 && i % outliers == 0;
    const Eigen::Vector3d error(random.normal(), random.normal(), random.normal());
    result.to.emplace_back(wrong ? anywhere(random)
                                 : Eigen::Vector3d(deformed(result.from[i]) + noise * error));
  }
  return result;
}

TEST(Deformation, IsFoundAmongOutliers) {
  const Pairs some = pairs(600, 0.005, 2, 1);
  const auto fit = fit_deformation(some.from, some.to, some.from);
  ASSERT_TRUE(fit);
  EXPECT_GT(fit->inliers.size(), 280U);
  EXPECT_LT(fit->inliers.size(), 320U);
  EXPECT_NEAR(fit->deviation, 0.005, 0.001);
  std::size_t wrong = 0;
  for (const std::size_t i : fit->inliers) wrong += i % 2 == 0 ? 1 : 0;
  EXPECT_LT(wrong, 15U);
  Random random(2);
  for (int i = 0; i < 200; ++i) {
    const Eigen::Vector3d x = 0.8 * anywhere(random);
    EXPECT_LT((fit->deformation(x) - deformed(x)).norm(), 0.01) << x.transpose();
  }
}

TEST(Deformation, OfEqualPointsIsTheIdentity) {
  Pairs some = pairs(100, 0.0, 0, 3);
  some.to = some.from;
  const auto fit = fit_deformation(some.from, some.to, some.from);
  ASSERT_TRUE(fit);
  EXPECT_EQ(fit->inliers.size(), 100U);
  const Eigen::Vector3d x(0.3, 0.4, 0.1);
  EXPECT_LT((fit->deformation(x) - x).norm(), 1e-12);
  EXPECT_LT((fit->deformation.near(x).matrix() - Matrix4d::Identity()).norm(), 1e-12);
}

// Units do not matter: the result scales with the points.
TEST(Deformation, HasNoUnit) {
  const Pairs some = pairs(300, 0.005, 3, 4);
  Pairs large = some;
  for (Eigen::Vector3d& x : large.from) x *= 1000.0;
  for (Eigen::Vector3d& x : large.to) x *= 1000.0;
  const auto fit = fit_deformation(some.from, some.to, some.from);
  const auto other = fit_deformation(large.from, large.to, large.from);
  ASSERT_TRUE(fit && other);
  EXPECT_EQ(fit->inliers, other->inliers);
  const Eigen::Vector3d x(0.3, 0.4, 0.1);
  EXPECT_LT((1000.0 * fit->deformation(x) - other->deformation(1000.0 * x)).norm(), 1e-6);
}

TEST(Deformation, HasTheDerivativeOfItsDifferences) {
  const Pairs some = pairs(300, 0.0, 0, 5);
  const auto fit = fit_deformation(some.from, some.to, some.from);
  ASSERT_TRUE(fit);
  Random random(6);
  constexpr double kStep = 1e-5;
  for (int i = 0; i < 20; ++i) {
    const Eigen::Vector3d x = 0.9 * anywhere(random);
    Eigen::Matrix3d expected;
    for (int axis = 0; axis < 3; ++axis) {
      const Eigen::Vector3d step = kStep * Eigen::Vector3d::Unit(axis);
      expected.col(axis) =
          (fit->deformation(x + step) - fit->deformation(x - step)) / (2.0 * kStep);
    }
    EXPECT_LT((fit->deformation.derivative(x) - expected).norm(), 1e-8);
  }
}

TEST(Deformation, IsNearASimilarityEverywhere) {
  const Pairs some = pairs(2000, 0.0, 0, 7);
  const auto fit = fit_deformation(some.from, some.to, some.from);
  ASSERT_TRUE(fit);
  for (const double y : {-1.0, 0.0, 1.0}) {
    const Eigen::Vector3d x(0.0, y, 0.0);
    const Similarity3 near = fit->deformation.near(x);
    EXPECT_LT((near * x - fit->deformation(x)).norm(), 1e-12);
    // Along y the stretch counts twice, because it grows that way, and the turn shears.
    EXPECT_NEAR(near.scale(), std::cbrt((1.0 + 0.06 * y) * (1.0 + 0.06 * y) * (1.0 + 0.12 * y)),
                0.01);
    EXPECT_NEAR(degrees(near.rigid().angle()), degrees(0.08 * 1.5 * std::abs(y)), 1.0);
  }
}

TEST(Deformation, FoldsWhereItTurnsSpaceInsideOut) {
  Deformation::Coefficients coefficients = Deformation::Coefficients::Zero();
  coefficients(0, 1) = 0.5;  // of x, by x
  const Eigen::Vector3d x(0.1, 0.2, 0.3);
  EXPECT_FALSE(Deformation(Eigen::Vector3d::Zero(), 1.0, coefficients).folds(x));
  EXPECT_FALSE(Deformation().folds(x));
  coefficients(0, 1) = -1.5;
  const Deformation folded(Eigen::Vector3d::Zero(), 1.0, coefficients);
  EXPECT_TRUE(folded.folds(x));
  EXPECT_LT((folded.near(x) * x - folded(x)).norm(), 1e-12);
  EXPECT_EQ(folded.near(x).rigid().angle(), 0.0);
}

TEST(Deformation, EndsBeyondItsRegion) {
  const Pairs some = pairs(300, 0.0, 0, 8);
  const auto fit = fit_deformation(some.from, some.to, some.from);
  ASSERT_TRUE(fit);
  const Eigen::Vector3d way(0.6, 0.8, 0.0);
  const Eigen::Vector3d far = fit->deformation(100.0 * way) - 100.0 * way;
  const Eigen::Vector3d farther = fit->deformation(1000.0 * way) - 1000.0 * way;
  EXPECT_LT((far - farther).norm(), 0.02);
  EXPECT_LT(far.norm(), 5.0);
  EXPECT_EQ(fit->deformation.derivative(100.0 * way), Eigen::Matrix3d::Identity());
}

// A tenth of the radius is a usual coefficient; what would need ten times as much is not believed.
TEST(Deformation, IsSmallAPriori) {
  const Pairs few = pairs(60, 0.02, 0, 9);
  const auto fit = fit_deformation(few.from, few.to, few.from);
  ASSERT_TRUE(fit);
  Random random(10);
  for (int i = 0; i < 100; ++i) {
    const Eigen::Vector3d x = anywhere(random);
    EXPECT_LT((fit->deformation(x) - deformed(x)).norm(), 0.2) << "60 pairs, 60 coefficients";
  }
}

TEST(Deformation, NeedsTwentyPairsThatAgree) {
  const Pairs some = pairs(300, 0.0, 0, 11);
  const auto first = [&](std::size_t count) {
    return fit_deformation(std::span(some.from).first(count), std::span(some.to).first(count),
                           some.from);
  };
  EXPECT_TRUE(first(60));
  EXPECT_FALSE(first(19));
  EXPECT_FALSE(first(0));
  // Nothing but outliers.
  const Pairs strange = pairs(60, 0.0, 1, 12);
  EXPECT_FALSE(fit_deformation(strange.from, strange.to, strange.from));
  const std::vector<Eigen::Vector3d> one_place(30, Eigen::Vector3d::Ones());
  EXPECT_FALSE(fit_deformation(one_place, one_place, one_place));
}

}  // namespace
}  // namespace cairn::detail
