// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/alignment/detail/bends/by_parts.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <stop_token>
#include <thread>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "cairn/alignment/align.hpp"
#include "cairn/alignment/bends.hpp"
#include "cairn/core/random.hpp"
#include "cairn/geometry/angles.hpp"
#include "cairn/map/synthetic.hpp"

#include "support/bent_maps.hpp"

namespace cairn {
namespace {

using detail::is_aligned_straightened;
using testing::again;
using testing::bent;
using testing::described_pair;
using testing::Look;
using testing::random_look;
using testing::with_looks;

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
    EXPECT_TRUE(is_aligned_straightened(parts, source, target, {}, {}));
  }
}

// Of places in the target: those of `map` in this pose against those of the map that is not bent in the true one.
struct Errors {
  Errors(const LandmarkMap& map, const Similarity3& pose, const SyntheticPair& truth) {
    std::vector<double> distances;
    for (std::uint32_t i = 0; i < map.landmark_count(); ++i) {
      const Eigen::Vector3d there =
          truth.target_from_source * truth.source.landmarks().positions[i];
      distances.push_back((pose * map.landmarks().positions[i] - there).norm());
    }
    const auto middle = distances.begin() + static_cast<std::ptrdiff_t>(distances.size() / 2);
    std::nth_element(distances.begin(), middle, distances.end());
    median = *middle;
    for (std::uint32_t i = 0; i < map.frame_count(); ++i) {
      const Rigid3 frame = truth.target_from_source * truth.source.world_from_camera(FrameIndex{i});
      const Rigid3 error = frame.inverse() * pose.rigid() * map.world_from_camera(FrameIndex{i});
      largest_turn = std::max(largest_turn, error.angle());
    }
  }
  double median = 0.0;
  double largest_turn = 0.0;  // of keyframes
};

TEST(ByParts, StraightenABentMap) {
  const SyntheticPair pair = described_pair(64);
  const LandmarkMap crooked = bent(pair.source, 8.0);
  const PartsAlignment parts = place_by_parts(PreparedMap(crooked), PreparedMap(pair.target), {});
  ASSERT_TRUE(parts.consensus);
  ASSERT_EQ(parts.bend->map, MapRole::kSource);
  const Errors before(crooked, *parts.target_from_source, pair);
  const Errors after(straightened(crooked, parts), *parts.target_from_source, pair);
  EXPECT_LT(after.median, 0.3 * before.median);
  EXPECT_LT(after.largest_turn, 0.5 * before.largest_turn);
  // The target is bent by as much against the source; what is straightened then is in the target's frame.
  const PartsAlignment back = place_by_parts(PreparedMap(pair.target), PreparedMap(crooked), {});
  ASSERT_TRUE(back.consensus);
  ASSERT_EQ(back.bend->map, MapRole::kTarget);
  const Errors other(straightened(crooked, back), back.target_from_source->inverse(), pair);
  EXPECT_LT(other.median, 0.3 * before.median);
}

TEST(ByParts, StraighteningTurnsCovariancesWithTheirLandmarks) {
  const SyntheticPair pair = described_pair(64);
  const LandmarkMap crooked = bent(pair.source, 8.0);
  const PartsAlignment parts = place_by_parts(PreparedMap(crooked), PreparedMap(pair.target), {});
  ASSERT_TRUE(parts.consensus);
  const LandmarkMap straight = straightened(crooked, parts);
  for (std::uint32_t i = 0; i < straight.landmark_count(); ++i) {
    const Eigen::Matrix3d& before = crooked.landmarks().covariances[i];
    const Eigen::Matrix3d& after = straight.landmarks().covariances[i];
    EXPECT_NEAR(after.trace(), before.trace(), 1e-9 * before.trace());
    EXPECT_NEAR(after.determinant(), before.determinant(), 1e-9 * before.determinant());
  }
  EXPECT_EQ(straight.observation_count(), crooked.observation_count());
}

TEST(ByParts, AreTheSameForAnyNumberOfThreads) {
  const SyntheticPair pair = described_pair(62);
  const PreparedMap source(bent(pair.source, 6.0));
  const PreparedMap target(pair.target);
  AlignOptions options;
  const PartsAlignment one = place_by_parts(source, target, options);
  const PartsAlignment three = place_by_parts(source, target, options, {.executor = Executor(3)});
  ASSERT_TRUE(one.consensus);
  ASSERT_TRUE(three.consensus);
  EXPECT_EQ(one.target_from_source->matrix(), three.target_from_source->matrix());
  EXPECT_EQ(one.covariance, three.covariance);
  EXPECT_EQ(one.bend->rotation_rad, three.bend->rotation_rad);
}

