// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/registration/icp.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <optional>
#include <stop_token>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/error.hpp"
#include "cairn/core/random.hpp"
#include "cairn/geometry/covariance.hpp"
#include "cairn/map/operations.hpp"
#include "cairn/map/synthetic.hpp"
#include "cairn/registration/convergence/pcl_criteria.hpp"
#include "cairn/registration/correspondence/confident_neighbor.hpp"
#include "cairn/registration/estimation/point_to_point.hpp"
#include "cairn/registration/neighbors/batch_tree.hpp"
#include "cairn/registration/stages.hpp"

#include "support/brute_force_search.hpp"
#include "support/refusal.hpp"

namespace cairn {
namespace {

using ::testing::HasSubstr;

constexpr double kDegree = std::numbers::pi / 180.0;

double distance(const Rigid3& a, const Rigid3& b) {
  return a.difference_to(b).norm();
}

PointSet random_points(std::uint64_t seed, std::size_t count) {
  Random random(seed);
  PointSet points;
  for (std::size_t i = 0; i < count; ++i) {
    points.positions.emplace_back(random.uniform(0, 2), random.uniform(0, 1), random.uniform(0, 1));
    points.confidences.push_back(1.0 + static_cast<double>(random.index(5)));
  }
  return points;
}

PointSet moved(PointSet points, const Rigid3& pose) {
  for (auto& position : points.positions) position = pose * position;
  return points;
}

// The paper's algorithm once more, as plainly as it can be written.
Rigid3 plain_icp(const PointSet& source, const PointSet& target, std::size_t k, int iterations) {
  Rigid3 pose;
  for (int iteration = 0; iteration < iterations; ++iteration) {
    Eigen::Matrix3Xd from(3, source.positions.size());
    Eigen::Matrix3Xd to(3, source.positions.size());
    for (std::size_t i = 0; i < source.positions.size(); ++i) {
      const Eigen::Vector3d query = pose * source.positions[i];
      std::vector<std::size_t> order(target.positions.size());
      for (std::size_t j = 0; j < order.size(); ++j) order[j] = j;
      std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
        return (target.positions[a] - query).squaredNorm() <
               (target.positions[b] - query).squaredNorm();
      });
      std::size_t best = order[0];
      for (std::size_t j = 1; j < k; ++j) {
        if (target.confidences[order[j]] > target.confidences[best]) best = order[j];
      }
      from.col(static_cast<Eigen::Index>(i)) = query;
      to.col(static_cast<Eigen::Index>(i)) = target.positions[best];
    }
    const Eigen::Matrix4d step = Eigen::umeyama(from, to, false);
    pose = Rigid3::from_matrix(Matrix4d(step)) * pose;
  }
  return pose;
}

TEST(Align, FollowsThePlainAlgorithmStepByStep) {
  const PointSet target = random_points(1, 150);
  const PointSet source =
      moved(random_points(2, 120), Rigid3::from_roll_pitch_yaw({0.1, 0, 0}, 0, 0, 0.1));
  for (const std::size_t k : {1UL, 3UL, 5UL}) {
    IcpOptions options;
    options.k = k;
    options.max_iterations = 20;
    options.mse_change_threshold = 0.0;
    const RegistrationResult result = icp(source, target, options);
    for (std::size_t i = 0; i < result.history.size(); ++i) {
      const Rigid3 expected = plain_icp(source, target, k, static_cast<int>(i) + 1);
      ASSERT_LT(distance(result.history[i].target_from_source, expected), 1e-9) << k << " " << i;
    }
  }
}

TEST(Align, FindsASmallMotionOfTheSameMapExactly) {
  const PointSet target = random_points(3, 500);
  const auto truth = Rigid3::from_roll_pitch_yaw({0.02, -0.01, 0.01}, 0.01, -0.02, 0.02);
  IcpOptions options;
  options.k = 1;
  options.overlap_radius = 0.01;
  const RegistrationResult result = icp(moved(target, truth.inverse()), target, options);
  EXPECT_EQ(result.status, RegistrationStatus::kConverged);
  EXPECT_LT(distance(result.target_from_source, truth), 1e-9);
  EXPECT_LT(*result.score, 1e-18);
  EXPECT_GT(*result.initial_score, 1e-6);
  EXPECT_EQ(result.matches.size(), target.positions.size());
  EXPECT_EQ(result.overlap->source, 1.0);
  EXPECT_EQ(result.overlap->target, 1.0);
  ASSERT_TRUE(result.covariance);
  EXPECT_LT(result.covariance->norm(), 1e-12) << "no residuals, no uncertainty";
}

