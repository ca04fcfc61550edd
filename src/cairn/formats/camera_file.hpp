// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>

#include "cairn/core/file.hpp"
#include "cairn/map/camera_calibration.hpp"

namespace cairn {

/// The calibrated colour cameras of the TUM RGB-D benchmark: fr1, fr2, fr3.
/// @throws Error (misuse) for any other name
Camera tum_camera(const std::string& name);
/// Rolling-shutter readout time of a tum_camera()'s colour image, first row to last, in seconds;
/// std::nullopt if not measured (docs/method.md, "Rolling shutter").
std::optional<double> tum_readout_s(const std::string& name);

/// Content of a camera file beside an image sequence.
struct CameraFile {
  Camera camera;                                ///< left camera for a stereo pair
  std::optional<double> depth_units_per_metre;  ///< scale of depth images, if any
  /// Rolling-shutter readout time, first row to last, in seconds.
  std::optional<double> readout_s = {};
  /// For a stereo pair. The image size is 0 if the file does not state one, as in OpenCV's
  /// stereo_calib.
  std::optional<StereoRig> rig = {};
};

/// Reads the file of one camera: lines `key: value` with model, width, height, parameters (a list
/// in brackets), depth_units_per_metre and readout_s; '#' starts a comment. Also reads other
/// programs' YAML, recognised by its keys: ROS's camera_info, EuRoC's sensor.yaml, Kalibr's
/// camchain.yaml, OpenCV's matrices, or settings of ORB-SLAM2, ORB-SLAM3 or stella_vslam. From
/// these, returns the camera of the raw images.
/// @throws Error (input) naming source, line and key; also for a file of two cameras
CameraFile read_camera_file(ByteSource& source);
/// As read_camera_file(), but also reads a stereo pair: Kalibr's cam0 and cam1, or OpenCV's M1, D1,
/// M2, D2 (or K1, K2), R and T.
/// @throws Error (input) naming source, line and key
CameraFile read_calibration_file(ByteSource& source);
/// Reads a stereo pair from two files of EuRoC (T_BS) or ROS (R and P).
/// @throws Error (input) as read_camera_file(); also if the files state no relative pose
StereoRig read_stereo_files(ByteSource& left, ByteSource& right);
/// The text of a file of one camera.
std::string camera_file_text(const CameraFile& file);

}  // namespace cairn
