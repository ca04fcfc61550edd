// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/merging/changes.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/error.hpp"
#include "cairn/core/random.hpp"
#include "cairn/geometry/angles.hpp"
#include "cairn/map/camera.hpp"

namespace cairn {
namespace {

using ::testing::IsEmpty;
using ::testing::SizeIs;

constexpr std::size_t kBytes = 32;

// A point that features are found at, with what it looks like.
struct Spot {
  Eigen::Vector3d position;
  std::vector<std::uint8_t> look;
};

std::vector<Spot> spots_in(const Eigen::Vector3d& low, const Eigen::Vector3d& high,
                           std::size_t count, std::uint64_t seed) {
  Random random(seed);
  std::vector<Spot> spots(count);
  for (Spot& spot : spots) {
    for (int axis = 0; axis < 3; ++axis) {
      spot.position[axis] = low[axis] + random.uniform(0.0, 1.0) * (high[axis] - low[axis]);
    }
    for (std::size_t k = 0; k < kBytes; ++k) {
      spot.look.push_back(static_cast<std::uint8_t>(random.index(256)));
    }
  }
  return spots;
}

std::vector<Spot> moved(std::vector<Spot> spots, const Rigid3& motion) {
  for (Spot& spot : spots) spot.position = motion * spot.position;
  return spots;
}

// A wall 3 m off; cameras in a row before it look along z.
std::vector<Spot> wall() {
  return spots_in({-2.0, -1.0, 3.0}, {2.0, 1.0, 3.02}, 900, 1);
}

constexpr double kFocal = 300.0;
constexpr int kWidth = 640;
constexpr int kHeight = 480;

// The map of a visit to spots: some of them are found, in a random order, by the cameras that see them.
LandmarkMap visit(const std::vector<Spot>& spots, std::uint64_t seed, double found = 0.7,
                  double shift = 0.0) {
  Random random(seed);
  MapTables tables;
  Camera camera;
  camera.model = "PINHOLE";
  camera.width = kWidth;
  camera.height = kHeight;
  camera.parameters = {kFocal, kFocal, 320.0, 240.0};
  tables.cameras.push_back(camera);
  constexpr std::uint32_t kFrames = 8;
  for (std::uint32_t f = 0; f < kFrames; ++f) {
    tables.frames.ids.push_back(FrameId{f});
    tables.frames.translations.emplace_back(-0.7 + 0.2 * f + shift, 0.0, 0.0);
    tables.frames.quaternions.push_back({1.0, 0.0, 0.0, 0.0});
    tables.frames.cameras.push_back(CameraIndex{0});
  }
  DescriptorColumn looks{.kind = "test", .bytes_each = kBytes, .known = {}, .bytes = {}};
  tables.observations.offsets.push_back(0);
  for (const Spot& spot : spots) {
    if (random.uniform(0.0, 1.0) > found) continue;
    std::size_t seen = 0;
    const Eigen::Vector3d noise(random.normal(), random.normal(), random.normal());
    const Eigen::Vector3d position = spot.position + 0.004 * noise;
    for (std::uint32_t f = 0; f < kFrames; ++f) {
      const Eigen::Vector3d x = position - tables.frames.translations[f];
      const Pixel pixel{kFocal * x.x() / x.z() + 320.0, kFocal * x.y() / x.z() + 240.0};
      if (pixel.u < 0 || pixel.v < 0 || pixel.u > kWidth || pixel.v > kHeight) continue;
      tables.observations.frames.push_back(FrameIndex{f});
      tables.observations.pixels.push_back(pixel);
      ++seen;
    }
    if (seen == 0) continue;
    tables.landmarks.ids.push_back(LandmarkId{tables.landmarks.ids.size()});
    tables.landmarks.positions.push_back(position);
    tables.observations.offsets.push_back(tables.observations.frames.size());
    looks.known.push_back(1);
    looks.bytes.insert(looks.bytes.end(), spot.look.begin(), spot.look.end());
  }
  tables.landmarks.descriptors = std::move(looks);
  return LandmarkMap(std::move(tables));
}

std::vector<Spot> with(std::vector<Spot> spots, const std::vector<Spot>& more) {
  spots.insert(spots.end(), more.begin(), more.end());
  return spots;
}

std::vector<Spot> box_at(double x) {
  return spots_in({x, -0.1, 2.0}, {x + 0.3, 0.2, 2.1}, 80, 7);
}

ChangeResult changes_between(const LandmarkMap& first, const LandmarkMap& second) {
  return find_changes({.map = &first, .name = "a", .world_from_map = {}},
                      {.map = &second, .name = "b", .world_from_map = {}});
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
