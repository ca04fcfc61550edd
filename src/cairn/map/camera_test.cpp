// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/map/camera.hpp"

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/error.hpp"

namespace cairn {
namespace {

using ::testing::HasSubstr;

constexpr double kCameraNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kCameraInfinity = std::numeric_limits<double>::infinity();

Camera camera(const std::string& model, std::vector<double> parameters) {
  return {CameraId{1}, model, 640, 480, std::move(parameters)};
}

// A camera of every model, with its parameters of distortion, if any, set to `distortion`.
std::vector<Camera> cameras_of_all_models(double distortion) {
  std::vector<Camera> cameras;
  for (const CameraModel& model : camera_models()) {
    std::vector<double> parameters;
    for (const std::string_view name : model.parameters) {
      const bool focal_length = name[0] == 'f';
      const bool centre = name[0] == 'c';
      parameters.push_back(focal_length ? 500.0 : centre ? 300.0 : distortion);
    }
    cameras.push_back(camera(std::string(model.name), parameters));
  }
  return cameras;
}

struct Projection {
  Camera camera;
  Eigen::Vector3d x_in_camera;
  Pixel pixel;
};

TEST(Project, FollowsEachModelsFormula) {
  // By hand: x/z = 0.5, y/z = -1/4, so r² = 0.3125, r⁴ = 0.09765625, r⁶ = 0.030517578125.
  const Eigen::Vector3d x(1.0, -0.5, 2.0);
  // Fisheye: r = 0.5590169943749475, angle = 0.5097396788110 (arctangent), a² = 0.2598345401535.
  const std::vector<Projection> projections = {
      {camera("SIMPLE_PINHOLE", {500, 320, 240}), x, {570, 115}},
      {camera("PINHOLE", {500, 400, 320, 240}), x, {570, 140}},
      // 1 + 0.1·0.3125 = 1.03125
      {camera("SIMPLE_RADIAL", {500, 320, 240, 0.1}), x, {577.8125, 111.09375}},
      // 1 + 0.1·0.3125 - 0.2·0.09765625 = 1.01171875
      {camera("RADIAL", {500, 320, 240, 0.1, -0.2}), x, {572.9296875, 113.53515625}},
      // xy = -0.125. x: 0.505859375 + 2·0.01·(-0.125) + 0.02·(0.3125 + 0.5) = 0.519609375;
      // y: -0.2529296875 + 2·0.02·(-0.125) + 0.01·(0.3125 + 0.125) = -0.2535546875
      {camera("OPENCV", {500, 400, 320, 240, 0.1, -0.2, 0.01, 0.02}), x, {579.8046875, 138.578125}},
      // Above: 1.01171875 + 0.3·0.030517578125 = 1.0208740234375; below: 1 + 0.4·0.3125
      // - 0.5·0.09765625 + 0.6·0.030517578125 = 1.094482421875; ratio 0.93274593798795...
      {camera("FULL_OPENCV", {500, 400, 320, 240, 0.1, -0.2, 0.01, 0.02, 0.3, 0.4, -0.5, 0.6}),
       x,
       {320 + 500 * (0.5 * 1.0208740234375 / 1.094482421875 + 0.01375),
        240 + 400 * (-0.25 * 1.0208740234375 / 1.094482421875 - 0.000625)}},
  };
  for (const Projection& p : projections) {
    SCOPED_TRACE(p.camera.model);
    ASSERT_EQ(camera_defect(p.camera), "");
    const auto pixel = project(p.camera, p.x_in_camera);
    ASSERT_TRUE(pixel.has_value());
    EXPECT_NEAR(pixel->u, p.pixel.u, 1e-10);
    EXPECT_NEAR(pixel->v, p.pixel.v, 1e-10);
  }
}

TEST(Project, FisheyeModelsAgreeWhereTheyOverlap) {
  // One lens in several models: k1 and k2 of the angle, and nothing else.
  const Eigen::Vector3d x(0.7, -0.4, 1.1);
  const Pixel full =
      project(camera("OPENCV_FISHEYE", {500, 400, 320, 240, 0.05, 0, 0, 0}), x).value();
  const Pixel prism =
      project(camera("THIN_PRISM_FISHEYE", {500, 400, 320, 240, 0.05, 0, 0, 0, 0, 0, 0, 0}), x)
          .value();
  EXPECT_NEAR(prism.u, full.u, 1e-10);
  EXPECT_NEAR(prism.v, full.v, 1e-10);
  const Pixel square =
      project(camera("OPENCV_FISHEYE", {500, 500, 320, 240, 0.05, -0.02, 0, 0}), x).value();
  const Pixel radial = project(camera("RADIAL_FISHEYE", {500, 320, 240, 0.05, -0.02}), x).value();
  EXPECT_NEAR(radial.u, square.u, 1e-10);
  EXPECT_NEAR(radial.v, square.v, 1e-10);
  const Pixel one = project(camera("SIMPLE_RADIAL_FISHEYE", {500, 320, 240, 0.05}), x).value();
  const Pixel one_of_two = project(camera("RADIAL_FISHEYE", {500, 320, 240, 0.05, 0}), x).value();
  EXPECT_EQ(one.u, one_of_two.u);
  EXPECT_EQ(one.v, one_of_two.v);
  // Without distortion the distance from the centre is f times the angle: 45 degrees here.
  const Pixel plain = project(camera("SIMPLE_FISHEYE", {500, 320, 240}), {1, 0, 1}).value();
  EXPECT_NEAR(plain.u, 320 + 500 * std::atan(1.0), 1e-10);
  EXPECT_EQ(project(camera("FISHEYE", {500, 500, 320, 240}), {1, 0, 1})->u, plain.u);
}

TEST(Project, ThinPrismMovesBySquaredAngle) {
  // r = tan(1/2) on the u axis, so the angle is 1/2 and its square 1/4.
  const Eigen::Vector3d x(std::tan(0.5), 0.0, 1.0);
  const Pixel pixel = project(camera("THIN_PRISM_FISHEYE",
                                     {100, 100, 0, 0, 0.1, 0.2, 0.01, 0.02, 0.3, 0.4, 0.5, 0.6}),
                              x)
                          .value();
  const double radial = 1 + 0.1 / 4 + 0.2 / 16 + 0.3 / 64 + 0.4 / 256;
  EXPECT_NEAR(pixel.u, 100 * (0.5 * radial + 0.02 * 0.75 + 0.5 / 4), 1e-10);
  EXPECT_NEAR(pixel.v, 100 * (0.01 * 0.25 + 0.6 / 4), 1e-10);
}

TEST(Project, FieldOfViewModelHasItsFormula) {
  // r = 1 with omega = pi/2: atan(2 * tan(pi/4)) / (pi/2).
  const double omega = 2 * std::atan(1.0);
  const Pixel pixel = project(camera("FOV", {100, 100, 0, 0, omega}), {1, 0, 1}).value();
  EXPECT_NEAR(pixel.u, 100 * std::atan(2.0) / omega, 1e-10);
  EXPECT_EQ(pixel.v, 0.0);
  EXPECT_NEAR(project(camera("FOV", {100, 100, 0, 0, 0}), {1, 0, 1})->u, 100.0, 1e-10);
}

TEST(Project, FisheyeMapsTheAngleToTheAxis) {
  // At 45° to the axis (x = z) the distance from the centre is f·θd, θ = π/4, θ² = 0.61685...
  const double a = std::atan(1.0);
  const double distorted = a + 0.01 * std::pow(a, 3) - 0.02 * std::pow(a, 5) +
                           0.03 * std::pow(a, 7) - 0.04 * std::pow(a, 9);
  const Camera fisheye = camera("OPENCV_FISHEYE", {200, 300, 320, 240, 0.01, -0.02, 0.03, -0.04});
  const auto right = project(fisheye, {3.0, 0.0, 3.0});
  ASSERT_TRUE(right.has_value());
  EXPECT_NEAR(right->u, 320 + 200 * distorted, 1e-10);
  EXPECT_NEAR(right->v, 240, 1e-12);
  const auto down = project(fisheye, {0.0, 0.1, 0.1});
  ASSERT_TRUE(down.has_value());
  EXPECT_NEAR(down->u, 320, 1e-12);
  EXPECT_NEAR(down->v, 240 + 300 * distorted, 1e-10);
  // Without distortion, a direction almost across the axis lands at f·π/2.
  const auto across =
      project(camera("OPENCV_FISHEYE", {200, 200, 320, 240, 0, 0, 0, 0}), {1.0, 0.0, 1e-9});
  ASSERT_TRUE(across.has_value());
  EXPECT_NEAR(across->u, 320 + 200 * std::acos(0.0), 1e-6);
}

TEST(Project, FisheyeIsSmoothOnTheAxis) {
  const Camera fisheye = camera("OPENCV_FISHEYE", {200, 300, 320, 240, 0.01, -0.02, 0.03, -0.04});
  EXPECT_EQ(project(fisheye, {0.0, 0.0, 2.0}), (Pixel{320, 240}));
  for (const double offset : {1e-15, 1e-13, 0.9e-12, 1.1e-12, 1e-9, 1e-6}) {
    const auto pixel = project(fisheye, {offset, -offset, 1.0});
    ASSERT_TRUE(pixel.has_value());
    EXPECT_NEAR(pixel->u - 320, 200 * offset, 1e-12 + 1e-9 * offset) << offset;
    EXPECT_NEAR(pixel->v - 240, -300 * offset, 1e-12 + 1e-9 * offset) << offset;
  }
}

TEST(Project, WithoutDistortionEqualsPinhole) {
  const Camera pinhole = camera("PINHOLE", {500, 500, 300, 300});
  for (const Camera& undistorted : cameras_of_all_models(0.0)) {
    SCOPED_TRACE(undistorted.model);
    // The undistorted form of a fisheye lens is equidistant.
    if (undistorted.model.find("FISHEYE") != std::string::npos) continue;
    for (const Eigen::Vector3d& x :
         {Eigen::Vector3d(0, 0, 1), Eigen::Vector3d(1, 2, 3), Eigen::Vector3d(-0.3, 0.2, 0.4)}) {
      EXPECT_EQ(project(undistorted, x), project(pinhole, x));
    }
  }
}

TEST(Project, PutsTheOpticalAxisAtThePrincipalPoint) {
  for (const Camera& any : cameras_of_all_models(0.1)) {
    EXPECT_EQ(project(any, {0.0, 0.0, 0.7}), (Pixel{300, 300})) << any.model;
  }
}

TEST(Project, SeesNothingThatIsNotInFront) {
  for (const Camera& any : cameras_of_all_models(0.1)) {
    for (const double z : {0.0, -0.0, -1e-9, -2.0, -kCameraInfinity, kCameraNan}) {
      EXPECT_EQ(project(any, {0.1, 0.2, z}), std::nullopt) << any.model << ' ' << z;
    }
  }
}

TEST(Project, ReachesBeyondTheImage) {
  const auto pixel = project(camera("SIMPLE_PINHOLE", {500, 320, 240}), {-10.0, 10.0, 1.0});
  EXPECT_EQ(pixel, (Pixel{-4680, 5240}));
}

TEST(Project, RefusesACameraItCannotProjectWith) {
  for (const Camera& broken : {camera("PINHOL", {500, 500, 320, 240}), camera("PINHOLE", {500})}) {
    try {
      project(broken, {0.0, 0.0, 1.0});
      FAIL() << broken.model;
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::kMisuse);
      EXPECT_THAT(error.what(), HasSubstr(camera_defect(broken)));
    }
  }
}

TEST(CameraModels, AreThoseOfTheFormatsDocument) {
  std::vector<std::string> descriptions;
  for (const CameraModel& model : camera_models()) {
    std::string description(model.name);
    for (const std::string_view parameter : model.parameters) {
      description += ' ';
      description += parameter;
    }
    descriptions.push_back(description);
  }
  EXPECT_THAT(descriptions,
              ::testing::ElementsAre(
                  "SIMPLE_PINHOLE f cx cy", "PINHOLE fx fy cx cy", "SIMPLE_RADIAL f cx cy k",
                  "RADIAL f cx cy k1 k2", "OPENCV fx fy cx cy k1 k2 p1 p2",
                  "OPENCV_FISHEYE fx fy cx cy k1 k2 k3 k4",
                  "FULL_OPENCV fx fy cx cy k1 k2 p1 p2 k3 k4 k5 k6", "FOV fx fy cx cy omega",
                  "SIMPLE_RADIAL_FISHEYE f cx cy k", "RADIAL_FISHEYE f cx cy k1 k2",
                  "THIN_PRISM_FISHEYE fx fy cx cy k1 k2 p1 p2 k3 k4 sx1 sy1",
                  "SIMPLE_FISHEYE f cx cy", "FISHEYE fx fy cx cy"));
}

TEST(CameraDefect, IsNoneForEveryModel) {
  for (const Camera& any : cameras_of_all_models(0.1)) EXPECT_EQ(camera_defect(any), "");
}

TEST(CameraDefect, SaysWhatIsWrong) {
  EXPECT_EQ(
      camera_defect(camera("EUCM", {1, 2})),
      "camera model 'EUCM' is none of SIMPLE_PINHOLE, PINHOLE, SIMPLE_RADIAL, RADIAL, OPENCV, "
      "OPENCV_FISHEYE, FULL_OPENCV, FOV, SIMPLE_RADIAL_FISHEYE, RADIAL_FISHEYE, "
      "THIN_PRISM_FISHEYE, SIMPLE_FISHEYE, FISHEYE");
  EXPECT_EQ(camera_defect(camera("pinhole", {500, 500, 320, 240})).substr(0, 22),
            "camera model 'pinhole'");
  EXPECT_EQ(camera_defect(camera("PINHOLE", {500, 500, 320})),
            "camera model PINHOLE has 4 parameters (fx fy cx cy), not 3");
  EXPECT_EQ(camera_defect(camera("SIMPLE_RADIAL", {500, 320, 240, 0, 0})),
            "camera model SIMPLE_RADIAL has 4 parameters (f cx cy k), not 5");
  EXPECT_EQ(camera_defect(camera("PINHOLE", {0, 500, 320, 240})),
            "focal length fx is 0, not positive");
  EXPECT_EQ(camera_defect(camera("PINHOLE", {500, -2.5, 320, 240})),
            "focal length fy is -2.5, not positive");
  EXPECT_EQ(camera_defect(camera("SIMPLE_PINHOLE", {-1, 320, 240})),
            "focal length f is -1, not positive");
  EXPECT_EQ(camera_defect(camera("PINHOLE", {500, kCameraInfinity, 320, 240})),
            "camera parameter fy is not finite");
  EXPECT_EQ(camera_defect(camera("OPENCV", {500, 500, 320, 240, 0, 0, kCameraNan, 0})),
            "camera parameter p1 is not finite");
  for (const auto& [width, height] : {std::pair{0U, 480U}, std::pair{640U, 0U}}) {
    Camera no_size = camera("PINHOLE", {500, 500, 320, 240});
    no_size.width = width;
    no_size.height = height;
    EXPECT_EQ(camera_defect(no_size), "the image size is 0");
  }
  // A principal point outside the image is unusual but usable.
  EXPECT_EQ(camera_defect(camera("PINHOLE", {500, 500, -20, 900})), "");
}

TEST(Intrinsics, AreTheProjectionOfTheAxisAndItsDerivativesThere) {
  for (const Camera& camera : cameras_of_all_models(0.0)) {
    SCOPED_TRACE(camera.model);
    const Intrinsics found = intrinsics(camera);
    constexpr double kStep = 1e-4;
    const auto axis = project(camera, {0.0, 0.0, 1.0});
    const auto beside = project(camera, {kStep, kStep, 1.0});
    EXPECT_NEAR(axis->u, found.cx, 1e-9);
    EXPECT_NEAR(axis->v, found.cy, 1e-9);
    EXPECT_NEAR((beside->u - axis->u) / kStep, found.fx, 1e-4);
    EXPECT_NEAR((beside->v - axis->v) / kStep, found.fy, 1e-4);
  }
}

TEST(Unproject, InvertsEveryModel) {
  for (const double strength : {0.0, 0.05}) {
    for (const Camera& camera : cameras_of_all_models(strength)) {
      SCOPED_TRACE(camera.model);
      for (const Eigen::Vector2d& x :
           {Eigen::Vector2d(0.0, 0.0), Eigen::Vector2d(0.3, -0.2), Eigen::Vector2d(-0.45, 0.35)}) {
        const auto pixel = project(camera, {x.x(), x.y(), 1.0});
        ASSERT_TRUE(pixel);
        const auto found = unproject(camera, *pixel);
        ASSERT_TRUE(found);
        EXPECT_LT((*found - x).norm(), 1e-6);
      }
    }
  }
}

TEST(Unproject, FindsNothingWhereTheImageIsFoldedOver) {
  const Camera folded{CameraId{1}, "SIMPLE_RADIAL", 640, 480, {500.0, 320.0, 240.0, -0.5}};
  EXPECT_TRUE(unproject(folded, {320.0, 240.0}));
  EXPECT_FALSE(unproject(folded, {1200.0, 240.0})) << "no x is distorted that far";
}

}  // namespace
}  // namespace cairn