// Several parts of a map may see the same thing, and each be sure of it. The maps as wholes are refused here; a
// thing that is a large share of a map is beyond that verdict too (docs/evidence.md).
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

// The verdict on the whole maps is not the answer if a stop ends the placement of the parts.
TEST(ByParts, AStoppedAlignmentHasNoVerdict) {
  const PreparedMap source(described_pair(61).source);
  const PreparedMap target(described_pair(62).target);
  AlignOptions options;
  options.parts = PartsUse::kNever;
  const double whole_s = align(source, target, options).duration_s;
  options.parts = PartsUse::kWhereRefused;
  const Alignment complete = align(source, target, options);
  ASSERT_TRUE(complete.verdict && complete.parts);
  for (const double share : {0.2, 0.5, 0.8}) {
    std::stop_source stop;
    const std::chrono::duration<double> delay(whole_s + share * (complete.duration_s - whole_s));
    const std::jthread caller([&] {
      std::this_thread::sleep_for(delay);
      stop.request_stop();
    });
    const Alignment alignment = align(source, target, options, {.stop = stop.get_token()});
    // On a busy machine, the stop may come before the parts or after the end.
    if (alignment.verdict) {
      EXPECT_TRUE(alignment.parts) << share;
    } else {
      EXPECT_EQ(status_of(alignment), "cancelled") << share;
    }
  }
}

TEST(ByParts, JudgeAGivenPoseTooIfAlways) {
  const SyntheticPair pair = described_pair(61);
  const PreparedMap source(pair.source);
  const PreparedMap target(pair.target);
  AlignOptions options;
  options.parts = PartsUse::kAlways;
  const Alignment aligned = align(source, target, options);
  ASSERT_TRUE(aligned.target_from_source && aligned.parts) << aligned.reason;
  const Alignment judged = judge_pose(source, target, *aligned.target_from_source, options);
  EXPECT_EQ(judged.verdict, aligned.verdict) << judged.reason;
  EXPECT_EQ(judged.estimate->matrix(), aligned.estimate->matrix());
  ASSERT_TRUE(judged.parts);
  EXPECT_EQ(judged.parts->consensus, aligned.parts->consensus);
  options.parts = PartsUse::kWhereRefused;
  EXPECT_FALSE(judge_pose(source, target, *aligned.target_from_source, options).parts);
}

// The parts of a bent map of free scale have scales of their own, so that the scale is not exact.
TEST(ByParts, StateTheUncertaintyOfAFreeScale) {
  const SyntheticPair pair = described_pair(61);
  const PreparedMap source(bent(pair.source, 8.0));
  const PreparedMap target(pair.target);
  AlignOptions options;
  EXPECT_FALSE(place_by_parts(source, target, options).covariance_with_scale);
  options.scale = ScaleRange{0.5, 2.0};
  const PartsAlignment parts = place_by_parts(source, target, options);
  ASSERT_TRUE(parts.consensus && parts.covariance && parts.covariance_with_scale);
  const Matrix7d& covariance = *parts.covariance_with_scale;
  EXPECT_EQ(Matrix6d(covariance.topLeftCorner<6, 6>()), *parts.covariance);
  EXPECT_EQ(covariance, Matrix7d(covariance.transpose()));
  double squares = 0.0;
  double count = 0.0;
  for (const PartPose& part : parts.parts) {
    if (!part.agrees) continue;
    const double off =
        std::log(part.target_from_source->scale() / parts.target_from_source->scale());
    if (part.map == parts.bend->map) {
      squares += off * off;
      ++count;
    }
  }
  ASSERT_GT(count, 0.0);
  EXPECT_GE(covariance(6, 6), squares / count);
  EXPECT_LT(std::sqrt(covariance(6, 6)), 0.1);
}

TEST(ByParts, NeedTwoPartsOfEitherMap) {
  const SyntheticPair pair = described_pair(63);
  const PreparedMap one(pair.source);
  const PreparedMap small(synthetic_map({.seed = 63, .landmarks = 500, .frames = 20}));
  EXPECT_TRUE(place_by_parts(one, small, {}).parts.empty());
  EXPECT_TRUE(place_by_parts(small, one, {}).parts.empty());
}

}  // namespace
}  // namespace cairn
