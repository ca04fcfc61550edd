// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <gtest/gtest.h>

#include "cairn/core/random.hpp"
#include "cairn/geometry/similarity3.hpp"
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

TEST(PoseUncertainty, AllowsForTheFreedomsThatFewMatchesLose) {
  Random random(2);
  constexpr int kTrials = 2000;
  constexpr std::size_t kPoints = 8;
  double squared_error = 0.0;
  double variance = 0.0;
  for (int trial = 0; trial < kTrials; ++trial) {
    Points source(kPoints);
    Points target(kPoints);
    for (std::size_t i = 0; i < kPoints; ++i) {
      source[i] = random_vector(random);
      target[i] = source[i] + 0.01 * random_vector(random);
    }
    const Rigid3 found = closest_motion(source, target);
    Points moved;
    for (const auto& p : source) moved.push_back(found * p);
    const PoseUncertainty uncertainty = pose_uncertainty(found, moved, target, one_to_one(kPoints));
    ASSERT_TRUE(uncertainty.covariance);
    squared_error += found.translation().squaredNorm();
    variance += uncertainty.covariance->topLeftCorner<3, 3>().trace();
  }
  // Without the factor n/(n - 2) it would be 0.75.
  EXPECT_NEAR(variance / squared_error, 1.0, 0.12);
}

TEST(PoseUncertainty, TakesAWeightAsTheEstimateDid) {
  // Matches of weight 0 might as well not be; weights that are all alike change nothing.
  Random random(3);
  Points source(30);
  Points target(30);
  for (std::size_t i = 0; i < source.size(); ++i) {
    source[i] = random_vector(random);
    target[i] = source[i] + 0.01 * random_vector(random);
  }
  const Points few_source(source.begin(), source.begin() + 10);
  const Points few_target(target.begin(), target.begin() + 10);
  std::vector<double> weights(30, 0.0);
  std::fill_n(weights.begin(), 10, 2.5);
  const auto all = pose_uncertainty(Rigid3(), source, target, one_to_one(30), weights);
  const auto few = pose_uncertainty(Rigid3(), few_source, few_target, one_to_one(10));
  ASSERT_TRUE(all.covariance && few.covariance);
  // But for the factors of 30 and of 10 matches.
  const Matrix6d expected = (30.0 / 28.0) / (10.0 / 8.0) * *few.covariance;
  EXPECT_LT((*all.covariance - expected).norm(), 1e-9 * expected.norm());
  const std::vector<double> none(30, 0.0);
  const PoseUncertainty weightless =
      pose_uncertainty(Rigid3(), source, target, one_to_one(30), none);
  EXPECT_FALSE(weightless.covariance);
  EXPECT_TRUE(weightless.unobservable.empty()) << "nothing is known of it";
}

// The sandwich estimator in the pose's own parameters, derivatives by finite differences.
Matrix6d plain_sandwich(const Rigid3& pose, const Points& source, const Points& target,
                        const std::vector<Match>& matches, const std::vector<double>& weights) {
  constexpr double kStep = 1e-6;
  Eigen::Matrix<double, 6, 6> information = Eigen::Matrix<double, 6, 6>::Zero();
  Eigen::Matrix<double, 6, 6> scatter = Eigen::Matrix<double, 6, 6>::Zero();
  for (const Match& match : matches) {
    const Eigen::Vector3d& x = source[match.source];
    Eigen::Matrix<double, 3, 6> jacobian;
    for (int i = 0; i < 6; ++i) {
      const Vector6d step = kStep * Vector6d::Unit(i);
      jacobian.col(i) = (pose.perturbed(step) * x - pose.perturbed(-step) * x) / (2.0 * kStep);
    }
    const double weight = weights[match.source];
    const Vector6d gradient = weight * jacobian.transpose() * (pose * x - target[match.target]);
    information += weight * jacobian.transpose() * jacobian;
    scatter += gradient * gradient.transpose();
  }
  const auto count = static_cast<double>(matches.size());
  const Eigen::Matrix<double, 6, 6> inverse = information.inverse();
  return count / (count - 2.0) * inverse * scatter * inverse;
}

struct WeightedPairs {
  Rigid3 pose;
  Points source;
  Points target;
  std::vector<Match> matches;
  std::vector<double> weights;

  PoseUncertainty uncertainty() const {
    return pose_uncertainty(pose, moved_points(source, pose), target, matches, weights);
  }
};

