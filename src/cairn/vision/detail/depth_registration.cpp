// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/detail/depth_registration.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <Eigen/Geometry>

namespace cairn::detail {

DepthRegistration::DepthRegistration(const Camera& depth, Camera image,
                                     const Rigid3& image_from_depth)
    : image_(std::move(image)), projection_(image_), centre_(image_from_depth.translation()) {
  const Eigen::Vector3d unknown =
      Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN());
  Eigen::Vector3d near = Eigen::Vector3d::UnitZ();
  corners_.reserve(std::size_t{depth.width + 1} * (depth.height + 1));
  for (std::uint32_t v = 0; v <= depth.height; ++v) {
    for (std::uint32_t u = 0; u <= depth.width; ++u) {
      const auto ray = unproject(depth, {u - 0.5, v - 0.5}, near);
      const bool is_seen = ray && ray->z() > 0.0;
      corners_.push_back(is_seen ? image_from_depth.rotation() * (*ray / ray->z()) : unknown);
      if (is_seen) near = *ray;
    }
  }
}

DepthImage DepthRegistration::operator()(const DepthImage& depth) const {
  // A patch that is larger is too near to the image's camera to be right.
  constexpr double kLargest = 64.0;  // pixels
  DepthImage result(image_.width, image_.height);
  // The first pixel whose centre is not before `least`.
  const auto first_from = [](double least, std::uint32_t size) {
    return static_cast<std::uint32_t>(std::clamp(std::ceil(least), 0.0, static_cast<double>(size)));
  };
  for (std::uint32_t v = 0; v < depth.height; ++v) {
    for (std::uint32_t u = 0; u < depth.width; ++u) {
      const double metres = depth.at(u, v);
      if (!(metres > 0.0)) continue;
      // Patches share their corners, so that a surface has no holes.
      const std::size_t row = depth.width + 1;
      const std::size_t corner = v * row + u;
      Eigen::AlignedBox2d box;
      double z = 0.0;
      bool is_seen = true;
      for (const std::size_t at : {corner, corner + 1, corner + row, corner + row + 1}) {
        const Eigen::Vector3d point = metres * corners_[at] + centre_;
        const auto pixel = projection_(image_.parameters.data(), point);
        is_seen = is_seen && pixel && point.z() > 0.0;
        if (!is_seen) break;
        box.extend(Eigen::Vector2d(pixel->u, pixel->v));
        z += 0.25 * point.z();
      }
      if (!is_seen || !(box.sizes().maxCoeff() < kLargest)) continue;
      const std::uint32_t right = first_from(box.max().x(), image_.width);
      const std::uint32_t bottom = first_from(box.max().y(), image_.height);
      for (std::uint32_t y = first_from(box.min().y(), image_.height); y < bottom; ++y) {
        for (std::uint32_t x = first_from(box.min().x(), image_.width); x < right; ++x) {
          float& nearest = result.at(x, y);
          if (nearest == 0.0F || z < nearest) nearest = static_cast<float>(z);
        }
      }
    }
  }
  return result;
}

}  // namespace cairn::detail
