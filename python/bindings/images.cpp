// SPDX-License-Identifier: BSD-3-Clause
#include "bindings/images.hpp"

namespace cairn::python {

std::vector<std::uint8_t> image_of(py::handle given, const Camera& camera,
                                   const std::string& channels) {
  const auto height = static_cast<py::ssize_t>(camera.height);
  const auto width = static_cast<py::ssize_t>(camera.width);
  const bool reversed = word<bool>(channels, "channels", {{"rgb", true}, {"bgr", false}});
  const py::array array = py::array::ensure(given);
  if (!array) PyErr_Clear();
  std::vector<std::uint8_t> bgr(static_cast<std::size_t>(3 * height * width));
  if (array && array.ndim() == 2) {
    const auto gray = byte_array(given, "image", {height, width});
    for (std::size_t i = 0; i < bgr.size(); ++i) bgr[i] = gray.data()[i / 3];
    return bgr;
  }
  const auto colors = byte_array(given, "image", {height, width, 3});
  for (std::size_t i = 0; i < bgr.size(); i += 3) {
    for (std::size_t j = 0; j < 3; ++j) bgr[i + j] = colors.data()[i + (reversed ? 2 - j : j)];
  }
  return bgr;
}

std::vector<float> depth_of(py::handle given, const Camera& camera) {
  if (given.is_none()) return {};
  const auto array =
      real_array(given, "depth_m",
                 {static_cast<py::ssize_t>(camera.height), static_cast<py::ssize_t>(camera.width)},
                 Masked::kUnknown);
  std::vector<float> depth(static_cast<std::size_t>(array.size()));
  for (std::size_t i = 0; i < depth.size(); ++i) {
    const double value = array.data()[i];
    depth[i] = value > 0.0 && value < 1e6 ? static_cast<float>(value) : 0.0F;  // NaN: unknown
  }
  return depth;
}

}  // namespace cairn::python
