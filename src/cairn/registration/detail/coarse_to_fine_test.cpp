// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/registration/detail/coarse_to_fine.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <stop_token>
#include <vector>

#include <gtest/gtest.h>

#include "cairn/core/random.hpp"
#include "cairn/geometry/detail/pose_distance.hpp"
#include "cairn/geometry/similarity3.hpp"
#include "cairn/map/synthetic.hpp"
#include "cairn/registration/estimation/point_to_point.hpp"
#include "cairn/registration/icp.hpp"
#include "cairn/registration/score/fitness.hpp"

namespace cairn::detail {
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

std::vector<Eigen::Vector3d> in_cube(std::uint64_t seed, std::size_t count) {
  Random random(seed);
  std::vector<Eigen::Vector3d> points(count);
  for (auto& x : points) x = {random.uniform(), random.uniform(), random.uniform()};
  return points;
}

// Far shorter than the points' distances: the nearest point is the right one, if it is there.
const Rigid3 kSmallMotion = Rigid3::from_roll_pitch_yaw({1e-3, -1e-3, 5e-4}, 1e-3, 0, -1e-3);

TEST(CoarseToFine, DoesNotSampleTheTargetOfALimitedSearch) {
  const auto source = in_cube(1, 1300);
  const auto target = moved_points(source, kSmallMotion);
  const BatchTree tree(target);
  const auto error = [&](double max_distance) {
    const CoarseAlignment found =
        align_samples({source, {}, {}}, {tree, target, {}}, {.max_distance = max_distance});
    EXPECT_GT(found.iterations, 0);
    return PoseDistance::of(source)(found.target_from_source, kSmallMotion);
  };
  EXPECT_LT(error(100.0), 1e-12);
  EXPECT_GT(error(std::numeric_limits<double>::infinity()), 1e-6)
      << "few of a sample's points are in the other, drawn independently";
}

TEST(CoarseToFine, CountsOnlyPointsThatCanBeUsed) {
  // Of either set 1100 points are useful, too few for a sample.
  auto source = in_cube(2, 1300);
  auto target = moved_points(source, kSmallMotion);
  std::vector<double> confidences(1300, 1.0);
  for (std::size_t i = 0; i < 200; ++i) confidences[6 * i] = i % 2 == 0 ? 0.0 : -1.0;
  const std::vector<double> weights = [&] {
    std::vector<double> result = confidences;
    for (double& weight : result) weight = std::max(weight, 0.0);
    return result;
  }();
  const BatchTree tree(target);
  EXPECT_EQ(align_samples({source, {}, weights}, {tree, target, {}}, {}).iterations, 0);
  // All target points are searched; what is nearest to one that cannot be used is not matched.
  const CoarseAlignment found =
      align_samples({source, {}, {}}, {tree, target, confidences}, {.k = 1});
  EXPECT_GT(found.iterations, 0);
  EXPECT_LT(PoseDistance::of(source)(found.target_from_source, kSmallMotion), 1e-12);
}

TEST(CoarseToFine, DrawsOneOfEachSoManyConsecutivePoints) {
  // Sixteen copies of each place in a row: every sample has each of them equally often.
  const auto places = in_cube(9, 300);
  auto target = moved_points(places, kSmallMotion);
  Random random(10);
  for (auto& x : target) x += 1e-3 * Eigen::Vector3d(random.uniform(), random.uniform(), 0.0);
  std::vector<Eigen::Vector3d> source;
  for (const Eigen::Vector3d& x : places) source.insert(source.end(), 16, x);
  const BatchTree tree(target);
  const CoarseAlignment found = align_samples({source, {}, {}}, {tree, target, {}}, {});
  EXPECT_LT(PoseDistance::of(places)(found.target_from_source, closest_motion(places, target)),
            1e-12);
}

TEST(CoarseToFine, WeighsSampledPointsByTheirOwnWeight) {
  // What is in its place weighs most, what is not weighs next to nothing or nothing.
  const auto place = in_cube(3, 3000);
  const auto target = moved_points(place, kSmallMotion);
  auto source = place;
  std::vector<double> weights(source.size(), 1.0);
  for (std::size_t i = 0; i < source.size(); i += 2) {
    source[i] += Eigen::Vector3d(0.0, 0.0, i % 3 == 0 ? 5.0 : 0.5);
    weights[i] = i % 3 == 0 ? 0.0 : 1e-12;
  }
  const BatchTree tree(target);
  const CoarseAlignment found =
      align_samples({source, {}, weights}, {tree, target, {}}, {.max_distance = 100.0});
  EXPECT_GT(found.iterations, 0);
  EXPECT_LT(PoseDistance::of(place)(found.target_from_source, kSmallMotion), 1e-9);
}

TEST(CoarseToFine, KeepsOnlyMutualMatchesIfAsked) {
  // What the source alone has is far off, so that no target point is nearest to it.
  auto source = in_cube(4, 2000);
  const auto target = moved_points(source, kSmallMotion);
  for (const Eigen::Vector3d& x : in_cube(5, 500)) {
    source.emplace_back(0.1 * x + Eigen::Vector3d(10.0, 0.0, 0.0));
  }
  const BatchTree tree(target);
  const auto error = [&](bool reciprocal) {
    const CoarseAlignment found = align_samples({source, {}, {}}, {tree, target, {}},
                                                {.max_distance = 100.0, .reciprocal = reciprocal});
    return PoseDistance::of(target)(found.target_from_source, kSmallMotion);
  };
  EXPECT_LT(error(true), 0.01);
  EXPECT_GT(error(false), 0.1);
}

// Whether only the last step is shorter than the sampling error.
void expect_end_within_chance(const std::vector<Eigen::Vector3d>& source,
                              const std::vector<Eigen::Vector3d>& target) {
  const BatchTree tree(target);
  const auto after = [&](int most) {
    return align_samples({source, {}, {}}, {tree, target, {}},
                         {.max_iterations = most, .max_distance = 100.0});
  };
  const int last = after(100).iterations;
  ASSERT_GT(last, 3);
  ASSERT_LT(last, 100);
  const PoseDistance distance = PoseDistance::of(source);
  Rigid3 start;
  for (int i = 1; i <= last; ++i) {
    // Of all points, whose mean distance is about the sample's.
    const auto squared = nearest_squared_distances(source, start, tree, Executor(1));
    const double sampling_error = std::sqrt(*fitness_score(squared) / 300.0);
    const Rigid3 end = after(i).target_from_source;
    if (i < last) {
      EXPECT_GT(distance(end, start), 0.8 * sampling_error) << i;
    } else {
      EXPECT_LT(distance(end, start), 1.2 * sampling_error) << i;
    }
    start = end;
  }
}

TEST(CoarseToFine, EndsWhenAStepIsShorterThanTheSamplingError) {
  const auto target = in_cube(6, 1200);
  const auto source = in_cube(7, 1200);
  for (const double away : {0.1, 30.0}) {
    expect_end_within_chance(
        moved_points(source, Rigid3::from_roll_pitch_yaw({away, 0.05, 0}, 0, 0, 0.1)), target);
  }
}

TEST(CoarseToFine, EndsAtOnceWhereMatchesAreExact) {
  const auto source = in_cube(8, 1200);
  const auto target = moved_points(source, kSmallMotion);
  const BatchTree tree(target);
  EXPECT_EQ(align_samples({source, {}, {}}, {tree, target, {}}, {.max_distance = 1.0}).iterations,
            2)
      << "one moves, and one finds that nothing is left but rounding";
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
    return align_samples({source, {}, {}}, {tree, target, known}, {.k = 10}).target_from_source;
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
    return icp(pair.source, pair.target, options, {.executor = Executor(threads)});
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
  const RegistrationResult result =
      icp(pair.source, pair.target, from_afar(pair), {.stop = stop.get_token()});
  EXPECT_EQ(result.status, RegistrationStatus::kCancelled);
  EXPECT_EQ(result.coarse_iterations, 0);
}

}  // namespace
}  // namespace cairn::detail
