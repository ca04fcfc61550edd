// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "cairn/core/log.hpp"
#include "cairn/vision/detail/rectification.hpp"
#include "cairn/vision/detail/tum_layout.hpp"

namespace cairn::detail {

/// The images of a recorded sequence, each list in the order of time.
struct SequenceLists {
  std::vector<ImageEntry> images;    ///< colour images, or images of the left camera
  std::vector<ImageEntry> partners;  ///< depth images, or images of the right camera
  std::optional<StereoRig>
      rig;  ///< rig of a stereo sequence; a camera of size 0 has the size of the images
  std::filesystem::path
      calibration;  ///< where the rig of a stereo sequence is stated, for messages; otherwise empty
  /// Camera of an RGB-D sequence, if its layout has one.
  std::optional<Camera> camera = {};
  double depth_units_per_metre = kTumDepthUnits;
  std::optional<std::uint16_t> unknown_depth = {};  ///< stored value of unknown depth, besides 0
};

/// A camera as a sensor.yaml of EuRoC's layout.
/// @throws Error (misuse) for a camera whose model such a file cannot hold
std::string euroc_camera_text(const Camera& camera, const Rigid3& body_from_camera);

/// Whether a folder has a file or folder of any layout, so that a message should state what the folder lacks.
bool has_sequence_files(const std::filesystem::path& folder);

/// Reads the lists and the calibration of a sequence, in the first of these layouts whose files exist: TUM RGB-D,
/// ICL-NUIM, 7-Scenes, KITTI odometry (grey or colour pair), EuRoC. The times of ICL-NUIM and 7-Scenes are the numbers
/// of the frames.
/// @param needs_rig whether the calibration of a stereo sequence is read, and must exist
/// @throws Error (input) naming file, line and field of what cannot be read; for a folder in none of the layouts, what
///         each layout requires
SequenceLists read_sequence_lists(const std::filesystem::path& folder, bool needs_rig,
                                  const LogSink& log);

}  // namespace cairn::detail
