// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>

#include "cairn/core/file.hpp"
#include "cairn/map/camera_calibration.hpp"

namespace cairn {

/// The calibrated colour cameras of the TUM RGB-D benchmark: fr1, fr2, fr3.
/// @throws Error (misuse) for another name
Camera tum_camera(const std::string& name);
/// Seconds from the first row of such a camera's colour image to the last; std::nullopt where we could
/// not measure it (docs/method.md, "Rolling shutter").
std::optional<double> tum_readout_s(const std::string& name);

/// A camera as a file of its own, beside a sequence of images.
struct CameraFile {
  Camera camera;                                ///< of a stereo pair the left one
  std::optional<double> depth_units_per_metre;  ///< of depth images, where there are any
  /// Seconds from an image's first row to its last, of a rolling shutter.
  std::optional<double> readout_s = {};
  /// Of a stereo pair. The size of its cameras is 0 if the file does not state it, as OpenCV's stereo_calib.
  std::optional<StereoRig> rig = {};
};

/// Reads the file of one camera: lines `key: value` with model, width, height, parameters (a list in brackets),
/// depth_units_per_metre and readout_s; '#' starts a comment. Or the YAML of another program, by its keys: ROS's
/// camera_info, EuRoC's sensor.yaml, Kalibr's camchain.yaml, or OpenCV's matrices. Of those the camera of images as taken.
/// @throws Error (input) naming source, line and key; for a file of two cameras
CameraFile read_camera_file(ByteSource& source);
/// The same, or a stereo pair: Kalibr's cam0 and cam1, or OpenCV's M1, D1, M2, D2 (or K1, K2), R and T.
/// @throws Error (input) naming source, line and key
CameraFile read_calibration_file(ByteSource& source);
/// A stereo pair in two files, of EuRoC (by T_BS) or ROS (by R and P).
/// @throws Error (input) as the others; for files that do not say where the cameras are
StereoRig read_stereo_files(ByteSource& left, ByteSource& right);
/// Writes the file of one camera.
std::string camera_file_text(const CameraFile& file);

}  // namespace cairn
