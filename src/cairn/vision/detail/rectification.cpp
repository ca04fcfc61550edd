// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/detail/rectification.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "cairn/core/error.hpp"

namespace cairn::detail {
namespace {

void check_rig(const StereoRig& rig, const std::string& source) {
  for (const Camera& camera : {rig.left, rig.right}) {
    const std::string defect = camera_defect(camera);
    reject_if(!defect.empty(), source, defect, "two cameras without a defect");
  }
  reject_if(rig.left.width != rig.right.width || rig.left.height != rig.right.height, source,
            fmt::format("cameras of {} x {} and {} x {} pixels", rig.left.width, rig.left.height,
                        rig.right.width, rig.right.height),
            "cameras of one size");
  const Eigen::Vector3d& centre = rig.left_from_right.translation();
  const double baseline_m = centre.norm();
  constexpr double kLeast = 0.005;
  constexpr double kMost = 10.0;
  reject_if(!(baseline_m >= kLeast && baseline_m <= kMost), source,
            fmt::format("a baseline of {:.6g} m", baseline_m),
            fmt::format("{} to {} m: lengths in metres", kLeast, kMost));
  reject_if(centre.x() < 0.0, source,
            fmt::format("the right camera is {:.4g} m to the left of the left one", -centre.x()),
            "the left camera first: left and right are swapped");
  constexpr double kLeastCosine = 0.866;  // 30 degrees
  const Eigen::Matrix3d rotation = rig.left_from_right.rotation();
  reject_if(centre.x() < kLeastCosine * baseline_m || rotation(2, 2) < kLeastCosine ||
                rotation(0, 0) < kLeastCosine,
            source, "the cameras do not lie side by side with like orientations",
            "at most 30 degrees between the axes, and between baseline and rows");
}

bool is_rectified(const StereoRig& rig) {
  constexpr double kSame = 1e-6;  // metres, radians
  const Eigen::Vector3d& centre = rig.left_from_right.translation();
  return rig.left.model == "PINHOLE" && rig.right.model == "PINHOLE" &&
         rig.left.parameters == rig.right.parameters && rig.left_from_right.angle() < kSame &&
         std::hypot(centre.y(), centre.z()) < kSame;
}

}  // namespace

Rectification::Rectification(const StereoRig& rig, const std::string& source) {
  check_rig(rig, source);
  camera_ = rig.left;
  baseline_m_ = rig.left_from_right.translation().norm();
  if (is_rectified(rig)) return;
  // Rows along the baseline, and the optical axis as near to both cameras' as that allows.
  const Eigen::Matrix3d left_from_right = rig.left_from_right.rotation();
  Eigen::Matrix3d left_from_rectified;
  left_from_rectified.col(0) = rig.left_from_right.translation().normalized();
  left_from_rectified.col(1) = (Eigen::Vector3d::UnitZ() + left_from_right.col(2))
                                   .cross(left_from_rectified.col(0))
                                   .normalized();
  left_from_rectified.col(2) = left_from_rectified.col(0).cross(left_from_rectified.col(1));
  left_from_rectified_ = Rigid3(left_from_rectified, Eigen::Vector3d::Zero());
  const Eigen::Matrix3d right_from_rectified = left_from_right.transpose() * left_from_rectified;

  const Intrinsics original = intrinsics(rig.left);
  const double focal = 0.5 * (original.fx + original.fy);
  // The principal point keeps the middle of what the two originals see in their middle in the middle.
  Eigen::Vector2d middle = Eigen::Vector2d::Zero();
  const std::pair<const Camera&, const Eigen::Matrix3d&> views[] = {
      {rig.left, left_from_rectified}, {rig.right, right_from_rectified}};
  for (const auto& [camera, original_from_rectified] : views) {
    const auto ray = unproject(camera, {0.5 * (camera.width - 1.0), 0.5 * (camera.height - 1.0)});
    const Eigen::Vector3d seen =
        original_from_rectified.transpose() * ray.value_or(Eigen::Vector3d::UnitZ());
    middle += 0.5 * seen.head<2>() / seen.z();
  }
  camera_ = {rig.left.id,
             "PINHOLE",
             rig.left.width,
             rig.left.height,
             {focal, focal, 0.5 * (rig.left.width - 1.0) - focal * middle.x(),
              0.5 * (rig.left.height - 1.0) - focal * middle.y()}};
  left_ = places_in(rig.left, left_from_rectified);
  right_ = places_in(rig.right, right_from_rectified);
}

Rectification::Places Rectification::places_in(
    const Camera& original, const Eigen::Matrix3d& original_from_rectified) const {
  const Intrinsics rectified = intrinsics(camera_);
  Places places;
  places.reserve(std::size_t{camera_.width} * camera_.height);
  for (std::uint32_t v = 0; v < camera_.height; ++v) {
    for (std::uint32_t u = 0; u < camera_.width; ++u) {
      const Eigen::Vector3d ray((u - rectified.cx) / rectified.fx,
                                (v - rectified.cy) / rectified.fy, 1.0);
      const auto pixel = project(original, original_from_rectified * ray);
      places.emplace_back(pixel ? Eigen::Vector2d(pixel->u, pixel->v).cast<float>()
                                : Eigen::Vector2f(-1.0F, -1.0F));
    }
  }
  return places;
}

// Beyond the image it continues with its edge, which is no corner.
template <class ImageOf>
ImageOf Rectification::resampled(ImageOf image, const Places& places) {
  if (places.empty()) return image;
  ImageOf result(image.width, image.height);
  constexpr std::size_t kChannels = ImageOf::kPixelValues;
  const auto most_column = static_cast<float>(image.width - 1);
  const auto most_row = static_cast<float>(image.height - 1);
  for (std::size_t i = 0; i < places.size(); ++i) {
    const float x = std::clamp(places[i].x(), 0.0F, most_column);
    const float y = std::clamp(places[i].y(), 0.0F, most_row);
    const auto column = static_cast<std::size_t>(x);
    const auto row = static_cast<std::size_t>(y);
    const float right = x - static_cast<float>(column);
    const float down = y - static_cast<float>(row);
    const std::size_t next_column = std::min<std::size_t>(column + 1, image.width - 1);
    const std::size_t next_row = std::min<std::size_t>(row + 1, image.height - 1);
    for (std::size_t channel = 0; channel < kChannels; ++channel) {
      const auto value = [&](std::size_t at_column, std::size_t at_row) {
        return static_cast<float>((&image.at(at_column, at_row))[channel]);
      };
      const float above =
          value(column, row) + right * (value(next_column, row) - value(column, row));
      const float below = value(column, next_row) +
                          right * (value(next_column, next_row) - value(column, next_row));
      result.values[i * kChannels + channel] =
          static_cast<std::uint8_t>(std::lround(above + down * (below - above)));
    }
  }
  return result;
}

template GrayImage Rectification::resampled(GrayImage image, const Places& places);
template ColorImage Rectification::resampled(ColorImage image, const Places& places);

}  // namespace cairn::detail
