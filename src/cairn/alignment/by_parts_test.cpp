// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/alignment/by_parts.hpp"

#include <algorithm>
#include <array>
#include <cstdint>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "cairn/alignment/align.hpp"
#include "cairn/alignment/straightened.hpp"
#include "cairn/core/random.hpp"
#include "cairn/geometry/angles.hpp"
#include "cairn/map/synthetic.hpp"

namespace cairn {
namespace {

using Look = std::array<std::uint8_t, 32>;

Look random_look(Random& random) {
  Look look;
  for (std::uint8_t& byte : look) byte = static_cast<std::uint8_t>(random.index(256));
  return look;
}

// As another session sees it.
Look again(Look look, Random& random) {
  for (int i = 0; i < 12; ++i) {
    look[random.index(look.size())] ^= static_cast<std::uint8_t>(1U << random.index(8));
  }
  return look;
}

LandmarkMap with_looks(const LandmarkMap& map, const std::vector<Look>& looks) {
  MapTables tables = LandmarkMap(map).tables();
  DescriptorColumn column{"ORB", 32, {}, {}};
  for (const Look& look : looks) {
    column.known.push_back(1);
    column.bytes.insert(column.bytes.end(), look.begin(), look.end());
  }
  tables.landmarks.descriptors = std::move(column);
  return LandmarkMap(std::move(tables));
}

// Two sessions of one desk whose common landmarks look alike.
SyntheticPair described_pair(std::uint64_t seed) {
  SyntheticPair pair = synthetic_pair({.seed = seed, .landmarks = 3600, .frames = 60});
  Random random(seed);
  std::vector<Look> of_source;
  std::vector<Look> of_target;
  for (std::size_t i = 0; i < pair.source.landmark_count(); ++i) {
    of_source.push_back(random_look(random));
  }
  for (std::size_t i = 0; i < pair.target.landmark_count(); ++i) {
    of_target.push_back(random_look(random));
  }
  for (const auto& [source, target] : pair.shared) {
    of_target[target.value] = again(of_source[source.value], random);
  }
  pair.source = with_looks(pair.source, of_source);
  pair.target = with_looks(pair.target, of_target);
  return pair;
}

// Turned more and more from the first keyframe to the last, about the middle of the map.
LandmarkMap bent(const LandmarkMap& map, double degrees_bent) {
  MapTables tables = LandmarkMap(map).tables();
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& position : tables.landmarks.positions) centre += position;
  centre /= static_cast<double>(tables.landmarks.positions.size());
  const auto turn = [&](std::uint32_t frame) {
    const double share =
        static_cast<double>(frame) / static_cast<double>(tables.frames.ids.size() - 1);
    return rotation_exp(radians(degrees_bent) * share * Eigen::Vector3d(0.6, 0.0, 0.8));
  };
  for (std::uint32_t i = 0; i < tables.landmarks.positions.size(); ++i) {
    const auto seen = map.observing_frames(LandmarkIndex{i});
    const auto rotation = turn(seen[(seen.size() - 1) / 2].value);
    Eigen::Vector3d& position = tables.landmarks.positions[i];
    position = centre + rotation * (position - centre);
  }
  for (std::uint32_t i = 0; i < tables.frames.ids.size(); ++i) {
    Eigen::Vector3d& position = tables.frames.translations[i];
    position = centre + turn(i) * (position - centre);
  }
  return LandmarkMap(std::move(tables));
}

// Landmarks of one thing, and what each looks like.
struct Thing {
  std::vector<Eigen::Vector3d> positions;
  std::vector<Look> looks;
};

Thing random_thing(std::uint64_t seed, std::size_t landmarks, double radius) {
  Random random(seed);
  Thing thing;
  while (thing.positions.size() < landmarks) {
    const Eigen::Vector3d at(random.uniform(-1.0, 1.0), random.uniform(-1.0, 1.0),
                             random.uniform(-1.0, 1.0));
    if (at.norm() > 1.0) continue;
    thing.positions.emplace_back(radius * at);
    thing.looks.push_back(random_look(random));
  }
  return thing;
}

// A place of its own with the thing in it, seen by all keyframes from `first` on up to `end`.
LandmarkMap place_with(const Thing& thing, std::uint64_t seed, std::uint32_t first,
                       std::uint32_t end) {
  const LandmarkMap place = synthetic_map({.seed = seed, .landmarks = 3000, .frames = 60});
  MapTables tables = LandmarkMap(place).tables();
  Random random(seed);
  std::vector<Look> looks;
  for (std::size_t i = 0; i < place.landmark_count(); ++i) looks.push_back(random_look(random));
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& position : tables.landmarks.positions) centre += position;
  centre /= static_cast<double>(place.landmark_count());
  std::uint64_t id = 0;
  for (const LandmarkId used : tables.landmarks.ids) id = std::max(id, used.value + 1);
  const Eigen::Quaterniond turn =
      Eigen::Quaterniond(random.normal(), random.normal(), random.normal(), random.normal())
          .normalized();
  for (std::size_t i = 0; i < thing.positions.size(); ++i) {
    const Eigen::Vector3d noise(random.normal(), random.normal(), random.normal());
    tables.landmarks.ids.push_back(LandmarkId{id + i});
    tables.landmarks.positions.emplace_back(centre + turn * thing.positions[i] + 0.001 * noise);
    tables.landmarks.covariances.emplace_back(1e-6 * Eigen::Matrix3d::Identity());
    looks.push_back(again(thing.looks[i], random));
    const auto from = static_cast<std::uint32_t>(first + random.index(end - first - 3));
    for (std::uint32_t frame = from; frame < from + 3; ++frame) {
      tables.observations.frames.push_back(FrameIndex{frame});
      tables.observations.pixels.push_back(place.observed_pixels(LandmarkIndex{0})[0]);
    }
    tables.observations.offsets.push_back(tables.observations.frames.size());
  }
  tables.landmarks.colors = {};
  tables.landmarks.columns.clear();
  tables.observations.depths = {};
  tables.observations.keypoints = {};
  tables.observations.octaves = {};
  return with_looks(LandmarkMap(std::move(tables)), looks);
}

