// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <numbers>

namespace cairn {

constexpr double degrees(double radians) {
  return radians * 180.0 / std::numbers::pi;
}

constexpr double radians(double degrees) {
  return degrees * std::numbers::pi / 180.0;
}

}  // namespace cairn
