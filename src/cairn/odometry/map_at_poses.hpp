// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <functional>
#include <span>
#include <stop_token>

#include "cairn/core/executor.hpp"
#include "cairn/core/log.hpp"
#include "cairn/map/landmark_map.hpp"
#include "cairn/odometry/map_sequence.hpp"
#include "cairn/odometry/odometry.hpp"
#include "cairn/sequence/sequence.hpp"
#include "cairn/trajectory/trajectory.hpp"

namespace cairn {

struct MapAtPosesOptions {
  FeatureOptions features;
  /// Of the sensor. What the poses are off by comes on top: both are found from the residuals.
  SensorNoise noise;
  MapOptions map;                       ///< covariance: recursive only
  double max_time_difference_s = 0.02;  ///< of a frame to the nearest pose; positive
  /// Go on where an image cannot be read, without that keyframe. Else that is an error.
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
  Trajectory trajectory;  ///< of all frames that have a pose
  std::size_t frames = 0;
  std::size_t without_pose = 0;   ///< frames with none near in time
  std::size_t without_depth = 0;  ///< frames with a pose, but no depth image
  std::size_t unreadable = 0;     ///< keyframes left out for that
};

/// Builds a landmark map where the camera's poses are known, e.g. from motion capture or another
/// SLAM: nothing is estimated but the landmarks. A frame's pose is interpolated between those before
/// and after it, at most 0.1 s apart; or that of its own time, to a millisecond. Keyframes are
/// frames with depth after each turn of 10 degrees or 15 cm; only their images are read. The result
/// is the same with any number of threads.
/// @param timestamps_s of the frames, ascending
/// @param read_frame   gives a frame; called from several threads
/// @throws Error (input) if no frame has a pose, or no keyframe corners with depth; (misuse) naming
///         the field of the options or an image of another size than the camera's; (cancelled);
///         what read_frame throws
MapAtPoses map_at_poses(std::span<const double> timestamps_s,
                        const std::function<FrameImages(std::size_t frame)>& read_frame,
                        const Trajectory& poses, const Camera& camera,
                        const MapAtPosesOptions& options = {});

/// The same for a sequence on disk; frames without depth are no keyframes.
/// @throws Error (input) naming an image that cannot be read or has another size than the camera
MapAtPoses map_at_poses(const RgbdSequence& sequence, const Trajectory& poses, const Camera& camera,
                        const MapAtPosesOptions& options = {});

}  // namespace cairn
