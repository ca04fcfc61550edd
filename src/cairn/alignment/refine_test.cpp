// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/alignment/align.hpp"
#include "cairn/core/error.hpp"
#include "cairn/core/random.hpp"
#include "cairn/geometry/covariance.hpp"
#include "cairn/geometry/detail/centroid.hpp"
#include "cairn/map/synthetic.hpp"
#include "cairn/registration/neighbors/batch_tree.hpp"
#include "cairn/registration/score/fitness.hpp"

#include "support/refusal.hpp"

namespace cairn {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

double distance(const Rigid3& a, const Rigid3& b) {
  return a.difference_to(b).norm();
}

struct Pair {
  LandmarkCloud source;
  LandmarkCloud target;
  Rigid3 truth;
};

Pair synthetic(const SyntheticOptions& options) {
  const SyntheticPair pair = synthetic_pair(options);
  return {landmark_cloud(pair.source), landmark_cloud(pair.target), pair.target_from_source};
}

// Points with noise whose covariance is stated, seen by both; and as many seen by one only.
Pair noisy(std::uint64_t seed, double shared) {
  Random random(seed);
  Pair pair;
  pair.truth = Rigid3(rotation_exp({0.4, -0.3, 0.9}), {5.0, -3.0, 2.0});
  const Rigid3 back = pair.truth.inverse();
  const auto place = [&] {
    return Eigen::Vector3d(random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-0.5, 0.5));
  };
  const auto add = [&](LandmarkCloud& cloud, const Eigen::Vector3d& at) {
    const Eigen::Vector3d axis =
        Eigen::Vector3d(random.normal(), random.normal(), random.normal()).normalized();
    const Eigen::Matrix3d covariance =
        1e-6 * Eigen::Matrix3d::Identity() + 1e-4 * axis * axis.transpose();
    const Eigen::Matrix3d root = covariance.llt().matrixL();
    cloud.positions.push_back(
        at + root * Eigen::Vector3d(random.normal(), random.normal(), random.normal()));
    cloud.covariances.push_back(covariance);
  };
  for (int i = 0; i < 300; ++i) {
    const Eigen::Vector3d point = place();
    const bool both = random.chance(shared);
    add(pair.source, back * point);
    add(pair.target, both ? point : place());
  }
  return pair;
}

// The landmarks nearest to the cloud's middle.
LandmarkCloud middle_of(const LandmarkCloud& cloud, std::size_t count) {
  const Eigen::Vector3d middle = centroid(cloud.positions);
  std::vector<std::pair<double, std::size_t>> near;
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    near.emplace_back((cloud.positions[i] - middle).norm(), i);
  }
  std::sort(near.begin(), near.end());
  near.resize(count);
  LandmarkCloud part;
  for (const auto& [distance, i] : near) {
    part.positions.push_back(cloud.positions[i]);
    part.covariances.push_back(cloud.covariances[i]);
  }
  return part;
}

TEST(Refine, FindsTheTruthFromAFewDegreesAway) {
  const Pair pair = synthetic({.seed = 3, .outlier_fraction = 0.1});
  RefineOptions options;
  options.initial = Rigid3::from_roll_pitch_yaw({0.1, -0.1, 0.05}, 0.05, 0.05, -0.1) * pair.truth;
  const RegistrationResult result = refine(pair.source, pair.target, options);
  EXPECT_EQ(result.status, RegistrationStatus::kConverged) << result.reason;
  EXPECT_LT(distance(result.target_from_source, pair.truth), 5e-3);
  ASSERT_TRUE(result.covariance);
  EXPECT_LT(*result.score, *result.initial_score);
}

