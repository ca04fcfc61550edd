// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/detail/keyframe_map.hpp"

#include <algorithm>

#include <gtest/gtest.h>

#include "cairn/core/error.hpp"
#include "cairn/geometry/angles.hpp"

#include "support/textured_wall.hpp"

namespace cairn::detail {
namespace {

using testing::TexturedWall;

class KeyframeMapTest : public ::testing::Test {
 protected:
  TrackedFrame frame_at(std::size_t number, int right) const {
    TrackedFrame frame;
    frame.number = number;
    frame.timestamp_s = static_cast<double>(number);
    frame.features = map_.extractor().extract(wall_.gray(right), TexturedWall::depth_m());
    frame.landmarks.resize(frame.features.size());
    frame.world_from_camera =
        Rigid3(Eigen::Matrix3d::Identity(), {right * TexturedWall::kMetresPerPixel, 0.0, 0.0});
    return frame;
  }

  const TexturedWall wall_;
  KeyframeMap map_{TexturedWall::camera(), FeatureOptions(), SensorNoise()};
};

TEST_F(KeyframeMapTest, AFirstKeyframesLandmarksLieWhereItsCornersAre) {
  const TrackedFrame frame = frame_at(0, 0);
  ASSERT_GT(frame.features.size(), 300U);
  EXPECT_EQ(map_.add_keyframe(frame), 0U);
  const LandmarkGraph& graph = map_.graph();
  ASSERT_EQ(graph.keyframes().size(), 1U);
  EXPECT_GT(graph.landmarks().size(), frame.features.size() / 2);
  for (const TrackedLandmark& landmark : graph.landmarks()) {
    ASSERT_EQ(landmark.observations.size(), 1U);
    const auto keypoint = landmark.observations.front().keypoint;
    EXPECT_NEAR(landmark.position.z(), TexturedWall::kDepthM, 1e-5);
    const Eigen::Vector2d pixel = map_.extractor().pinhole().project(landmark.position);
    EXPECT_LT((pixel - frame.features.keypoints()[keypoint].pixel.cast<double>()).norm(), 1e-3);
  }
}

TEST_F(KeyframeMapTest, ExpectsInAFrameWhatIsInItsViewAndFindsItThere) {
  map_.add_keyframe(frame_at(0, 0));
  const TrackedFrame next = frame_at(1, 120);
  const ExpectedLandmarks expected = map_.expected_in(next);
  // The camera moved to the right: a fifth of the wall went out of its view.
  EXPECT_LT(expected.landmarks.size(), map_.graph().landmarks().size());
  EXPECT_GT(expected.landmarks.size(), map_.graph().landmarks().size() * 6 / 10);
  const auto matches = map_.match_corners(next, expected, 8.0);
  EXPECT_GT(matches.size(), expected.landmarks.size() / 2);
  std::size_t right = 0;
  for (const LandmarkMatch& match : matches) {
    const Eigen::Vector3d in_camera =
        next.world_from_camera.inverse() * map_.graph().landmark(match.landmark).position;
    const Eigen::Vector2d pixel = map_.extractor().pinhole().project(in_camera);
    const auto& keypoint = next.features.keypoints()[match.keypoint];
    if ((pixel - keypoint.pixel.cast<double>()).norm() < 2.5) ++right;
  }
  EXPECT_GT(right, matches.size() * 95 / 100);
}

TEST_F(KeyframeMapTest, ExpectsNothingBehindTheCamera) {
  map_.add_keyframe(frame_at(0, 0));
  TrackedFrame back = frame_at(1, 0);
  back.world_from_camera = Rigid3(rotation_exp({0.0, radians(180.0), 0.0}), {0.0, 0.0, 0.0});
  EXPECT_TRUE(map_.expected_in(back).landmarks.empty());
}

TEST_F(KeyframeMapTest, ASecondKeyframeObservesWhatIsKnownAndAddsWhatIsNew) {
  map_.add_keyframe(frame_at(0, 0));
  const std::size_t before = map_.graph().landmarks().size();
  TrackedFrame next = frame_at(1, 120);
  const ExpectedLandmarks expected = map_.expected_in(next);
  const auto matches = map_.match_corners(next, expected, 8.0);
  for (const LandmarkMatch& match : matches) next.landmarks[match.keypoint] = match.landmark;
  map_.note_found(next, expected);
  map_.add_keyframe(next);
  const auto& landmarks = map_.graph().landmarks();
  EXPECT_GT(landmarks.size(), before) << "what came into view";
  const auto twice = std::count_if(landmarks.begin(), landmarks.end(), [](const auto& landmark) {
    return landmark.observations.size() == 2;
  });
  EXPECT_GE(twice, static_cast<std::ptrdiff_t>(matches.size()));
}

// The wall's images are exact, so that its residuals ask for far less than the least noise.
TEST_F(KeyframeMapTest, EstimatesOfTheNoiseDoNotCompound) {
  const SensorNoise configured = map_.sensor().noise();
  const double least = 0.35 * configured.pixel;
  for (int session = 0; session < 2; ++session) {
    for (int i = 0; i < 6; ++i) {
      const auto number = static_cast<std::size_t>(i);
      TrackedFrame frame = frame_at(number, 20 * i);
      const ExpectedLandmarks expected = map_.expected_in(frame);
      for (const LandmarkMatch& match : map_.match_corners(frame, expected, 8.0)) {
        frame.landmarks[match.keypoint] = match.landmark;
      }
      map_.add_keyframe(frame);
    }
    for (int times = 0; times < 2; ++times) {
      map_.adopt_estimated_noise();
      EXPECT_LT(map_.sensor().noise().pixel, 0.9 * configured.pixel);
      EXPECT_GE(map_.sensor().noise().pixel, least * (1.0 - 1e-12));
    }
    map_.clear();
    EXPECT_EQ(map_.sensor().noise().pixel, configured.pixel) << "the next map starts anew";
    EXPECT_EQ(map_.sensor().noise().depth_quadratic, configured.depth_quadratic);
  }
}

TEST_F(KeyframeMapTest, GivesItsLandmarksAsAMap) {
  map_.add_keyframe(frame_at(0, 0));
  const std::vector<Eigen::Matrix3d> covariances(map_.graph().landmarks().size(),
                                                 1e-4 * Eigen::Matrix3d::Identity());
  const LandmarkMap map = map_.to_map({}, covariances, {});
  EXPECT_EQ(map.frame_count(), 1U);
  EXPECT_EQ(map.landmark_count(), map_.graph().landmarks().size());
  EXPECT_EQ(map.observation_count(), map.landmark_count());
  ASSERT_TRUE(map.landmarks().descriptors);
  MapOptions twice;
  twice.min_observations = 2;
  EXPECT_EQ(map_.to_map(twice, covariances, {}).landmark_count(), 0U);
}

TEST_F(KeyframeMapTest, GivesEachLandmarkTheDescriptorsOfItsDistinctViews) {
  constexpr std::uint32_t kKeyframes = 6;
  for (std::uint32_t i = 0; i < kKeyframes; ++i) {
    TrackedFrame frame = frame_at(i, static_cast<int>(8 * i));
    // The sensor's noise changes what a corner looks like.
    cv::Mat image = wall_.gray(static_cast<int>(8 * i));
    cv::Mat noise(image.size(), CV_8SC1);
    cv::RNG(i + 1).fill(noise, cv::RNG::NORMAL, 0, 10);
    cv::add(image, noise, image, cv::noArray(), CV_8U);
    frame.features = map_.extractor().extract(image, TexturedWall::depth_m());
    frame.landmarks.assign(frame.features.size(), std::nullopt);
    if (i > 0) {
      const ExpectedLandmarks expected = map_.expected_in(frame);
      const auto matches = map_.match_corners(frame, expected, 8.0);
      const auto more = map_.find_without_corners(frame, expected, matches);
      for (const LandmarkMatch& match : matches) frame.landmarks[match.keypoint] = match.landmark;
      for (const LandmarkMatch& match : more) frame.landmarks[match.keypoint] = match.landmark;
    }
    map_.add_keyframe(frame);
  }
  const std::vector<Eigen::Matrix3d> covariances(map_.graph().landmarks().size(),
                                                 1e-4 * Eigen::Matrix3d::Identity());
  const LandmarkMap map = map_.to_map({}, covariances, {});
  const DescriptorColumn& column = *map.landmarks().descriptors;
  std::size_t often = 0;
  std::size_t several = 0;
  for (std::uint32_t i = 0; i < map.landmark_count(); ++i) {
    const std::size_t observations = map.observation_count(LandmarkIndex{i});
    EXPECT_LE(column.count(i), std::min(observations, kDistinctViews));
    EXPECT_GE(column.count(i), 1U);
    often += observations >= 3 ? 1 : 0;
    several += observations >= 3 && column.count(i) >= 3 ? 1 : 0;
  }
  EXPECT_GT(often, map.landmark_count() / 4);
  // Three or more where there are so many observations; at an edge of the image, the view is unknown.
  EXPECT_GT(several, often * 9 / 10);
  MapOptions one;
  one.descriptors_each = 1;
  EXPECT_EQ(map_.to_map(one, covariances, {}).landmarks().descriptors->bytes, column.bytes);
  EXPECT_FALSE(map_.to_map(one, covariances, {}).landmarks().descriptors->has_further());
  for (const std::size_t each : {std::size_t{0}, kMostDescriptorsEach + 1}) {
    one.descriptors_each = each;
    EXPECT_THROW(one.validate(), Error);
  }
}

TEST(IsNewView, IsFarEnoughAwayOrTurned) {
  EXPECT_FALSE(is_new_view(Rigid3()));
  EXPECT_FALSE(is_new_view(Rigid3(rotation_exp({0.0, radians(1.0), 0.0}), {0.01, 0.0, 0.0})));
  EXPECT_TRUE(is_new_view(Rigid3(Eigen::Matrix3d::Identity(), {1.0, 0.0, 0.0})));
  EXPECT_TRUE(is_new_view(Rigid3(rotation_exp({0.0, radians(60.0), 0.0}), {0.0, 0.0, 0.0})));
  // The limits are 0.15 m and 0.17 rad; neither makes up for the other.
  EXPECT_FALSE(is_new_view(Rigid3(rotation_exp({0.0, 0.0, 0.16}), {0.0, 0.14, 0.0})));
  EXPECT_TRUE(is_new_view(Rigid3(rotation_exp({0.0, 0.0, 0.18}), {0.0, 0.0, 0.0})));
  EXPECT_TRUE(is_new_view(Rigid3(rotation_exp({0.0, 0.0, 0.0}), {0.0, 0.16, 0.0})));
}

}  // namespace
}  // namespace cairn::detail
