// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/registration/coarse_to_fine.hpp"

#include <optional>
#include <span>
#include <stop_token>
#include <vector>

#include <gtest/gtest.h>

#include "cairn/core/random.hpp"
#include "cairn/geometry/detail/pose_distance.hpp"
#include "cairn/geometry/moved_points.hpp"
#include "cairn/map/synthetic.hpp"
#include "cairn/registration/icp.hpp"

namespace cairn {
namespace {

struct Maps {
  PointSet source;
  PointSet target;
  Rigid3 truth;
};

Maps maps() {
  const SyntheticPair pair = synthetic_pair({.seed = 2, .landmarks = 8000});
  return {point_set(pair.source, observations_metric()),
          point_set(pair.target, observations_metric()), pair.target_from_source};
}

IcpOptions from_afar(const Maps& maps) {
  IcpOptions options;
  options.initial = Rigid3::from_roll_pitch_yaw({0.3, -0.2, 0.1}, 0.05, -0.05, 0.3) * maps.truth;
  options.coarse_to_fine = true;
  return options;
}

TEST(CoarseToFine, EndsWhereThePlainAlgorithmStays) {
  const Maps pair = maps();
  for (const std::size_t k : {1UL, 5UL}) {
    IcpOptions options = from_afar(pair);
    options.k = k;
    const RegistrationResult coarse = icp(pair.source, pair.target, options);
    EXPECT_GT(coarse.coarse_iterations, 0);
    ASSERT_TRUE(coarse.repetition) << "k = " << k;

    IcpOptions again;
    again.k = k;
    again.initial = coarse.target_from_source;
    const RegistrationResult plain = icp(pair.source, pair.target, again);
    ASSERT_TRUE(plain.repetition) << "k = " << k;
    EXPECT_EQ(plain.repetition->cycle.length, coarse.repetition->cycle.length);
    const PoseDistance distance = PoseDistance::of(pair.source.positions);
    // A cycle has several poses.
    const double tolerance = plain.repetition->cycle.length == 1 ? 1e-9 : 1e-3;
    EXPECT_LT(distance(plain.target_from_source, coarse.target_from_source), tolerance);
  }
}

TEST(CoarseToFine, NeedsFewerIterationsWithAllPoints) {
  const Maps pair = maps();
  IcpOptions options = from_afar(pair);
  const RegistrationResult coarse = icp(pair.source, pair.target, options);
  options.coarse_to_fine = false;
  const RegistrationResult plain = icp(pair.source, pair.target, options);
  EXPECT_EQ(plain.coarse_iterations, 0);
  EXPECT_LT(coarse.iterations, plain.iterations / 2);
  const PoseDistance distance = PoseDistance::of(pair.source.positions);
  EXPECT_LT(distance(plain.target_from_source, coarse.target_from_source), 0.01);
}

TEST(CoarseToFine, HasNoSamplesOfASmallMap) {
  Maps pair = maps();
  pair.source.positions.resize(1000);
  pair.source.confidences.resize(1000);
  IcpOptions options = from_afar(pair);
  const RegistrationResult coarse = icp(pair.source, pair.target, options);
  options.coarse_to_fine = false;
  const RegistrationResult plain = icp(pair.source, pair.target, options);
  EXPECT_EQ(coarse.coarse_iterations, 0);
  EXPECT_EQ(coarse.target_from_source.matrix(), plain.target_from_source.matrix());
  EXPECT_EQ(coarse.iterations, plain.iterations);
}

// How many iterations samples take of two equal sets of points, moved, at most one a sample.
int samples_of(std::size_t count) {
  Random random(count);
  std::vector<Eigen::Vector3d> source(count);
  for (auto& x : source) x = {random.uniform(), random.uniform(), random.uniform()};
  const std::vector<Eigen::Vector3d> target =
      moved_points(source, Rigid3::from_roll_pitch_yaw({0.2, 0, 0}, 0, 0, 0.5));
  const BatchTree tree(target);
  return align_samples({source, {}, {}}, {tree, target, {}}, {.max_iterations = 1}).iterations;
}

TEST(CoarseToFine, QuartersThePointsWhileAFewHundredAreLeft) {
  EXPECT_EQ(samples_of(1199), 0);
  EXPECT_EQ(samples_of(1200), 1);
  EXPECT_EQ(samples_of(4799), 1);
  EXPECT_EQ(samples_of(4800), 2);
}

TEST(CoarseToFine, MatchesSamplesByTheirConfidence) {
  // Each target point has a copy beside it that is more confident.
  const Maps pair = maps();
  std::vector<Eigen::Vector3d> target = pair.target.positions;
  std::vector<double> confidences(target.size(), 1.0);
  for (const Eigen::Vector3d& x : pair.target.positions) {
    target.emplace_back(x + Eigen::Vector3d(0.1, 0.0, 0.0));
    confidences.push_back(2.0);
  }
  const std::vector<Eigen::Vector3d> source = moved_points(pair.source.positions, pair.truth);
  const BatchTree tree(target);
  const auto found = [&](std::span<const double> known) {
    return align_samples({source, {}, {}}, {tree, target, known}, {.matching = {.k = 10}})
        .target_from_source;
  };
  const PoseDistance distance = PoseDistance::of(source);
  const Rigid3 copies(Eigen::Quaterniond::Identity(), {0.1, 0.0, 0.0});
  EXPECT_LT(distance(found(confidences), copies), 0.03);
  EXPECT_GT(distance(found({}), copies), 0.04);
}

TEST(CoarseToFine, GivesTheSameBytesWithAnyNumberOfThreads) {
  const Maps pair = maps();
  IcpOptions options = from_afar(pair);
  options.reciprocal = true;
  options.trimmed_fraction = 0.1;
  const auto run = [&](unsigned threads) {
    options.execution.executor = Executor(threads);
    return icp(pair.source, pair.target, options);
  };
  const RegistrationResult one = run(1);
  const RegistrationResult two = run(2);
  EXPECT_GT(one.coarse_iterations, 0);
  EXPECT_EQ(one.target_from_source.matrix(), two.target_from_source.matrix());
  EXPECT_EQ(one.coarse_iterations, two.coarse_iterations);
  EXPECT_EQ(one.matches, two.matches);
}

TEST(CoarseToFine, DrawsNoPointWithoutWeight) {
  const Maps pair = maps();
  // Every second point is far off and weighs nothing.
  PointSet source = pair.source;
  for (std::size_t i = 0; i < source.positions.size(); i += 2) {
    source.positions[i] += Eigen::Vector3d(0.0, 0.0, 50.0);
    source.confidences[i] = 0.0;
  }
  IcpOptions options = from_afar(pair);
  options.weight_by_source_confidence = true;
  const RegistrationResult result = icp(source, pair.target, options);
  EXPECT_GT(result.coarse_iterations, 0);
  EXPECT_LT(PoseDistance::of(pair.source.positions)(result.target_from_source, pair.truth), 0.05);
}

TEST(CoarseToFine, KeepsThePoseWhereSamplesFindNoMatches) {
  const Maps pair = maps();
  IcpOptions options;
  options.initial = Rigid3(Eigen::Quaterniond::Identity(), {1000.0, 0.0, 0.0});
  options.coarse_to_fine = true;
  options.max_distance = 0.1;
  const RegistrationResult result = icp(pair.source, pair.target, options);
  EXPECT_EQ(result.status, RegistrationStatus::kFailed);
  EXPECT_EQ(result.coarse_iterations, 0);
  EXPECT_LT(result.target_from_source.difference_to(options.initial).norm(), 1e-9);
}

TEST(CoarseToFine, StopsWhenAsked) {
  const Maps pair = maps();
  std::stop_source stop;
  stop.request_stop();
  IcpOptions options = from_afar(pair);
  options.execution.stop = stop.get_token();
  const RegistrationResult result = icp(pair.source, pair.target, options);
  EXPECT_EQ(result.status, RegistrationStatus::kCancelled);
  EXPECT_EQ(result.coarse_iterations, 0);
}

}  // namespace
}  // namespace cairn
