// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/registration/estimation/point_to_point.hpp"

#include <vector>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "cairn/core/random.hpp"

namespace cairn {
namespace {

using Points = std::vector<Eigen::Vector3d>;

Eigen::Vector3d any_vector(Random& random) {
  return {random.normal(), random.normal(), random.normal()};
}

Rigid3 random_rigid(Random& random) {
  return {Eigen::Quaterniond(random.normal(), random.normal(), random.normal(), random.normal()),
          any_vector(random)};
}

Points all_moved(const Points& points, const Rigid3& pose) {
  Points result;
  for (const auto& p : points) result.push_back(pose * p);
  return result;
}

double cost(const Points& from, const Points& to, const Rigid3& pose,
            const std::vector<double>& weights) {
  double sum = 0.0;
  for (std::size_t i = 0; i < from.size(); ++i)
    sum += weights[i] * (pose * from[i] - to[i]).squaredNorm();
  return sum;
}

double pose_distance(const Rigid3& a, const Rigid3& b) {
  return a.difference_to(b).norm();
}

TEST(ClosestMotion, RecoversAnyMotionFromExactPairs) {
  Random random(1);
  for (int i = 0; i < 100; ++i) {
    Points from(3 + random.index(20));
    for (auto& p : from) p = any_vector(random);
    const Rigid3 truth = random_rigid(random);
    EXPECT_LT(pose_distance(closest_motion(from, all_moved(from, truth)), truth), 1e-9);
  }
}

TEST(ClosestMotion, AgreesWithEigensUmeyamaOnNoisyPairs) {
  Random random(2);
  for (int i = 0; i < 50; ++i) {
    Points from(30);
    for (auto& p : from) p = any_vector(random);
    Points to = all_moved(from, random_rigid(random));
    for (auto& p : to) p += 0.3 * any_vector(random);
    const auto as_matrix = [](const Points& points) {
      return Eigen::Map<const Eigen::Matrix3Xd>(points.front().data(), 3,
                                                static_cast<Eigen::Index>(points.size()));
    };
    const Eigen::Matrix4d theirs = Eigen::umeyama(as_matrix(from), as_matrix(to), false);
    EXPECT_LT((closest_motion(from, to).matrix() - theirs).norm(), 1e-10);
  }
}

TEST(ClosestMotion, MinimisesTheWeightedCost) {
  Random random(3);
  Points from(20);
  Points to(20);
  std::vector<double> weights(20);
  for (std::size_t i = 0; i < from.size(); ++i) {
    from[i] = any_vector(random);
    to[i] = from[i] + 0.2 * any_vector(random);
    weights[i] = random.uniform();
  }
  const Rigid3 best = closest_motion(from, to, weights);
  const double least = cost(from, to, best, weights);
  for (int i = 0; i < 200; ++i) {
    Vector6d delta;
    delta << 1e-3 * any_vector(random), 1e-3 * any_vector(random);
    EXPECT_GT(cost(from, to, best.perturbed(delta), weights), least);
  }
}

TEST(ClosestMotion, NeverMirrors) {
  const Points from = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  Points to = from;
  for (auto& p : to) p.z() = -p.z();
  EXPECT_NEAR(closest_motion(from, to).rotation().determinant(), 1.0, 1e-12);
}

TEST(ClosestMotion, KeepsItsPrecisionFarFromTheOrigin) {
  Random random(5);
  const Eigen::Vector3d far(1e6, 2e6, -1e6);
  Points from(50);
  for (auto& p : from) p = any_vector(random);
  Points to = all_moved(from, Rigid3::from_roll_pitch_yaw({0, 0, 0}, 0.3, 0.2, -0.1));
  const Rigid3 near = closest_motion(from, to);
  for (auto& p : from) p += far;
  for (auto& p : to) p += far;
  const Rigid3 found = closest_motion(from, to);
  EXPECT_LT((found.inverse() * near).angle(), 1e-8);
  EXPECT_LT((found * from[7] - to[7]).norm(), 1e-8);
}

TEST(ClosestMotion, HandlesCoplanarPoints) {
  Random random(4);
  Points from(10);
  for (auto& p : from) p = {random.normal(), random.normal(), 0.0};
  const Rigid3 truth = random_rigid(random);
  EXPECT_LT(pose_distance(closest_motion(from, all_moved(from, truth)), truth), 1e-9);
}

TEST(ClosestMotion, TurnsCollinearPointsOntoTheirLineWithoutSpin) {
  Points from;
  for (int i = 0; i < 5; ++i) from.emplace_back(i, 0, 0);
  const auto turn = Rigid3::from_roll_pitch_yaw({1, 2, 3}, 0, 0, 0.4);
  const Rigid3 found = closest_motion(from, all_moved(from, turn));
  EXPECT_LT(pose_distance(found, turn), 1e-9)
      << "the smallest rotation that fits, none about the line";
}

TEST(ClosestMotion, SpinsAThinCloudUnlessItsWidthIsRounding) {
  const Rigid3 spin = Rigid3::from_roll_pitch_yaw({0, 0, 0}, 0.4, 0, 0);
  const auto found = [&](double width) {
    Points from;
    for (int i = 0; i < 11; ++i) from.emplace_back(0.1 * i, i % 2 == 0 ? width : 0.0, 0.0);
    return closest_motion(from, all_moved(from, spin));
  };
  EXPECT_LT(pose_distance(found(1e-3), spin), 1e-6);
  EXPECT_LT(found(1e-6).angle(), 1e-5);
}

TEST(ClosestMotion, OnlyTranslatesCoincidingPoints) {
  const Points from(4, Eigen::Vector3d(1, 2, 3));
  const Points to(4, Eigen::Vector3d(2, 2, 2));
  const Rigid3 found = closest_motion(from, to);
  EXPECT_EQ(found.angle(), 0.0);
  EXPECT_EQ(found.translation(), Eigen::Vector3d(1, 0, -1));
}

TEST(PointToPointEstimation, WeighsMatchesByTheirSourcePoint) {
  const Points target = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {100, 100, 100}};
  const Points source = {{0, 0, 1}, {1, 0, 1}, {0, 1, 1}, {0, 0, 0}};
  const std::vector<Match> matches = {{0, 0, 1}, {1, 1, 1}, {2, 2, 1}, {3, 3, 1}};
  const std::vector<double> weights = {1, 1, 1, 0};
  const Rigid3 step = PointToPointEstimation(target, weights)(source, matches);
  EXPECT_LT(pose_distance(step, Rigid3(Eigen::Quaterniond::Identity(), {0, 0, -1})), 1e-12);
}

}  // namespace
}  // namespace cairn