TEST(Refine, IsDrawnInByIcpWhereMapsShareMuch) {
  const Pair pair = synthetic({.seed = 3, .overlap = 0.95});
  const Eigen::Vector3d middle = centroid(pair.target.positions);
  const Rigid3 to_middle(Eigen::Quaterniond::Identity(), middle);
  const Rigid3 turn = Rigid3::from_roll_pitch_yaw({0.0, 0.6, 0.3}, 0.17, 0.0, 0.4);
  const Rigid3 far = to_middle * turn * to_middle.inverse() * pair.truth;
  RefineOptions options;
  options.initial = far;
  options.trace = true;
  const RegistrationResult result = refine(pair.source, pair.target, options);
  EXPECT_LT(distance(result.target_from_source, pair.truth), 5e-3);
  EXPECT_THAT(result.reason, HasSubstr("by ICP"));
  EXPECT_EQ(result.history.size(), static_cast<std::size_t>(result.iterations));
  EXPECT_EQ(result.history.back().score, result.score);

  // The other way round, the same.
  options.initial = far.inverse();
  const RegistrationResult back = refine(pair.target, pair.source, options);
  EXPECT_LT(distance(back.target_from_source, result.target_from_source.inverse()), 1e-3);
  EXPECT_EQ(back.history.back().score, back.score);

  options.initial = far;
  options.by_icp_too = false;
  const RegistrationResult alone = refine(pair.source, pair.target, options);
  EXPECT_GT(distance(alone.target_from_source, pair.truth), 0.1);
  EXPECT_THAT(alone.reason, Not(HasSubstr("by ICP")));
}

TEST(Refine, IsNotLedAstrayByIcp) {
  // ICP leaves the truth where most landmarks have no counterpart.
  const Pair pair = synthetic({.seed = 3, .overlap = 0.3});
  RefineOptions options;
  options.initial = pair.truth;
  EXPECT_LT(distance(refine(pair.source, pair.target, options).target_from_source, pair.truth),
            5e-3);
}

TEST(Refine, IsCloserWithCovariances) {
  double with = 0.0;
  double without = 0.0;
  for (std::uint64_t seed = 0; seed < 10; ++seed) {
    Pair pair = noisy(seed, 0.6);
    RefineOptions options;
    options.initial = pair.truth;
    options.coarse = options.fine = 0.02;
    with += distance(refine(pair.source, pair.target, options).target_from_source, pair.truth);
    pair.source.covariances.clear();
    pair.target.covariances.clear();
    without += distance(refine(pair.source, pair.target, options).target_from_source, pair.truth);
  }
  EXPECT_LT(with, without);
}

double error_of(const RegistrationResult& result, const Rigid3& truth) {
  return normalised_squared_error(result.target_from_source, *result.covariance, truth);
}

TEST(Refine, CovarianceCoversTheErrorWhereMatchesAreRight) {
  constexpr int kTrials = 200;
  double sum = 0.0;
  for (std::uint64_t seed = 0; seed < kTrials; ++seed) {
    const Pair pair = noisy(1000 + seed, 1.0);
    RefineOptions options;
    options.initial = pair.truth;
    options.coarse = options.fine = 0.03;
    const RegistrationResult result = refine(pair.source, pair.target, options);
    ASSERT_TRUE(result.covariance);
    sum += error_of(result, pair.truth);
  }
  // The covariance is made larger for its few parts, 2.43 times for 16: of Gaussian errors the mean would be
  // 4.9 (16/15 of that of Hotelling's distribution of 15 degrees of freedom, 11.25, over 2.43). It is about
  // half of that: what is made for maps that are bent is large for maps that are not.
  EXPECT_GT(sum / kTrials, 1.5);
  EXPECT_LT(sum / kTrials, 7.0);
}

TEST(Refine, CovarianceCoversTheErrorWhereMostMatchesAreWrong) {
  constexpr int kTrials = 20;
  for (const double overlap : {0.3, 0.6, 0.9}) {
    int inside = 0;
    double sum = 0.0;
    for (std::uint64_t seed = 0; seed < kTrials; ++seed) {
      const Pair pair =
          synthetic({.seed = 500 + seed, .landmarks = 1500, .frames = 40, .overlap = overlap});
      RefineOptions options;
      options.initial = pair.truth;
      options.coarse = 0.1;
      const RegistrationResult result = refine(pair.source, pair.target, options);
      ASSERT_TRUE(result.covariance);
      const double distance = error_of(result, pair.truth);
      inside += distance < kNormalisedSquaredError95 ? 1 : 0;
      sum += distance;
    }
    EXPECT_GE(inside, kTrials * 0.85) << "overlap " << overlap;
    EXPECT_GT(sum / kTrials, 0.6) << "overlap " << overlap << ": so large that it says nothing";
  }
}

