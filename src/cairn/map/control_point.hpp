// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "cairn/map/camera.hpp"

namespace cairn {

/// A ground control point: a mark whose place on the Earth was surveyed, and the pixels where images show it. It does
/// not move with the map.
struct ControlPoint {
  struct View {
    std::string image_name;  ///< of a frame of this map or of another one; not empty
    Pixel pixel;

    friend bool operator==(const View&, const View&) = default;
  };

  std::string name;                  ///< not empty; not necessarily distinct
  double latitude_deg = 0.0;         ///< as in GeodeticPosition
  double longitude_deg = 0.0;        ///< as in GeodeticPosition
  std::optional<double> altitude_m;  ///< std::nullopt if unknown
  std::vector<View> views;

  friend bool operator==(const ControlPoint&, const ControlPoint&) = default;
};

}  // namespace cairn
