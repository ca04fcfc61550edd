// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "cairn/core/execution.hpp"
#include "cairn/geometry/trajectory.hpp"
#include "cairn/map/landmark_map.hpp"
#include "cairn/pose_graph/pose_graph.hpp"
#include "cairn/vision/odometry.hpp"
#include "cairn/vision/sequence.hpp"

namespace cairn {

/// Limits of a mini-map's length; the first limit reached ends the mini-map.
struct MiniMapLength {
  std::optional<double> metres;       ///< length of the camera path; positive
  std::optional<std::size_t> frames;  ///< tracked frames; at least 2
  std::optional<double> turn_rad;     ///< sum of the angles between tracked frames; positive
};

/// Progress of the mapping after a frame.
struct MappingProgress {
  std::size_t frame = 0;  ///< frames done so far
  std::size_t frames = 0;
  std::size_t landmarks = 0;  ///< found in the last frame
  std::size_t lost = 0;       ///< lost frames so far
};

struct MapSequenceOptions {
  OdometryOptions odometry;
  MapOptions map;
  std::optional<MiniMapLength> mini_maps;  ///< std::nullopt: one map of the whole sequence
  /// Only for map_sequence(): skips unreadable images; if false, they are an error.
  bool skip_unreadable = false;
  /// Called after each frame, with more detail than Execution::progress.
  std::function<void(const MappingProgress&)> on_frame = {};

  /// @throws Error (misuse) naming the field
  void validate() const;
};

/// Consecutive frames that were not tracked after tracking had begun.
struct LostStretch {
  double first_timestamp_s = 0.0;
  double last_timestamp_s = 0.0;
  std::size_t frames = 0;
};

struct MappedSequence {
  /// One map, or the mini-maps in temporal order. The first map begins at OdometryOptions::start;
  /// each other map is in the frame of its first camera.
  std::vector<LandmarkMap> maps;
  /// Odometry links, one fewer than maps: the pose of each mini-map in the previous one, with
  /// stated_covariance(). The last keyframe of a mini-map is the first keyframe of the next. Node
  /// ids are indices in `maps`.
  std::vector<Link> links;
  /// Poses of all tracked frames, in the frame of the first map.
  Trajectory trajectory;

  std::size_t frames = 0;
  std::size_t frames_without_depth = 0;
  std::size_t unreadable = 0;
  std::size_t waiting = 0;  ///< frames before tracking began
  std::size_t tracked = 0;
  std::size_t keyframes = 0;
  std::vector<LostStretch> lost;
  double mean_tracked_landmarks = 0.0;  ///< per tracked frame
  /// Median over the tracked frames that are not keyframes, because keyframes are fitted; pixels.
  std::optional<double> median_reprojection_error;

  std::size_t lost_frames() const;
};

/// Builds the map of a sequence. While one thread tracks, the others read later frames and extract
/// features. The number of threads does not affect the result. Without tracking, `maps` is empty.
/// @param read_frame returns frame 0 to frames - 1, in temporal order; called from several threads
/// @throws Error (misuse) naming the field of the options or an image that does not have the camera's size;
///        (cancelled); what read_frame throws
MappedSequence map_frames(std::size_t frames,
                          const std::function<FrameImages(std::size_t frame)>& read_frame,
                          const Camera& camera, const MapSequenceOptions& options = {},
                          const Execution& execution = {});

/// As map_frames(), for a sequence on disk; landmarks get colours from the images.
/// @throws Error (input) naming an image that cannot be read or does not have the camera's size; (misuse);
///        (cancelled)
MappedSequence map_sequence(const ImageSequence& sequence, const Camera& camera,
                            const MapSequenceOptions& options = {},
                            const Execution& execution = {});

/// Pose graph of the mini-maps of a sequence: one node per mini-map, with its index as id, and
/// odometry links between neighbours. Poses are in the frame of the first mini-map, computed from
/// the links alone. The session is a UUID computed from the maps' content.
/// @param names one per mini-map
PoseGraph pose_graph(const MappedSequence& mapped, std::span<const std::string> names);

/// Covariance stored for a keyframe's pose, and for the link to the next mini-map.
///
/// The marginal covariance assumes independent errors, but the common errors of depth camera,
/// calibration and shutter remain after any number of observations. Therefore the marginal
/// covariance is scaled, and a constant is added. The constants come from 50 links of TUM
/// fr1/desk, xyz and rpy (0.5 and 1 m long), compared with motion capture after hand-eye
/// calibration. There, errors did not grow with the camera's rotation. See docs/method.md.
/// @param marginal covariance relative to the map's first keyframe, (δt, δφ), metres and radians
Matrix6d stated_covariance(const Matrix6d& marginal);

struct MapAtPosesOptions {
  FeatureOptions features;
  /// Sensor noise. The pose error is added; both are estimated from the residuals.
  SensorNoise noise;
  MapOptions map;                       ///< its covariance must be recursive
  double max_time_difference_s = 0.02;  ///< between a frame and the nearest pose; positive
  /// Skips keyframes with an unreadable image; if false, such an image is an error.
  bool skip_unreadable = false;
  std::function<void(const MappingProgress&)> on_frame = {};  ///< after each keyframe

  /// @throws Error (misuse) naming the field
  void validate() const;
};

struct MapAtPoses {
  LandmarkMap map;        ///< in the world frame of the poses
  Trajectory trajectory;  ///< poses of all frames with a pose
  std::size_t frames = 0;
  std::size_t without_pose = 0;   ///< frames without a pose close in time
  std::size_t without_depth = 0;  ///< frames with a pose but no depth image
  std::size_t unreadable = 0;     ///< keyframes left out because of an unreadable image
};

/// Builds a landmark map with known camera poses, e.g. from motion capture or another SLAM system;
/// only the landmarks are estimated. A frame's pose is interpolated between its neighbouring poses
/// if these are at most 0.1 s apart; otherwise, a pose within 1 ms of the frame is used. A frame
/// with depth becomes a keyframe after 10 degrees or 15 cm of motion. Only images of keyframes are
/// read. The result is the same for any number of threads.
/// @param timestamps_s timestamps of the frames, ascending
/// @param read_frame   returns a frame; called from several threads
/// @throws Error (input) if no frame has a pose, or no keyframe has corners with depth; (misuse) naming the
///        field of the options or an image that does not have the camera's size; (cancelled); what read_frame
///        throws
MapAtPoses map_at_poses(std::span<const double> timestamps_s,
                        const std::function<FrameImages(std::size_t frame)>& read_frame,
                        const Trajectory& poses, const Camera& camera,
                        const MapAtPosesOptions& options = {}, const Execution& execution = {});

/// As above, for a sequence on disk; frames without depth are not keyframes.
/// @throws Error (input) naming an image that cannot be read or does not have the camera's size
MapAtPoses map_at_poses(const ImageSequence& sequence, const Trajectory& poses,
                        const Camera& camera, const MapAtPosesOptions& options = {},
                        const Execution& execution = {});

}  // namespace cairn
