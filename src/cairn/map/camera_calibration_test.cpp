// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/map/camera_calibration.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/error.hpp"

#include "support/refusal.hpp"

namespace cairn {
namespace {

using ::testing::HasSubstr;

CameraCalibration some_calibration() {
  CameraCalibration stated;
  stated.width = 640;
  stated.height = 480;
  stated.distortion_model = "plumb_bob";
  stated.distortion = {0.1, -0.2, 0.001, 0.002, 0.0};
  stated.intrinsics = {500, 0, 320, 0, 510, 240, 0, 0, 1};
  stated.projection = {505, 0, 321, -50.5, 0, 505, 241, 0, 0, 0, 1, 0};
  return stated;
}

TEST(Calibration, ACameraHasTheModelOfItsCoefficients) {
  CameraCalibration stated = some_calibration();
  const Camera expected{
      CameraId{0}, "OPENCV", 640, 480, {500, 510, 320, 240, 0.1, -0.2, 0.001, 0.002}};
  for (const char* const name :
       {"plumb_bob", "rational_polynomial", "radtan", "radial-tangential"}) {
    stated.distortion_model = name;
    EXPECT_EQ(camera_of(stated, false, "m"), expected) << name;
  }
  EXPECT_EQ(camera_of(stated, true, "m"),
            (Camera{CameraId{0}, "PINHOLE", 640, 480, {505, 505, 321, 241}}));
  stated.distortion[4] = 0.3;
  EXPECT_EQ(camera_of(stated, false, "m").model, "FULL_OPENCV");
  EXPECT_EQ(camera_of(stated, false, "m").parameters[8], 0.3);
  stated.distortion = {0, 0, 0, 0, 0};
  EXPECT_EQ(camera_of(stated, false, "m").model, "PINHOLE");
}

// Without coefficients its image is as far from the middle as the angle says, not as its tangent.
TEST(Calibration, AFisheyeIsNeverAPinhole) {
  CameraCalibration stated = some_calibration();
  stated.distortion_model = "equidistant";
  for (const std::vector<double>& coefficients :
       {std::vector<double>{}, std::vector<double>{0, 0, 0, 0}}) {
    stated.distortion = coefficients;
    const auto pixel = project(camera_of(stated, false, "m"), {1.0, 0.0, 1.0});
    ASSERT_TRUE(pixel);
    EXPECT_NEAR(pixel->u, 320 + 500 * std::atan(1.0), 1e-9);
  }
}

TEST(Calibration, NamesWhatIsWrong) {
  CameraCalibration stated = some_calibration();
  const auto refused = [&] {
    return testing::message_of(ErrorKind::kInput, [&] { camera_of(stated, false, "bag: info"); });
  };
  stated.distortion_model = "inverse_brown_conrady";
  EXPECT_THAT(refused(), HasSubstr("bag: info: distortion model 'inverse_brown_conrady'"));
  stated = some_calibration();
  stated.distortion.resize(14, 0.5);
  EXPECT_THAT(refused(), HasSubstr("14 coefficients of plumb_bob; expected at most 8"));
  stated = some_calibration();
  stated.intrinsics = {};
  EXPECT_THAT(refused(), HasSubstr("was not calibrated"));
}

// A point seen by both cameras has one row in the rectified images, and the columns that P says.
TEST(Calibration, APairIsWhereItsRectificationSays) {
  const auto turned = [](double x, double y, double z) {
    const Rigid3 pose(
        Eigen::Quaterniond(Eigen::AngleAxisd(0.05, Eigen::Vector3d(x, y, z).normalized())),
        Eigen::Vector3d::Zero());
    return Eigen::Matrix3d(pose.rotation());
  };
  const auto with = [](const Eigen::Matrix3d& rectified_from_camera, double p3) {
    CameraCalibration stated = some_calibration();
    const Eigen::Matrix<double, 3, 3, Eigen::RowMajor> rows = rectified_from_camera;
    std::copy(rows.data(), rows.data() + 9, stated.rectification.begin());
    stated.projection[3] = p3;
    return stated;
  };
  const Eigen::Matrix3d of_left = turned(1, 2, 3);
  const Eigen::Matrix3d of_right = turned(-2, 1, 1);
  const auto pose = left_from_right(with(of_left, 0.0), with(of_right, -50.5), false, "m");
  ASSERT_TRUE(pose);
  const Eigen::Vector3d in_right(0.3, -0.2, 2.0);
  const Eigen::Vector3d rectified_left = of_left * (*pose * in_right);
  const Eigen::Vector3d rectified_right = of_right * in_right;
  EXPECT_NEAR(rectified_left.y(), rectified_right.y(), 1e-12);
  EXPECT_NEAR(rectified_left.z(), rectified_right.z(), 1e-12);
  EXPECT_NEAR(505 * rectified_right.x(), 505 * rectified_left.x() - 50.5, 1e-9);

  const auto rectified = left_from_right(with(of_left, 0.0), with(of_right, -50.5), true, "m");
  EXPECT_LT((rectified->translation() - Eigen::Vector3d(0.1, 0, 0)).norm(), 1e-15);
  EXPECT_FALSE(left_from_right(with(of_left, 0.0), with(of_right, 0.0), false, "m"));
  EXPECT_THAT(
      testing::message_of(
          ErrorKind::kInput,
          [&] { left_from_right(with(2.0 * of_left, 0.0), with(of_right, -1.0), false, "bag"); }),
      HasSubstr("bag: R"));
}

}  // namespace
}  // namespace cairn
