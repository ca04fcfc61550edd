// SPDX-License-Identifier: BSD-3-Clause
// What icp() does where there is little or nothing to align: each case has a defined outcome.
#include <cmath>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/random.hpp"
#include "cairn/registration/icp.hpp"

namespace cairn {
namespace {

using ::testing::HasSubstr;

PointSet points(std::vector<Eigen::Vector3d> positions, std::vector<double> confidences = {}) {
  return {std::move(positions), std::move(confidences)};
}

PointSet cube() {
  PointSet result;
  for (int i = 0; i < 8; ++i) {
    result.positions.emplace_back(i & 1, (i >> 1) & 1, 1.5 * ((i >> 2) & 1));
    result.confidences.push_back(1.0);
  }
  return result;
}

PointSet shifted(PointSet set, const Eigen::Vector3d& offset) {
  for (auto& position : set.positions) position += offset;
  return set;
}

TEST(DegenerateInput, EmptySetsFailAndSayWhich) {
  const auto initial = Rigid3::from_roll_pitch_yaw({1, 2, 3}, 0, 0, 0.5);
  IcpOptions options;
  options.initial = initial;
  options.overlap_radius = 1.0;
  const RegistrationResult no_source = icp({}, cube(), options);
  EXPECT_EQ(no_source.status, RegistrationStatus::kFailed);
  EXPECT_EQ(no_source.stop_reason, StopReason::kTooFewMatches);
  EXPECT_THAT(no_source.reason, HasSubstr("the source has no landmarks"));
  EXPECT_EQ(no_source.target_from_source.matrix(), initial.matrix());
  EXPECT_FALSE(no_source.score);
  EXPECT_FALSE(no_source.overlap);
  EXPECT_THAT(icp(cube(), {}, options).reason, HasSubstr("the target has no landmarks"));
  EXPECT_EQ(icp({}, {}).status, RegistrationStatus::kFailed);
}

TEST(DegenerateInput, FewerThanThreeSourcePointsFailWithAScore) {
  const RegistrationResult result = icp(points({{0, 0, 0}, {1, 0, 0}}), cube());
  EXPECT_EQ(result.status, RegistrationStatus::kFailed);
  EXPECT_EQ(result.iterations, 0);
  EXPECT_EQ(result.score, 0.0);
  EXPECT_THAT(result.reason, HasSubstr("fewer than 3 matches between 2 source and 8 target"));
}

TEST(DegenerateInput, ThreePointsAreEnough) {
  const PointSet three = points({{0, 0, 0}, {1, 0, 0}, {0, 2, 0}});
  const RegistrationResult result = icp(shifted(three, {0.1, 0.1, 0.1}), three);
  EXPECT_EQ(result.status, RegistrationStatus::kConverged);
  EXPECT_LT(*result.score, 1e-20);
}

TEST(DegenerateInput, FewTargetPointsServeManySourcePoints) {
  const RegistrationResult result = icp(cube(), points({{0, 0, 0}, {1, 0, 0}}));
  EXPECT_EQ(result.status, RegistrationStatus::kConverged);
  EXPECT_TRUE(std::isfinite(*result.score));
}

TEST(DegenerateInput, AKBeyondTheTargetIsTheWholeTarget) {
  PointSet target = cube();
  target.confidences[6] = 2.0;
  IcpOptions all;
  all.k = 8;
  IcpOptions more;
  more.k = 1000000000;
  const PointSet source = shifted(cube(), {0.2, 0, 0});
  const RegistrationResult a = icp(source, target, all);
  const RegistrationResult b = icp(source, target, more);
  EXPECT_EQ(a.target_from_source.matrix(), b.target_from_source.matrix());
  EXPECT_EQ(a.matches, b.matches);
}

TEST(DegenerateInput, CoincidingPointsAreMovedOntoEachOtherWithoutRotation) {
  const PointSet source = points(std::vector<Eigen::Vector3d>(5, {1, 1, 1}));
  const PointSet target = points(std::vector<Eigen::Vector3d>(5, {4, 5, 6}));
  const RegistrationResult result = icp(source, target);
  EXPECT_EQ(result.status, RegistrationStatus::kConverged);
  EXPECT_EQ(result.target_from_source.angle(), 0.0);
  EXPECT_LT(
      (result.target_from_source * Eigen::Vector3d(1, 1, 1) - Eigen::Vector3d(4, 5, 6)).norm(),
      1e-12);
  EXPECT_FALSE(result.covariance);
  EXPECT_EQ(result.unobservable.size(), 3U);
}

TEST(DegenerateInput, CollinearPointsAlignWithTheirSpinUnobservable) {
  PointSet target;
  for (int i = 0; i < 20; ++i) target.positions.emplace_back(0.1 * i + 0.001 * i * i, 0, 0);
  PointSet source = target;
  const auto tilt = Rigid3::from_roll_pitch_yaw({0.01, 0.01, 0}, 0, 0, 0.02);
  for (auto& p : source.positions) p = tilt.inverse() * p;
  const RegistrationResult result = icp(source, target);
  EXPECT_EQ(result.status, RegistrationStatus::kConverged);
  EXPECT_LT(*result.score, 1e-12);
  EXPECT_FALSE(result.covariance);
  ASSERT_EQ(result.unobservable.size(), 1U);
  EXPECT_NEAR(std::abs(result.unobservable[0].rotation.normalized().x()), 1.0, 1e-6);
}

TEST(DegenerateInput, CoplanarPointsDetermineThePose) {
  Random random(1);
  PointSet target;
  for (int i = 0; i < 100; ++i)
    target.positions.emplace_back(random.uniform(), random.uniform(), 0);
  const auto truth = Rigid3::from_roll_pitch_yaw({0.005, 0.004, 0.05}, 0.02, -0.01, 0.01);
  PointSet source = target;
  for (auto& p : source.positions) p = truth.inverse() * p;
  const RegistrationResult result = icp(source, target);
  EXPECT_LT(result.target_from_source.difference_to(truth).norm(), 1e-9);
  EXPECT_TRUE(result.covariance);
  EXPECT_TRUE(result.unobservable.empty());
}

TEST(DegenerateInput, DuplicatedPointsChangeNothingButTheirWeight) {
  PointSet target = cube();
  const RegistrationResult once = icp(shifted(cube(), {0.1, 0.05, 0}), target);
  target.positions.insert(target.positions.end(), target.positions.begin(), target.positions.end());
  target.confidences.assign(16, 1.0);
  const RegistrationResult twice = icp(shifted(cube(), {0.1, 0.05, 0}), target);
  EXPECT_LT(once.target_from_source.difference_to(twice.target_from_source).norm(), 1e-12);
  for (const Match& match : twice.matches) EXPECT_LT(match.target, 8U) << "ties go to the lower id";
}

TEST(DegenerateInput, TheMoreConfidentOfTwoAtOnePlaceIsMatched) {
  PointSet target = cube();
  target.positions.push_back(target.positions[3]);
  target.confidences.push_back(5.0);
  IcpOptions options;
  options.k = 2;
  options.max_iterations = 1;
  options.max_distance = 0.5;
  const RegistrationResult result = icp(cube(), target, options);
  EXPECT_EQ(result.matches[3].target, 8U);
}

TEST(DegenerateInput, TargetsNobodyTrustsAreNeverMatched) {
  PointSet target = cube();
  target.confidences.assign(8, 0.0);
  const RegistrationResult none = icp(cube(), target);
  EXPECT_EQ(none.status, RegistrationStatus::kFailed);
  EXPECT_EQ(none.score, 0.0) << "the score does not know of confidences";
  target.confidences = {1, 1, 1, 1, 0, -1, 0, -2};
  IcpOptions options;
  options.k = 1;
  const RegistrationResult some = icp(cube(), target, options);
  EXPECT_EQ(some.status, RegistrationStatus::kConverged);
  EXPECT_EQ(some.matches.size(), 4U) << "k = 1: those whose nearest is trusted";
}

TEST(DegenerateInput, SourceWeightsThatAreNotPositiveCarryNothing) {
  PointSet source = shifted(cube(), {0.1, 0, 0});
  source.confidences.assign(8, 0.0);
  IcpOptions options;
  options.weight_by_source_confidence = true;
  EXPECT_EQ(icp(source, cube(), options).status, RegistrationStatus::kFailed);
  source.confidences = {1, 1, 1, 1, -1, 0, 0, -5};
  const RegistrationResult some = icp(source, cube(), options);
  EXPECT_EQ(some.status, RegistrationStatus::kConverged);
  EXPECT_EQ(some.matches.size(), 4U);
}

TEST(DegenerateInput, NothingWithinReachFails) {
  IcpOptions options;
  options.max_distance = 1.0;
  const RegistrationResult result = icp(shifted(cube(), {100, 0, 0}), cube(), options);
  EXPECT_EQ(result.status, RegistrationStatus::kFailed);
  EXPECT_GT(*result.score, 9000.0);
}

}  // namespace
}  // namespace cairn