TEST(Refine, MovesWithTheMaps) {
  const Pair pair = synthetic({.seed = 4, .landmarks = 800});
  RefineOptions options;
  options.initial = Rigid3::from_roll_pitch_yaw({0.02, 0.01, 0.0}, 0.0, 0.01, 0.02) * pair.truth;
  const RegistrationResult still = refine(pair.source, pair.target, options);
  const Rigid3 motion(rotation_exp({0.5, 2.0, -1.0}), {300.0, -200.0, 100.0});
  LandmarkCloud moved = pair.target;
  for (auto& position : moved.positions) position = motion * position;
  for (auto& covariance : moved.covariances) {
    covariance = motion.rotation() * covariance * motion.rotation().transpose();
  }
  options.initial = motion * options.initial;
  const RegistrationResult result = refine(pair.source, moved, options);
  EXPECT_LT((motion * still.target_from_source).difference_to(result.target_from_source).norm(),
            1e-5);
}

TEST(Refine, IsTheSameForAnyNumberOfThreads) {
  const Pair pair = synthetic({.seed = 5});
  RefineOptions options;
  options.initial = pair.truth;
  const RegistrationResult one = refine(pair.source, pair.target, options);
  const RegistrationResult two =
      refine(pair.source, pair.target, options, {.executor = Executor(2)});
  EXPECT_EQ(one.target_from_source.matrix(), two.target_from_source.matrix());
  EXPECT_EQ(*one.covariance, *two.covariance);
}

TEST(Refine, MatchesOneToOneOnDemand) {
  const Pair pair = synthetic({.seed = 6});
  RefineOptions options;
  options.initial = pair.truth;
  options.one_to_one = true;
  const RegistrationResult result = refine(pair.source, pair.target, options);
  EXPECT_LT(distance(result.target_from_source, pair.truth), 5e-3);
  std::set<std::uint32_t> taken;
  for (const Match& match : result.matches) EXPECT_TRUE(taken.insert(match.target).second);
}

TEST(Refine, NamesTheMotionThatMatchesLeaveOpen) {
  // Points on a line may turn about it.
  LandmarkCloud line;
  for (int i = 0; i < 50; ++i) line.positions.emplace_back(0.01 * i * i, 0.0, 0.0);
  RefineOptions options;
  options.coarse = options.fine = 0.05;
  const RegistrationResult result = refine(line, line, options);
  ASSERT_EQ(result.unobservable.size(), 1U);
  EXPECT_FALSE(result.covariance);
  const Eigen::Vector3d axis = result.unobservable[0].rotation.normalized();
  EXPECT_NEAR(std::abs(axis.x()), 1.0, 1e-6);
}

// Floor and walls along x; each landmark of both clouds, or of one alone.
Pair corridor(std::uint64_t seed, double shared) {
  Random random(seed);
  Pair pair;
  const auto on_surface = [&](double from, double to) {
    const double x = random.uniform(from, to);
    const double across = random.uniform(-1.0, 1.0);
    const std::size_t surface = random.index(3);
    if (surface == 0) return Eigen::Vector3d(x, across, 0.0);
    return Eigen::Vector3d(x, surface == 1 ? -1.0 : 1.0, 1.0 + across);
  };
  const auto add = [&](LandmarkCloud& cloud, const Eigen::Vector3d& at) {
    // In this order, whatever the compiler.
    const Eigen::Vector3d noise{random.normal(), random.normal(), random.normal()};
    cloud.positions.push_back(at + 0.01 * noise);
  };
  for (int i = 0; i < 2000; ++i) {
    const bool both = random.chance(shared);
    const Eigen::Vector3d point = on_surface(2.0, 8.0);
    add(pair.source, point);
    add(pair.target, both ? point : on_surface(0.0, 10.0));
  }
  return pair;
}