TEST(Align, OverlapIsOfEachSetsOwnPoints) {
  const PointSet target = random_points(3, 400);
  PointSet source = target;
  source.positions.resize(100);
  source.confidences.resize(100);
  IcpOptions options;
  options.k = 1;
  options.overlap_radius = 1e-6;
  const RegistrationResult result = icp(source, target, options);
  EXPECT_EQ(result.overlap->source, 1.0);
  EXPECT_EQ(result.overlap->target, 0.25);
}

TEST(Align, OneCandidateOrNoConfidencesIsTheBaseIcp) {
  const PointSet target = random_points(4, 300);
  const PointSet source = random_points(5, 200);
  IcpOptions options;
  options.k = 1;
  const RegistrationResult weighted = icp(source, target, options);
  options.k = 5;
  const RegistrationResult base = icp({source.positions, {}}, {target.positions, {}}, options);
  EXPECT_EQ(distance(weighted.target_from_source, base.target_from_source), 0.0);
  EXPECT_EQ(weighted.matches, base.matches);
}

TEST(Align, MapsTheSourceAsReadWithTheInitialPosePartOfTheResult) {
  const PointSet target = random_points(6, 300);
  const auto truth = Rigid3::from_roll_pitch_yaw({5, -3, 2}, 0.5, 1.0, 2.0);
  IcpOptions options;
  options.k = 1;
  options.initial = truth.perturbed((Vector6d() << 0.01, 0.01, 0, 0.005, 0, 0.005).finished());
  const RegistrationResult result = icp(moved(target, truth.inverse()), target, options);
  EXPECT_LT(distance(result.target_from_source, truth), 1e-9);
}

TEST(Align, DoesNotDependOnWhereTheWorldIs) {
  const PointSet target = random_points(7, 300);
  const PointSet source = random_points(8, 250);
  const RegistrationResult here = icp(source, target);
  const auto shift = Rigid3::from_roll_pitch_yaw({3, 4, -5}, 0.2, 0.3, 0.4);
  IcpOptions options;
  options.initial = shift;
  const RegistrationResult there = icp(source, moved(target, shift), options);
  EXPECT_LT(distance(there.target_from_source, shift * here.target_from_source), 1e-8);
  EXPECT_NEAR(*there.score, *here.score, 1e-10);
}

TEST(Align, KeepsItsPrecisionAtHugeOffsets) {
  const PointSet target = random_points(9, 400);
  const PointSet source =
      moved(random_points(10, 400), Rigid3::from_roll_pitch_yaw({0.05, 0, 0}, 0, 0, 0.05));
  const Eigen::Vector3d far(1e6, -1e6, 1e6);
  const Rigid3 shift(Eigen::Quaterniond::Identity(), far);
  for (const std::size_t k : {1UL, 5UL}) {
    IcpOptions options;
    options.k = k;
    const RegistrationResult centred = icp(source, target, options);
    const RegistrationResult offset = icp(moved(source, shift), moved(target, shift), options);
    for (const auto& x : source.positions) {
      const Eigen::Vector3d expected = shift * (centred.target_from_source * x);
      EXPECT_LT((offset.target_from_source * (shift * x) - expected).norm(), 1e-6);
    }
    EXPECT_NEAR(*offset.score, *centred.score, 1e-9);
  }
}

TEST(Align, GivesTheSameBytesWithAnyNumberOfThreads) {
  const SyntheticPair pair = synthetic_pair({.seed = 4});
  IcpOptions options;
  options.initial = pair.target_from_source;
  options.overlap_radius = 0.05;
  options.reciprocal = true;
  const auto run = [&](unsigned threads) {
    return icp(pair.source, pair.target, observations_metric(), options, {},
               {.executor = Executor(threads)});
  };
  const RegistrationResult one = run(1);
  for (const unsigned threads : {2U, 3U}) {
    const RegistrationResult many = run(threads);
    EXPECT_EQ(one.target_from_source.matrix(), many.target_from_source.matrix());
    EXPECT_EQ(one.score, many.score);
    EXPECT_EQ(one.matches, many.matches);
    EXPECT_EQ(*one.covariance, *many.covariance);
    EXPECT_EQ(one.overlap->target, many.overlap->target);
  }
}

