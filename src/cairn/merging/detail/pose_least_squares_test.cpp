// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/merging/detail/pose_least_squares.hpp"

#include <cmath>
#include <utility>
#include <vector>

#include <Eigen/Dense>
#include <gtest/gtest.h>

#include "cairn/core/error.hpp"
#include "cairn/core/random.hpp"

namespace cairn {
namespace {

constexpr double kDeviation = 0.01;

// A ring of poses with chords, measured with errors.
struct Ring {
  Ring(std::size_t count, std::uint64_t seed, bool scales) : random(seed) {
    for (std::size_t i = 0; i < count; ++i) {
      const double scale = scales && i > 0 ? std::exp(0.3 * random.normal()) : 1.0;
      truth.emplace_back(scale, i == 0 ? Rigid3() : pose());
    }
    for (std::size_t i = 0; i < count; ++i) {
      for (const std::size_t step : {1, 3}) edge(i, (i + step) % count, scales);
    }
  }
  Rigid3 pose() {
    const double x = random.uniform(-2.0, 2.0);
    const double y = random.uniform(-2.0, 2.0);
    const double z = random.uniform(-2.0, 2.0);
    const double roll = random.uniform(-3.0, 3.0);
    const double pitch = random.uniform(-1.0, 1.0);
    return Rigid3::from_roll_pitch_yaw({x, y, z}, roll, pitch, random.uniform(-3.0, 3.0));
  }
  Similarity3 off(const Similarity3& pose, double deviation, bool scales) {
    Vector6d error;
    for (int k = 0; k < 6; ++k) error[k] = deviation * random.normal();
    const double growth = scales ? std::exp(deviation * random.normal()) : 1.0;
    return {pose.scale() * growth, pose.rigid().perturbed(error)};
  }
  void edge(std::size_t target, std::size_t source, bool scales) {
    Matrix7d covariance = kDeviation * kDeviation * Matrix7d::Identity();
    covariance(0, 4) = covariance(4, 0) = 0.5 * kDeviation * kDeviation;
    if (!scales) covariance(6, 6) = kSameScale * kSameScale;
    const Similarity3 right = truth[target].inverse() * truth[source];
    edges.push_back({edges.size(), target, source, off(right, kDeviation, scales), covariance});
  }
  std::vector<Similarity3> start(double deviation, bool scales) {
    std::vector<Similarity3> poses = truth;
    for (std::size_t i = 1; i < poses.size(); ++i) poses[i] = off(poses[i], deviation, scales);
    return poses;
  }

  Random random;
  std::vector<Similarity3> truth;
  std::vector<PoseEdge> edges;
};

Similarity3 nudged(const Similarity3& pose, int direction, double by) {
  if (direction == 6) return {pose.scale() * std::exp(by), pose.rigid()};
  Vector6d delta = Vector6d::Zero();
  delta[direction] = by;
  return {pose.scale(), pose.rigid().perturbed(delta)};
}

TEST(PoseLeastSquares, NoPoseNearbyIsBetter) {
  for (const bool scales : {false, true}) {
    for (std::uint64_t seed = 1; seed <= 5; ++seed) {
      Ring ring(12, seed, scales);
      // A wrong edge, which the loss tames.
      ring.edges[5].target_from_source = ring.pose();
      PoseLeastSquares problem(ring.edges, ring.start(0.1, scales));
      problem.solve(100, 1e-14);
      const double least = problem.cost();
      for (std::size_t i = 1; i < 12; ++i) {
        for (int direction = 0; direction < (scales ? 7 : 6); ++direction) {
          for (const double by : {-1e-4, 1e-4}) {
            std::vector<Similarity3> poses = problem.poses();
            poses[i] = nudged(poses[i], direction, by);
            EXPECT_GT(PoseLeastSquares(ring.edges, poses).cost(), least)
                << seed << ": " << i << ", " << direction;
          }
        }
      }
    }
  }
}

TEST(PoseLeastSquares, FindsOneMinimumFromSeveralStarts) {
  Ring ring(20, 3, true);
  PoseLeastSquares first(ring.edges, ring.start(0.05, true));
  first.solve(100, 1e-14);
  for (const double deviation : {0.0, 0.2, 0.4}) {
    PoseLeastSquares again(ring.edges, ring.start(deviation, true));
    again.solve(100, 1e-14);
    EXPECT_NEAR(again.cost(), first.cost(), 1e-9 * first.cost()) << deviation;
    for (std::size_t i = 0; i < 20; ++i) {
      EXPECT_LT((again.poses()[i].matrix() - first.poses()[i].matrix()).norm(), 1e-6);
    }
  }
}

// By finite differences of the cost, whose second derivatives near zero error are the information.
TEST(PoseLeastSquares, CovariancesAreTheInverseOfTheCostsCurvature) {
  for (const bool scales : {false, true}) {
    Ring ring(6, 4, scales);
    for (PoseEdge& edge : ring.edges) {
      edge.target_from_source = ring.truth[edge.target].inverse() * ring.truth[edge.source];
    }
    const int size = scales ? 7 : 6;
    const auto cost = [&](int a, double by_a, int b, double by_b) {
      std::vector<Similarity3> poses = ring.truth;
      for (const auto& [k, by] : {std::pair(a, by_a), std::pair(b, by_b)}) {
        const auto pose = static_cast<std::size_t>(1 + k / size);
        poses[pose] = nudged(poses[pose], k % size, by);
      }
      return PoseLeastSquares(ring.edges, poses).cost();
    };
    constexpr double kStep = 1e-5;
    Eigen::MatrixXd curvature(5 * size, 5 * size);
    for (int a = 0; a < curvature.rows(); ++a) {
      for (int b = 0; b < curvature.cols(); ++b) {
        curvature(a, b) = (cost(a, kStep, b, kStep) - cost(a, kStep, b, -kStep) -
                           cost(a, -kStep, b, kStep) + cost(a, -kStep, b, -kStep)) /
                          (4.0 * kStep * kStep);
      }
    }
    const Eigen::MatrixXd expected = curvature.inverse();
    const std::vector<Matrix7d> covariances =
        PoseLeastSquares(ring.edges, ring.truth).covariances();
    EXPECT_EQ(covariances[0], Matrix7d::Zero());
    for (int i = 0; i < 5; ++i) {
      const Eigen::MatrixXd block = expected.block(i * size, i * size, size, size);
      const Matrix7d& stated = covariances[static_cast<std::size_t>(i + 1)];
      EXPECT_LT((stated.topLeftCorner(size, size) - block).norm(), 1e-3 * block.norm()) << i;
      EXPECT_EQ(stated(6, 6) == 0.0, !scales);
    }
  }
}

TEST(PoseLeastSquares, RefusesPosesThatNothingDetermines) {
  Ring ring(6, 5, false);
  std::erase_if(ring.edges,
                [](const PoseEdge& edge) { return edge.target == 2 || edge.source == 2; });
  EXPECT_THROW(PoseLeastSquares(ring.edges, ring.truth).covariances(), Error);
}

}  // namespace
}  // namespace cairn
