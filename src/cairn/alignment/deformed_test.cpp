// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/alignment/align.hpp"
#include "cairn/alignment/bends.hpp"
#include "cairn/alignment/prepared_map.hpp"
#include "cairn/core/random.hpp"
#include "cairn/geometry/angles.hpp"
#include "cairn/geometry/detail/centroid.hpp"
#include "cairn/map/synthetic.hpp"

#include "support/bent_maps.hpp"

namespace cairn {
namespace {

using testing::deformed_by;
using testing::described_pair;
using testing::Stretch;

AlignOptions of_free_scale() {
  AlignOptions options;
  options.scale = ScaleRange{0.5, 2.0};
  options.parts = PartsUse::kNever;
  return options;
}

double median_distance(const LandmarkMap& map, const Similarity3& pose,
                       const SyntheticPair& truth) {
  std::vector<double> distances;
  for (std::uint32_t i = 0; i < map.landmark_count(); ++i) {
    const Eigen::Vector3d there = truth.target_from_source * truth.source.landmarks().positions[i];
    distances.push_back((pose * map.landmarks().positions[i] - there).norm());
  }
  const auto middle = distances.begin() + static_cast<std::ptrdiff_t>(distances.size() / 2);
  std::nth_element(distances.begin(), middle, distances.end());
  return *middle;
}

TEST(DeformedMaps, AreAlignedAndTheDeformationIsStated) {
  const SyntheticPair pair = described_pair(61);
  const Stretch truth(pair.source);
  const LandmarkMap source = deformed_by(truth, pair.source);
  AlignOptions options = of_free_scale();
  options.deformation = false;
  const Alignment rigid = align(source, pair.target, options);
  EXPECT_NE(rigid.verdict, Verdict::kAligned) << "else the deformation is too small for this test";
  EXPECT_FALSE(rigid.deformation);
  options.deformation = true;
  const Alignment found = align(source, pair.target, options);
  ASSERT_EQ(found.verdict, Verdict::kAligned) << found.reason;
  EXPECT_GE(*found.probability, 0.99);
  EXPECT_THAT(found.reason, ::testing::HasSubstr("deformed against each other"));
  ASSERT_TRUE(found.deformation);
  std::vector<double> scales;
  for (const Eigen::Vector3d& x : pair.source.landmarks().positions) {
    scales.push_back(truth.scale(x));
  }
  std::sort(scales.begin(), scales.end());
  const std::size_t edge = scales.size() / 20;
  const double ratio = scales[scales.size() - 1 - edge] / scales[edge];
  EXPECT_NEAR(found.deformation->scale_ratio, ratio, 0.2 * (ratio - 1.0));
  // The single pose is that of the middle.
  EXPECT_LT(median_distance(source, *found.target_from_source, pair), 0.1 * truth.radius());
  ASSERT_TRUE(found.registration.covariance_with_scale);
  EXPECT_NEAR(std::sqrt((*found.registration.covariance_with_scale)(6, 6)), 0.1, 0.05)
      << "the local scales differ from the single one by so much";
  double sum = 0.0;
  for (const PlacementCandidate& candidate : found.candidates) sum += candidate.probability;
  EXPECT_LE(sum, 1.0 + 1e-9);
}

TEST(DeformedMaps, AreStraightened) {
  const SyntheticPair pair = described_pair(62);
  const Stretch truth(pair.source, 2.0);
  const LandmarkMap source = deformed_by(truth, pair.source);
  const PreparedMap from(source);
  const PreparedMap to(pair.target);
  const DeformablePair both(from, to);
  const auto pose = both.fit(std::array{Similarity3(pair.target_from_source)});
  ASSERT_TRUE(pose);
  EXPECT_LT(pose->residual, 0.2);
  const LandmarkMap straight = straightened(source, *pose);
  EXPECT_LT(median_distance(straight, pose->target_from_source, pair),
            0.1 * median_distance(source, pose->target_from_source, pair));
  EXPECT_EQ(straight.observation_count(), source.observation_count());
  // A camera still sees what it saw.
  const auto seen = [](const LandmarkMap& map, const Rigid3& camera, FrameIndex frame) {
    std::vector<Eigen::Vector3d> directions;
    for (std::uint32_t i = 0; i < map.landmark_count(); ++i) {
      const auto frames = map.observing_frames(LandmarkIndex{i});
      if (std::find(frames.begin(), frames.end(), frame) == frames.end()) continue;
      directions.emplace_back((camera.inverse() * map.landmarks().positions[i]).normalized());
    }
    return directions;
  };
  for (const std::uint32_t index : {0U, 20U, 59U}) {
    const FrameIndex frame{index};
    const auto before = seen(source, source.world_from_camera(frame), frame);
    const auto after = seen(straight, straight.world_from_camera(frame), frame);
    const auto unmoved = seen(straight, source.world_from_camera(frame), frame);
    double off = 0.0;
    double off_unmoved = 0.0;
    for (std::size_t i = 0; i < before.size(); ++i) {
      off += (after[i] - before[i]).norm();
      off_unmoved += (unmoved[i] - before[i]).norm();
    }
    EXPECT_LT(off, 0.95 * off_unmoved) << index;
  }
}

TEST(DeformedMaps, ThatAreNotDeformedStayAsTheyAre) {
  const SyntheticPair pair = described_pair(63);
  AlignOptions options = of_free_scale();
  const Alignment with = align(pair.source, pair.target, options);
  options.deformation = false;
  const Alignment without = align(pair.source, pair.target, options);
  ASSERT_EQ(with.verdict, Verdict::kAligned);
  EXPECT_FALSE(with.deformation);
  EXPECT_EQ(with.target_from_source->matrix(), without.target_from_source->matrix());
  EXPECT_EQ(with.registration.covariance, without.registration.covariance);
}

// A deformation that was fitted to wrong matches does not make the other matches agree.
TEST(DeformedMaps, OfDifferentPlacesDoNotFit) {
  const LandmarkMap one = described_pair(64).source;
  const LandmarkMap other = described_pair(65).target;
  const PreparedMap source(one);
  const PreparedMap target(other);
  const DeformablePair pair(source, target);
  Random random(66);
  AlignOptions options;
  options.scale = ScaleRange{0.5, 2.0};
  for (int i = 0; i < 50; ++i) {
    const Eigen::Quaterniond turn(random.normal(), random.normal(), random.normal(),
                                  random.normal());
    const Eigen::Vector3d shift(random.normal(), random.normal(), random.normal());
    const Rigid3 rotation(turn, Eigen::Vector3d::Zero());
    const Similarity3 start(Rigid3(turn, centroid(other.landmarks().positions) -
                                             rotation * centroid(one.landmarks().positions) +
                                             0.3 * Stretch(other).radius() * shift));
    const auto pose = pair.fit(std::array{start});
    EXPECT_TRUE(!pose || pair.judge(*pose, options).verdict != Verdict::kAligned);
  }
}

// Landmarks of the source whose partners in the target are those of others look like matches, and none agrees.
TEST(DeformedMaps, FitOnlyIfTheMatchesDo) {
  const SyntheticPair pair = described_pair(67);
  MapTables tables = LandmarkMap(pair.source).tables();
  std::rotate(tables.landmarks.descriptors->bytes.begin(),
              tables.landmarks.descriptors->bytes.begin() + 32 * 101,
              tables.landmarks.descriptors->bytes.end());
  const LandmarkMap shuffled(std::move(tables));
  const PreparedMap source(shuffled);
  const PreparedMap target(pair.target);
  const DeformablePair both(source, target);
  const auto pose = both.fit(std::array{Similarity3(pair.target_from_source)});
  AlignOptions options;
  options.scale = ScaleRange{0.5, 2.0};
  EXPECT_TRUE(!pose || both.judge(*pose, options).verdict != Verdict::kAligned);
}

// A single pose means nothing then, whatever the evidence.
TEST(DeformedMaps, AreNotAlignedIfTheDeformationIsLarge) {
  const SyntheticPair pair = described_pair(61);
  for (const auto& [factor, small] : {std::pair(1.0, true), {3.0, false}}) {
    const LandmarkMap large = deformed_by(Stretch(pair.source, factor), pair.source);
    const PreparedMap source(large);
    const PreparedMap target(pair.target);
    const DeformablePair both(source, target);
    const auto pose = both.fit(std::array{Similarity3(pair.target_from_source)});
    ASSERT_TRUE(pose) << factor;
    EXPECT_EQ(pose->is_small, small);
    AlignOptions options;
    options.scale = ScaleRange{0.5, 2.0};
    EXPECT_EQ(both.judge(*pose, options).verdict == Verdict::kAligned, small);
    AlignOptions options_of_parts = of_free_scale();
    options_of_parts.parts = PartsUse::kWhereRefused;
    const Alignment alignment = align(large, pair.target, options_of_parts);
    EXPECT_EQ(alignment.verdict == Verdict::kAligned, small) << alignment.reason;
    EXPECT_EQ(alignment.target_from_source.has_value(), small);
  }
}

TEST(DeformedMaps, AreNotAlignedByAPoseThatIsNotAllowed) {
  const SyntheticPair pair = described_pair(61);
  const LandmarkMap source = deformed_by(Stretch(pair.source), pair.source);
  AlignOptions options = of_free_scale();
  const Alignment free = align(source, pair.target, options);
  ASSERT_EQ(free.verdict, Verdict::kAligned) << free.reason;
  // A part of the map has a smaller scale than the whole.
  options.scale->most = free.target_from_source->scale() / 1.05;
  const Alignment narrow = align(source, pair.target, options);
  EXPECT_NE(narrow.verdict, Verdict::kAligned);
  EXPECT_THAT(narrow.reason, ::testing::HasSubstr("but the pose has a scale of"));
  EXPECT_FALSE(narrow.target_from_source);
}

// As align() judges its own.
TEST(DeformedMaps, AreSoForAGivenPoseToo) {
  const SyntheticPair pair = described_pair(61);
  const PreparedMap target(pair.target);
  AlignOptions options = of_free_scale();
  int stated = 0;
  for (const double factor : {0.2, 0.4, 0.6}) {
    const LandmarkMap source = deformed_by(Stretch(pair.source, factor), pair.source);
    const PreparedMap prepared(source);
    options.deformation = false;
    const Alignment rigid = align(prepared, target, options);
    options.deformation = true;
    const Alignment found = align(prepared, target, options);
    if (rigid.verdict != Verdict::kAligned || !found.deformation) continue;
    ++stated;
    const Alignment judged = judge_pose(prepared, target, *rigid.target_from_source, options);
    EXPECT_EQ(judged.verdict, found.verdict) << judged.reason;
    EXPECT_EQ(judged.estimate->matrix(), rigid.estimate->matrix());
    ASSERT_TRUE(judged.deformation) << factor;
    EXPECT_NEAR(judged.deformation->scale_ratio, found.deformation->scale_ratio, 1e-3);
  }
  EXPECT_GT(stated, 0) << "else this shows nothing";
}

TEST(DeformedMaps, NeedDescriptors) {
  const SyntheticPair pair = synthetic_pair({.seed = 68, .landmarks = 500, .frames = 16});
  const PreparedMap source(pair.source);
  const PreparedMap target(pair.target);
  const DeformablePair both(source, target);
  EXPECT_FALSE(both.fit(std::array{Similarity3(pair.target_from_source)}));
  EXPECT_FALSE(both.fit({}));
}

TEST(DeformedMaps, AreTheSameForAnyNumberOfThreads) {
  const SyntheticPair pair = described_pair(61);
  const LandmarkMap source = deformed_by(Stretch(pair.source), pair.source);
  AlignOptions options = of_free_scale();
  const Alignment one = align(source, pair.target, options);
  const Alignment three = align(source, pair.target, options, {.executor = Executor(3)});
  ASSERT_TRUE(one.deformation && three.deformation);
  EXPECT_EQ(one.target_from_source->matrix(), three.target_from_source->matrix());
  EXPECT_EQ(one.registration.covariance, three.registration.covariance);
  EXPECT_EQ(one.reason, three.reason);
}

}  // namespace
}  // namespace cairn