TEST(ByParts, AgreeOnABentMapAndSayHowFarItBends) {
  const SyntheticPair pair = described_pair(61);
  for (const double angle : {0.0, 4.0, 8.0}) {
    const PreparedMap source(bent(pair.source, angle));
    const PreparedMap target(pair.target);
    const PartsAlignment parts = place_by_parts(source, target, {});
    ASSERT_TRUE(parts.consensus) << angle;
    EXPECT_EQ(parts.bend->map, angle > 0.0 ? MapRole::kSource : parts.bend->map);
    // The parts' middles are nearer than the first and the last keyframe.
    EXPECT_NEAR(degrees(parts.bend->rotation_rad), 0.8 * angle, 1.5);
    EXPECT_TRUE(is_aligned_straightened(parts, source, target, {}));
  }
}

TEST(ByParts, AreTheSameForAnyNumberOfThreads) {
  const SyntheticPair pair = described_pair(62);
  const PreparedMap source(bent(pair.source, 6.0));
  const PreparedMap target(pair.target);
  PlaceOptions options;
  const PartsAlignment one = place_by_parts(source, target, options);
  options.execution.executor = Executor(3);
  const PartsAlignment three = place_by_parts(source, target, options);
  ASSERT_TRUE(one.consensus);
  ASSERT_TRUE(three.consensus);
  EXPECT_EQ(one.target_from_source->matrix(), three.target_from_source->matrix());
  EXPECT_EQ(one.covariance, three.covariance);
  EXPECT_EQ(one.bend->rotation_rad, three.bend->rotation_rad);
}

// Several parts of a map may see the same thing, and each be sure of it. The maps as wholes are refused here; a
// thing that is a large share of a map is beyond that verdict too (docs/method.md).
TEST(ByParts, AcceptNoTwoPlacesForOneThingThatStandsInBoth) {
  int convincing = 0;
  for (const std::size_t landmarks : {60, 90, 120, 180, 240, 480}) {
    const Thing thing = random_thing(7, landmarks, 0.12);
    const LandmarkMap source = place_with(thing, 71, 20, 40);
    const LandmarkMap target = place_with(thing, 72, 20, 40);
    for (const PartsUse parts : {PartsUse::kNever, PartsUse::kWhereRefused}) {
      AlignOptions options;
      options.parts = parts;
      const Alignment alignment = align(source, target, options);
      EXPECT_NE(alignment.verdict, Verdict::kAligned) << landmarks << ": " << alignment.reason;
      if (alignment.probability >= 0.99) ++convincing;
    }
  }
  EXPECT_GT(convincing, 0) << "the thing must be enough to convince, or this tests nothing";
}

TEST(ByParts, NeedTwoPartsOfEitherMap) {
  const SyntheticPair pair = described_pair(63);
  const PreparedMap source(pair.source);
  const PreparedMap small(pair.target, {.cut = {.parts = 1}});
  EXPECT_TRUE(place_by_parts(source, small, {}).parts.empty());
  EXPECT_TRUE(place_by_parts(small, source, {}).parts.empty());
}

}  // namespace
}  // namespace cairn
