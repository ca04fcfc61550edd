// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/recording/camera_info.hpp"

#include <algorithm>

#include <fmt/format.h>

#include "cairn/core/error.hpp"

namespace cairn {

Camera camera_of(const CameraInfo& info, bool is_rectified, const std::string& place) {
  const auto& k = info.intrinsics;
  const auto& p = info.projection;
  const auto& d = info.distortion;
  Camera camera{CameraId{0}, "PINHOLE", info.width, info.height, {k[0], k[4], k[2], k[5]}};
  const bool is_straight =
      std::all_of(d.begin(), d.end(), [](double value) { return value == 0.0; });
  if (is_rectified) {
    camera.parameters = {p[0], p[5], p[2], p[6]};
  } else if (!is_straight) {
    const std::string& model = info.distortion_model;
    const std::string_view ours = model == "plumb_bob"             ? "FULL_OPENCV"
                                  : model == "rational_polynomial" ? "FULL_OPENCV"
                                  : model == "equidistant"         ? "OPENCV_FISHEYE"
                                                                   : "";
    reject_if(ours.empty(), place, "distortion model " + printable(model),
              "plumb_bob, rational_polynomial or equidistant");
    const std::size_t count = ours == "OPENCV_FISHEYE" ? 4 : 8;
    const bool has_more =
        std::any_of(d.begin() + static_cast<std::ptrdiff_t>(std::min(count, d.size())), d.end(),
                    [](double value) { return value != 0.0; });
    reject_if(has_more, place, fmt::format("{} coefficients of {}", d.size(), model),
              fmt::format("at most {} other than 0", count));
    camera.model = ours;
    camera.parameters.insert(camera.parameters.end(), d.begin(), d.end());
    camera.parameters.resize(4 + count, 0.0);
    // What the higher coefficients leave out is the simpler model.
    const bool is_short = std::all_of(camera.parameters.begin() + 8, camera.parameters.end(),
                                      [](double value) { return value == 0.0; });
    if (count == 8 && is_short) {
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

}  // namespace cairn