TEST(Align, SearchesInBatchesAsIfEveryPointWereLookedAt) {
  const SyntheticPair pair = synthetic_pair({.seed = 4});
  const PointSet source = point_set(pair.source, observations_metric());
  const PointSet target = point_set(pair.target, observations_metric());
  const auto initial = Rigid3::from_roll_pitch_yaw({0.1, 0.1, 0.0}, 0.05, 0.0, 0.2);
  const auto run = [&]<class Search>(const Search& search, std::size_t k) {
    const ConfidentNeighborCorrespondence<Search> find_matches(
        {search, target.positions, target.confidences}, std::nullopt, {.k = k});
    std::vector<Iteration> steps;
    run_icp(source.positions, initial, find_matches, PointToPointEstimation(target.positions),
            PclCriteria{.max_iterations = 6}, {},
            [&](Iteration step) { steps.push_back(std::move(step)); });
    return steps;
  };
  for (const std::size_t k : {1UL, 5UL, 30UL}) {
    const auto batched = run(BatchTree(target.positions), k);
    const auto plain = run(testing::BruteForceSearch(target.positions), k);
    ASSERT_EQ(batched.size(), plain.size());
    for (std::size_t i = 0; i < plain.size(); ++i) {
      ASSERT_EQ(batched[i].matches, plain[i].matches) << "iteration " << i << ", k = " << k;
      EXPECT_EQ(batched[i].target_from_source.matrix(), plain[i].target_from_source.matrix());
    }
  }
}

// The nearest of a set's points, all looked at.
Neighbor nearest_of_all(const PointSet& set, const Eigen::Vector3d& query) {
  Neighbor nearest;
  testing::BruteForceSearch(set.positions).nearest(query, {&nearest, 1});
  return nearest;
}

// Of the points moved by the pose, to the nearest of the others.
std::vector<double> squared_distances_to_nearest(const PointSet& points, const Rigid3& pose,
                                                 const PointSet& others) {
  std::vector<double> result;
  for (const auto& x : points.positions) {
    result.push_back(nearest_of_all(others, pose * x).squared_distance);
  }
  return result;
}

double plain_score(const PointSet& source, const Rigid3& pose, const PointSet& target) {
  const auto squared = squared_distances_to_nearest(source, pose, target);
  return std::accumulate(squared.begin(), squared.end(), 0.0) / static_cast<double>(squared.size());
}

double plain_share(const PointSet& points, const Rigid3& pose, const PointSet& others,
                   double radius) {
  const auto squared = squared_distances_to_nearest(points, pose, others);
  const auto within =
      std::count_if(squared.begin(), squared.end(), [&](double x) { return x <= radius * radius; });
  return static_cast<double>(within) / static_cast<double>(squared.size());
}

TEST(Align, DescribesTheFitAsALookAtAllPointsDoes) {
  const PointSet target = random_points(30, 90);
  const PointSet source =
      moved(random_points(31, 70), Rigid3::from_roll_pitch_yaw({-4, 3, 2}, 0.1, 0.2, 1.0));
  IcpOptions options;
  options.initial = Rigid3::from_roll_pitch_yaw({-4, 3, 2}, 0.1, 0.2, 1.0).inverse();
  options.max_iterations = 4;
  options.trace = true;
  options.overlap_radius = 0.1;
  const RegistrationResult result = icp(source, target, options);
  const Rigid3& pose = result.target_from_source;
  EXPECT_NEAR(*result.initial_score, plain_score(source, options.initial, target), 1e-12);
  EXPECT_NEAR(*result.score, plain_score(source, pose, target), 1e-12);
  EXPECT_EQ(result.overlap->source, plain_share(source, pose, target, 0.1));
  EXPECT_EQ(result.overlap->target, plain_share(target, pose.inverse(), source, 0.1));
  EXPECT_NE(result.overlap->source, result.overlap->target);
  Rigid3 before = options.initial;
  for (const IterationRecord& record : result.history) {
    EXPECT_NEAR(*record.score, plain_score(source, record.target_from_source, target), 1e-12);
    double sum = 0.0;
    for (const Match& match : record.matches) {
      sum +=
          (before * source.positions[match.source] - target.positions[match.target]).squaredNorm();
    }
    EXPECT_NEAR(record.mean_squared_distance, sum / static_cast<double>(record.match_count), 1e-12);
    before = record.target_from_source;
  }
  ASSERT_EQ(result.matches.size(), source.positions.size());
  for (const Match& match : result.matches) {
    EXPECT_NEAR(
        match.squared_distance,
        (pose * source.positions[match.source] - target.positions[match.target]).squaredNorm(),
        1e-12);
  }
}

