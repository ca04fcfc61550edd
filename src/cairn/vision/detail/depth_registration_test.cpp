// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/detail/depth_registration.hpp"

#include <gtest/gtest.h>

namespace cairn::detail {
namespace {

const Camera kDepthCamera{
    CameraId{0}, "OPENCV", 160, 120, {150, 152, 80, 61, -0.1, 0.02, 0.001, -0.001}};
const Camera kImageCamera{CameraId{1}, "PINHOLE", 320, 240, {260, 262, 158, 121}};
const Rigid3 kImageFromDepth(
    Eigen::Quaterniond(Eigen::AngleAxisd(0.05, Eigen::Vector3d(1, 2, 3).normalized())),
    {0.04, -0.01, 0.005});

// A surface that each camera sees at the depth that its line of sight meets it.
struct Wall {
  Eigen::Vector3d normal;  // of unit length, in the image's camera
  double distance;

  DepthImage seen_by(const Camera& camera, const Rigid3& image_from_camera) const {
    DepthImage depth(camera.width, camera.height);
    for (std::uint32_t v = 0; v < camera.height; ++v) {
      for (std::uint32_t u = 0; u < camera.width; ++u) {
        const Eigen::Vector3d ray = unproject(camera, {double(u), double(v)}).value();
        const double metres = (distance - normal.dot(image_from_camera.translation())) /
                              normal.dot(image_from_camera.rotation() * ray);
        depth.at(u, v) = static_cast<float>(metres * ray.z());
      }
    }
    return depth;
  }
};

TEST(DepthRegistration, ShowsASurfaceAsTheImagesCameraSeesIt) {
  const DepthRegistration registration(kDepthCamera, kImageCamera, kImageFromDepth);
  const Wall wall{Eigen::Vector3d(0.3, -0.2, 1.0).normalized(), 2.0};
  const DepthImage got = registration(wall.seen_by(kDepthCamera, kImageFromDepth));
  const DepthImage expected = wall.seen_by(kImageCamera, Rigid3());
  ASSERT_TRUE(same_size(got, expected));
  // What the depth camera sees surely; a patch is one depth, on the slope of a wall too.
  int compared = 0;
  for (std::uint32_t v = 40; v < 200; ++v) {
    for (std::uint32_t u = 60; u < 260; ++u) {
      ASSERT_NEAR(got.at(u, v), expected.at(u, v), 0.012) << u << " " << v;
      ++compared;
    }
  }
  EXPECT_EQ(compared, 200 * 160);
}

TEST(DepthRegistration, TheNearestSurfaceCounts) {
  const DepthRegistration registration(kDepthCamera, kImageCamera, kImageFromDepth);
  DepthImage depth(160, 120, 3.0F);
  for (std::uint32_t v = 50; v < 70; ++v) {
    for (std::uint32_t u = 70; u < 90; ++u) depth.at(u, v) = 1.0F;
  }
  const DepthImage got = registration(depth);
  // Its middle, moved by the parallax.
  const Eigen::Vector3d middle = kImageFromDepth * (unproject(kDepthCamera, {80, 60}).value());
  const Pixel pixel = project(kImageCamera, middle).value();
  EXPECT_NEAR(got.at(static_cast<std::size_t>(pixel.u), static_cast<std::size_t>(pixel.v)), 1.0,
              0.02);
}

TEST(DepthRegistration, WhatIsUnknownStaysUnknown) {
  const DepthRegistration registration(kDepthCamera, kImageCamera, kImageFromDepth);
  EXPECT_EQ(registration(DepthImage(160, 120)), DepthImage(320, 240));
  // Behind the image's camera, or in it.
  const DepthRegistration ahead(kDepthCamera, kImageCamera,
                                Rigid3(Eigen::Quaterniond::Identity(), {0, 0, -2.0}));
  EXPECT_EQ(ahead(DepthImage(160, 120, 1.5F)), DepthImage(320, 240));
}

// One camera for both changes nothing.
TEST(DepthRegistration, KeepsTheDepthOfOneCamera) {
  const DepthRegistration registration(kImageCamera, kImageCamera, Rigid3());
  DepthImage depth(320, 240);
  for (std::size_t i = 0; i < depth.values.size(); ++i) {
    depth.values[i] = 0.5F + 0.001F * static_cast<float>(i % 977);
  }
  const DepthImage got = registration(depth);
  for (std::size_t i = 0; i < depth.values.size(); ++i) {
    ASSERT_NEAR(got.values[i], depth.values[i], 1e-6) << i;
  }
}

}  // namespace
}  // namespace cairn::detail
