// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <utility>

#include "cairn/map/camera.hpp"

namespace cairn::detail {

/// OpenSfM's image coordinates: the centre of the image is (0, 0), its longer side is 1.
struct OpenSfmImage {
  double width = 0.0;
  double height = 0.0;

  double size() const { return std::max(width, height); }
  Pixel pixel(double x, double y) const {
    return {x * size() + (width - 1.0) / 2.0, y * size() + (height - 1.0) / 2.0};
  }
  std::pair<double, double> normalized(const Pixel& pixel) const {
    return {(pixel.u - (width - 1.0) / 2.0) / size(), (pixel.v - (height - 1.0) / 2.0) / size()};
  }
};

inline OpenSfmImage opensfm_image(const Camera& camera) {
  return {static_cast<double>(camera.width), static_cast<double>(camera.height)};
}

}  // namespace cairn::detail
