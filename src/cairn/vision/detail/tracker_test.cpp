// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/detail/tracker.hpp"

#include <cmath>

#include <gtest/gtest.h>

#include "cairn/geometry/covariance.hpp"

#include "support/textured_wall.hpp"

// On images whose motion is known to the pixel.
namespace cairn::detail {
namespace {

using testing::TexturedWall;

class TrackerTest : public ::testing::Test {
 protected:
  FrameReport track(int right, bool with_depth = true) {
    const cv::Mat depth = with_depth ? TexturedWall::depth_m() : cv::Mat();
    return track(wall_.gray(right), depth);
  }
  FrameReport track(const cv::Mat& gray, const cv::Mat& depth_m) {
    return tracker_.track(time_s_ += 0.03, tracker_.extractor().extract(gray, depth_m), "");
  }
  // How far the last pose is from where the camera was, metres.
  double error(int right) const {
    const auto pose = tracker_.last_pose();
    if (!pose) return 1e9;
    const Rigid3 truth(Eigen::Matrix3d::Identity(),
                       {right * TexturedWall::kMetresPerPixel, 0.0, 0.0});
    return pose->difference_to(truth).norm();
  }

  const TexturedWall wall_;
  Tracker tracker_{TexturedWall::camera(), {}};
  double time_s_ = 0.0;
};

TEST_F(TrackerTest, WaitsForDepthAndTexture) {
  EXPECT_EQ(track(0, false).status, FrameStatus::kWaiting);
  EXPECT_EQ(track(cv::Mat(480, 640, CV_8UC1, cv::Scalar(90)), TexturedWall::depth_m()).status,
            FrameStatus::kWaiting);
  EXPECT_FALSE(tracker_.last_pose());
  const FrameReport first = track(0);
  EXPECT_EQ(first.status, FrameStatus::kTracked);
  EXPECT_TRUE(first.keyframe);
  EXPECT_LT(error(0), 1e-12) << "the map is in the frame of its first camera";
}

TEST_F(TrackerTest, HasAnEmptyMapBeforeItsFirstKeyframe) {
  for (const auto kind : {LandmarkCovariance::kMarginal, LandmarkCovariance::kRecursive}) {
    const LandmarkMap map = tracker_.map({.covariance = kind});
    EXPECT_EQ(map.frame_count(), 0U);
    EXPECT_EQ(map.landmark_count(), 0U);
  }
}

TEST_F(TrackerTest, FollowsTheCamera) {
  for (int right = 0; right <= 60; right += 6) {
    ASSERT_EQ(track(right).status, FrameStatus::kTracked) << right;
    EXPECT_LT(error(right), 0.002) << right;
  }
  EXPECT_EQ(tracker_.trajectory().size(), 11U);
}

TEST_F(TrackerTest, FollowsFramesThatHaveNoDepth) {
  track(0);
  ASSERT_EQ(track(6, false).status, FrameStatus::kTracked);
  EXPECT_LT(error(6), 0.004);
}

TEST_F(TrackerTest, IsLostWhereNothingIsKnownAndComesBack) {
  track(0);
  track(5);
  cv::Mat other;
  cv::flip(wall_.gray(200, 90), other, 0);
  EXPECT_EQ(track(other, TexturedWall::depth_m()).status, FrameStatus::kLost);
  EXPECT_FALSE(tracker_.last_pose());
  EXPECT_EQ(track(8).status, FrameStatus::kTracked);
  EXPECT_LT(error(8), 0.003);
  EXPECT_EQ(tracker_.trajectory().size(), 3U) << "the lost frame has no pose";
}

TEST_F(TrackerTest, ANewMapBeginsInTheFrameOfItsFirstCamera) {
  for (int right = 0; right <= 40; right += 8) track(right);
  ASSERT_TRUE(tracker_.can_begin_new_map());
  const FinishedMap finished = tracker_.begin_new_map({});
  EXPECT_GE(finished.map.frame_count(), 2U);
  const Rigid3 expected(Eigen::Matrix3d::Identity(),
                        {40 * TexturedWall::kMetresPerPixel, 0.0, 0.0});
  EXPECT_LT(finished.to_next.target_from_source->rigid().difference_to(expected).norm(), 0.002);
  const auto& covariances = finished.map.frames().pose_covariances;
  ASSERT_EQ(covariances.size(), finished.map.frame_count());
  EXPECT_EQ(*covariances[covariances.size() - 1], finished.to_next.covariance);
  EXPECT_LT(tracker_.last_pose()->difference_to(Rigid3()).norm(), 1e-12);
}

TEST_F(TrackerTest, StatesHowUncertainEachKeyframeIs) {
  for (int right = 0; right <= 200; right += 8) track(right);
  const LandmarkMap map = tracker_.map({});
  const auto& covariances = map.frames().pose_covariances;
  ASSERT_EQ(covariances.size(), map.frame_count());
  ASSERT_GE(covariances.size(), 4U);
  EXPECT_TRUE(covariances[0]->isZero(0.0)) << "the first is where the map begins";
  double before = 0.0;
  for (std::uint32_t i = 1; i < map.frame_count(); ++i) {
    const Matrix6d covariance = *covariances[i];
    // A wall from the front: what is uncertain grows with the way along it.
    const double along = covariance(0, 0);
    EXPECT_GT(along, before) << i;
    before = along;
    const Rigid3 pose = map.world_from_camera(FrameIndex{i});
    const double moved = std::round(pose.translation().x() / TexturedWall::kMetresPerPixel);
    const Rigid3 truth(Eigen::Matrix3d::Identity(),
                       {moved * TexturedWall::kMetresPerPixel, 0.0, 0.0});
    EXPECT_LT(normalised_squared_error(pose, covariance, truth), 12.6) << i;
  }
}

}  // namespace
}  // namespace cairn::detail
