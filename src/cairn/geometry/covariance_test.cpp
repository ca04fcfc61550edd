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

}  // namespace
}  // namespace cairn