TEST(Refine, SaysWhichWayACorridorIsOpen) {
  RefineOptions options;
  options.coarse = 0.5;
  int open_count = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const Pair alike = corridor(seed, 0.0);
    const RegistrationResult open = refine(alike.source, alike.target, options);
    EXPECT_EQ(open.covariance.has_value(), open.unobservable.empty());
    if (open.unobservable.size() != 1) continue;
    ++open_count;
    EXPECT_GT(std::abs(open.unobservable[0].translation.normalized().x()), 0.99);
  }
  // Now and then chance makes as many landmarks agree on one place along it as would hold it.
  EXPECT_GE(open_count, 19);

  // Landmarks that are the same hold it, though their surfaces do not.
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    const Pair same = corridor(seed, 0.5);
    const RegistrationResult held = refine(same.source, same.target, options);
    EXPECT_TRUE(held.unobservable.empty());
    ASSERT_TRUE(held.covariance);
    EXPECT_LT(std::abs(held.target_from_source.translation().x()), 0.02);
  }
}

TEST(Refine, KnowsHowWellASmallMapIsHeldInALargeOneAndTheOtherWayRound) {
  const Pair pair = synthetic({.seed = 7, .landmarks = 4000, .overlap = 0.9});
  const LandmarkCloud small = middle_of(pair.source, pair.source.size() / 15);
  RefineOptions options;
  options.coarse = 0.1;
  options.fine = 0.04;
  options.initial = pair.truth;
  const RegistrationResult there = refine(small, pair.target, options);
  EXPECT_TRUE(there.unobservable.empty());
  EXPECT_TRUE(there.covariance);
  options.initial = pair.truth.inverse();
  const RegistrationResult back = refine(pair.target, small, options);
  EXPECT_TRUE(back.unobservable.empty());
  ASSERT_TRUE(back.covariance);

  // The same, seen from the other side.
  EXPECT_LT(distance(back.target_from_source, there.target_from_source.inverse()), 1e-9);
  const Matrix6d expected = inverse_covariance(there.target_from_source, *there.covariance);
  EXPECT_LT((*back.covariance - expected).norm(), 1e-6 * expected.norm());
  EXPECT_NE(back.score, there.score) << "each of its own source";
  for (std::size_t i = 0; i < back.matches.size(); ++i) {
    ASSERT_LT(back.matches[i].source, pair.target.size());
    ASSERT_LT(back.matches[i].target, small.size());
    if (i > 0) {
      ASSERT_LT(back.matches[i - 1].source, back.matches[i].source);
    }
  }
}

// Of a source that is the smaller cloud, and of one that is the larger: which of them moves must not show.
TEST(Refine, FindsTheScaleTooAndSaysAllInTheTargetsUnit) {
  constexpr double kUnit = 7.0;  // of the source
  constexpr double kRadius = 0.02;
  const Pair pair = synthetic({.seed = 3, .landmarks = 3000, .outlier_fraction = 0.1});
  for (const bool source_is_small : {true, false}) {
    const LandmarkCloud source = scaled(
        source_is_small ? middle_of(pair.source, pair.source.size() * 2 / 5) : pair.source, kUnit);
    const LandmarkCloud target =
        source_is_small ? pair.target : middle_of(pair.target, pair.target.size() * 2 / 5);
    RefineOptions options;
    options.initial = pair.truth;
    options.coarse = 0.1;
    options.scale = 1.04 / kUnit;
    options.overlap_radius = kRadius;
    options.trace = true;
    const RegistrationResult result = refine(source, target, options);
    EXPECT_EQ(result.status, RegistrationStatus::kConverged) << result.reason;
    EXPECT_NEAR(result.scale * kUnit, 1.0, 5e-3);
    EXPECT_LT(distance(result.target_from_source, pair.truth), 0.02);
    ASSERT_TRUE(result.covariance_with_scale);
    EXPECT_EQ(*result.covariance, (result.covariance_with_scale->topLeftCorner<6, 6>()));

    const BatchTree tree(target.positions);
    const auto there =
        nearest_squared_distances(source.positions, result.similarity(), tree, Executor());
    EXPECT_NEAR(*result.score, *fitness_score(there), 1e-9);
    EXPECT_NEAR(result.overlap->source, *share_within(there, kRadius), 1e-3);
    const LandmarkCloud sized = scaled(source, result.scale);
    const auto back =
        nearest_squared_distances(target.positions, result.target_from_source.inverse(),
                                  BatchTree(sized.positions), Executor());
    EXPECT_NEAR(result.overlap->target, *share_within(back, kRadius), 1e-3);
    for (const Match& match : result.matches) {
      ASSERT_NEAR(
          (result.similarity() * source.positions[match.source] - target.positions[match.target])
              .squaredNorm(),
          match.squared_distance, 1e-9);
    }
    const IterationRecord& last = result.history.back();
    EXPECT_EQ(last.scale, result.scale);
    EXPECT_NEAR(*last.score, *result.score, 1e-9);
    const Similarity3 start(*options.scale, options.initial);
    EXPECT_NEAR(
        *result.initial_score,
        *fitness_score(nearest_squared_distances(source.positions, start, tree, Executor())), 1e-9);
  }
}

