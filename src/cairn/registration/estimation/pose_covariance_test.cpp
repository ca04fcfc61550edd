// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/registration/estimation/pose_covariance.hpp"

#include <cmath>
#include <vector>

#include <Eigen/Cholesky>
#include <gtest/gtest.h>

#include "cairn/core/random.hpp"
#include "cairn/registration/estimation/point_to_point.hpp"

namespace cairn {
namespace {

using Points = std::vector<Eigen::Vector3d>;

Eigen::Vector3d random_vector(Random& random) {
  return {random.normal(), random.normal(), random.normal()};
}

std::vector<Match> one_to_one(std::size_t count) {
  std::vector<Match> matches;
  for (std::uint32_t i = 0; i < count; ++i) matches.push_back({i, i, 0.0});
  return matches;
}

TEST(PoseUncertainty, IsCalibratedForRightMatchesWithUnequalAnisotropicNoise) {
  Random random(1);
  constexpr int kTrials = 400;
  constexpr std::size_t kPoints = 200;
  double normalised_error = 0.0;
  for (int trial = 0; trial < kTrials; ++trial) {
    const Rigid3 truth(Eigen::Quaterniond(random.normal(), random.normal(), random.normal(), 1.0),
                       5.0 * random_vector(random));
    Points source(kPoints);
    Points target(kPoints);
    for (std::size_t i = 0; i < kPoints; ++i) {
      source[i] = Eigen::Vector3d(3, -2, 1) + random_vector(random);
      const double scale = 0.01 * (1.0 + static_cast<double>(i % 5));
      const Eigen::Vector3d noise = Eigen::Vector3d(1, 2, 4).cwiseProduct(random_vector(random));
      target[i] = truth * source[i] + scale * noise;
    }
    const Rigid3 found = closest_motion(source, target);
    Points moved;
    for (const auto& p : source) moved.push_back(found * p);
    const PoseUncertainty uncertainty = pose_uncertainty(found, moved, target, one_to_one(kPoints));
    ASSERT_TRUE(uncertainty.covariance);
    ASSERT_TRUE(uncertainty.unobservable.empty());
    const Vector6d error = found.difference_to(truth);
    const Eigen::Matrix<double, 6, 6> covariance = *uncertainty.covariance;
    normalised_error += error.dot(Vector6d(covariance.ldlt().solve(error)));
  }
  // Chi-square with 6 degrees of freedom has mean 6; the mean of 400 has deviation 0.17, and the
  // estimator's own scatter raises it a little.
  EXPECT_NEAR(normalised_error / kTrials, 6.0, 0.8);
}

TEST(PoseUncertainty, FindsTheSpinOfALine) {
  Points points;
  for (int i = 0; i < 10; ++i) points.emplace_back(0.1 * i, 0.2 * i, 0.0);
  Points noisy = points;
  for (std::size_t i = 0; i < noisy.size(); ++i)
    noisy[i] += Eigen::Vector3d(0, 0, i % 2 == 0 ? 1e-3 : -1e-3);
  const PoseUncertainty uncertainty =
      pose_uncertainty(Rigid3(), points, noisy, one_to_one(points.size()));
  EXPECT_FALSE(uncertainty.covariance);
  ASSERT_EQ(uncertainty.unobservable.size(), 1U);
  const OpenDirection& open = uncertainty.unobservable.front();
  EXPECT_LT(open.translation.norm(), 1e-6 * open.rotation.norm());
  const Eigen::Vector3d line = Eigen::Vector3d(1, 2, 0).normalized();
  EXPECT_NEAR(std::abs(open.rotation.normalized().dot(line)), 1.0, 1e-9);
}

TEST(PoseUncertainty, FindsAllRotationsOpenForOnePlace) {
  const Points points(5, Eigen::Vector3d(1, 2, 3));
  const PoseUncertainty uncertainty =
      pose_uncertainty(Rigid3(), points, points, one_to_one(points.size()));
  EXPECT_FALSE(uncertainty.covariance);
  EXPECT_EQ(uncertainty.unobservable.size(), 3U);
}

TEST(PoseUncertainty, IsOpenWhereItGoesBeyondTheReachOfTheEvidence) {
  PoseEvidence<6> evidence;
  evidence.information = Matrix6d::Identity();
  evidence.scatter = Vector6d(0.01, 0.01, 0.09, 0.01, 0.01, 0.01).asDiagonal();
  evidence.reach = 0.31;
  EXPECT_TRUE(pose_uncertainty(Similarity3(), evidence).covariance);
  evidence.reach = 0.29;
  const PoseUncertainty open = pose_uncertainty(Similarity3(), evidence);
  EXPECT_FALSE(open.covariance);
  ASSERT_EQ(open.unobservable.size(), 1U);
  EXPECT_NEAR(std::abs(open.unobservable.front().translation.z()), 1.0, 1e-12);
}

TEST(PoseUncertainty, IsUnknownWithoutMatches) {
  const PoseUncertainty uncertainty = pose_uncertainty(Rigid3(), {}, {}, {});
  EXPECT_FALSE(uncertainty.covariance);
  EXPECT_TRUE(uncertainty.unobservable.empty());
}

}  // namespace
}  // namespace cairn
