// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/map/camera.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>
#include <vector>

#include <fmt/format.h>
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
      double value = distortion;
      if (name[0] == 'f') value = 500.0;
      if (name[0] == 'c') value = 300.0;
      if (name == "beta") value = 1.0 + distortion;
      if (name == "w") value = 640.0;
      if (name == "h") value = 480.0;
      parameters.push_back(value);
    }
    cameras.push_back(camera(std::string(model.name), parameters));
  }
  return cameras;
}

// What projects a plane in front of the camera onto the image, and nothing else.
bool is_perspective(const Camera& camera) {
  static const std::vector<std::string> names = {
      "SIMPLE_PINHOLE", "PINHOLE", "SIMPLE_RADIAL", "RADIAL", "OPENCV", "FULL_OPENCV", "FOV"};
  return std::find(names.begin(), names.end(), camera.model) != names.end();
}

// Unit vector that far from the optical axis, turned about it from the image's u axis; radians.
Eigen::Vector3d ray_at(double angle, double turn) {
  return {std::sin(angle) * std::cos(turn), std::sin(angle) * std::sin(turn), std::cos(angle)};
}

constexpr double kDegree = std::numbers::pi / 180.0;

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

// Pixels of two points, computed with COLMAP's own functions (src/colmap/sensor/models.h, commit 5d968cf). The centre
// of the first pixel is at 0.5 there, which makes a difference only where no principal point is stated.
TEST(Project, GivesTheNumbersOfColmapsFunctions) {
  struct Known {
    const char* model;
    std::vector<double> parameters;
    std::vector<Pixel> pixels;  // of the points
  };
  const std::array<Eigen::Vector3d, 2> points = {Eigen::Vector3d(-0.7, 0.55, 0.9),
                                                 Eigen::Vector3d(1.1, 0.4, 0.6)};
  const std::vector<Known> all = {
      {"SIMPLE_PINHOLE",
       {500, 320, 240},
       {{-68.8888888888889, 545.555555555556}, {1236.66666666667, 573.333333333333}}},
      {"PINHOLE",
       {500, 480, 320, 240},
       {{-68.8888888888889, 533.333333333333}, {1236.66666666667, 560}}},
      {"SIMPLE_RADIAL",
       {500, 320, 240, 0.03},
       {{-80.3034979423868, 554.524176954733}, {1341.31944444444, 611.388888888889}}},
      {"RADIAL",
       {500, 320, 240, 0.03, -0.01},
       {{-76.5808322325526, 551.599225325577}, {1208.56545781893, 563.114711934156}}},
      {"OPENCV",
       {500, 480, 320, 240, 0.03, -0.01, 0.002, -0.003},
       {{-80.8138569239106, 542.160441497739}, {1195.21823559671, 551.176790123457}}},
      {"OPENCV_FISHEYE",
       {500, 480, 320, 240, 0.03, -0.01, 0.002, -0.0003},
       {{8.77361054022754, 474.753619478228}, {848.147402908822, 424.371457015443}}},
      {"FULL_OPENCV",
       {500, 480, 320, 240, 0.03, -0.01, 0.002, -0.003, 0.004, 0.02, -0.005, 0.006},
       {{-74.3127093533763, 537.256718758822}, {1123.99730895661, 526.314212096368}}},
      {"FOV",
       {500, 480, 320, 240, 0.8},
       {{-22.3171246077818, 498.204916847013}, {922.532747762545, 450.33870467347}}},
      {"SIMPLE_RADIAL_FISHEYE",
       {500, 320, 240, 0.03},
       {{7.76439206100906, 485.32797766635}, {854.142840704553, 434.233760256201}}},
      {"RADIAL_FISHEYE",
       {500, 320, 240, 0.03, -0.01},
       {{8.89905888248586, 484.43645373519}, {846.674065226116, 431.517841900406}}},
      {"THIN_PRISM_FISHEYE",
       {500, 480, 320, 240, 0.03, -0.01, 0.002, -0.003, 0.004, -0.0005, 0.006, -0.007},
       {{7.83705055296616, 474.688377455024}, {849.118336741452, 421.191377793835}}},
      {"RAD_TAN_THIN_PRISM_FISHEYE",
       {500, 480, 320, 240, 0.03, -0.01, 0.002, -0.0003, 0.0004, -0.00005, 0.002, -0.003, 0.006,
        -0.007, 0.004, 0.005},
       {{11.584612091617, 474.730639922771}, {849.063205836259, 429.331104174328}}},
      {"SIMPLE_DIVISION",
       {500, 320, 240, -0.12},
       {{-31.5724895667926, 516.235527516766}, {1003.7557462543, 488.638453183382}}},
      {"DIVISION",
       {500, 480, 320, 240, 0.02},
       {{-76.8118586374991, 539.309516229428}, {1319.63664105238, 588.964063785558}}},
      {"SIMPLE_FISHEYE",
       {500, 320, 240},
       {{13.3602880267232, 480.931202264718}, {835.527462694293, 427.464531888834}}},
      {"FISHEYE",
       {500, 480, 320, 240},
       {{13.3602880267232, 471.293954174129}, {835.527462694293, 419.96595061328}}},
      {"EUCM",
       {500, 480, 320, 240, 0.57, 1.13},
       {{10.6475990271058, 473.34009673384}, {846.132645145025, 423.668123396081}}},
      {"EQUIRECTANGULAR",
       {640, 320},
       {{252.666695731381, 205.781014485209}, {429.13696059384, 191.475360242824}}},
  };
  ASSERT_EQ(all.size(), camera_models().size());
  for (const Known& known : all) {
    SCOPED_TRACE(known.model);
    const Camera of_model = camera(known.model, known.parameters);
    ASSERT_EQ(camera_defect(of_model), "");
    const double first = of_model.model == "EQUIRECTANGULAR" ? 0.5 : 0.0;
    for (std::size_t i = 0; i < points.size(); ++i) {
      const auto pixel = project(of_model, points[i]);
      ASSERT_TRUE(pixel.has_value());
      EXPECT_NEAR(pixel->u, known.pixels[i].u - first, 1e-9);
      EXPECT_NEAR(pixel->v, known.pixels[i].v - first, 1e-9);
    }
  }
}