TEST(Align, MatchesMutualNeighborsOnlyIfAsked) {
  PointSet target = random_points(32, 60);
  PointSet source = random_points(33, 80);
  target.confidences.clear();
  source.confidences.clear();
  IcpOptions options;
  options.reciprocal = true;
  options.max_iterations = 3;
  const RegistrationResult result = icp(source, target, options);
  const Rigid3& pose = result.target_from_source;
  std::vector<std::pair<std::size_t, std::size_t>> expected;
  for (std::size_t i = 0; i < source.positions.size(); ++i) {
    const std::size_t j = nearest_of_all(target, pose * source.positions[i]).index;
    const Neighbor back = nearest_of_all(source, pose.inverse() * target.positions[j]);
    if (back.index == i) expected.emplace_back(i, j);
  }
  std::vector<std::pair<std::size_t, std::size_t>> found;
  for (const Match& match : result.matches) found.emplace_back(match.source, match.target);
  EXPECT_EQ(found, expected);
  EXPECT_LT(found.size(), source.positions.size());
}

TEST(Align, ReportsProgressAsShareOfTheMostIterations) {
  IcpOptions options;
  options.max_iterations = 5;
  options.mse_change_threshold = 0.0;
  std::vector<double> shares;
  const RegistrationResult result =
      icp(random_points(34, 100), random_points(35, 100), options,
          {.progress = [&](double share) { shares.push_back(share); }});
  ASSERT_EQ(result.stop_reason, StopReason::kIterationLimit);
  EXPECT_EQ(shares, (std::vector<double>{0.2, 0.4, 0.6, 0.8, 1.0}));
}

TEST(Align, SaysHowItEndedAndHowLongItTook) {
  const PointSet target = random_points(36, 100);
  const PointSet source = random_points(37, 100);
  IcpOptions options;
  options.max_iterations = 2;
  const auto start = std::chrono::steady_clock::now();
  const RegistrationResult limited = icp(source, target, options);
  const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - start;
  EXPECT_EQ(limited.reason, "stopped at the limit of 2 iterations");
  EXPECT_GT(limited.duration_s, 0.0);
  EXPECT_LE(limited.duration_s, elapsed.count());

  const PointSet place = {std::vector<Eigen::Vector3d>(5, {1, 2, 3}), {}};
  options.mse_change_threshold = 0.0;
  options.stop_at_repetition = false;
  options.max_iterations = 100;
  EXPECT_THAT(icp(place, place, options).reason, HasSubstr("nothing moved any more"));
  options.mse_change_threshold = 1e9;
  EXPECT_THAT(icp(source, target, options).reason,
              HasSubstr("mean squared match distance settled"));
  options = {};
  EXPECT_THAT(icp({source.positions, {}}, {target.positions, {}}, options).reason,
              HasSubstr("the matches settled"));

  std::stop_source stop;
  stop.request_stop();
  EXPECT_EQ(icp(source, target, options, {.stop = stop.get_token()}).reason,
            "cancelled after 0 iterations");
}