TEST(Refine, WithAScaleSaysTheSameOfTheSmallerMapWhicheverIsTheSource) {
  const Pair pair = synthetic({.seed = 7, .landmarks = 1500, .overlap = 0.9});
  constexpr double kUnit = 3.0;  // of the source
  const LandmarkCloud source = scaled(pair.source, kUnit);
  RefineOptions options;
  options.coarse = 0.1;
  options.fine = 0.03;
  options.initial = pair.truth;
  options.scale = 1.0 / kUnit;
  const RegistrationResult there = refine(source, pair.target, options);
  const Similarity3 back_truth = Similarity3(1.0 / kUnit, pair.truth).inverse();
  options.coarse = 0.1 * kUnit;
  options.fine = 0.03 * kUnit;
  options.initial = back_truth.rigid();
  options.scale = kUnit;
  const RegistrationResult back = refine(pair.target, source, options);
  EXPECT_NEAR(back.scale * there.scale, 1.0, 1e-6);
  EXPECT_LT(distance(back.similarity().inverse().rigid(), there.target_from_source), 1e-5);
  ASSERT_TRUE(there.covariance_with_scale);
  ASSERT_TRUE(back.covariance_with_scale);
  EXPECT_NEAR(normalised_squared_error(back.similarity(), *back.covariance_with_scale, back_truth),
              normalised_squared_error(there.similarity(), *there.covariance_with_scale,
                                       Similarity3(1.0 / kUnit, pair.truth)),
              0.5);
}

// The map, whose keyframes' poses grow uncertain from the first on, as by odometry.
LandmarkMap drifting(const LandmarkMap& map) {
  MapTables tables = LandmarkMap(map).tables();
  for (std::size_t i = 0; i < tables.frames.ids.size(); ++i) {
    tables.frames.pose_covariances.push_back(
        Matrix6d(1e-4 * static_cast<double>(i) * Matrix6d::Identity()));
  }
  return LandmarkMap(std::move(tables));
}

TEST(Refine, AddsTheDriftThatEitherMapStates) {
  const SyntheticPair pair = synthetic_pair({.seed = 7, .landmarks = 1500, .overlap = 0.5});
  RefineOptions options;
  options.coarse = 0.1;
  const auto covariance = [&](const LandmarkMap& source, const LandmarkMap& target) {
    return *refine(PreparedMap(source), PreparedMap(target), options).covariance;
  };
  options.initial = pair.target_from_source;
  const Matrix6d alone = covariance(pair.source, pair.target);
  const Matrix6d of_source = covariance(drifting(pair.source), pair.target) - alone;
  const Matrix6d of_target = covariance(pair.source, drifting(pair.target)) - alone;
  EXPECT_GT(of_source.trace(), 1e-4);
  EXPECT_GT(of_target.trace(), 1e-4);
  EXPECT_TRUE((covariance(drifting(pair.source), drifting(pair.target)) - alone)
                  .isApprox(of_source + of_target, 1e-6));
  options.initial = pair.target_from_source.inverse();
  const Matrix6d back =
      covariance(pair.target, drifting(pair.source)) - covariance(pair.target, pair.source);
  EXPECT_TRUE(inverse_covariance(pair.target_from_source, of_source).isApprox(back, 0.01));
}

