// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/alignment/detail/refinement/robust_alignment.hpp"

#include <memory>
#include <stop_token>
#include <vector>

#include <gtest/gtest.h>

#include "cairn/core/random.hpp"
#include "cairn/geometry/angles.hpp"

namespace cairn::detail {
namespace {

// A cloud seen twice: `shared` of the source's landmarks are the target's too, but for noise.
struct Problem {
  Problem(double shared, double noise, double scale = 1.0, std::uint64_t seed = 1) {
    Random random(seed);
    LandmarkCloud source;
    LandmarkCloud target;
    const Similarity3 moved(scale, Rigid3(rotation_exp({0.2, -0.1, 0.4}), {0.1, 0.2, -0.1}));
    const auto place = [&] {
      return Eigen::Vector3d(random.uniform(-1, 1), random.uniform(-1, 1),
                             random.uniform(-0.5, 0.5));
    };
    for (int i = 0; i < 800; ++i) {
      const Eigen::Vector3d at = place();
      const Eigen::Vector3d off(random.normal(), random.normal(), random.normal());
      source.positions.push_back(at);
      target.positions.push_back(random.chance(shared) ? moved * at + noise * off
                                                       : moved * place());
    }
    const PreparedCloud from = PreparedCloud::plain(std::move(source));
    const PreparedCloud to = PreparedCloud::plain(std::move(target));
    positions = from.landmarks().positions;
    truth = centred_pose(from, to, moved);
    alignment = std::make_unique<RobustAlignment>(from, to, true, Executor());
  }

  Similarity3 start(double metres, double degrees) const {
    const Rigid3 off(rotation_exp(Eigen::Vector3d(0.6, 0.0, 0.8) * radians(degrees)),
                     {0.0, metres, 0.0});
    return Similarity3(truth.scale(), off * truth.rigid());
  }
  // Between points of the cloud's size.
  double error(const Similarity3& pose) const {
    double most = 0.0;
    for (const Eigen::Vector3d& at : positions) {
      most = std::max(most, (pose * at - truth * at).norm());
    }
    return most;
  }

  std::vector<Eigen::Vector3d> positions;  // of the source, centred
  Similarity3 truth;
  std::unique_ptr<RobustAlignment> alignment;
};

TEST(RobustAlignment, ComesToTheTruthThoughHalfOfTheLandmarksAreOnlyInOneCloud) {
  const Problem problem(0.5, 0.002);
  const auto run = problem.alignment->run(problem.start(0.1, 8.0), {.coarse = 0.3, .fine = 0.03});
  EXPECT_LT(problem.error(run.target_from_source), 0.004);
  EXPECT_GT(run.iterations, 0);
  EXPECT_EQ(run.target_from_source.scale(), 1.0) << "which was not free";
}

TEST(RobustAlignment, FindsTheScaleWhereItIsFree) {
  const Problem problem(0.7, 0.002, 1.0);
  Similarity3 start = problem.start(0.03, 3.0);
  start = Similarity3(1.06, start.rigid());
  const auto run = problem.alignment->run(start, {.coarse = 0.3, .fine = 0.03, .free_scale = true});
  EXPECT_NEAR(run.target_from_source.scale(), 1.0, 0.002);
  EXPECT_LT(problem.error(run.target_from_source), 0.006);
  const auto held = problem.alignment->run(start, {.coarse = 0.3, .fine = 0.03});
  EXPECT_EQ(held.target_from_source.scale(), 1.06);
}

TEST(RobustAlignment, ReachesAFixedPoint) {
  const Problem problem(0.8, 0.002);
  const RobustAlignment::Schedule schedule{.coarse = 0.03, .fine = 0.03};
  const auto once = problem.alignment->run(problem.start(0.01, 1.0), schedule);
  const auto twice = problem.alignment->run(once.target_from_source, schedule);
  EXPECT_LT(once.target_from_source.rigid().difference_to(twice.target_from_source.rigid()).norm(),
            1e-5);
}

TEST(RobustAlignment, ObjectiveIsLargestAtTheTruth) {
  const Problem problem(0.6, 0.002);
  const auto value = [&](const Similarity3& pose) {
    return problem.alignment->value(pose, 0.03, problem.alignment->matches(pose));
  };
  const double best = value(problem.truth);
  EXPECT_GT(best, value(problem.start(0.02, 0.0)));
  EXPECT_GT(best, value(problem.start(0.0, 2.0)));
  EXPECT_GT(value(problem.start(0.02, 0.0)), value(problem.start(0.3, 0.0)));
}

TEST(RobustAlignment, SaysEachIterationAndStopsAtTheLimit) {
  const Problem problem(0.8, 0.002);
  int told = 0;
  const auto run = problem.alignment->run(problem.start(0.2, 10.0),
                                          {.coarse = 0.3, .fine = 0.03, .max_iterations = 3}, {},
                                          [&](const RobustAlignment::Iteration& iteration) {
                                            ++told;
                                            EXPECT_FALSE(iteration.matches.empty());
                                          });
  EXPECT_EQ(run.iterations, 3);
  EXPECT_EQ(told, 3);
  EXPECT_EQ(run.stop_reason, StopReason::kIterationLimit);
}

TEST(RobustAlignment, StopsWhenAsked) {
  const Problem problem(0.8, 0.002);
  std::stop_source stop;
  stop.request_stop();
  const auto run = problem.alignment->run(problem.start(0.2, 10.0), {.coarse = 0.3, .fine = 0.03},
                                          stop.get_token());
  EXPECT_EQ(run.iterations, 0);
}

TEST(RobustAlignment, CovarianceHoldsTheErrorAndAPlaneLeavesDirectionsOpen) {
  const Problem problem(0.8, 0.004);
  const auto run = problem.alignment->run(problem.start(0.02, 2.0), {.coarse = 0.1, .fine = 0.03});
  const PoseUncertainty known = problem.alignment->uncertainty(
      run.target_from_source, 0.03, problem.alignment->matches(run.target_from_source));
  ASSERT_TRUE(known.covariance);
  EXPECT_TRUE(known.unobservable.empty());
  const Vector6d off = run.target_from_source.rigid().difference_to(problem.truth.rigid());
  EXPECT_LT(off.dot(known.covariance->ldlt().solve(off)), 20.0) << "chi-squared of six: 99.7 %";

  // Two floors of other landmarks slide and turn on each other.
  Random random(3);
  LandmarkCloud floor;
  LandmarkCloud other;
  for (int i = 0; i < 800; ++i) {
    floor.positions.emplace_back(random.uniform(-1, 1), random.uniform(-1, 1),
                                 0.002 * random.normal());
    other.positions.emplace_back(random.uniform(-1, 1), random.uniform(-1, 1),
                                 0.002 * random.normal());
  }
  const RobustAlignment flat(PreparedCloud::plain(floor), PreparedCloud::plain(other), true,
                             Executor());
  const Similarity3 rest;
  const PoseUncertainty open = flat.uncertainty(rest, 0.1, flat.matches(rest));
  EXPECT_FALSE(open.unobservable.empty());
}

}  // namespace
}  // namespace cairn::detail
