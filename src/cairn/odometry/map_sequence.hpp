// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include "cairn/core/executor.hpp"
#include "cairn/core/log.hpp"
#include "cairn/map/landmark_map.hpp"
#include "cairn/odometry/odometry.hpp"
#include "cairn/sequence/sequence.hpp"
#include "cairn/trajectory/trajectory.hpp"

namespace cairn {

/// When a mini-map is long enough: after any of these, where given.
struct MiniMapLength {
  std::optional<double> metres;       ///< of the camera's path; positive
  std::optional<std::size_t> frames;  ///< tracked frames; at least 2
  std::optional<double> turn_rad;     ///< sum of the angles between tracked frames; positive
};

/// How far mapping has come, told after each frame.
struct MappingProgress {
  std::size_t frame = 0;  ///< done so far
  std::size_t frames = 0;
  std::size_t landmarks = 0;  ///< found in the last frame
  std::size_t lost = 0;       ///< frames so far
};

struct MapSequenceOptions {
  OdometryOptions odometry;
  MapOptions map;
  std::optional<MiniMapLength> mini_maps;  ///< nothing: one map of all
  /// Of map_sequence: go on where an image cannot be read, as if the camera had taken none. Else that
  /// is an error.
  bool skip_unreadable = false;
  Executor executor = Executor();  ///< one thread by default; results do not depend on how many
  std::stop_token stop = {};
  std::function<void(const MappingProgress&)> progress = {};
  LogSink log = {};

  /// @throws Error (misuse) naming the field
  void validate() const;
};

/// Consecutive frames that were not tracked though tracking had begun.
struct LostStretch {
  double first_timestamp_s = 0.0;
  double last_timestamp_s = 0.0;
  std::size_t frames = 0;
};

struct MappedSequence {
  /// One map, or the mini-maps in the order of time, each in the frame of its first camera but the
  /// first, which has the start pose.
  std::vector<LandmarkMap> maps;
  /// How each mini-map lies in the one before, its first keyframe being the last of that one; one
  /// fewer than maps.
  std::vector<MiniMapLink> links;
  /// All tracked frames, in the frame of the first map.
  Trajectory trajectory;

  std::size_t frames = 0;
  std::size_t frames_without_depth = 0;
  std::size_t unreadable = 0;
  std::size_t waiting = 0;  ///< before tracking began
  std::size_t tracked = 0;
  std::size_t keyframes = 0;
  std::vector<LostStretch> lost;
  double mean_tracked_landmarks = 0.0;  ///< a tracked frame
  /// Of tracked frames that are no keyframes, hence were not fitted; pixels.
  std::optional<double> median_reprojection_error;

  std::size_t lost_frames() const;
};

/// What one moment of a sequence looks like.
struct FrameImages {
  double timestamp_s = 0.0;
  std::string name;  ///< of the colour image
  cv::Mat gray;      ///< 8 bit, of the camera's size; empty where it could not be read, because of
  std::string defect;
  cv::Mat depth_m;  ///< 32-bit float of the same size, 0 where unknown; empty if there is none
};

/// Images that are in memory, row by row from the top left.
/// @param bgr     8-bit blue, green, red of each pixel
/// @param depth_m of each pixel, 0 where unknown; empty if there is none
/// @throws Error (misuse) if their sizes are not those of such an image
FrameImages frame_images(double timestamp_s, std::uint32_t width, std::uint32_t height,
                         std::span<const std::uint8_t> bgr, std::span<const float> depth_m);

/// Those of a sequence on disk. Thread-safe.
/// @param skip_unreadable an image that cannot be read is a defect of what is returned, no error
/// @throws Error (input) naming an image that cannot be read or has another size than the camera
FrameImages frame_images(const RgbdSequence& sequence, std::size_t frame, const Camera& camera,
                         bool skip_unreadable);

/// Builds the map of a whole sequence; images are got and searched for features on all threads,
/// ahead of the tracking. The result is the same with any number of threads. A sequence in which
/// tracking never began has no maps.
/// @param read_frame gives frame 0 to frames - 1, in the order of time; called from several threads
/// @throws Error (misuse) naming the field of the options or an image of another size than the
///         camera's; (cancelled); what read_frame throws
MappedSequence map_frames(std::size_t frames,
                          const std::function<FrameImages(std::size_t frame)>& read_frame,
                          const Camera& camera, const MapSequenceOptions& options = {});

/// The same for a sequence on disk, whose landmarks get the colours of its images.
/// @throws Error (input) naming an image that cannot be read or has another size than the camera;
///         (misuse); (cancelled)
MappedSequence map_sequence(const RgbdSequence& sequence, const Camera& camera,
                            const MapSequenceOptions& options = {});

}  // namespace cairn
