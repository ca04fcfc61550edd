// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/merging/changes.hpp"

#include <algorithm>
#include <cmath>
#include <stop_token>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/error.hpp"
#include "cairn/core/random.hpp"
#include "cairn/geometry/angles.hpp"

#include "support/refusal.hpp"
#include "support/visits.hpp"

namespace cairn {
namespace {

using testing::box_at;
using ::testing::IsEmpty;
using testing::moved;
using ::testing::SizeIs;
using testing::Spot;
using testing::spots_in;
using testing::visit;
using testing::wall;
using testing::with;

ChangeResult changes_between(const LandmarkMap& first, const LandmarkMap& second) {
  return find_changes({.map = &first, .name = "a", .world_from_map = {}},
                      {.map = &second, .name = "b", .world_from_map = {}});
}

// A visit with descriptors of bytes, as SIFT's: each byte of a second view is near that of the first, but many bits differ.
LandmarkMap visit_with_bytes(const std::vector<Spot>& spots, std::uint64_t seed) {
  MapTables tables = visit(spots, seed).tables();
  tables.landmarks.descriptors->kind = "SIFT";
  Random random(seed);
  for (std::uint8_t& byte : tables.landmarks.descriptors->bytes) {
    const int changed = byte + static_cast<int>(random.index(41)) - 20;
    byte = static_cast<std::uint8_t>(std::clamp(changed, 0, 255));
  }
  return LandmarkMap(std::move(tables));
}

TEST(FindChanges, FindsNothingWhereNothingChanged) {
  const auto spots = with(wall(), box_at(0.2));
  const ChangeResult result = changes_between(visit(spots, 11), visit(spots, 12));
  EXPECT_THAT(result.changes, IsEmpty());
  EXPECT_NEAR(result.repeated, 0.7, 0.1);
  EXPECT_GT(result.comparable_first, 300U);
}

TEST(FindChanges, FindsWhatVanishedAndWhatAppeared) {
  const LandmarkMap with_box = visit(with(wall(), box_at(0.2)), 11);
  const LandmarkMap without = visit(wall(), 12);
  for (const bool appeared : {false, true}) {
    const ChangeResult result =
        appeared ? changes_between(without, with_box) : changes_between(with_box, without);
    ASSERT_THAT(result.changes, SizeIs(1));
    const Change& change = result.changes.front();
    EXPECT_EQ(change.kind, appeared ? ChangeKind::kAppeared : ChangeKind::kVanished);
    const ChangedPlace& place = appeared ? *change.after : *change.before;
    EXPECT_EQ(change.before.has_value(), !appeared);
    EXPECT_LT((place.centre - Eigen::Vector3d(0.35, 0.05, 2.05)).norm(), 0.06);
    EXPECT_NEAR(place.high.x() - place.low.x(), 0.28, 0.04);
    EXPECT_GT(change.confidence, 0.99);
    EXPECT_GT(place.landmarks.size(), 35U);
  }
}

TEST(FindChanges, OneThingThatMovedIsOneChange) {
  const Rigid3 motion = Rigid3::from_roll_pitch_yaw({-0.9, 0.2, 0.1}, 0.0, 0.0, radians(20.0));
  const LandmarkMap first = visit(with(wall(), box_at(0.3)), 11);
  const LandmarkMap second = visit(with(wall(), moved(box_at(0.3), motion)), 12);
  const ChangeResult result = changes_between(first, second);
  ASSERT_THAT(result.changes, SizeIs(1));
  const Change& change = result.changes.front();
  EXPECT_EQ(change.kind, ChangeKind::kMoved);
  ASSERT_TRUE(change.after_from_before.has_value());
  const Rigid3 error = change.after_from_before->inverse() * motion;
  EXPECT_LT((error * change.before->centre - change.before->centre).norm(), 0.01);
  EXPECT_LT(error.angle(), radians(4.0));
}

TEST(FindChanges, ComparesBytesByTheirDistance) {
  const LandmarkMap first = visit_with_bytes(with(wall(), box_at(0.3)), 11);
  const ChangeResult same = changes_between(first, visit_with_bytes(with(wall(), box_at(0.3)), 12));
  EXPECT_THAT(same.changes, IsEmpty());
  EXPECT_NEAR(same.repeated, 0.7, 0.1);
  const ChangeResult vanished = changes_between(first, visit_with_bytes(wall(), 12));
  ASSERT_THAT(vanished.changes, SizeIs(1));
  EXPECT_EQ(vanished.changes.front().kind, ChangeKind::kVanished);
  const Rigid3 motion = Rigid3::from_roll_pitch_yaw({-0.9, 0.2, 0.1}, 0.0, 0.0, radians(20.0));
  const ChangeResult turned =
      changes_between(first, visit_with_bytes(with(wall(), moved(box_at(0.3), motion)), 12));
  ASSERT_THAT(turned.changes, SizeIs(1));
  EXPECT_EQ(turned.changes.front().kind, ChangeKind::kMoved);
}

TEST(FindChanges, ThingsThatLookDifferentDidNotMoveButCameAndWent) {
  const auto other = spots_in({-0.6, -0.1, 2.0}, {-0.3, 0.2, 2.1}, 80, 99);
  const ChangeResult result =
      changes_between(visit(with(wall(), box_at(0.3)), 11), visit(with(wall(), other), 12));
  ASSERT_THAT(result.changes, SizeIs(2));
  EXPECT_EQ(result.changes[0].kind, ChangeKind::kVanished);
  EXPECT_EQ(result.changes[1].kind, ChangeKind::kAppeared);
}

TEST(FindChanges, SaysNothingOfWhatTheOtherMapDidNotLookAt) {
  // The second visit's cameras stand 8 m to the right.
  auto far_wall = wall();
  for (Spot& spot : far_wall) spot.position.x() += 8.0;
  const ChangeResult result =
      changes_between(visit(with(wall(), box_at(0.2)), 11), visit(far_wall, 12, 0.7, 8.0));
  EXPECT_THAT(result.changes, IsEmpty());
  EXPECT_EQ(result.comparable_first, 0U);
}

TEST(FindChanges, SaysNothingOfWhatIsHidden) {
  // A screen before the box, of which the second map sees nothing but the screen.
  const auto screen = spots_in({-0.4, -0.5, 1.0}, {0.8, 0.6, 1.01}, 900, 5);
  const LandmarkMap first = visit(with(wall(), box_at(0.2)), 11);
  std::vector<Spot> seen;
  for (const Spot& spot : wall()) {
    if (std::abs(spot.position.x()) > 1.6) seen.push_back(spot);
  }
  const ChangeResult result = changes_between(first, visit(with(seen, screen), 12));
  for (const Change& change : result.changes) EXPECT_EQ(change.kind, ChangeKind::kAppeared);
}

TEST(FindChanges, IsTheSameInBothMapsFrames) {
  const Rigid3 pose = Rigid3::from_roll_pitch_yaw({1.0, 2.0, 3.0}, 0.3, -0.2, 1.0);
  const LandmarkMap first = visit(with(wall(), box_at(0.2)), 11);
  const LandmarkMap second = visit(wall(), 12);
  const ChangeResult here = changes_between(first, second);
  const ChangeResult there = find_changes({.map = &first, .name = "a", .world_from_map = pose},
                                          {.map = &second, .name = "b", .world_from_map = pose});
  ASSERT_EQ(here.changes.size(), there.changes.size());
  EXPECT_EQ(here.changes[0].before->landmarks.size(), there.changes[0].before->landmarks.size());
}

TEST(FindChanges, MapsWithoutObservationsHaveNothingToCompare) {
  MapTables tables;
  tables.landmarks.ids = {LandmarkId{0}};
  tables.landmarks.positions = {Eigen::Vector3d(0.0, 0.0, 2.0)};
  const LandmarkMap bare(std::move(tables));
  EXPECT_EQ(changes_between(bare, visit(wall(), 12)).comparable_first, 0U);
  EXPECT_THAT(changes_between(bare, bare).changes, IsEmpty());
}

TEST(FindChanges, IsTheSameForAnyNumberOfThreadsAndStopsWhenAsked) {
  const LandmarkMap first = visit(with(wall(), box_at(0.2)), 11);
  const LandmarkMap second = visit(wall(), 12);
  const PlacedMap before{.map = &first, .name = "a", .world_from_map = {}};
  const PlacedMap after{.map = &second, .name = "b", .world_from_map = {}};
  const ChangeResult one = find_changes(before, after);
  const ChangeResult two = find_changes(before, after, {}, {.executor = Executor(2)});
  EXPECT_EQ(one.comparable_first, two.comparable_first);
  EXPECT_EQ(one.comparable_second, two.comparable_second);
  EXPECT_EQ(one.repeated, two.repeated);
  ASSERT_THAT(one.changes, SizeIs(1));
  ASSERT_THAT(two.changes, SizeIs(1));
  EXPECT_EQ(one.changes[0].confidence, two.changes[0].confidence);
  EXPECT_EQ(one.changes[0].before->landmarks, two.changes[0].before->landmarks);
  std::stop_source stop;
  stop.request_stop();
  EXPECT_THAT(
      testing::refusal(ErrorKind::kCancelled,
                       [&] { find_changes(before, after, {}, {.stop = stop.get_token()}); }),
      ::testing::HasSubstr("cancelled"));
}

TEST(FindChanges, RefusesInvalidOptions) {
  const LandmarkMap map = visit(wall(), 11);
  const PlacedMap placed{.map = &map, .name = "a", .world_from_map = {}};
  EXPECT_THROW(find_changes(placed, placed, {.tolerance = 0.0}), Error);
  EXPECT_THROW(find_changes(placed, placed, {.reach = std::nan("")}), Error);
  EXPECT_THROW(find_changes(placed, placed, {.min_landmarks = 2}), Error);
  EXPECT_THROW(find_changes(placed, placed, {.min_confidence = 1.0}), Error);
}

}  // namespace
}  // namespace cairn
