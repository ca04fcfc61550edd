// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/geometry/limits.hpp"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

namespace cairn {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
const double kBeyond = std::nextafter(kLargestCoordinate, kInfinity);

TEST(Limits, HoldEachCoordinateOfEitherSign) {
  EXPECT_EQ(coordinate_defect(Eigen::Vector3d(1e9, -1e9, 0.0)), "");
  for (int axis = 0; axis < 3; ++axis) {
    for (const double sign : {-1.0, 1.0}) {
      Eigen::Vector3d point(1.0, 2.0, 3.0);
      point[axis] = sign * kBeyond;
      EXPECT_FALSE(are_coordinates(point));
      EXPECT_EQ(coordinate_defect(point), "is beyond the limit");
      EXPECT_EQ(coordinate_defect(Rigid3(Eigen::Quaterniond::Identity(), point)),
                "is beyond the limit");
      point[axis] = sign * kInfinity;
      EXPECT_EQ(coordinate_defect(point), "is not finite");
      point[axis] = std::nan("");
      EXPECT_FALSE(are_coordinates(point));
      EXPECT_EQ(coordinate_defect(point), "is not finite");
    }
  }
  EXPECT_EQ(coordinate_defect({0.0, kBeyond}), "is beyond the limit");
  EXPECT_EQ(coordinate_defect({0.0, 1.0}), "");
}

TEST(Limits, HoldRotationsToBeNumbers) {
  const Eigen::Quaterniond broken(std::nan(""), 0.0, 0.0, 1.0);
  EXPECT_EQ(coordinate_defect(Rigid3(broken, Eigen::Vector3d::Zero())), "is not finite");
  EXPECT_EQ(coordinate_defect(Rigid3()), "");
}

TEST(Limits, HoldVariances) {
  Eigen::Matrix3d covariance = Eigen::Vector3d(1.0, kLargestVariance, 0.0).asDiagonal();
  EXPECT_EQ(landmark_covariance_defect(covariance), "");
  covariance(1, 1) = std::nextafter(kLargestVariance, kInfinity);
  EXPECT_EQ(landmark_covariance_defect(covariance),
            "beyond the limit: it has a variance of more than 1e18");
  covariance(0, 1) = 1e17;
  EXPECT_NE(landmark_covariance_defect(covariance).find("not symmetric"), std::string::npos);
}

// What the limit is for.
TEST(Limits, KeepSumsOfSquaresFiniteInSinglePrecision) {
  const auto largest = static_cast<float>(kLargestCoordinate);
  EXPECT_TRUE(std::isfinite(4294967296.0F * 3.0F * largest * largest));
  EXPECT_TRUE(std::isfinite(largest * largest * largest * largest));
}

}  // namespace
}  // namespace cairn
