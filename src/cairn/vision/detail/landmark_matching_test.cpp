// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/detail/landmark_matching.hpp"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/landmark_graphs.hpp"

namespace cairn::detail {
namespace {

using ::testing::IsEmpty;
using testing::make_true_graph;
using testing::test_sensor;

const cv::Size kImage(640, 480);

std::vector<std::uint32_t> keypoints_of(const std::vector<LandmarkMatch>& matches) {
  std::vector<std::uint32_t> keypoints;
  for (const LandmarkMatch& match : matches) keypoints.push_back(match.keypoint);
  return keypoints;
}

TEST(KeepCommonTurn, KeepsThoseThatTurnAlike) {
  std::vector<LandmarkMatch> matches;
  std::vector<float> turns;
  for (std::uint32_t i = 0; i < 30; ++i) {
    matches.push_back({i, {i}, 0});
    // Two thirds turn by about half a turn, where the angle jumps; the others by anything else.
    const bool common = i % 3 != 0;
    const float jitter = 0.02F * static_cast<float>(static_cast<int>(i % 5) - 2);
    turns.push_back(common ? (i % 2 == 0 ? 3.14F : -3.14F) + jitter
                           : -2.0F + 0.12F * static_cast<float>(i));
  }
  const auto kept = keypoints_of(keep_common_turn(matches, turns));
  for (std::uint32_t i = 0; i < 30; ++i) {
    const bool is_kept = std::find(kept.begin(), kept.end(), i) != kept.end();
    if (i % 3 != 0) {
      EXPECT_TRUE(is_kept) << i;
    } else if (std::abs(std::remainder(turns[i] - 3.14F, 6.2832F)) > 0.7F) {
      EXPECT_FALSE(is_kept) << i;
    }
  }
  EXPECT_THAT(keep_common_turn({}, {}), IsEmpty());
}

// One keyframe with all points, and the frame that is matched with it: the same keypoints.
class MatchNearTest : public ::testing::Test {
 protected:
  MatchNearTest()
      : made_(make_true_graph({.seed = 2,
                               .keyframes = 1,
                               .points = 100,
                               .noise = 0.0,
                               .with_depth = 1.0,
                               .seen_again = 1.0})) {
    const Keyframe& keyframe = made_.graph.keyframes()[0];
    features_ = keyframe.features;
    for (std::uint32_t i = 0; i < features_.size(); ++i) {
      landmarks_.push_back(*keyframe.landmarks[i]);
      const auto appearance = expected_appearance(
          test_sensor(), kImage, made_.graph.landmark(landmarks_.back()),
          keyframe.world_from_camera.inverse(), keyframe.world_from_camera.translation());
      if (!appearance) throw std::logic_error("a keypoint outside the image");
      appearances_.push_back(*appearance);
    }
  }

  std::vector<LandmarkMatch> match(const std::vector<bool>& taken, double radius_pixels = 4.0) {
    return match_near(made_.graph, features_, landmarks_, appearances_, taken, radius_pixels);
  }

