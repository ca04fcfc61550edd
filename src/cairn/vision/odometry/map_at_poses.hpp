// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <functional>
#include <span>
#include <stop_token>

#include "cairn/core/executor.hpp"
#include "cairn/core/log.hpp"
#include "cairn/geometry/trajectory.hpp"
#include "cairn/map/landmark_map.hpp"
#include "cairn/vision/odometry/map_sequence.hpp"
#include "cairn/vision/odometry/odometry.hpp"
#include "cairn/vision/sequence/sequence.hpp"

namespace cairn {

struct MapAtPosesOptions {
  FeatureOptions features;
  /// Of the sensor. The error of the poses is added; both are estimated from the residuals.
  SensorNoise noise;
  MapOptions map;                       ///< its covariance must be recursive
  double max_time_difference_s = 0.02;  ///< between a frame and the nearest pose; positive
  /// Skip keyframes whose image cannot be read; if false, that is an error.
  bool skip_unreadable = false;
  Executor executor = Executor();  ///< one thread by default; results do not depend on how many
  std::stop_token stop = {};
  std::function<void(const MappingProgress&)> progress = {};  ///< of keyframes
  LogSink log = {};

  /// @throws Error (misuse) naming the field
  void validate() const;
};

struct MapAtPoses {
  LandmarkMap map;        ///< in the world of the poses
  Trajectory trajectory;  ///< of all frames with a pose
  std::size_t frames = 0;
  std::size_t without_pose = 0;   ///< frames without a pose near in time
  std::size_t without_depth = 0;  ///< frames with a pose but no depth image
  std::size_t unreadable = 0;     ///< keyframes left out because an image could not be read
};

/// Builds a landmark map with known camera poses, e.g. from motion capture or another SLAM system; only the
/// landmarks are estimated. A frame's pose is interpolated between neighbours at most 0.1 s apart, or is
/// that of the same time, to a millisecond. Keyframes are frames with depth after each rotation of 10
/// degrees or 15 cm of motion; only their images are read. The result is the same for any number of
/// threads.
/// @param timestamps_s of the frames, ascending
/// @param read_frame   returns a frame; called from several threads
/// @throws Error (input) if no frame has a pose, or no keyframe has corners with depth; (misuse) naming the
///        field of the options or an image that does not have the camera's size; (cancelled); what read_frame
///        throws
MapAtPoses map_at_poses(std::span<const double> timestamps_s,
                        const std::function<FrameImages(std::size_t frame)>& read_frame,
                        const Trajectory& poses, const Camera& camera,
                        const MapAtPosesOptions& options = {});

/// The same for a sequence on disk; frames without depth are not keyframes.
/// @throws Error (input) naming an image that cannot be read or does not have the camera's size
MapAtPoses map_at_poses(const RgbdSequence& sequence, const Trajectory& poses, const Camera& camera,
                        const MapAtPosesOptions& options = {});

}  // namespace cairn