TEST(Align, AcceptsOptionsAtTheirLimits) {
  const PointSet points = random_points(38, 10);
  IcpOptions options;
  options.k = 1;
  options.max_iterations = 1;
  options.mse_change_threshold = 0.0;
  options.max_distance = std::numeric_limits<double>::min();
  options.trimmed_fraction = 0.0;
  options.overlap_radius = std::numeric_limits<double>::min();
  EXPECT_NO_THROW(options.validate());
  options.trimmed_fraction = std::nextafter(1.0, 0.0);
  EXPECT_NO_THROW(options.validate());
  // Of nothing no weights are missed.
  options.weight_by_source_confidence = true;
  EXPECT_EQ(icp({}, points, options).status, RegistrationStatus::kFailed);
}

TEST(Align, AlignsTwoSessionsOfOneDeskNearTheTruth) {
  const SyntheticPair pair = synthetic_pair({.seed = 5, .overlap = 0.8});
  IcpOptions options;
  options.initial = pair.target_from_source.perturbed(
      (Vector6d() << 0.03, -0.02, 0.02, 0.02, -0.02, 0.03).finished());
  for (const auto& metric : {std::optional<Metric>(), std::optional(observations_metric())}) {
    options.trimmed_fraction = 0.3;
    const RegistrationResult result = icp(pair.source, pair.target, metric, options);
    const Eigen::Vector3d centre = pair.source.landmarks().positions.front();
    EXPECT_LT((result.target_from_source * centre - pair.target_from_source * centre).norm(), 0.02);
    EXPECT_LT((result.target_from_source.inverse() * pair.target_from_source).angle(),
              1.5 * kDegree);
  }
}

TEST(Align, MatchesOnlyWithinTheDistance) {
  PointSet target = random_points(11, 200);
  PointSet source = target;
  target.confidences.clear();
  source.confidences.clear();
  for (std::size_t i = 0; i < 50; ++i) source.positions[i] += Eigen::Vector3d(0, 0, 10);
  IcpOptions options;
  options.max_distance = 0.5;
  const RegistrationResult result = icp(source, target, options);
  EXPECT_EQ(result.matches.size(), 150U);
  EXPECT_LT(distance(result.target_from_source, Rigid3()), 1e-9);
}

TEST(Align, TrimmingAndWeightsKeepOutliersFromThePose) {
  PointSet target = random_points(12, 200);
  target.confidences.assign(200, 1.0);
  PointSet source = target;
  for (std::size_t i = 0; i < 40; ++i) {
    source.positions[i] += Eigen::Vector3d(0, 0, 3);
    source.confidences[i] = 0.0;
  }
  IcpOptions trim;
  trim.trimmed_fraction = 0.2;
  IcpOptions weigh;
  weigh.weight_by_source_confidence = true;
  EXPECT_LT(distance(icp(source, target, trim).target_from_source, Rigid3()), 1e-9);
  EXPECT_LT(distance(icp(source, target, weigh).target_from_source, Rigid3()), 1e-9);
  EXPECT_GT(distance(icp(source, target).target_from_source, Rigid3()), 1e-2);
}

TEST(Align, RecordsEveryIteration) {
  const PointSet target = random_points(13, 100);
  const PointSet source = random_points(14, 100);
  IcpOptions options;
  options.trace = true;
  const RegistrationResult result = icp(source, target, options);
  ASSERT_EQ(result.history.size(), static_cast<std::size_t>(result.iterations));
  EXPECT_EQ(result.history.back().target_from_source.matrix(), result.target_from_source.matrix());
  EXPECT_EQ(*result.history.back().score, *result.score);
  for (const IterationRecord& record : result.history) {
    EXPECT_EQ(record.matches.size(), record.match_count);
  }
  options.trace = false;
  const RegistrationResult brief = icp(source, target, options);
  EXPECT_FALSE(brief.history.front().score);
  EXPECT_TRUE(brief.history.front().matches.empty());
}

