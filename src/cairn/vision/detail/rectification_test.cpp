// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/detail/rectification.hpp"

#include <cmath>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/error.hpp"

#include "support/refusal.hpp"

namespace cairn::detail {
namespace {

using ::testing::HasSubstr;

const Camera kLeft{
    CameraId{0}, "OPENCV", 320, 240, {230.0, 229.0, 165.0, 118.0, -0.28, 0.07, 2e-4, 2e-5}};
const Camera kRight{
    CameraId{0}, "OPENCV", 320, 240, {228.0, 227.5, 158.0, 123.0, -0.27, 0.06, 1e-4, -3e-5}};
const Rigid3 kTilted = Rigid3::from_roll_pitch_yaw({0.11, 0.004, -0.003}, 0.02, -0.03, 0.015);

// A bright spot where the camera sees a point; dark elsewhere.
GrayImage spot(const Camera& camera, const Eigen::Vector3d& x_in_camera) {
  const auto at = project(camera, x_in_camera);
  GrayImage image(camera.width, camera.height);
  for (std::uint32_t v = 0; v < image.height; ++v) {
    for (std::uint32_t u = 0; u < image.width; ++u) {
      const double squared = std::pow(u - at->u, 2) + std::pow(v - at->v, 2);
      image.at(u, v) = static_cast<std::uint8_t>(std::lround(250.0 * std::exp(-squared / 8.0)));
    }
  }
  return image;
}

Eigen::Vector2d centroid(const GrayImage& image) {
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  double weight = 0.0;
  for (std::uint32_t v = 0; v < image.height; ++v) {
    for (std::uint32_t u = 0; u < image.width; ++u) {
      sum += image.at(u, v) * Eigen::Vector2d(u, v);
      weight += image.at(u, v);
    }
  }
  return sum / weight;
}

// Rows are common, and depth from disparity gives the point as far from the left camera as it is, in a frame that is only
// turned.
TEST(Rectification, RowsAreCommonAndDisparitiesGiveThePoint) {
  const Rectification rectification({kLeft, kRight, kTilted}, "rig");
  EXPECT_NEAR(rectification.baseline_m(), kTilted.translation().norm(), 1e-12);
  const Intrinsics pinhole = intrinsics(rectification.camera());
  std::vector<Eigen::Vector3d> true_points;
  std::vector<Eigen::Vector3d> points;
  for (const Eigen::Vector3d& x :
       {Eigen::Vector3d(0.0, 0.0, 1.0), {0.4, -0.2, 1.2}, {-0.6, 0.5, 2.0}, {0.9, 0.6, 2.5}}) {
    const Eigen::Vector2d left = centroid(rectification.left(spot(kLeft, x)));
    const Eigen::Vector2d right =
        centroid(rectification.right(spot(kRight, kTilted.inverse() * x)));
    EXPECT_NEAR(left.y(), right.y(), 0.05);
    const double z = pinhole.fx * rectification.baseline_m() / (left.x() - right.x());
    points.emplace_back((left.x() - pinhole.cx) / pinhole.fx * z,
                        (left.y() - pinhole.cy) / pinhole.fy * z, z);
    true_points.push_back(x);
    EXPECT_NEAR(points.back().norm(), x.norm(), 0.01 * x.norm());
  }
  for (std::size_t i = 1; i < points.size(); ++i) {
    EXPECT_NEAR((points[i] - points[0]).norm(), (true_points[i] - true_points[0]).norm(), 0.02);
  }
}

TEST(Rectification, LeavesRectifiedImagesAlone) {
  const Camera pinhole{CameraId{0}, "PINHOLE", 320, 240, {230.0, 230.0, 160.0, 120.0}};
  const Rectification rectification(
      {pinhole, pinhole, Rigid3(Eigen::Quaterniond::Identity(), {0.5, 0.0, 0.0})}, "rig");
  EXPECT_EQ(rectification.camera(), pinhole);
  EXPECT_EQ(rectification.baseline_m(), 0.5);
  const GrayImage image = spot(pinhole, {0.1, 0.2, 1.0});
  EXPECT_EQ(rectification.right(image), image);
}

TEST(Rectification, RefusesWhatIsNoPair) {
  const auto refused = [](const Rigid3& left_from_right, const Camera& right = kRight) {
    return testing::refusal(ErrorKind::kInput, [&] {
      Rectification({kLeft, right, left_from_right}, "rig");
    });
  };
  const auto beside = [](double x, double y = 0.0) {
    return Rigid3(Eigen::Quaterniond::Identity(), {x, y, 0.0});
  };
  EXPECT_EQ(refused(beside(0.11)), "");
  EXPECT_THAT(refused(beside(0.0)), HasSubstr("rig: a baseline of 0 m"));
  EXPECT_THAT(refused(beside(110.0)), HasSubstr("lengths in metres"));
  EXPECT_THAT(refused(beside(-0.11)), HasSubstr("left and right are swapped"));
  EXPECT_THAT(refused(beside(0.0, 0.11)), HasSubstr("side by side"));
  EXPECT_THAT(refused(Rigid3::from_roll_pitch_yaw({0.11, 0.0, 0.0}, 0.0, 1.0, 0.0)),
              HasSubstr("side by side"));
  Camera other = kRight;
  other.width = 640;
  EXPECT_THAT(refused(beside(0.11), other), HasSubstr("320 x 240 and 640 x 240"));
}

}  // namespace
}  // namespace cairn::detail