TEST(Refine, CovarianceCoversTheErrorOfTheScale) {
  constexpr int kTrials = 20;
  for (const double overlap : {0.3, 0.8}) {
    int inside = 0;
    double sum = 0.0;
    for (std::uint64_t seed = 0; seed < kTrials; ++seed) {
      const Pair pair =
          synthetic({.seed = 500 + seed, .landmarks = 1500, .frames = 40, .overlap = overlap});
      RefineOptions options;
      options.initial = pair.truth;
      options.scale = 1.0;
      options.coarse = 0.1;
      const RegistrationResult result = refine(pair.source, pair.target, options);
      ASSERT_TRUE(result.covariance_with_scale);
      const double squared =
          normalised_squared_error(result.similarity(), *result.covariance_with_scale, pair.truth);
      inside += squared < kNormalisedSquaredErrorWithScale95 ? 1 : 0;
      sum += squared;
    }
    EXPECT_GE(inside, kTrials * 0.85) << "overlap " << overlap;
    EXPECT_GT(sum / kTrials, 0.6) << "overlap " << overlap << ": so large that it says nothing";
  }
}

TEST(Refine, SaysNothingOfAPoseThatIsNoOptimum) {
  const Pair pair = synthetic({.seed = 8, .landmarks = 800});
  std::stop_source stop;
  stop.request_stop();
  RefineOptions options;
  options.initial = pair.truth;
  const RegistrationResult result =
      refine(pair.source, pair.target, options, {.stop = stop.get_token()});
  EXPECT_EQ(result.status, RegistrationStatus::kCancelled);
  EXPECT_FALSE(result.covariance);
  EXPECT_TRUE(result.unobservable.empty());
}

TEST(Refine, FailsWithTooFewLandmarks) {
  LandmarkCloud two;
  two.positions = {{0, 0, 0}, {1, 0, 0}};
  const RegistrationResult result = refine(two, two);
  EXPECT_EQ(result.status, RegistrationStatus::kFailed);
  EXPECT_THAT(result.reason, HasSubstr("2 source and 2 target"));
}

TEST(Refine, SurvivesLandmarksThatCoincide) {
  LandmarkCloud same;
  same.positions.assign(30, Eigen::Vector3d(1, 2, 3));
  const RegistrationResult result = refine(same, same);
  EXPECT_TRUE(result.target_from_source.matrix().allFinite());
}

TEST(Refine, RefusesInvalidOptionsByName) {
  const auto refused = [](const RefineOptions& options, const char* field) {
    EXPECT_THAT(testing::refusal(ErrorKind::kMisuse, [&] { options.validate(); }),
                HasSubstr(field));
  };
  refused({.coarse = 0.0}, "RefineOptions.coarse");
  refused({.fine = -1.0}, "RefineOptions.fine");
  refused({.coarse = 0.1, .fine = 0.2}, "RefineOptions.fine");
  refused({.max_iterations = 0}, "RefineOptions.max_iterations");
  refused({.overlap_radius = std::numeric_limits<double>::infinity()},
          "RefineOptions.overlap_radius");
}

TEST(Refine, RefusesCloudsWithDefects) {
  LandmarkCloud cloud;
  cloud.positions.assign(5, Eigen::Vector3d::Zero());
  cloud.weights = {1.0, 1.0};
  EXPECT_THROW(refine(cloud, cloud), Error);
  cloud.weights.assign(5, -1.0);
  EXPECT_THROW(refine(cloud, cloud), Error);
  cloud.weights.clear();
  cloud.positions[2].x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(refine(cloud, cloud), Error);
}

}  // namespace
}  // namespace cairn
