// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>

#include "cairn/core/file.hpp"
#include "cairn/map/camera.hpp"

namespace cairn {

/// The calibrated colour cameras of the TUM RGB-D benchmark: fr1, fr2, fr3.
/// @throws Error (misuse) for another name
Camera tum_camera(const std::string& name);
/// Seconds from the first row of such a camera's colour image to the last; std::nullopt where we could
/// not measure it (docs/method.md, "Rolling shutter").
std::optional<double> tum_readout_s(const std::string& name);

/// A camera as a file of its own, beside a sequence of images.
struct CameraFile {
  Camera camera;
  std::optional<double> depth_units_per_metre;  ///< of depth images, where there are any
  /// Seconds from an image's first row to its last, of a rolling shutter.
  std::optional<double> readout_s = {};
};

/// Reads a camera file: lines `key: value` with model, width, height, parameters (a list in brackets),
/// depth_units_per_metre and readout_s; '#' starts a comment.
/// @throws Error (input) naming source, line and key
CameraFile read_camera_file(ByteSource& source);
/// Writes such a file.
std::string camera_file_text(const CameraFile& file);

}  // namespace cairn
