// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/geometry/covariance.hpp"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/random.hpp"

namespace cairn {
namespace {

using ::testing::HasSubstr;

Eigen::Matrix3d random_matrix(Random& random) {
  return Eigen::Matrix3d::NullaryExpr([&] { return random.normal(); });
}

TEST(CovarianceDefect, AcceptsCovariances) {
  Random random(1);
  for (int i = 0; i < 100; ++i) {
    const Eigen::Matrix3d a = random_matrix(random);
    EXPECT_EQ(covariance_defect(a * a.transpose()), "");
    const Eigen::Vector3d v = a.col(0);
    EXPECT_EQ(covariance_defect(v * v.transpose()), "") << "rank one";
  }
  EXPECT_EQ(covariance_defect(Eigen::Matrix3d::Zero()), "");
}

TEST(CovarianceDefect, NamesWhatIsWrong) {
  Eigen::Matrix3d asymmetric = Eigen::Matrix3d::Identity();
  asymmetric(0, 1) = 0.1;
  EXPECT_THAT(covariance_defect(asymmetric), HasSubstr("not symmetric"));
  EXPECT_THAT(covariance_defect(-Eigen::Matrix3d::Identity()), HasSubstr("eigenvalue is -1"));
  Eigen::Matrix3d indefinite = Eigen::Matrix3d::Identity();
  indefinite(0, 1) = indefinite(1, 0) = 2.0;
  EXPECT_THAT(covariance_defect(indefinite), HasSubstr("indefinite"));
  EXPECT_THAT(covariance_defect(Eigen::Matrix3d::Constant(std::nan(""))), HasSubstr("not finite"));
}

// The quick test against eigenvalues, near the edge of what is accepted.
// Lengths of micrometres beside angles of a radian: units decide nothing.
TEST(PoseCovarianceDefect, JudgesInAnyUnits) {
  Random random(3);
  for (int i = 0; i < 50; ++i) {
    const Matrix6d a = Matrix6d::NullaryExpr([&] { return random.normal(); });
    Vector6d units = Vector6d::Ones();
    units.head<3>().setConstant(std::pow(10.0, random.uniform(-9.0, 9.0)));
    const Matrix6d good = units.asDiagonal() * (a * a.transpose()) * units.asDiagonal();
    EXPECT_EQ(pose_covariance_defect(good), "");
    Matrix6d lopsided = good;
    lopsided(0, 1) += 1e-3 * std::sqrt(good(0, 0) * good(1, 1));
    EXPECT_EQ(pose_covariance_defect(lopsided), "is not symmetric");
    Matrix6d correlated = good;
    correlated(4, 2) = correlated(2, 4) = 1.1 * std::sqrt(good(4, 4) * good(2, 2));
    EXPECT_EQ(pose_covariance_defect(correlated), "has a correlation that is greater than 1");
    Matrix6d open = good;  // two directions that agree wholly, and a third that contradicts one
    open.setZero();
    open.diagonal() = units.cwiseAbs2();
    open(0, 1) = open(1, 0) = 0.9 * units[0] * units[1];
    open(0, 5) = open(5, 0) = 0.9 * units[0] * units[5];
    open(1, 5) = open(5, 1) = -0.9 * units[1] * units[5];
    EXPECT_EQ(pose_covariance_defect(open), "is indefinite");
  }
  EXPECT_EQ(pose_covariance_defect(Matrix6d(Matrix6d::Zero())), "");
  EXPECT_EQ(pose_covariance_defect(Matrix6d(-Matrix6d::Identity())), "is indefinite");
  EXPECT_EQ(pose_covariance_defect(Matrix6d(Matrix6d::Constant(std::nan("")))),
            "has an entry that is not finite");
}

TEST(CovarianceDefect, AgreesWithTheEigenvalues) {
  Random random(4);
  int accepted = 0;
  int refused = 0;
  for (int i = 0; i < 20000; ++i) {
    const Eigen::Matrix3d axes =
        Eigen::Quaterniond(random.normal(), random.normal(), random.normal(), random.normal())
            .normalized()
            .toRotationMatrix();
    const double scale = std::pow(10.0, random.normal() * 20.0);
    const double middle = std::pow(random.uniform(), 4.0);
    const double smallest = random.normal() * 1e-6;
    Eigen::Matrix3d matrix =
        scale * axes * Eigen::Vector3d(smallest, middle, 1.0).asDiagonal() * axes.transpose();
    matrix = (0.5 * (matrix + matrix.transpose())).eval();
    const double tolerance = 1e-6 * matrix.cwiseAbs().maxCoeff() / scale;
    if (std::abs(smallest + tolerance) < 1e-7) continue;  // within what rounding makes of it
    const bool is_one = covariance_defect(matrix).empty();
    EXPECT_EQ(is_one, smallest > -tolerance) << matrix;
    (is_one ? accepted : refused) += 1;
  }
  EXPECT_GT(accepted, 1000);
  EXPECT_GT(refused, 1000);
}

TEST(SpectralNorm, IsTheLargestSingularValue) {
  Random random(2);
  const Eigen::Matrix3d a = random_matrix(random);
  const Eigen::Matrix3d symmetric = a + a.transpose();
  EXPECT_NEAR(spectral_norm(symmetric), symmetric.jacobiSvd().singularValues()[0], 1e-12);
}

TEST(LeftTransformedCovariance, AgreesWithPerturbedPoses) {
  Random random(3);
  const auto pose = [&] {
    return Rigid3(
        Eigen::Quaterniond(random.normal(), random.normal(), random.normal(), random.normal()),
        {random.normal(), random.normal(), random.normal()});
  };
  const Rigid3 a_from_b = pose();
  const Rigid3 c_from_a = pose();
  for (int axis = 0; axis < 6; ++axis) {
    Vector6d delta = Vector6d::Zero();
    delta[axis] = 1e-6;
    const Vector6d moved =
        (c_from_a * a_from_b).difference_to(c_from_a * a_from_b.perturbed(delta));
    const Matrix6d expected = moved * moved.transpose();
    const Matrix6d outer = delta * delta.transpose();
    EXPECT_LT((left_transformed_covariance(outer, c_from_a) - expected).norm(), 1e-18);
  }
}

TEST(CovarianceAtPoint, IsThatOfTheDisplacementsOfThePoint) {
  Random random(4);
  const Similarity3 pose(
      1.7, Rigid3(Eigen::Quaterniond(random.normal(), random.normal(), random.normal(), 1.0),
                  {random.normal(), random.normal(), random.normal()}));
  const Eigen::Vector3d x{random.normal(), 10.0, random.normal()};
  for (int axis = 0; axis < 7; ++axis) {
    Vector7d delta = Vector7d::Zero();
    delta[axis] = 1e-6;
    const Similarity3 moved(pose.scale() * std::exp(delta[6]),
                            pose.rigid().perturbed(delta.head<6>()));
    const Eigen::Vector3d off = moved * x - pose * x;
    const Matrix7d at_point =
        covariance_at_point(Matrix7d(delta * delta.transpose()), pose.linear() * x);
    const Eigen::Matrix3d expected = off * off.transpose();
    EXPECT_LT((at_point.topLeftCorner<3, 3>() - expected).norm(), 1e-15);
    const Eigen::Vector4d rest = delta.tail<4>();
    const Eigen::Matrix4d kept = rest * rest.transpose();
    EXPECT_LT((at_point.bottomRightCorner<4, 4>() - kept).norm(), 1e-18);
  }
}

TEST(NormalisedSquaredError, CountsStandardDeviations) {
  const auto truth = Rigid3::from_roll_pitch_yaw({40, -30, 20}, 0.5, -0.7, 2.0);
  Matrix6d covariance = Matrix6d::Zero();
  covariance.diagonal() << 0.01, 0.04, 0.09, 1e-4, 4e-4, 9e-4;
  const Rigid3 found = truth.perturbed((Vector6d() << 0.2, 0.0, 0.3, 0.0, 0.02, 0.0).finished());
  EXPECT_NEAR(normalised_squared_error(found, covariance, truth), 4.0 + 1.0 + 1.0, 1e-9);
  EXPECT_EQ(normalised_squared_error(truth, covariance, truth), 0.0);
}

TEST(NormalisedSquaredError, IsTheSameInOtherAxes) {
  Random random(5);
  Eigen::Matrix<double, 6, 6> mix;
  for (int i = 0; i < 36; ++i) mix(i / 6, i % 6) = random.normal();
  Vector6d error;
  for (int i = 0; i < 6; ++i) error[i] = 1e-3 * random.normal();
  const Eigen::Matrix<double, 6, 1> mixed = 1e-3 * mix * Eigen::Matrix<double, 6, 1>(error);
  const Rigid3 pose = Rigid3::from_roll_pitch_yaw({1, 2, 3}, 0.1, 0.2, 0.3);
  const double plain =
      normalised_squared_error(pose, Matrix6d::Identity(), pose.perturbed(1e-3 * error));
  EXPECT_NEAR(normalised_squared_error(pose, mix * mix.transpose(), pose.perturbed(mixed)), plain,
              1e-6 * plain);
}

TEST(InverseCovariance, IsThatOfTheInvertedPerturbations) {
  const Rigid3 pose = Rigid3::from_roll_pitch_yaw({1, -2, 3}, 0.4, -0.2, 1.3);
  constexpr double kStep = 1e-6;
  Matrix6d jacobian;
  for (int i = 0; i < 6; ++i) {
    const Rigid3 moved = pose.perturbed(kStep * Vector6d::Unit(i));
    jacobian.col(i) = pose.inverse().difference_to(moved.inverse()) / kStep;
  }
  Matrix6d covariance = Matrix6d::Identity();
  covariance(0, 4) = covariance(4, 0) = 0.5;
  const Matrix6d expected = jacobian * covariance * jacobian.transpose();
  EXPECT_LT((inverse_covariance(pose, covariance) - expected).norm(), 1e-4);
  EXPECT_LT((inverse_covariance(pose.inverse(), inverse_covariance(pose, covariance)) - covariance)
                .norm(),
            1e-9);
}

TEST(InverseCovariance, WithAScaleIsThatOfTheInvertedPerturbationsToo) {
  const Similarity3 pose(2.5, Rigid3::from_roll_pitch_yaw({1, -2, 3}, 0.4, -0.2, 1.3));
  constexpr double kStep = 1e-6;
  const auto perturbed = [&](const Vector7d& delta) {
    return Similarity3(pose.scale() * std::exp(delta[6]), pose.rigid().perturbed(delta.head<6>()));
  };
  Matrix7d jacobian;
  for (int i = 0; i < 7; ++i) {
    const Similarity3 before = pose.inverse();
    const Similarity3 after = perturbed(kStep * Vector7d::Unit(i)).inverse();
    jacobian.col(i).head<6>() = before.rigid().difference_to(after.rigid()) / kStep;
    jacobian(6, i) = std::log(after.scale() / before.scale()) / kStep;
  }
  Matrix7d covariance = Matrix7d::Identity();
  covariance(0, 4) = covariance(4, 0) = 0.5;
  covariance(2, 6) = covariance(6, 2) = -0.3;
  const Matrix7d expected = jacobian * covariance * jacobian.transpose();
  EXPECT_LT((inverse_covariance(pose, covariance) - expected).norm(), 1e-4);
}

}  // namespace
}  // namespace cairn
