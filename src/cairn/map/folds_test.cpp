// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/map/folds.hpp"

#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/random.hpp"
#include "cairn/map/detail/covisibility.hpp"
#include "cairn/map/synthetic.hpp"

namespace cairn {
namespace {

using detail::ConnectedFrames;
using detail::Covisibility;
using detail::CovisibleFrames;
using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::SizeIs;

// Landmarks and the frames that see them.
struct Views {
  int landmarks;
  std::vector<std::uint32_t> frames;
};

LandmarkMap map_of(std::uint32_t frames, const std::vector<Views>& all) {
  MapTables tables;
  for (std::uint32_t i = 0; i < frames; ++i) {
    tables.frames.ids.push_back(FrameId{i});
    tables.frames.translations.emplace_back(i, 0.0, 0.0);
    tables.frames.quaternions.push_back({1.0, 0.0, 0.0, 0.0});
  }
  tables.observations.offsets.push_back(0);
  for (const Views& views : all) {
    for (int i = 0; i < views.landmarks; ++i) {
      tables.landmarks.ids.push_back(LandmarkId{tables.landmarks.ids.size()});
      tables.landmarks.positions.emplace_back(i, 0.0, 5.0);
      for (const std::uint32_t frame : views.frames) {
        tables.observations.frames.push_back(FrameIndex{frame});
        tables.observations.pixels.push_back({1.0, 2.0});
      }
      tables.observations.offsets.push_back(tables.observations.frames.size());
    }
  }
  return LandmarkMap(std::move(tables));
}

std::vector<FrameIndex> frames(const std::vector<std::uint32_t>& indices) {
  std::vector<FrameIndex> result;
  for (const std::uint32_t index : indices) result.push_back(FrameIndex{index});
  return result;
}

TEST(Covisibility, IsTheStrongestForest) {
  const Covisibility covisibility(
      map_of(5, {{10, {0, 1}}, {30, {1, 2}}, {20, {0, 2}}, {7, {3, 4}}}));
  std::vector<std::size_t> strengths;
  for (const CovisibleFrames& one : covisibility.forest()) strengths.push_back(one.landmarks);
  EXPECT_THAT(strengths, ElementsAre(30, 20, 7)) << "0 and 1 are connected through 2";
}

TEST(Covisibility, GivesEachFrameToThoseToWhichItIsConnectedMoreStrongly) {
  // 0 - 1 - 2 - 3 - 4 - 5, weak between 2 and 3; 6 is alone.
  const LandmarkMap map =
      map_of(7, {{50, {0, 1}}, {40, {1, 2}}, {8, {2, 3}}, {30, {3, 4}}, {60, {4, 5}}, {5, {6}}});
  const Covisibility covisibility(map);
  const ConnectedFrames group = covisibility.group_of(frames({4}), frames({0}));
  EXPECT_EQ(group.frames, frames({3, 4, 5}));
  EXPECT_DOUBLE_EQ(group.shared, 8.0 / 98.0);
  EXPECT_EQ(covisibility.group_of(frames({0}), frames({4})).frames, frames({0, 1, 2}));
  const ConnectedFrames alone = covisibility.group_of(frames({6}), frames({0}));
  EXPECT_EQ(alone.frames, frames({6}));
  EXPECT_EQ(alone.shared, 0.0);
}

// Frames on a ring look at landmarks around its centre. Those of `second` see copies of the landmarks, as where a model
// takes the back of a can for its front, but for a few in a hundred.
LandmarkMap ring(const std::vector<bool>& second, bool with_times = false) {
  MapTables tables;
  tables.cameras.push_back({CameraId{1}, "PINHOLE", 640, 480, {500.0, 500.0, 320.0, 240.0}});
  std::vector<Rigid3> poses;
  for (std::uint32_t i = 0; i < second.size(); ++i) {
    const double angle = 0.1 * static_cast<double>(i % (second.size() / 2));
    const Eigen::Matrix3d turn = Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitY()).matrix();
    poses.emplace_back(turn, turn * Eigen::Vector3d(0.0, 0.0, -5.0));
    const Eigen::Quaterniond q = poses.back().quaternion();
    tables.frames.ids.push_back(FrameId{i});
    tables.frames.translations.push_back(poses.back().translation());
    tables.frames.quaternions.push_back({q.w(), q.x(), q.y(), q.z()});
    tables.frames.cameras.push_back(CameraIndex{0});
    tables.frames.image_names.push_back("image" + std::to_string(i) + ".jpg");
    if (with_times) tables.frames.timestamps_s.push_back(1.0 + i);
  }
  Random random(3);
  tables.observations.offsets.push_back(0);
  for (std::uint64_t l = 0; l < 400; ++l) {
    const Eigen::Vector3d x(random.uniform(-1.0, 1.0), random.uniform(-1.0, 1.0),
                            random.uniform(-1.0, 1.0));
    tables.landmarks.ids.push_back(LandmarkId{l});
    tables.landmarks.positions.push_back(x);
    const bool is_of_second = l % 2 == 1;
    const bool is_of_both = l % 40 == 0;
    for (std::uint32_t i = 0; i < second.size(); ++i) {
      if (second[i] != is_of_second && !is_of_both) continue;
      tables.observations.frames.push_back(FrameIndex{i});
      tables.observations.pixels.push_back(*project(tables.cameras[0], poses[i].inverse() * x));
    }
    tables.observations.offsets.push_back(tables.observations.frames.size());
  }
  return LandmarkMap(std::move(tables));
}

TEST(SeparateFrames, AreThoseThatSeeTheSamePlaceButNotTheSameLandmarks) {
  std::vector<bool> second(20, false);
  EXPECT_THAT(separate_frames(ring(second)), IsEmpty());
  for (std::size_t i = 12; i < 20; ++i) second[i] = true;
  const std::vector<SeparateFrames> found = separate_frames(ring(second));
  ASSERT_THAT(found, SizeIs(1));
  EXPECT_EQ(found[0].frames, frames({12, 13, 14, 15, 16, 17, 18, 19}));
  EXPECT_LT(found[0].shared, 0.15);
  EXPECT_GT(found[0].usual, 0.4);
}

TEST(SeparateFrames, AreNoneOfASessionThatReturns) {
  std::vector<bool> second(20, false);
  for (std::size_t i = 12; i < 20; ++i) second[i] = true;
  EXPECT_THAT(separate_frames(ring(second, true)), IsEmpty());
  EXPECT_THAT(separate_frames(LandmarkMap(MapTables())), IsEmpty());
  EXPECT_THAT(separate_frames(synthetic_map({.landmarks = 500, .frames = 12})), IsEmpty());
}

}  // namespace
}  // namespace cairn
