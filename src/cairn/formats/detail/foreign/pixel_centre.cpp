// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/formats/detail/foreign/pixel_centre.hpp"

#include <algorithm>

namespace cairn::detail {

std::size_t centre_place(const Camera& camera) {
  for (const CameraModel& model : camera_models()) {
    if (model.name != camera.model) continue;
    const auto cx = std::find(model.parameters.begin(), model.parameters.end(), "cx");
    return static_cast<std::size_t>(cx - model.parameters.begin());
  }
  return 0;
}

void shift_centre(Camera& camera, double by) {
  const std::size_t place = centre_place(camera);
  camera.parameters.at(place) += by;
  camera.parameters.at(place + 1) += by;
}

}  // namespace cairn::detail
