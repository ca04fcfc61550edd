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

TEST(Similarity3, IsReadFromItsMatrix) {
  Random random(2);
  for (int i = 0; i < 100; ++i) {
    const Similarity3 a = random_similarity(random);
    const Similarity3 read = Similarity3::from_matrix(a.matrix());
    EXPECT_NEAR(read.scale(), a.scale(), 1e-12 * a.scale());
    EXPECT_LT((read.matrix() - a.matrix()).norm(), 1e-11);
  }
  Matrix4d rounded = Rigid3(rotation_exp({0.3, 0.2, 0.1}), {1, 2, 3}).matrix();
  for (int i = 0; i < 16; ++i)
    rounded(i / 4, i % 4) = std::round(1e6 * rounded(i / 4, i % 4)) / 1e6;
  EXPECT_EQ(Similarity3::from_matrix(rounded).scale(), 1.0);
  // Nearly rigid motions are read, too, on both sides of the tolerance.
  for (int i = -100; i <= 100; ++i) {
    const Similarity3 pose(1.0 + 1e-6 * i, Rigid3(rotation_exp({0.3, 0.2, 0.1}), {1, 2, 3}));
    EXPECT_NEAR(Similarity3::from_matrix(pose.matrix()).scale(), pose.scale(), 5e-5) << i;
  }
  Matrix4d mirrored = Matrix4d::Identity();
  mirrored(0, 0) = -1.0;
  EXPECT_THROW(Similarity3::from_matrix(mirrored), Error);
  Matrix4d sheared = Matrix4d::Identity();
  sheared(0, 1) = 0.1;
  EXPECT_THROW(Similarity3::from_matrix(sheared), Error);
  EXPECT_THROW(Similarity3::from_matrix(Matrix4d::Zero()), Error);
  for (const double scale : {1e10, 1e100, 1e-10}) {
    Matrix4d extreme = Matrix4d::Identity();
    extreme.topLeftCorner<3, 3>() *= scale;
    EXPECT_THROW(Similarity3::from_matrix(extreme), Error) << scale;
  }
  Matrix4d far = Matrix4d::Identity();
  far(1, 3) = -1.1e9;
  EXPECT_THROW(Similarity3::from_matrix(far), Error);
  EXPECT_THROW(Rigid3::from_matrix(far), Error);
}

TEST(Similarity3, RefusesScalesThatAreNotPositive) {
  for (const double scale : {0.0, -1.0, std::nan(""), HUGE_VAL}) {
    EXPECT_THROW(Similarity3(scale, Rigid3()), Error);
  }
}

}  // namespace
}  // namespace cairn
