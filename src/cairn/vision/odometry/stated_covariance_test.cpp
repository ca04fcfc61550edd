// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/odometry/stated_covariance.hpp"

#include <cmath>

#include <gtest/gtest.h>

namespace cairn {
namespace {

TEST(StatedCovariance, IsMillimetresAndMilliradiansWhereTheMarginalIsNone) {
  const Matrix6d stated = stated_covariance(Matrix6d::Zero());
  EXPECT_TRUE(Eigen::MatrixXd(stated).isDiagonal(0.0));
  for (int i = 0; i < 6; ++i) {
    const double deviation = std::sqrt(stated(i, i));  // m, rad
    EXPECT_GT(deviation, 0.003) << i;
    EXPECT_LT(deviation, 0.005) << i;
    EXPECT_EQ(stated(i, i), stated(i < 3 ? 0 : 3, i < 3 ? 0 : 3))
        << "the axes of one kind are alike";
  }
}

TEST(StatedCovariance, AddsTenMarginalDeviations) {
  Eigen::Matrix<double, 6, 6> root;
  for (int i = 0; i < 36; ++i) root(i / 6, i % 6) = 1e-3 * std::sin(i * i + 1.0);
  const Matrix6d marginal = root * root.transpose();
  const Matrix6d more = stated_covariance(marginal) - stated_covariance(Matrix6d::Zero());
  EXPECT_TRUE(more.isApprox(100.0 * marginal, 1e-9)) << more;
}

}  // namespace
}  // namespace cairn
