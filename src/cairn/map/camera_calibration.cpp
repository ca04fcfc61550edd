// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/map/camera_calibration.hpp"

#include <algorithm>
#include <span>
#include <string_view>
#include <utility>

#include <fmt/format.h>

#include "cairn/core/error.hpp"

namespace cairn {
namespace {

constexpr std::pair<std::string_view, std::string_view> kDistortionModels[] = {
    {"plumb_bob", "FULL_OPENCV"},
    {"rational_polynomial", "FULL_OPENCV"},
    {"radtan", "FULL_OPENCV"},
    {"radial-tangential", "FULL_OPENCV"},
    {"equidistant", "OPENCV_FISHEYE"},
    // Of RealSense's own recordings, as its ROS driver publishes them.
    {"Brown Conrady", "FULL_OPENCV"},
    {"Modified Brown Conrady", "FULL_OPENCV"},
    {"Inverse Brown Conrady", "FULL_OPENCV"},
    {"Kannala Brandt4", "OPENCV_FISHEYE"}};

bool are_zero(std::span<const double> values) {
  return std::all_of(values.begin(), values.end(), [](double value) { return value == 0.0; });
}

}  // namespace

Camera camera_of(const CameraCalibration& calibration, bool is_rectified,
                 const std::string& place) {
  const auto& k = calibration.intrinsics;
  const auto& p = calibration.projection;
  const std::span<const double> d = calibration.distortion;
  const std::string& model = calibration.distortion_model;
  Camera camera{
      CameraId{0}, "PINHOLE", calibration.width, calibration.height, {k[0], k[4], k[2], k[5]}};
  if (is_rectified) {
    camera.parameters = {p[0], p[5], p[2], p[6]};
  } else if (!are_zero(d) || model == "equidistant" || model == "Kannala Brandt4") {
    const auto* const known =
        std::find_if(std::begin(kDistortionModels), std::end(kDistortionModels),
                     [&](const auto& entry) { return entry.first == model; });
    reject_if(known == std::end(kDistortionModels), place, "distortion model " + printable(model),
              "plumb_bob, rational_polynomial, radtan, radial-tangential or equidistant");
    camera.model = known->second;
    const std::size_t count = camera.model == "OPENCV_FISHEYE" ? 4 : 8;
    reject_if(d.size() > count && !are_zero(d.subspan(count)), place,
              fmt::format("{} coefficients of {}", d.size(), model),
              fmt::format("at most {} other than 0", count));
    camera.parameters.insert(camera.parameters.end(), d.begin(), d.end());
    camera.parameters.resize(4 + count, 0.0);
    // What the higher coefficients leave out is the simpler model.
    if (count == 8 && are_zero(std::span(camera.parameters).subspan(8))) {
      camera.model = "OPENCV";
      camera.parameters.resize(8);
    }
  }
  reject_if(
      !(camera.parameters[0] > 0.0), place,
      fmt::format("a focal length of {}: the camera was not calibrated", camera.parameters[0]),
      "a calibrated camera, or one given");
  const std::string defect = camera_defect(camera);
  reject_if(!defect.empty(), place, defect, "a camera without a defect");
  return camera;
}

std::optional<Rigid3> left_from_right(const CameraCalibration& left, const CameraCalibration& right,
                                      bool are_rectified, const std::string& place) {
  const auto centre_x = [](const CameraCalibration& camera) {
    return camera.projection[0] > 0.0 ? -camera.projection[3] / camera.projection[0] : 0.0;
  };
  const auto rectified_from = [&](const CameraCalibration& camera) {
    Matrix4d pose = Matrix4d::Identity();
    pose.topLeftCorner<3, 3>() =
        Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(camera.rectification.data());
    try {
      return Rigid3::from_matrix(pose);
    } catch (const Error& error) {
      throw Error(ErrorKind::kInput, place + ": R", error.what(), "");
    }
  };
  const double baseline = centre_x(right) - centre_x(left);
  if (baseline == 0.0) return std::nullopt;
  const Rigid3 step(Eigen::Quaterniond::Identity(), Eigen::Vector3d(baseline, 0.0, 0.0));
  if (are_rectified) return step;
  return rectified_from(left).inverse() * step * rectified_from(right);
}

}  // namespace cairn