TEST(Align, CovarianceHoldsTheTruthOfRightMatchesFarFromTheOrigin) {
  // Well separated points, so that the nearest is the right match, in frames far apart.
  Random random(15);
  PointSet source;
  for (int i = 0; i < 125; ++i) source.positions.emplace_back(i % 5, (i / 5) % 5, i / 25);
  const auto truth = Rigid3::from_roll_pitch_yaw({40, -30, 20}, 0.5, -0.7, 2.0);
  constexpr int kTrials = 200;
  int inside = 0;
  for (int trial = 0; trial < kTrials; ++trial) {
    PointSet target = moved(source, truth);
    for (auto& p : target.positions) {
      p += 0.02 * Eigen::Vector3d(random.normal(), random.normal(), random.normal());
    }
    IcpOptions options;
    options.initial = truth;
    const RegistrationResult result = icp(source, target, options);
    const double error =
        normalised_squared_error(result.target_from_source, *result.covariance, truth);
    inside += error < kNormalisedSquaredError95 ? 1 : 0;
  }
  EXPECT_GT(inside, kTrials * 0.90);
}

TEST(Align, StopsWhenAsked) {
  std::stop_source stop;
  const Execution execution{.stop = stop.get_token(), .progress = [&](double share) {
                              EXPECT_GT(share, 0.0);
                              stop.request_stop();
                            }};
  const RegistrationResult result =
      icp(random_points(16, 100), random_points(17, 100), {}, execution);
  EXPECT_EQ(result.status, RegistrationStatus::kCancelled);
  EXPECT_EQ(result.stop_reason, StopReason::kCancelled);
  EXPECT_EQ(result.iterations, 1);
}

std::string refusal(const PointSet& source, const PointSet& target, const IcpOptions& options) {
  return testing::refusal(ErrorKind::kMisuse, [&] { icp(source, target, options); });
}

TEST(Align, RefusesMisuseByName) {
  const PointSet points = random_points(18, 10);
  const auto with = [&](auto&& change) {
    IcpOptions options;
    change(options);
    return refusal(points, points, options);
  };
  const double nan = std::nan("");
  EXPECT_THAT(with([](auto& o) { o.k = 0; }), HasSubstr("IcpOptions.k: 0; expected at least 1"));
  EXPECT_THAT(with([](auto& o) { o.max_iterations = 0; }), HasSubstr("IcpOptions.max_iterations"));
  EXPECT_THAT(with([](auto& o) { o.max_distance = 0; }), HasSubstr("IcpOptions.max_distance"));
  EXPECT_THAT(with([&](auto& o) { o.max_distance = nan; }), HasSubstr("IcpOptions.max_distance"));
  EXPECT_THAT(with([](auto& o) { o.trimmed_fraction = 1; }), HasSubstr("trimmed_fraction: 1"));
  EXPECT_THAT(with([](auto& o) { o.trimmed_fraction = -0.1; }), HasSubstr("trimmed_fraction: -0"));
  EXPECT_THAT(with([](auto& o) { o.mse_change_threshold = -1; }),
              HasSubstr("mse_change_threshold"));
  EXPECT_THAT(with([](auto& o) { o.overlap_radius = 0; }), HasSubstr("overlap_radius"));
  EXPECT_THAT(with([&](auto& o) {
                o.initial = Rigid3(Eigen::Quaterniond(1, 0, 0, 0), {nan, 0, 0});
              }),
              HasSubstr("IcpOptions.initial"));
  EXPECT_THAT(with([&](auto& o) {
                o.initial = Rigid3(Eigen::Quaterniond(1, 0, 0, 0), {1e10, 0, 0});
              }),
              HasSubstr("IcpOptions.initial: is beyond the limit"));

  PointSet short_of_confidences = points;
  short_of_confidences.confidences.pop_back();
  EXPECT_THAT(refusal(points, short_of_confidences, {}), HasSubstr("target: 9 confidences of 10"));
  PointSet not_finite = points;
  not_finite.positions[3].y() = nan;
  EXPECT_THAT(refusal(not_finite, points, {}), HasSubstr("source: position of point 3"));
  not_finite = points;
  not_finite.positions.front().x() = nan;
  EXPECT_THAT(refusal(points, not_finite, {}), HasSubstr("target: position of point 0"));
  PointSet far = points;
  far.positions[3].y() = -1e40;
  EXPECT_THAT(refusal(points, far, {}),
              HasSubstr("target: position of point 3 is beyond the limit"));
  PointSet nan_confidence = points;
  nan_confidence.confidences[4] = nan;
  EXPECT_THAT(refusal(points, nan_confidence, {}), HasSubstr("confidence of point 4"));
  nan_confidence = points;
  nan_confidence.confidences.front() = nan;
  EXPECT_THAT(refusal(nan_confidence, points, {}), HasSubstr("confidence of point 0"));
  IcpOptions weigh;
  weigh.weight_by_source_confidence = true;
  EXPECT_THAT(refusal({points.positions, {}}, points, weigh), HasSubstr("no confidences"));
}