TEST(Project, WideModelsSeeBeyondNinetyDegrees) {
  const Eigen::Vector3d x = ray_at(120.0 * kDegree, 0.0);
  // Equidistant: f times the angle.
  EXPECT_NEAR(project(camera("SIMPLE_FISHEYE", {300, 320, 240}), x)->u, 320 + 300 * 120.0 * kDegree,
              1e-9);
  // EUCM of alpha 1/2 and beta 1 is the stereographic projection, 2·f·tan of half the angle.
  EXPECT_NEAR(project(camera("EUCM", {100, 100, 320, 240, 0.5, 1.0}), x)->u,
              320 + 200 * std::tan(60.0 * kDegree), 1e-9);
  // DIVISION: r/(1 + k·r²) is the tangent, with k = -1/4: r = 2 at 90 degrees, and the root of
  // r² + 4·r/tan - 4 = 0 beyond.
  const Camera division = camera("SIMPLE_DIVISION", {100, 320, 240, -0.25});
  EXPECT_NEAR(project(division, {3.0, 0.0, 0.0})->u, 320 + 200, 1e-9);
  const double cotangent = 1.0 / std::tan(120.0 * kDegree);
  EXPECT_NEAR(project(division, x)->u,
              320 + 100 * (-2.0 * cotangent + 2.0 * std::sqrt(cotangent * cotangent + 1.0)), 1e-9);
}

TEST(Project, WideModelsSeeNoFartherThanTheirFormulaIsInvertible) {
  for (const double turn : {0.3, 2.0, 4.4}) {
    // Alpha 0.8: to where z is -(1 - alpha)/alpha times the length, 104.48 degrees.
    const Camera eucm = camera("EUCM", {200, 200, 320, 240, 0.8, 1.0});
    EXPECT_TRUE(project(eucm, ray_at(104.4 * kDegree, turn)));
    EXPECT_FALSE(project(eucm, ray_at(104.6 * kDegree, turn)));
    // k = 1/4: to the tangent 1/(2·√k) = 1.
    const Camera division = camera("DIVISION", {200, 200, 320, 240, 0.25});
    EXPECT_TRUE(project(division, ray_at(44.9 * kDegree, turn)));
    EXPECT_FALSE(project(division, ray_at(45.1 * kDegree, turn)));
    EXPECT_FALSE(project(division, ray_at(170.0 * kDegree, turn)));
    // a - 0.08·a³ turns back at a = 2.04, 117 degrees; from there on it would be a ghost.
    const Camera fisheye = camera("SIMPLE_RADIAL_FISHEYE", {200, 320, 240, -0.08});
    EXPECT_TRUE(project(fisheye, ray_at(110.0 * kDegree, turn)));
    EXPECT_FALSE(project(fisheye, ray_at(130.0 * kDegree, turn)));
    EXPECT_FALSE(project(fisheye, ray_at(175.0 * kDegree, turn)));
  }
}

