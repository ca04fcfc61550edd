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
  std::vector<ImageEntry> images;    ///< in colour, or of the left camera
  std::vector<ImageEntry> partners;  ///< of depth, or of the right camera
  std::optional<StereoRig>
      rig;  ///< of a stereo sequence; cameras of size 0 have that of the images
  std::filesystem::path
      calibration;  ///< of a stereo sequence where its rig is, for messages; else empty
  /// Of an RGB-D sequence whose layout has one.
  std::optional<Camera> camera = {};
  double depth_units_per_metre = kTumDepthUnits;
  std::optional<std::uint16_t> unknown_depth = {};  ///< besides 0, as stored
};

/// A camera as a sensor.yaml of EuRoC's layout.
/// @throws Error (misuse) for a camera whose model such a file cannot hold
std::string euroc_camera_text(const Camera& camera, const Rigid3& body_from_camera);

/// Whether a folder has a file or folder of any layout, so that it is worth to say what it lacks.
bool has_sequence_files(const std::filesystem::path& folder);

/// Reads the lists and the calibration of a sequence, in the first of the layouts whose files are there: TUM RGB-D,
/// ICL-NUIM, 7-Scenes, KITTI odometry (grey or colour pair), EuRoC. The times of the second and third are the numbers of
/// the frames.
/// @param needs_rig whether the calibration of a stereo sequence is read, and must be there
/// @throws Error (input) naming file, line and field of what cannot be read; for a folder in none of the layouts, what
///         each of them wants
SequenceLists read_sequence_lists(const std::filesystem::path& folder, bool needs_rig,
                                  const LogSink& log);

}  // namespace cairn::detail
