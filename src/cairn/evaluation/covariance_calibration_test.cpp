// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/evaluation/covariance_calibration.hpp"

#include <cmath>
#include <limits>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "cairn/core/random.hpp"

namespace cairn {
namespace {

Eigen::Matrix3d some_covariance() {
  Eigen::Matrix3d covariance;
  covariance << 4e-4, 1e-4, -2e-4, 1e-4, 1e-4, 0.0, -2e-4, 0.0, 9e-3;
  return covariance;
}

// Landmarks whose errors are drawn from `covariance`, at depths of 0 to 5 m, seen 2 to 25 times.
std::vector<LandmarkEstimate> drawn(std::size_t count, const Eigen::Matrix3d& covariance) {
  Random random(11);
  const Eigen::Matrix3d root = covariance.llt().matrixL();
  std::vector<LandmarkEstimate> landmarks;
  for (std::size_t i = 0; i < count; ++i) {
    LandmarkEstimate landmark;
    landmark.truth = Eigen::Vector3d(random.normal(), random.normal(), random.uniform(0, 5));
    landmark.estimate =
        *landmark.truth +
        root * Eigen::Vector3d(Eigen::Vector3d::NullaryExpr([&] { return random.normal(); }));
    landmark.covariance = covariance;
    landmark.depth = landmark.truth->z();
    landmark.observations = 2 + random.index(24);
    landmarks.push_back(landmark);
  }
  return landmarks;
}

std::vector<LandmarkEstimate> with_covariance_times(double factor,
                                                    std::vector<LandmarkEstimate> landmarks) {
  for (LandmarkEstimate& landmark : landmarks) *landmark.covariance *= factor;
  return landmarks;
}

TEST(NormalisedSquaredError, IsTheSquareOfTheErrorInStandardDeviations) {
  const Eigen::Matrix3d covariance = Eigen::Vector3d(0.01, 0.04, 0.25).asDiagonal();
  EXPECT_NEAR(*normalised_squared_error({0.1, 0, 0}, covariance), 1.0, 1e-12);
  EXPECT_NEAR(*normalised_squared_error({0.1, -0.4, 1.5}, covariance), 1.0 + 4.0 + 9.0, 1e-12);
  EXPECT_EQ(*normalised_squared_error({0, 0, 0}, covariance), 0.0);
}

TEST(NormalisedSquaredError, DoesNotDependOnTheFrame) {
  const Eigen::Matrix3d turn(Eigen::AngleAxisd(1.1, Eigen::Vector3d(1, 2, -1).normalized()));
  const Eigen::Vector3d error(0.02, -0.01, 0.05);
  EXPECT_NEAR(*normalised_squared_error(error, some_covariance()),
              *normalised_squared_error(turn * error, turn * some_covariance() * turn.transpose()),
              1e-9);
}

TEST(NormalisedSquaredError, IsUnknownOfACertainDirection) {
  EXPECT_FALSE(normalised_squared_error({1, 0, 0}, Eigen::Matrix3d::Zero()));
  EXPECT_FALSE(
      normalised_squared_error({1, 0, 0}, Eigen::Vector3d(1, 1, 0).asDiagonal().toDenseMatrix()));
  EXPECT_FALSE(normalised_squared_error(
      {1, 0, 0}, Eigen::Matrix3d::Constant(std::numeric_limits<double>::quiet_NaN())));
}

TEST(NormalisedSquaredError, TakesADirectionAsCertainByItsShareOfTheLargestVariance) {
  const auto known = [](double largest, double smallest) {
    const Eigen::Matrix3d covariance = Eigen::Vector3d(largest, smallest, largest).asDiagonal();
    return normalised_squared_error({0, 0, 0}, covariance).has_value();
  };
  for (const double largest : {1e-4, 1.0, 1e4}) {
    EXPECT_TRUE(known(largest, 1.5e-14 * largest)) << largest;
    EXPECT_FALSE(known(largest, 0.8e-14 * largest)) << largest;
  }
}

// Sampling error: the mean of n draws of chi-squared with 3 degrees of freedom has standard
// deviation sqrt(6 / n), a share of 0.95 has sqrt(0.0475 / n). Four of these are allowed.
TEST(CalibrateCovariances, RightCovariancesGiveThreeAnd95Percent) {
  constexpr std::size_t kCount = 20000;
  const CovarianceCalibration result = calibrate_covariances(drawn(kCount, some_covariance()));
  const double root = std::sqrt(static_cast<double>(kCount));
  ASSERT_TRUE(result.all);
  EXPECT_EQ(result.all->count, kCount);
  EXPECT_NEAR(result.all->mean, kExpectedNees, 4.0 * std::sqrt(6.0) / root);
  EXPECT_NEAR(result.all->median, 2.366, 0.1);
  EXPECT_NEAR(result.all->inside_95, 0.95, 4.0 * std::sqrt(0.0475) / root);
  for (const auto& bin : result.by_depth) {
    ASSERT_TRUE(bin.statistics);
    const auto count = static_cast<double>(bin.statistics->count);
    EXPECT_NEAR(bin.statistics->mean, kExpectedNees, 4.0 * std::sqrt(6.0 / count));
    EXPECT_NEAR(bin.statistics->inside_95, 0.95, 4.0 * std::sqrt(0.0475 / count));
  }
}

TEST(CalibrateCovariances, WrongCovariancesShow) {
  const auto landmarks = drawn(20000, some_covariance());
  const auto too_large = calibrate_covariances(with_covariance_times(4.0, landmarks));
  EXPECT_NEAR(too_large.all->mean, 0.75, 0.02);
  EXPECT_GT(too_large.all->inside_95, 0.999);
  const auto too_small = calibrate_covariances(with_covariance_times(0.25, landmarks));
  EXPECT_NEAR(too_small.all->mean, 12.0, 0.3);
  // P(chi-squared of 3 < 7.8147 / 4) = 0.4178
  EXPECT_NEAR(too_small.all->inside_95, 0.4178, 0.015);
}

TEST(CalibrateCovariances, BinsReachFromTheirBoundToTheNext) {
  std::vector<LandmarkEstimate> landmarks;
  for (const auto& [depth, observations] : {std::pair<double, std::size_t>{0.0, 2},
                                            {0.999, 3},
                                            {1.0, 4},
                                            {3.5, 5},
                                            {4.0, 19},
                                            {100.0, 20},
                                            {-0.1, 1000},
                                            {2.5, 1}}) {
    LandmarkEstimate landmark;
    landmark.truth = landmark.estimate;
    landmark.covariance = Eigen::Matrix3d::Identity();
    landmark.depth = depth;
    landmark.observations = observations;
    landmarks.push_back(landmark);
  }
  landmarks.emplace_back(landmarks.front()).depth.reset();
  landmarks.back().observations.reset();
  const CovarianceCalibration result = calibrate_covariances(landmarks);
  EXPECT_EQ(result.all->count, 9U) << "in no bin is not out of all";
  std::vector<std::size_t> by_depth;
  for (const auto& bin : result.by_depth) {
    by_depth.push_back(bin.statistics ? bin.statistics->count : 0);
  }
  EXPECT_EQ(by_depth, (std::vector<std::size_t>{2, 1, 1, 1, 2}));
  std::vector<std::size_t> by_observations;
  for (const auto& bin : result.by_observations) {
    by_observations.push_back(bin.statistics ? bin.statistics->count : 0);
  }
  EXPECT_EQ(by_observations, (std::vector<std::size_t>{1, 2, 1, 1, 2}));
  EXPECT_EQ(result.by_depth[1].from, 1.0);
  EXPECT_EQ(result.by_depth[1].to, 2.0);
  EXPECT_EQ(result.by_depth[3].to, 4.0);
  EXPECT_FALSE(result.by_depth.back().to);
}

TEST(CalibrateCovariances, CountsTheLandmarksInsideTheBound) {
  std::vector<LandmarkEstimate> landmarks(4);
  for (LandmarkEstimate& landmark : landmarks) {
    landmark.truth = Eigen::Vector3d::Zero();
    landmark.covariance = Eigen::Matrix3d::Identity();
  }
  landmarks[0].estimate = {0, 3, 0};
  landmarks[1].estimate = {2.7, 0, 0};
  const CovarianceCalibration result = calibrate_covariances(landmarks);
  EXPECT_EQ(result.all->inside_95, 0.75) << "9 is beyond the bound of 7.81, 7.29 is not";
}

TEST(CalibrateCovariances, CountsWhatItCouldNotJudgeOnce) {
  auto landmarks = drawn(5, some_covariance());
  landmarks[0].truth.reset();
  landmarks[0].covariance.reset();
  landmarks[1].covariance.reset();
  landmarks[2].covariance = Eigen::Matrix3d::Zero();
  const CovarianceCalibration result = calibrate_covariances(landmarks);
  EXPECT_EQ(result.without_truth, 1U);
  EXPECT_EQ(result.without_covariance, 1U);
  EXPECT_EQ(result.singular, 1U);
  EXPECT_EQ(result.all->count, 2U);
  EXPECT_FALSE(result.nees[0]);
  EXPECT_TRUE(result.nees[4]);
  EXPECT_FALSE(calibrate_covariances({}).all);
}

}  // namespace
}  // namespace cairn