WeightedPairs weighted_pairs(std::uint64_t seed) {
  Random random(seed);
  WeightedPairs pairs;
  pairs.pose = Rigid3::from_roll_pitch_yaw({3, -4, 5}, 0.4, -0.3, 2.0);
  pairs.target.resize(12);
  for (std::uint32_t i = 0; i < 12; ++i) {
    pairs.source.push_back(random_vector(random));
    pairs.weights.push_back(random.uniform(0.1, 3.0));
    const std::uint32_t partner = (i * 5 + 3) % 12;
    pairs.target[partner] = pairs.pose * pairs.source[i] + 0.05 * random_vector(random);
    pairs.matches.push_back({i, partner, 0.0});
  }
  pairs.matches.erase(pairs.matches.begin() + 4);
  return pairs;
}

TEST(PoseUncertainty, IsTheSandwichOfTheDerivativesByThePose) {
  const WeightedPairs pairs = weighted_pairs(4);
  const PoseUncertainty found = pairs.uncertainty();
  ASSERT_TRUE(found.covariance);
  const Matrix6d expected =
      plain_sandwich(pairs.pose, pairs.source, pairs.target, pairs.matches, pairs.weights);
  EXPECT_LT((*found.covariance - expected).norm(), 1e-6 * expected.norm());
}

TEST(PoseUncertainty, DoesNotDependOnTheUnitsOfLengthAndWeight) {
  const WeightedPairs pairs = weighted_pairs(5);
  const Matrix6d once = *pairs.uncertainty().covariance;
  for (const double unit : {1e-7, 1e7}) {
    WeightedPairs scaled = pairs;
    scaled.pose = Rigid3(pairs.pose.quaternion(), unit * pairs.pose.translation());
    for (auto& p : scaled.source) p *= unit;
    for (auto& p : scaled.target) p *= unit;
    const PoseUncertainty in_unit = scaled.uncertainty();
    ASSERT_TRUE(in_unit.covariance) << unit;
    Vector6d units;
    units << unit, unit, unit, 1, 1, 1;
    const Matrix6d expected = units.asDiagonal() * once * units.asDiagonal();
    const Matrix6d ratio = in_unit.covariance->cwiseQuotient(expected);
    EXPECT_LT((ratio - Matrix6d::Ones()).cwiseAbs().maxCoeff(), 1e-6) << unit;

    WeightedPairs weighted = pairs;
    for (double& weight : weighted.weights) weight *= unit * unit;
    ASSERT_TRUE(weighted.uncertainty().covariance) << unit;
    EXPECT_LT((*weighted.uncertainty().covariance - once).norm(), 1e-9 * once.norm());
  }
}

TEST(PoseUncertainty, DoesNotDependOnWhereTheTargetIs) {
  WeightedPairs pairs = weighted_pairs(6);
  const Matrix6d here = *pairs.uncertainty().covariance;
  const Eigen::Vector3d far(1e6, -2e6, 1e6);
  pairs.pose = Rigid3(pairs.pose.quaternion(), pairs.pose.translation() + far);
  for (auto& p : pairs.target) p += far;
  const PoseUncertainty there = pairs.uncertainty();
  ASSERT_TRUE(there.covariance);
  EXPECT_LT((*there.covariance - here).norm(), 1e-6 * here.norm());
}

TEST(PoseUncertainty, NeedsThreeMatches) {
  const Points source = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  const Points target = {{0, 0, 0.1}, {1.1, 0, 0}, {0, 1, 0}};
  EXPECT_TRUE(pose_uncertainty(Rigid3(), source, target, one_to_one(3)).covariance);
  const PoseUncertainty of_two = pose_uncertainty(Rigid3(), source, target, one_to_one(2));
  EXPECT_FALSE(of_two.covariance);
  EXPECT_TRUE(of_two.unobservable.empty()) << "nothing is known of it";
}