TEST(Project, APanoramaHoldsTheWholeSphere) {
  const Camera panorama{CameraId{1}, "EQUIRECTANGULAR", 800, 400, {800, 400}};
  // Centres of pixels are integers, so the image reaches from -0.5 to 799.5.
  EXPECT_EQ(project(panorama, {0, 0, 2}), (Pixel{399.5, 199.5}));
  EXPECT_NEAR(project(panorama, {5, 0, 0})->u, 599.5, 1e-9);
  EXPECT_NEAR(project(panorama, {-5, 0, 0})->u, 199.5, 1e-9);
  EXPECT_NEAR(project(panorama, {1e-9, 0, -1})->u, 799.5, 1e-6);
  EXPECT_NEAR(project(panorama, {-1e-9, 0, -1})->u, -0.5, 1e-6);
  EXPECT_NEAR(project(panorama, {0, -1, 0})->v, -0.5, 1e-9) << "up";
  EXPECT_NEAR(project(panorama, {0, 1, 1})->v, 299.5, 1e-9) << "45 degrees down";
  EXPECT_EQ(project(panorama, {0, 0, 0}), std::nullopt);
}

TEST(Reprojection, GoesTheShorterWayRoundAPanorama) {
  const Camera panorama{CameraId{1}, "EQUIRECTANGULAR", 800, 400, {800, 400}};
  const auto projected = project(panorama, {0.01, 0.0, -1.0});  // near the right border
  ASSERT_GT(projected->u, 790.0);
  const auto off = reprojection(panorama, {0.01, 0.0, -1.0}, {projected->u - 800.0 + 3.0, 201.0});
  EXPECT_NEAR(off->x(), -3.0, 1e-9);
  EXPECT_NEAR(off->y(), -1.5, 1e-9);
  const Camera pinhole = camera("PINHOLE", {500, 500, 320, 240});
  EXPECT_NEAR(reprojection(pinhole, {10.0, 0.0, 1.0}, {0.0, 240.0})->x(), 5320.0, 1e-9);
  EXPECT_EQ(reprojection(pinhole, {0.0, 0.0, -1.0}, {0.0, 0.0}), std::nullopt);
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
    // The undistorted form of a fisheye lens is equidistant, and a panorama has none.
    if (undistorted.model.find("FISHEYE") != std::string::npos ||
        undistorted.model == "EQUIRECTANGULAR") {
      continue;
    }
    for (const Eigen::Vector3d& x :
         {Eigen::Vector3d(0, 0, 1), Eigen::Vector3d(1, 2, 3), Eigen::Vector3d(-0.3, 0.2, 0.4)}) {
      EXPECT_NEAR(project(undistorted, x)->u, project(pinhole, x)->u, 1e-10);
      EXPECT_NEAR(project(undistorted, x)->v, project(pinhole, x)->v, 1e-10);
    }
  }
}

TEST(Project, PutsTheOpticalAxisAtThePrincipalPoint) {
  for (const Camera& any : cameras_of_all_models(0.1)) {
    const Intrinsics k = intrinsics(any);
    EXPECT_EQ(project(any, {0.0, 0.0, 0.7}), (Pixel{k.cx, k.cy})) << any.model;
    EXPECT_EQ(k.cx, any.model == "EQUIRECTANGULAR" ? 319.5 : 300.0) << any.model;
  }
}

