// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/detail/landmark_graph.hpp"

#include <algorithm>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/landmark_graphs.hpp"

namespace cairn::detail {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using testing::kTestPinhole;
using testing::make_true_graph;
using ::testing::Pair;

// What holds at any time: each side of the relation says what the other says, a keyframe observes a
// landmark once, and a patch was cut at an observation.
void expect_consistent(const LandmarkGraph& graph) {
  std::size_t from_keypoints = 0;
  for (std::uint32_t k = 0; k < graph.keyframes().size(); ++k) {
    const Keyframe& keyframe = graph.keyframes()[k];
    ASSERT_EQ(keyframe.landmarks.size(), keyframe.features.size());
    for (std::uint32_t i = 0; i < keyframe.landmarks.size(); ++i) {
      if (!keyframe.landmarks[i]) continue;
      ++from_keypoints;
      const auto& observations = graph.landmark(*keyframe.landmarks[i]).observations;
      ASSERT_EQ(std::count(observations.begin(), observations.end(), KeypointReference{k, i}), 1);
    }
  }
  std::size_t from_landmarks = 0;
  for (const TrackedLandmark& landmark : graph.landmarks()) {
    std::set<std::uint32_t> keyframes;
    for (const KeypointReference& reference : landmark.observations) {
      keyframes.insert(reference.keyframe);
      const Keyframe& keyframe = graph.keyframes()[reference.keyframe];
      ASSERT_TRUE(keyframe.landmarks[reference.keypoint]);
      ASSERT_EQ(&graph.landmark(*keyframe.landmarks[reference.keypoint]), &landmark);
    }
    from_landmarks += landmark.observations.size();
    ASSERT_EQ(keyframes.size(), landmark.observations.size());
    if (!landmark.gone() && landmark.appearance) {
      ASSERT_EQ(std::count(landmark.observations.begin(), landmark.observations.end(),
                           landmark.appearance->seen_at),
                1);
    }
  }
  ASSERT_EQ(from_keypoints, from_landmarks);
}

KeypointReference any_keypoint(const LandmarkGraph& graph, Random& random) {
  const auto keyframe = static_cast<std::uint32_t>(random.index(graph.keyframes().size()));
  const std::size_t count = graph.keyframes()[keyframe].features.size();
  return {keyframe, static_cast<std::uint32_t>(random.index(count))};
}

TEST(LandmarkGraph, BothSidesAgreeWhateverIsDone) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    LandmarkGraph graph = make_true_graph({.seed = seed, .keyframes = 6, .points = 40}).graph;
    expect_consistent(graph);
    Random random(seed);
    for (int step = 0; step < 2000; ++step) {
      const LandmarkIndex a{static_cast<std::uint32_t>(random.index(graph.landmarks().size()))};
      const LandmarkIndex b{static_cast<std::uint32_t>(random.index(graph.landmarks().size()))};
      const KeypointReference at = any_keypoint(graph, random);
      Keyframe& keyframe = graph.keyframes()[at.keyframe];
      switch (random.index(6)) {
        case 0:
          graph.forget(at);
          EXPECT_FALSE(keyframe.landmarks[at.keypoint]);
          break;
        case 1:
          if (random.chance(0.1)) graph.remove(a);
          break;
        case 2:
          if (a.value != b.value && !graph.landmark(b).gone() && random.chance(0.2)) {
            graph.merge(a, b);
            EXPECT_TRUE(graph.landmark(a).gone());
          }
          break;
        case 3:
          if (!keyframe.landmarks[at.keypoint]) graph.add_landmark(at);
          break;
        case 4:
          if (const auto index = keyframe.landmarks[at.keypoint]) {
            graph.landmark(*index).appearance = LandmarkAppearance{at, {}};
          }
          break;
        default:
          if (!keyframe.landmarks[at.keypoint] && !graph.landmark(a).gone() &&
              !graph.observes(at.keyframe, a)) {
            graph.observe(a, at);
            graph.refresh(a);
          }
      }
    }
    expect_consistent(graph);
  }
}

TEST(LandmarkGraph, ANewLandmarkIsWhereItsDepthSays) {
  LandmarkGraph graph(testing::test_sensor());
  Keyframe keyframe;
  keyframe.frame = 7;
  keyframe.world_from_camera = Rigid3::from_roll_pitch_yaw({1.0, 2.0, 3.0}, 0.1, 0.2, 0.3);
  Keypoint keypoint;
  keypoint.pixel = {100.0F, 80.0F};
  keypoint.depth_m = 2.5F;
  keyframe.features = testing::features_of({keypoint}, {{1, 2, 3, 4}});
  const Rigid3 pose = keyframe.world_from_camera;
  const LandmarkIndex index = graph.add_landmark({graph.add_keyframe(std::move(keyframe)), 0});
  const TrackedLandmark& landmark = graph.landmark(index);
  const Eigen::Vector3d x = pose.inverse() * landmark.position;
  EXPECT_NEAR(x.z(), 2.5, 1e-12);
  EXPECT_LT((kTestPinhole.project(x) - Eigen::Vector2d(100.0, 80.0)).norm(), 1e-9);
  EXPECT_EQ(landmark.descriptor, (Descriptor{1, 2, 3, 4}));
  EXPECT_EQ(landmark.last_seen, 7U);
  EXPECT_NEAR(landmark.viewing_direction.dot(landmark.position - pose.translation()), x.norm(),
              1e-9);
}

