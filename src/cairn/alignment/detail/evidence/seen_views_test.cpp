// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/alignment/detail/evidence/seen_views.hpp"

#include <numeric>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "cairn/core/random.hpp"
#include "cairn/geometry/similarity3.hpp"
#include "cairn/map/synthetic.hpp"

namespace cairn::detail {
namespace {

// A wall at x = 2, seen by a camera at the origin; a landmark every 2 cm.
LandmarkCloud wall() {
  LandmarkCloud cloud;
  for (int i = -40; i <= 40; ++i) {
    for (int j = -40; j <= 40; ++j) cloud.positions.emplace_back(2.0, 0.02 * i, 0.02 * j);
  }
  LandmarkView& view = cloud.views.emplace_back();
  view.landmarks.resize(cloud.size());
  std::iota(view.landmarks.begin(), view.landmarks.end(), 0U);
  return cloud;
}

SightCounts counts(const LandmarkCloud& source, const LandmarkCloud& target, const Rigid3& pose) {
  SightCounts counts = SeenViews(target).count(moved_points(source.positions, pose));
  counts += SeenViews(source).count(moved_points(target.positions, pose.inverse()));
  return counts;
}

Rigid3 shifted(double x, double y) {
  return {Eigen::Quaterniond::Identity(), Eigen::Vector3d(x, y, 0.0)};
}

TEST(SightCounts, AddUp) {
  SightCounts counts{.agree = 1, .in_front = 2, .behind = 3};
  counts += SightCounts{.agree = 10, .in_front = 20, .behind = 30};
  EXPECT_EQ(counts.agree, 11U);
  EXPECT_EQ(counts.in_front, 22U);
  EXPECT_EQ(counts.behind, 33U);
  EXPECT_EQ(counts.total(), 66U);
}

TEST(SeenViews, AgreesWhereSurfacesMeet) {
  const SightCounts same = counts(wall(), wall(), Rigid3());
  EXPECT_EQ(same.agree, same.total());
  EXPECT_EQ(same.total(), 2 * wall().size());
  const SightCounts along = counts(wall(), wall(), shifted(0.0, 0.3));
  EXPECT_EQ(along.agree, along.total());
}

TEST(SeenViews, TellsFrontFromBehind) {
  LandmarkCloud blind = wall();
  blind.views.clear();
  // The source's wall in front of the target's is where the target's camera looked through.
  const SightCounts front = counts(blind, wall(), shifted(-0.5, 0.0));
  EXPECT_EQ(front.in_front, front.total());
  EXPECT_GT(front.total(), 0U);
  const SightCounts behind = counts(blind, wall(), shifted(0.5, 0.0));
  EXPECT_EQ(behind.behind, behind.total());
  EXPECT_GT(behind.total(), 0U);
  // Asked from the other side, what the source's camera saw: the pose's inverse.
  const SightCounts back = counts(wall(), blind, shifted(0.5, 0.0));
  EXPECT_EQ(back.in_front, back.total());
  EXPECT_GT(back.total(), 0U);
}

TEST(SeenViews, SaysNothingOfWhatNoCameraLookedAt) {
  EXPECT_EQ(counts(wall(), wall(), shifted(0.0, 50.0)).total(), 0U);
  LandmarkCloud blind = wall();
  blind.views.clear();
  EXPECT_EQ(counts(blind, blind, Rigid3()).total(), 0U);
}

// One camera at the origin, and the landmarks that it sees.
SeenViews seen_from_origin(std::vector<Eigen::Vector3d> landmarks) {
  LandmarkCloud cloud;
  cloud.positions = std::move(landmarks);
  LandmarkView& view = cloud.views.emplace_back();
  view.landmarks.resize(cloud.size());
  std::iota(view.landmarks.begin(), view.landmarks.end(), 0U);
  return SeenViews(cloud);
}

TEST(SeenViews, AgreesFromTheNearestToTheFarthestThatADirectionShows) {
  const SeenViews views = seen_from_origin({{3.0, 0.0, 0.0}, {4.0, 0.0, 0.0}, {2.0, 0.0, 0.0}});
  const auto at = [&](double x) {
    return views.count(std::vector<Eigen::Vector3d>{{x, 0.0, 0.0}});
  };
  for (const double x : {1.93, 2.0, 2.5, 4.0, 4.15}) EXPECT_EQ(at(x).agree, 1U) << x;
  for (const double x : {0.5, 1.79}) EXPECT_EQ(at(x).in_front, 1U) << x;
  for (const double x : {4.41, 9.0}) EXPECT_EQ(at(x).behind, 1U) << x;
  // Between the two, and where the camera itself is, nothing is said.
  for (const double x : {1.81, 1.91, 4.17, 4.39, 0.0}) EXPECT_EQ(at(x).total(), 0U) << x;
}

TEST(SeenViews, KeepsDirectionsApartAllAround) {
  Random random(1);
  for (int trial = 0; trial < 200; ++trial) {
    const double x = random.uniform(0.2, 1.0);
    const double y = random.uniform(0.2, 1.0);
    const double z = random.uniform(0.2, 1.0);
    std::vector<Eigen::Vector3d> mirrored;
    for (const double sx : {-1.0, 1.0}) {
      for (const double sy : {-1.0, 1.0}) {
        for (const double sz : {-1.0, 1.0}) mirrored.emplace_back(sx * x, sy * y, sz * z);
      }
    }
    for (const Eigen::Vector3d& seen : mirrored) {
      const SeenViews views = seen_from_origin({seen});
      const SightCounts all = views.count(mirrored);
      EXPECT_EQ(all.agree, 1U) << seen.transpose();
      EXPECT_EQ(all.total(), 1U) << seen.transpose();
      EXPECT_EQ(views.count(std::vector<Eigen::Vector3d>{1.02 * seen}).agree, 1U);
    }
  }
}

TEST(SeenViews, AgreeAtTheRightPoseOfTwoMaps) {
  const SyntheticPair pair = synthetic_pair({.seed = 4, .landmarks = 800});
  const LandmarkCloud source = landmark_cloud(pair.source);
  const LandmarkCloud target = landmark_cloud(pair.target);
  ASSERT_FALSE(source.views.empty());
  const SightCounts right = counts(source, target, pair.target_from_source);
  EXPECT_GT(static_cast<double>(right.agree), 0.9 * static_cast<double>(right.total()));
  const SightCounts turned = counts(
      source, target,
      pair.target_from_source * Rigid3(rotation_exp({0.0, 0.0, 1.0}), Eigen::Vector3d::Zero()));
  EXPECT_LT(static_cast<double>(turned.agree) / static_cast<double>(turned.total()),
            static_cast<double>(right.agree) / static_cast<double>(right.total()));
}

}  // namespace
}  // namespace cairn::detail
