// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/simulation/detail/renderer.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/error.hpp"
#include "cairn/simulation/detail/scene_builder.hpp"
#include "cairn/simulation/path.hpp"

namespace cairn::detail {
namespace {

using Eigen::Vector3d;
using ::testing::HasSubstr;

const Camera kCamera{CameraId{0}, "PINHOLE", 80, 60, {65.0, 66.0, 39.5, 29.5}};
// A coarse grid of light, and edges as they come.
Renderer plain_renderer(Scene scene) {
  return {std::move(scene), 1.0, false};
}

// A white floor, 10 m wide, and a box with a half-metre side on it.
const Vector3d kLow(-0.25, -0.25, 0.0);
const Vector3d kHigh(0.25, 0.25, 0.5);

Scene floor_and_box() {
  SceneBuilder builder(1.0);
  Random random(1);
  const auto white = builder.paint(1.0, 1.0, 4.0, {1.0F, 1.0F, 1.0F}, nullptr, random);
  const auto dark = builder.paint(1.0, 1.0, 4.0, {0.2F, 0.1F, 0.3F}, nullptr, random);
  builder.begin_object("floor", Rigid3());
  builder.panel({-5, 5, 0}, {10, 0, 0}, {0, -10, 0}, white);
  builder.begin_object("box", Rigid3());
  builder.box(kLow, kHigh - kLow, SceneBuilder::Skin::all(dark));
  return builder.build(Executor());
}

// Distance to the nearest of floor and box, in units of `direction`; infinite if there is none.
double exact_depth(const Vector3d& origin, const Vector3d& direction) {
  double nearest = std::numeric_limits<double>::infinity();
  const double floor = -origin.z() / direction.z();
  if (floor > 0.0) {
    const Vector3d foot = origin + floor * direction;
    if (std::abs(foot.x()) <= 5.0 && std::abs(foot.y()) <= 5.0) nearest = floor;
  }
  double enter = 0.0;
  double leave = std::numeric_limits<double>::infinity();
  for (int axis = 0; axis < 3; ++axis) {
    const double a = (kLow[axis] - origin[axis]) / direction[axis];
    const double b = (kHigh[axis] - origin[axis]) / direction[axis];
    enter = std::max(enter, std::min(a, b));
    leave = std::min(leave, std::max(a, b));
  }
  return enter < leave ? std::min(nearest, enter) : nearest;
}

Vector3d ray_of(const RayTable& rays, std::size_t pixel) {
  return {rays.x[pixel], rays.y[pixel], 1.0};
}

TEST(Renderer, DepthIsThatOfTheGeometry) {
  const Renderer renderer = plain_renderer(floor_and_box());
  const RayTable rays = ray_table(kCamera);
  for (const Vector3d& eye :
       {Vector3d(1.5, -1.0, 1.2), Vector3d(0.1, 0.2, 2.5), Vector3d(-3, 1, 0.3)}) {
    const Rigid3 pose = looking_at(eye, {0.05, 0.0, 0.25});
    const RenderedFrame frame = renderer.render(kCamera, rays, pose);
    std::size_t compared = 0;
    for (std::size_t i = 0; i < frame.depth_m.size(); ++i) {
      const double expected = exact_depth(eye, pose.rotation() * ray_of(rays, i));
      if (!std::isfinite(expected)) {
        EXPECT_EQ(frame.depth_m[i], 0.0F);
        continue;
      }
      // A ray along an edge may hit either side.
      const bool off_edges =
          std::abs(exact_depth(eye, pose.rotation() * (ray_of(rays, i) + Vector3d(1e-4, 1e-4, 0))) -
                   expected) < 0.01 * expected;
      if (!off_edges) continue;
      EXPECT_NEAR(frame.depth_m[i], expected, 2e-6 * expected);
      ++compared;
    }
    EXPECT_GT(compared, 2000U);
  }
}

TEST(Renderer, FacingIsTheCosineOfTheIncidence) {
  const Renderer renderer = plain_renderer(floor_and_box());
  const RayTable rays = ray_table(kCamera);
  const Rigid3 pose = looking_at({2.0, 1.0, 1.5}, {2.0, 3.0, 0.0});
  const RenderedFrame frame = renderer.render(kCamera, rays, pose);
  for (std::size_t i = 0; i < frame.facing.size(); ++i) {
    if (frame.depth_m[i] == 0.0F) continue;
    const Vector3d direction = (pose.rotation() * ray_of(rays, i)).normalized();
    EXPECT_NEAR(frame.facing[i], -direction.z(), 1e-5);
  }
}

class RayTableTest : public ::testing::TestWithParam<Camera> {};
INSTANTIATE_TEST_SUITE_P(
    Models, RayTableTest,
    ::testing::Values(
        kCamera, Camera{CameraId{0}, "SIMPLE_RADIAL", 80, 60, {65.0, 40.0, 30.0, -0.1}},
        Camera{CameraId{0}, "OPENCV", 80, 60, {65.0, 66.0, 40.0, 30.0, 0.1, -0.05, 0.001, -0.002}},
        Camera{CameraId{0},
               "OPENCV_FISHEYE",
               80,
               60,
               {35.0, 36.0, 40.0, 30.0, 0.01, -0.002, 0.0, 0.0}},
        Camera{CameraId{0},
               "FULL_OPENCV",
               640,
               480,
               {517.306408, 516.469215, 318.643040, 255.313989, 0.262383, -0.953104, -0.005358,
                0.002628, 1.163314, 0.0, 0.0, 0.0}}),
    [](const auto& camera) { return camera.param.model; });

TEST_P(RayTableTest, InvertsTheProjection) {
  const Camera& camera = GetParam();
  const RayTable rays = ray_table(camera);
  for (std::size_t row = 0; row < camera.height; row += 7) {
    for (std::size_t column = 0; column < camera.width; column += 3) {
      const auto pixel = project(camera, 2.5 * ray_of(rays, row * camera.width + column));
      ASSERT_TRUE(pixel.has_value());
      EXPECT_NEAR(pixel->u, static_cast<double>(column), 1e-3);
      EXPECT_NEAR(pixel->v, static_cast<double>(row), 1e-3);
    }
  }
}

TEST_P(RayTableTest, KnownPointAppearsWhereTheCameraProjectsIt) {
  const Camera& camera = GetParam();
  const Renderer renderer = plain_renderer(floor_and_box());
  const Rigid3 pose = looking_at({0.9, -0.8, 1.1}, {0.0, 0.0, 0.3});
  const RenderedFrame frame = renderer.render(camera, ray_table(camera), pose);
  // Points on the box's top are dark and as far as their depth; the pixel around them shows it.
  for (const double x : {-0.15, 0.0, 0.15}) {
    const Vector3d in_camera = pose.inverse() * Vector3d(x, -0.1, 0.5);
    const auto pixel = project(camera, in_camera);
    ASSERT_TRUE(pixel.has_value());
    const auto column = static_cast<std::size_t>(std::lround(pixel->u));
    const auto row = static_cast<std::size_t>(std::lround(pixel->v));
    EXPECT_NEAR(frame.depth_m[row * camera.width + column], in_camera.z(), 0.03);
  }
}

TEST(RayTable, RefusesDistortionThatFoldsTheImage) {
  const Camera camera{CameraId{0}, "SIMPLE_RADIAL", 80, 60, {30.0, 40.0, 30.0, -3.0}};
  try {
    ray_table(camera);
    FAIL();
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("pixel (0, 0)"));
  }
}

TEST(Renderer, SamePictureForAnyNumberOfThreads) {
  const Renderer one(floor_and_box(), 0.2, true, Executor(1));
  const Renderer two(floor_and_box(), 0.2, true, Executor(2));
  const RayTable rays = ray_table(kCamera);
  const Rigid3 pose = looking_at({1.5, -1.0, 1.2}, {0, 0, 0.2});
  const RenderedFrame a = one.render(kCamera, rays, pose, Executor(1));
  const RenderedFrame b = two.render(kCamera, rays, pose, Executor(2));
  EXPECT_EQ(a.bgr, b.bgr);
  EXPECT_EQ(a.depth_m, b.depth_m);
  EXPECT_EQ(a.facing, b.facing);
}

TEST(Renderer, SmoothingEdgesMixesColoursOnlyThere) {
  const Renderer plain = plain_renderer(floor_and_box());
  const Renderer smooth(floor_and_box(), 1.0, true);
  const RayTable rays = ray_table(kCamera);
  const Rigid3 pose = looking_at({1.5, -1.0, 1.2}, {0, 0, 0.2});
  const RenderedFrame a = plain.render(kCamera, rays, pose);
  const RenderedFrame b = smooth.render(kCamera, rays, pose);
  EXPECT_EQ(a.depth_m, b.depth_m);
  std::size_t changed = 0;
  for (std::size_t i = 0; i < a.depth_m.size(); ++i)
    changed += a.bgr[3 * i] != b.bgr[3 * i] ? 1 : 0;
  EXPECT_GT(changed, 20U);
  EXPECT_LT(changed, 400U);
}

TEST(Renderer, LampsCastShadows) {
  Scene scene = floor_and_box();
  scene.lights.push_back({{0, 0, 2.0}, 0.1, 0.1, 3.0});
  const Renderer renderer(std::move(scene), 0.05, true);
  const RayTable rays = ray_table(kCamera);
  // Straight down from above: beside the box it is darker than farther out, where light falls in.
  const RenderedFrame frame =
      renderer.render(kCamera, rays, looking_at({0.0, 0.0, 3.0}, {0.0, 1e-6, 0.0}));
  const auto light_at = [&](double x, double y) {
    const Vector3d in_camera =
        looking_at({0.0, 0.0, 3.0}, {0.0, 1e-6, 0.0}).inverse() * Vector3d(x, y, 0.0);
    const auto pixel = project(kCamera, in_camera);
    const auto column = static_cast<std::size_t>(std::lround(pixel->u));
    const auto row = static_cast<std::size_t>(std::lround(pixel->v));
    return frame.bgr[3 * (row * kCamera.width + column) + 1];
  };
  EXPECT_LT(1.5 * light_at(0.29, 0.0), light_at(0.8, 0.0));
}

TEST(Renderer, AnEmptySceneIsBlack) {
  const Renderer renderer = plain_renderer(Scene{});
  const RenderedFrame frame = renderer.render(kCamera, ray_table(kCamera), Rigid3());
  EXPECT_EQ(*std::max_element(frame.bgr.begin(), frame.bgr.end()), 0);
  EXPECT_EQ(*std::max_element(frame.depth_m.begin(), frame.depth_m.end()), 0.0F);
}

TEST(Renderer, RefusesWhatIsWrongByName) {
  Scene scene = floor_and_box();
  scene.surfaces[3].texture = 99;
  try {
    const Renderer renderer = plain_renderer(std::move(scene));
    FAIL();
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("Scene.surfaces[3]"));
  }
  const Renderer renderer = plain_renderer(floor_and_box());
  EXPECT_THROW(renderer.render(kCamera, RayTable{}, Rigid3()), Error);
}

}  // namespace
}  // namespace cairn::detail