TEST(LandmarkGraph, MergedLandmarksKeepAllObservationsInTheOrderOfKeyframes) {
  LandmarkGraph graph(testing::test_sensor());
  for (int k = 0; k < 4; ++k) {
    Keyframe keyframe;
    std::vector<Keypoint> keypoints(2);
    for (Keypoint& keypoint : keypoints) keypoint.depth_m = 2.0F;
    keyframe.features = testing::features_of(keypoints, std::vector<Descriptor>(2));
    graph.add_keyframe(std::move(keyframe));
  }
  const LandmarkIndex a = graph.add_landmark({0, 0});
  graph.observe(a, {2, 0});
  const LandmarkIndex b = graph.add_landmark({1, 1});
  graph.observe(b, {2, 1});  // the same keyframe, another keypoint
  graph.observe(b, {3, 1});
  graph.merge(b, a);
  EXPECT_THAT(graph.landmark(a).observations,
              ElementsAre(KeypointReference{0, 0}, KeypointReference{1, 1}, KeypointReference{2, 0},
                          KeypointReference{3, 1}));
  EXPECT_FALSE(graph.keyframes()[2].landmarks[1]) << "was of the landmark that is gone";
  EXPECT_EQ(graph.landmark(a).expected, 2U);
  expect_consistent(graph);
}

TEST(LandmarkGraph, ForgettingWhereThePatchWasCutForgetsThePatch) {
  LandmarkGraph graph = make_true_graph({.seed = 1}).graph;
  for (std::uint32_t i = 0; i < graph.landmarks().size(); ++i) {
    TrackedLandmark& landmark = graph.landmark({i});
    if (landmark.observations.size() < 2) continue;
    const auto observations = landmark.observations;
    landmark.appearance = LandmarkAppearance{observations[0], {}};
    graph.forget(observations[1]);
    EXPECT_TRUE(landmark.appearance);
    graph.forget(observations[0]);
    EXPECT_FALSE(landmark.appearance);
    return;
  }
  FAIL() << "no landmark was seen twice";
}

TEST(LandmarkGraph, RefreshChoosesTheDescriptorNearestToAll) {
  LandmarkGraph graph(testing::test_sensor());
  const Descriptor odd{~0ULL, ~0ULL, 0, 0};
  for (const Descriptor& descriptor : {odd, Descriptor{1, 0, 0, 0}, Descriptor{3, 0, 0, 0}}) {
    Keyframe keyframe;
    std::vector<Keypoint> keypoints(1);
    keypoints[0].depth_m = 2.0F;
    keyframe.features = testing::features_of(keypoints, {descriptor});
    graph.add_keyframe(std::move(keyframe));
  }
  const LandmarkIndex index = graph.add_landmark({0, 0});
  EXPECT_EQ(graph.landmark(index).descriptor, odd);
  graph.observe(index, {1, 0});
  graph.observe(index, {2, 0});
  graph.refresh(index);
  EXPECT_EQ(graph.landmark(index).descriptor, (Descriptor{3, 0, 0, 0}));
}

TEST(LandmarkGraph, CovisibleKeyframesComeWithCountsMostFirst) {
  LandmarkGraph graph(testing::test_sensor());
  for (int k = 0; k < 4; ++k) {
    Keyframe keyframe;
    std::vector<Keypoint> keypoints(3);
    for (Keypoint& keypoint : keypoints) keypoint.depth_m = 2.0F;
    keyframe.features = testing::features_of(keypoints, std::vector<Descriptor>(3));
    graph.add_keyframe(std::move(keyframe));
  }
  for (std::uint32_t i = 0; i < 3; ++i) {
    const LandmarkIndex index = graph.add_landmark({0, i});
    graph.observe(index, {2, i});
    if (i == 0) graph.observe(index, {1, i});
  }
  EXPECT_THAT(graph.covisible(0), ElementsAre(Pair(2U, 3U), Pair(1U, 1U)));
  EXPECT_THAT(graph.covisible(3), IsEmpty());
}

// A camera at half the distance sees the patch twice as large: one of its pixels is half a pixel of
// the patch; turned about its axis, the map turns.
TEST(LandmarkGraph, ThePatchScalesAndTurnsWithTheView) {
  LandmarkGraph graph(testing::test_sensor());
  Keyframe keyframe;
  std::vector<Keypoint> keypoints(1);
  keypoints[0].pixel = {319.5F, 239.5F};
  keypoints[0].depth_m = 2.0F;
  keyframe.features = testing::features_of(keypoints, std::vector<Descriptor>(1));
  graph.add_keyframe(std::move(keyframe));
  TrackedLandmark& landmark = graph.landmark(graph.add_landmark({0, 0}));
  EXPECT_FALSE(graph.patch_from_image(landmark, {})) << "no patch was cut";
  landmark.appearance = LandmarkAppearance{{0, 0}, {}};
  const auto near =
      graph.patch_from_image(landmark, Rigid3::from_roll_pitch_yaw({0, 0, -1}, 0, 0, 0));
  ASSERT_TRUE(near);
  EXPECT_TRUE(near->isApprox(0.5 * Eigen::Matrix2d::Identity(), 0.01)) << *near;
  const auto turned =
      graph.patch_from_image(landmark, Rigid3::from_roll_pitch_yaw({0, 0, 0}, 0, 0, 0.5));
  ASSERT_TRUE(turned);
  EXPECT_TRUE(turned->isApprox(Eigen::Rotation2Dd(-0.5).toRotationMatrix(), 0.02)) << *turned;
  EXPECT_FALSE(graph.patch_from_image(landmark, Rigid3::from_roll_pitch_yaw({0, 0, -3}, 0, 0, 0)))
      << "behind the camera";
}

}  // namespace
}  // namespace cairn::detail
