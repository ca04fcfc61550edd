// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/geometry/rigid3.hpp"

#include <numbers>

#include <gtest/gtest.h>

#include "cairn/core/error.hpp"
#include "cairn/core/random.hpp"

namespace cairn {
namespace {

Eigen::Vector3d random_vector(Random& random, double scale) {
  return scale * Eigen::Vector3d(random.normal(), random.normal(), random.normal());
}

Rigid3 random_rigid(Random& random) {
  return {Eigen::Quaterniond(random.normal(), random.normal(), random.normal(), random.normal()),
          random_vector(random, 3.0)};
}

void expect_same(const Rigid3& a, const Rigid3& b) {
  EXPECT_LT((a.matrix() - b.matrix()).cwiseAbs().maxCoeff(), 1e-12);
}

TEST(Rigid3, IsAGroup) {
  Random random(1);
  for (int i = 0; i < 100; ++i) {
    const Rigid3 a = random_rigid(random);
    const Rigid3 b = random_rigid(random);
    const Rigid3 c = random_rigid(random);
    expect_same((a * b) * c, a * (b * c));
    expect_same(a * a.inverse(), Rigid3());
    expect_same(a * Rigid3(), a);
    const Eigen::Vector3d x = random_vector(random, 1.0);
    EXPECT_LT(((a * b) * x - a * (b * x)).norm(), 1e-12);
  }
}

TEST(Rigid3, KeepsARotationThatItGave) {
  Random random(3);
  for (int i = 0; i < 10000; ++i) {
    const Rigid3 pose = random_rigid(random);
    EXPECT_EQ(Rigid3(pose.quaternion(), pose.translation()).quaternion().coeffs(),
              pose.quaternion().coeffs());
  }
}

TEST(Rigid3, StaysARotationThroughManyProducts) {
  Random random(4);
  Rigid3 product;
  for (int i = 0; i < 100000; ++i) {
    product = product * Rigid3(random_rigid(random).quaternion(), Eigen::Vector3d::Zero());
    ASSERT_NEAR(product.quaternion().squaredNorm(), 1.0, 1e-15);
  }
}

TEST(Rigid3, AgreesWithItsMatrix) {
  Random random(2);
  for (int i = 0; i < 100; ++i) {
    const Rigid3 a = random_rigid(random);
    const Eigen::Vector3d x = random_vector(random, 1.0);
    EXPECT_LT(((a.matrix() * x.homogeneous()).head<3>() - a * x).norm(), 1e-12);
    expect_same(Rigid3::from_matrix(a.matrix()), a);
  }
}

TEST(Rigid3, PerturbationAndDifferenceAreInverse) {
  Random random(3);
  for (int i = 0; i < 100; ++i) {
    const Rigid3 a = random_rigid(random);
    const Rigid3 b = random_rigid(random);
    expect_same(a.perturbed(a.difference_to(b)), b);
    Vector6d delta;
    delta << random_vector(random, 1e-9), random_vector(random, 1e-9);
    EXPECT_LT((a.difference_to(a.perturbed(delta)) - delta).norm(), 1e-14);
  }
}

TEST(Rigid3, YawTurnsXTowardsYAndIsAppliedLast) {
  const double quarter = std::numbers::pi / 2;
  const auto yaw = Rigid3::from_roll_pitch_yaw({1, 2, 3}, 0, 0, quarter);
  EXPECT_LT((yaw * Eigen::Vector3d(1, 0, 0) - Eigen::Vector3d(1, 3, 3)).norm(), 1e-12);
  const auto both = Rigid3::from_roll_pitch_yaw({0, 0, 0}, quarter, 0, quarter);
  EXPECT_LT((both * Eigen::Vector3d(0, 1, 0) - Eigen::Vector3d(0, 0, 1)).norm(), 1e-12);
}

TEST(Rigid3, RollPitchYawComesBack) {
  Random random(4);
  for (int i = 0; i < 100; ++i) {
    const Rigid3 a = random_rigid(random);
    const Eigen::Vector3d rpy = a.roll_pitch_yaw();
    expect_same(Rigid3::from_roll_pitch_yaw(a.translation(), rpy.x(), rpy.y(), rpy.z()), a);
  }
  for (const double pitch : {std::numbers::pi / 2, -std::numbers::pi / 2}) {
    const auto locked = Rigid3::from_roll_pitch_yaw({0, 0, 0}, 0.3, pitch, 0.5);
    const Eigen::Vector3d rpy = locked.roll_pitch_yaw();
    expect_same(Rigid3::from_roll_pitch_yaw({0, 0, 0}, rpy.x(), rpy.y(), rpy.z()), locked);
  }
}

TEST(Rigid3, AngleIsThatOfTheRotation) {
  EXPECT_NEAR(Rigid3::from_roll_pitch_yaw({9, 9, 9}, 0, 0, -0.25).angle(), 0.25, 1e-15);
  EXPECT_NEAR(Rigid3(Eigen::Quaterniond(-1, 0, 0, 1e-9), {0, 0, 0}).angle(), 2e-9, 1e-20);
}

TEST(Rigid3, RefusesMatricesThatAreNotRigid) {
  Matrix4d scaled = Matrix4d::Identity();
  scaled(0, 0) = 1.1;
  Matrix4d mirrored = Matrix4d::Identity();
  mirrored(2, 2) = -1.0;
  Matrix4d projective = Matrix4d::Identity();
  projective(3, 0) = 0.1;
  Matrix4d not_a_number = Matrix4d::Identity();
  not_a_number(0, 3) = std::nan("");
  for (const Matrix4d& matrix : {scaled, mirrored, projective, not_a_number}) {
    EXPECT_THROW(Rigid3::from_matrix(matrix), Error);
  }
}

TEST(RotationLog, InvertsExpUpToHalfATurn) {
  Random random(5);
  for (int i = 0; i < 200; ++i) {
    const Eigen::Vector3d direction = random_vector(random, 1.0).normalized();
    const double angle = i % 2 == 0 ? random.uniform(0.0, 3.14) : random.uniform(0.0, 1e-7);
    EXPECT_LT((rotation_log(rotation_exp(angle * direction)) - angle * direction).norm(),
              1e-12 + 1e-9 * angle);
  }
}

TEST(Skew, IsTheCrossProduct) {
  const Eigen::Vector3d a(1, 2, 3);
  const Eigen::Vector3d b(-4, 5, 0.5);
  EXPECT_EQ((skew(a) * b).eval(), a.cross(b).eval());
}

}  // namespace
}  // namespace cairn