TEST(Project, PerspectiveModelsSeeNothingThatIsNotInFront) {
  for (const Camera& any : cameras_of_all_models(0.1)) {
    if (!is_perspective(any)) {
      EXPECT_EQ(project(any, {0.1, 0.2, kCameraNan}), std::nullopt) << any.model;
      continue;
    }
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
                  "RAD_TAN_THIN_PRISM_FISHEYE fx fy cx cy k0 k1 k2 k3 k4 k5 p0 p1 s0 s1 s2 s3",
                  "SIMPLE_DIVISION f cx cy k", "DIVISION fx fy cx cy k", "SIMPLE_FISHEYE f cx cy",
                  "FISHEYE fx fy cx cy", "EUCM fx fy cx cy alpha beta", "EQUIRECTANGULAR w h"));
}

TEST(CameraDefect, IsNoneForEveryModel) {
  for (const Camera& any : cameras_of_all_models(0.1)) EXPECT_EQ(camera_defect(any), "");
}

TEST(CameraDefect, SaysWhatIsWrong) {
  EXPECT_EQ(
      camera_defect(camera("DOUBLE_SPHERE", {1, 2})),
      "camera model 'DOUBLE_SPHERE' is none of SIMPLE_PINHOLE, PINHOLE, SIMPLE_RADIAL, RADIAL, "
      "OPENCV, "
      "OPENCV_FISHEYE, FULL_OPENCV, FOV, SIMPLE_RADIAL_FISHEYE, RADIAL_FISHEYE, "
      "THIN_PRISM_FISHEYE, RAD_TAN_THIN_PRISM_FISHEYE, SIMPLE_DIVISION, DIVISION, SIMPLE_FISHEYE, "
      "FISHEYE, EUCM, EQUIRECTANGULAR");
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
  EXPECT_EQ(camera_defect(camera("EUCM", {500, 500, 320, 240, 1.5, 1})),
            "camera parameter alpha is 1.5, not 0 to 1");
  EXPECT_EQ(camera_defect(camera("EUCM", {500, 500, 320, 240, 0.5, 0})),
            "camera parameter beta is 0, not positive");
  EXPECT_EQ(camera_defect(camera("EQUIRECTANGULAR", {640, -1})),
            "camera parameter h is -1, not positive");
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
  for (const double strength : {0.0, 1e-5, 0.05}) {
    for (const Camera& camera : cameras_of_all_models(strength)) {
      SCOPED_TRACE(fmt::format("{} {}", camera.model, strength));
      const double step = strength > 0.01 || is_perspective(camera) ? 7.0 : 17.0;  // to 28 or 170
      int seen = 0;
      for (int i = 0; i <= (step > 10.0 ? 10 : 4); ++i) {
        for (const double turn : {0.4, 1.9, 3.6, 5.1}) {
          const Eigen::Vector3d x = ray_at(i * step * kDegree, turn);
          const auto pixel = project(camera, 2.5 * x);
          if (!pixel) continue;
          ++seen;
          const auto found = unproject(camera, *pixel);
          ASSERT_TRUE(found) << i * step;
          EXPECT_LT((*found - x).norm(), 1e-9) << i * step;
          // From a neighbour as from the axis.
          const auto from_near = unproject(camera, *pixel, (x + Eigen::Vector3d(0.01, 0, 0)));
          ASSERT_TRUE(from_near) << i * step;
          EXPECT_LT((*from_near - x).norm(), 1e-9) << i * step;
        }
      }
      EXPECT_GE(seen, 20);
    }
  }
}

TEST(Unproject, FindsNothingWhereTheImageIsFoldedOver) {
  const Camera folded{CameraId{1}, "SIMPLE_RADIAL", 640, 480, {500.0, 320.0, 240.0, -0.5}};
  EXPECT_TRUE(unproject(folded, {320.0, 240.0}));
  EXPECT_FALSE(unproject(folded, {1200.0, 240.0})) << "no x is distorted that far";
}

// The step to a point that far is infinite, and so is half of it.
TEST(Unproject, EndsWhateverTheFocalLength) {
  const Camera tiny{CameraId{1}, "OPENCV", 640, 480, {500.0, 5e-324, 320.0, 240.0, 0.1, 0, 0, 0}};
  EXPECT_FALSE(unproject(tiny, {10.0, 20.0}));
}

}  // namespace
}  // namespace cairn
