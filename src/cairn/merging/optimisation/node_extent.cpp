// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/merging/optimisation/node_extent.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

namespace cairn {
namespace {

double median(std::vector<double>& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace

NodeExtent node_extent(const LandmarkMap& map) {
  NodeExtent extent;
  const auto& positions = map.landmarks().positions;
  if (positions.empty()) return extent;
  std::vector<double> values(positions.size());
  for (int axis = 0; axis < 3; ++axis) {
    for (std::size_t i = 0; i < positions.size(); ++i) values[i] = positions[i][axis];
    extent.centre[axis] = median(values);
  }
  for (std::size_t i = 0; i < positions.size(); ++i) {
    values[i] = (positions[i] - extent.centre).norm();
  }
  const double radius = median(values);
  if (radius > 0.0 && std::isfinite(radius)) extent.radius = radius;
  return extent;
}

}  // namespace cairn