TEST(PoseUncertainty, IsOpenWhereTheInformationIsRoundingBesideTheLargest) {
  const auto open_with = [](const Vector6d& diagonal) {
    PoseEvidence<6> evidence;
    evidence.information = diagonal.asDiagonal();
    const PoseUncertainty uncertainty = pose_uncertainty(Similarity3(), evidence);
    EXPECT_EQ(uncertainty.covariance.has_value(), uncertainty.unobservable.empty());
    return uncertainty.unobservable.size();
  };
  EXPECT_EQ(open_with(Vector6d(1e-3, 1e-3, 1e-3, 1e-3, 1e-3, 1e-11)), 0U);
  EXPECT_EQ(open_with(Vector6d(1e-3, 1e-3, 1e-3, 1e-3, 1e-3, 1e-13)), 1U);
  EXPECT_EQ(open_with(Vector6d(1, 1, 1, 1, 1, 1e10)), 5U);
  EXPECT_EQ(open_with(Vector6d::Zero()), 6U);
}

TEST(PoseUncertainty, NamesADirectionOnceThatIsOpenForTwoReasons) {
  PoseEvidence<6> evidence;
  evidence.information = Vector6d(1, 1, 1, 1, 1, 1e-13).asDiagonal();
  evidence.scatter = 0.01 * evidence.information;
  evidence.reach = 10.0;
  EXPECT_EQ(pose_uncertainty(Similarity3(), evidence).unobservable.size(), 1U);
}

TEST(PoseUncertainty, OfASimilarityIsThatOfItsMotionAboutThePivot) {
  PoseEvidence<7> evidence;
  evidence.pivot = {3, -1, 2};
  evidence.length = 0.5;
  Matrix7d root = Matrix7d::Identity();
  root.diagonal() << 1, 2, 3, 4, 5, 6, 7;
  root(0, 4) = root(2, 6) = root(5, 6) = 1.5;
  evidence.information = root.transpose() * root;
  evidence.scatter = 1e-4 * evidence.information;
  const Similarity3 pose(1.3, Rigid3::from_roll_pitch_yaw({-2, 4, 1}, 0.3, -0.2, 1.0));
  const PoseUncertainty uncertainty = pose_uncertainty(pose, evidence);
  ASSERT_TRUE(uncertainty.covariance_with_scale);

  // How the pose's parameters follow a small motion about the pivot.
  constexpr double kStep = 1e-6;
  Matrix7d by_motion = Matrix7d::Zero();
  for (int i = 0; i < 7; ++i) {
    const Eigen::Matrix<double, 7, 1> motion = kStep * Eigen::Matrix<double, 7, 1>::Unit(i);
    const Eigen::Vector3d turn = motion.segment<3>(3) / evidence.length;
    const double log_scale = motion[6] / evidence.length;
    const Eigen::Vector3d arm = pose.translation() - evidence.pivot;
    const Eigen::Vector3d moved =
        evidence.pivot + motion.head<3>() + std::exp(log_scale) * (rotation_exp(turn) * arm);
    by_motion.col(i) << (moved - pose.translation()) / kStep, turn / kStep, log_scale / kStep;
  }
  const Matrix7d expected =
      1e-4 * by_motion * Matrix7d(evidence.information.inverse()) * by_motion.transpose();
  EXPECT_LT((*uncertainty.covariance_with_scale - expected).norm(), 1e-5 * expected.norm());
  EXPECT_LT((*uncertainty.covariance - expected.topLeftCorner<6, 6>()).norm(),
            1e-5 * expected.norm());
}

TEST(PoseUncertainty, KeepsTheSenseOfAScrewThatIsOpen) {
  PoseEvidence<6> evidence;
  evidence.length = 2.0;
  Vector6d screw;
  screw << 0, 0, 1, 0, 0, -1;
  evidence.information = Matrix6d::Identity() - 0.5 * screw * screw.transpose();
  const PoseUncertainty uncertainty = pose_uncertainty(Similarity3(), evidence);
  ASSERT_EQ(uncertainty.unobservable.size(), 1U);
  const OpenDirection& open = uncertainty.unobservable.front();
  // One unit along z for half a radian about -z.
  EXPECT_NEAR(open.rotation.z() / open.translation.z(), -0.5, 1e-9);
}

TEST(PoseUncertainty, FindsTheSpinOfALine) {
  Points points;
  for (int i = 0; i < 10; ++i) points.emplace_back(5.0 + 0.1 * i, 0.2 * i - 3.0, 2.0);
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
  evidence.scatter(2, 2) = 0.0625;
  evidence.reach = 0.25;
  EXPECT_TRUE(pose_uncertainty(Similarity3(), evidence).covariance) << "exactly at its end";
  evidence.reach = 0.24;
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
