// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/pose_graph/detail/pose_least_squares.hpp"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include <Eigen/Dense>
#include <gtest/gtest.h>

#include "cairn/core/error.hpp"
#include "cairn/core/random.hpp"

#include "support/moved_poses.hpp"

namespace cairn::detail {
namespace {

using testing::moved_along;

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
  Rigid3 pose() { return testing::random_pose(random); }
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
            poses[i] = moved_along(poses[i], direction, by);
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
        poses[pose] = moved_along(poses[pose], k % size, by);
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

// With errors so little weighed that the loss does not matter, against finite differences.
TEST(PoseLeastSquares, CovariancesAreExactForATurnOfAnyAngle) {
  for (const double angle : {0.0, 1e-4, 1.9e-3, 2.1e-3, 0.1, 1.0, 2.5}) {
    const Eigen::Vector3d turn = angle * Eigen::Vector3d(0.48, -0.6, 0.64);
    Eigen::Matrix3d by_turn;
    for (int k = 0; k < 3; ++k) {
      constexpr double kStep = 1e-3;
      const auto vector_at = [&](double by) {
        const Eigen::Vector3d delta = by * Eigen::Vector3d::Unit(k);
        return rotation_log(rotation_exp(delta) * rotation_exp(turn));
      };
      by_turn.col(k) = (8.0 * (vector_at(kStep) - vector_at(-kStep)) -
                        (vector_at(2.0 * kStep) - vector_at(-2.0 * kStep))) /
                       (12.0 * kStep);
    }
    Matrix7d covariance = 1e12 * Matrix7d::Identity();
    covariance(6, 6) = kSameScale * kSameScale;
    const Rigid3 source(rotation_exp(turn), Eigen::Vector3d::Zero());
    PoseLeastSquares problem({{0, 0, 1, {}, covariance}}, {{}, source});
    const Eigen::Matrix3d expected = (by_turn.transpose() * by_turn).inverse();
    const Eigen::Matrix3d stated = 1e-12 * problem.covariances()[1].block<3, 3>(3, 3);
    EXPECT_LT((stated - expected).norm(), 1e-9) << angle;
  }
}

// Largest difference of the poses' matrices.
double difference(const std::vector<Similarity3>& a, const std::vector<Similarity3>& b) {
  double most = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    most = std::max(most, (a[i].matrix() - b[i].matrix()).norm());
  }
  return most;
}

// Of measurements without errors, each step leaves little more than the square of the error, with a factor of its own
// and with that of an earlier step.
void each_step_comes_much_closer(Ring& ring, bool scales) {
  for (PoseEdge& edge : ring.edges) {
    edge.target_from_source = ring.truth[edge.target].inverse() * ring.truth[edge.source];
  }
  PoseLeastSquares problem(ring.edges, ring.start(0.02, scales));
  double before = difference(problem.poses(), ring.truth);
  for (int i = 0; i < 4 && before > 1e-11; ++i) {
    problem.solve(1, 0.0);
    const double after = difference(problem.poses(), ring.truth);
    EXPECT_LT(after, (i == 0 ? 0.05 : 0.002) * before) << ring.truth.size() << ": " << i;
    before = after;
  }
}

TEST(PoseLeastSquares, EachStepComesMuchCloser) {
  for (const bool scales : {false, true}) {
    for (const std::size_t count : {2, 4, 5, 20}) {
      Ring ring(count, 6 + count, scales);
      std::erase_if(ring.edges, [](const PoseEdge& edge) { return edge.target == edge.source; });
      each_step_comes_much_closer(ring, scales);
    }
  }
}

// Between poses that are known from elsewhere.
TEST(PoseLeastSquares, EachStepComesMuchCloserWhereEdgesMatterLittle) {
  for (const bool scales : {false, true}) {
    Ring ring(6, 9, scales);
    for (PoseEdge& edge : ring.edges) edge.covariance.topLeftCorner<6, 6>() *= 100.0;
    for (std::size_t i = 1; i < 6; ++i) ring.edge(i % 2 == 0 ? 0 : i, i % 2 == 0 ? i : 0, scales);
    each_step_comes_much_closer(ring, scales);
  }
}

// Of one edge, and small errors, a step is expected to gain the whole cost.
TEST(PoseLeastSquares, StopsWithAStepThatIsExpectedToGainTooLittle) {
  Ring ring(2, 10, false);
  ring.edges.resize(1);
  const std::vector<Similarity3> start = ring.start(0.01, false);
  const auto poses = [&](int most, double tolerance) {
    PoseLeastSquares problem(ring.edges, start);
    problem.solve(most, tolerance);
    return problem.poses();
  };
  EXPECT_EQ(difference(poses(50, 1.1), poses(1, 0.0)), 0.0);
  EXPECT_GT(difference(poses(50, 0.8), poses(1, 0.0)), 0.0);
}

// From far away, some first steps do not come closer, and must be damped.
TEST(PoseLeastSquares, FindsTheMinimumFromFarAway) {
  int astray = 0;
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    Ring ring(8, seed, true);
    PoseLeastSquares problem(ring.edges, ring.start(4.0, true));
    const double before = problem.cost();
    PoseLeastSquares one = problem;
    one.solve(1, 0.0);
    EXPECT_LE(one.cost(), before);
    astray += one.cost() == before ? 1 : 0;
    double cost = before;
    for (int most = 1; most <= 20; ++most) {
      PoseLeastSquares some = problem;
      some.solve(most, 0.0);
      EXPECT_LE(some.cost(), cost) << seed << ": " << most;
      cost = some.cost();
    }
    problem.solve(30, 1e-14);
    PoseLeastSquares near(ring.edges, ring.truth);
    near.solve(30, 1e-14);
    EXPECT_NEAR(problem.cost(), near.cost(), 1e-6 * near.cost()) << seed;
  }
  EXPECT_GT(astray, 2);
}