// Points without structure, of random confidence: weighted matches among them do not settle for long.
PointSet confusing_points(std::size_t count, Random& random) {
  PointSet points;
  for (std::size_t i = 0; i < count; ++i) {
    points.positions.emplace_back(random.uniform(), random.uniform(), random.uniform());
    points.confidences.push_back(random.uniform());
  }
  return points;
}

TEST(AlignWhereMatchesComeBack, StopsWithAPoseOfTheCycle) {
  Random random(21);
  int fixed_points = 0;
  int cycles = 0;
  for (int trial = 0; trial < 200; ++trial) {
    const PointSet source = confusing_points(60, random);
    const PointSet target = confusing_points(60, random);
    IcpOptions options;
    options.stop_at_repetition = false;
    options.mse_change_threshold = 0.0;
    options.max_iterations = 200;
    const RegistrationResult through = icp(source, target, options);
    options.stop_at_repetition = true;
    const RegistrationResult stopped = icp(source, target, options);
    if (!through.repetition) {
      EXPECT_EQ(stopped.iterations, through.iterations);
      continue;
    }
    ASSERT_TRUE(stopped.repetition);
    const auto [cycle, best] = *stopped.repetition;
    EXPECT_EQ(cycle.first, through.repetition->cycle.first);
    EXPECT_EQ(cycle.length, through.repetition->cycle.length);
    EXPECT_EQ(stopped.iterations, cycle.first + cycle.length);
    EXPECT_GE(best, cycle.first);
    EXPECT_LT(best, cycle.first + cycle.length);
    ASSERT_LT(stopped.iterations, through.iterations);

    // From there on every pose is one of the cycle's.
    const auto pose = [&](int iteration) {
      return through.history[iteration - 1].target_from_source.matrix();
    };
    for (int i = cycle.first; i + cycle.length <= through.iterations; ++i) {
      ASSERT_TRUE(pose(i).isApprox(pose(i + cycle.length), 1e-9));
    }
    EXPECT_TRUE(stopped.target_from_source.matrix().isApprox(pose(best), 1e-9));
    // After the best iteration the next one's matches are the closest.
    for (int i = cycle.first; i < cycle.first + cycle.length; ++i) {
      EXPECT_LE(through.history[best].mean_squared_distance,
                through.history[i].mean_squared_distance + 1e-12);
    }
    if (cycle.length == 1) {
      ++fixed_points;
      EXPECT_EQ(stopped.stop_reason, StopReason::kFixedPoint);
      EXPECT_EQ(stopped.status, RegistrationStatus::kConverged);
    } else {
      ++cycles;
      EXPECT_EQ(stopped.stop_reason, StopReason::kCycle);
      EXPECT_EQ(stopped.status, RegistrationStatus::kStopped);
      EXPECT_THAT(stopped.reason, HasSubstr("repeat"));
    }
  }
  EXPECT_GT(fixed_points, 5);
  EXPECT_GT(cycles, 3);
}

TEST(AlignWhereMatchesComeBack, GoesOnAsPclDoesIfAsked) {
  Random random(22);
  PointSet points = confusing_points(200, random);
  points.confidences.clear();
  IcpOptions options;
  options.initial = Rigid3::from_roll_pitch_yaw({0.01, 0, 0}, 0, 0, 0.02);
  const RegistrationResult stopped = icp(points, points, options);
  EXPECT_EQ(stopped.stop_reason, StopReason::kFixedPoint);
  options.stop_at_repetition = false;
  const RegistrationResult through = icp(points, points, options);
  EXPECT_EQ(through.stop_reason, StopReason::kMseChange);
  EXPECT_EQ(through.repetition->cycle.length, 1);
  EXPECT_EQ(through.repetition->cycle.first, stopped.repetition->cycle.first);
  EXPECT_GT(through.iterations, stopped.iterations);
}

}  // namespace
}  // namespace cairn