  testing::TrueGraph made_;
  Features features_;
  std::vector<LandmarkIndex> landmarks_;
  std::vector<ExpectedAppearance> appearances_;
};

TEST_F(MatchNearTest, FindsEachLandmarkWhereItIs) {
  const auto matches = match(std::vector<bool>(features_.size(), false));
  ASSERT_EQ(matches.size(), features_.size());
  for (std::uint32_t i = 0; i < matches.size(); ++i) {
    EXPECT_EQ(matches[i].keypoint, i) << "ordered by keypoint";
    EXPECT_EQ(matches[i].landmark, landmarks_[i]);
    EXPECT_EQ(matches[i].distance, 0);
  }
}

TEST_F(MatchNearTest, LeavesTakenKeypointsAlone) {
  std::vector<bool> taken(features_.size(), false);
  for (std::size_t i = 0; i < taken.size(); i += 2) taken[i] = true;
  const auto matches = match(taken);
  EXPECT_EQ(matches.size(), features_.size() / 2);
  for (const LandmarkMatch& found : matches) EXPECT_FALSE(taken[found.keypoint]);
}

TEST_F(MatchNearTest, LooksWithinTheRadiusOnly) {
  const std::vector<bool> free(features_.size(), false);
  for (ExpectedAppearance& appearance : appearances_) {
    appearance.pixel.x() += 3.0;
    appearance.octave = 0.0;
    appearance.cos_view = 0.9;
  }
  // Keypoints on octaves that are not near the expected one do not count.
  std::size_t near_octave = 0;
  for (const Keypoint& keypoint : features_.keypoints())
    near_octave += keypoint.octave <= 1 ? 1 : 0;
  EXPECT_EQ(match(free, 3.5).size(), near_octave);
  EXPECT_THAT(match(free, 2.5), IsEmpty());
}

TEST_F(MatchNearTest, AnotherLandmarkIsNoMatch) {
  const std::vector<bool> free(features_.size(), false);
  Random random(4);
  for (const LandmarkIndex index : landmarks_) {
    made_.graph.landmark(index).descriptor = testing::random_descriptor(random);
  }
  EXPECT_LE(match(free, 10.0).size(), 1U);
}

TEST_F(MatchNearTest, AKeypointGoesToTheMostSimilarLandmark) {
  LandmarkGraph& graph = made_.graph;
  // A rival at the same place, one bit off.
  TrackedLandmark rival = graph.landmark(landmarks_[0]);
  rival.descriptor[0] ^= 1;
  graph.landmarks().push_back(rival);
  landmarks_.insert(landmarks_.begin(), {static_cast<std::uint32_t>(graph.landmarks().size() - 1)});
  appearances_.insert(appearances_.begin(), appearances_[0]);
  const auto matches = match(std::vector<bool>(features_.size(), false));
  ASSERT_EQ(matches.size(), features_.size());
  EXPECT_EQ(matches[0].landmark, landmarks_[1]);
}

TEST_F(MatchNearTest, DescriptorsAloneFindThemToo) {
  const auto matches = match_by_descriptor(made_.graph, 0, features_);
  ASSERT_EQ(matches.size(), features_.size());
  for (std::uint32_t i = 0; i < matches.size(); ++i) EXPECT_EQ(matches[i].landmark, landmarks_[i]);
  const Features none = testing::features_of({}, {});
  EXPECT_THAT(match_by_descriptor(made_.graph, 0, none), IsEmpty());
}

TEST(ExpectedAppearance, NothingThatCannotBeSeen) {
  const SensorModel& sensor = test_sensor();
  TrackedLandmark landmark;
  landmark.position = {0.0, 0.0, 2.0};
  landmark.viewing_direction = Eigen::Vector3d::UnitZ();
  landmark.reference_distance_m = 2.0;
  const auto from = [&](const Rigid3& world_from_camera) {
    return expected_appearance(sensor, kImage, landmark, world_from_camera.inverse(),
                               world_from_camera.translation());
  };
  const auto here = from({});
  ASSERT_TRUE(here);
  EXPECT_NEAR((here->pixel - Eigen::Vector2d(319.5, 239.5)).norm(), 0.0, 1e-9);
  EXPECT_NEAR(here->octave, 0.0, 1e-9);
  EXPECT_NEAR(here->cos_view, 1.0, 1e-9);
  const auto nearer = from(Rigid3::from_roll_pitch_yaw({0, 0, 2.0 - 2.0 / 1.44}, 0, 0, 0));
  ASSERT_TRUE(nearer);
  EXPECT_NEAR(nearer->octave, 2.0, 1e-9);
  EXPECT_FALSE(from(Rigid3::from_roll_pitch_yaw({0, 0, 3}, 0, 0, 0))) << "behind";
  EXPECT_FALSE(from(Rigid3::from_roll_pitch_yaw({0, 0, 1.95}, 0, 0, 0))) << "too near";
  EXPECT_FALSE(from(Rigid3::from_roll_pitch_yaw({0, 0, -10}, 0, 0, 0))) << "too far";
  EXPECT_FALSE(from(Rigid3::from_roll_pitch_yaw({0, 0, 0}, 0, 1.0, 0))) << "outside the image";
  // From the side, at the same distance.
  EXPECT_FALSE(from(Rigid3::from_roll_pitch_yaw({-2, 0, 2}, 0, 1.5708, 0)));
}

}  // namespace
}  // namespace cairn::detail