TEST(PoseLeastSquares, LeavesPosesThatNothingDetermines) {
  Ring ring(8, 5, false);
  std::erase_if(ring.edges,
                [](const PoseEdge& edge) { return edge.target == 2 || edge.source == 2; });
  const std::vector<Similarity3> start = ring.start(0.1, false);
  PoseLeastSquares problem(ring.edges, start);
  problem.solve(50, 1e-14);
  EXPECT_LT((problem.poses()[2].matrix() - start[2].matrix()).norm(), 1e-12);
  // The others come to where they come without it.
  const auto without = [](std::vector<Similarity3> poses) {
    poses.erase(poses.begin() + 2);
    return poses;
  };
  for (PoseEdge& edge : ring.edges) {
    edge.target -= edge.target > 2 ? 1 : 0;
    edge.source -= edge.source > 2 ? 1 : 0;
  }
  PoseLeastSquares others(ring.edges, without(start));
  others.solve(50, 1e-14);
  EXPECT_LT(difference(without(problem.poses()), others.poses()), 1e-6);
}

TEST(PoseLeastSquares, MovesNoFixedPose) {
  Ring ring(8, 7, true);
  const std::vector<Similarity3> start = ring.start(0.05, true);
  PoseLeastSquares problem(ring.edges, start, 3);
  problem.solve(50, 1e-14);
  const std::vector<Matrix7d> covariances = problem.covariances();
  for (std::size_t i = 0; i < 8; ++i) {
    EXPECT_EQ(problem.poses()[i].matrix() == start[i].matrix(), i < 3) << i;
    EXPECT_EQ(covariances[i].isZero(0.0), i < 3) << i;
  }
  PoseLeastSquares all(ring.edges, start, 8);
  all.solve(50, 1e-14);
  EXPECT_EQ(difference(all.poses(), start), 0.0);
  for (const Matrix7d& covariance : all.covariances()) EXPECT_TRUE(covariance.isZero(0.0));
}

TEST(PoseLeastSquares, TakesNoMoreStepsThanAllowed) {
  Ring ring(8, 8, true);
  const std::vector<Similarity3> start = ring.start(0.3, true);
  PoseLeastSquares one(ring.edges, start);
  one.solve(0, 0.0);
  EXPECT_EQ(difference(one.poses(), start), 0.0);
  PoseLeastSquares two = one;
  PoseLeastSquares many = one;
  one.solve(1, 0.0);
  two.solve(2, 0.0);
  many.solve(50, 0.0);
  EXPECT_GT(one.cost(), two.cost());
  EXPECT_GT(two.cost(), many.cost());
}

TEST(PoseLeastSquares, RefusesPosesThatNothingDetermines) {
  Ring ring(6, 5, false);
  std::erase_if(ring.edges,
                [](const PoseEdge& edge) { return edge.target == 2 || edge.source == 2; });
  EXPECT_THROW(PoseLeastSquares(ring.edges, ring.truth).covariances(), Error);
}

}  // namespace
}  // namespace cairn::detail
