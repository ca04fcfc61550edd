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
#include "cairn/geometry/trajectory.hpp"
#include "cairn/map/landmark_map.hpp"
#include "cairn/vision/odometry/odometry.hpp"
#include "cairn/vision/sequence/sequence.hpp"

namespace cairn {

/// Limits of a mini-map's length; the first one reached ends it.
struct MiniMapLength {
  std::optional<double> metres;       ///< of the camera's path; positive
  std::optional<std::size_t> frames;  ///< tracked frames; at least 2
  std::optional<double> turn_rad;     ///< sum of the angles between tracked frames; positive
};

/// Progress of mapping, reported after each frame.
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
  /// For map_sequence: treat an image that cannot be read as if it did not exist; if false, that is an
  /// error.
  bool skip_unreadable = false;
  Executor executor = Executor();  ///< one thread by default; results do not depend on how many
  std::stop_token stop = {};
  std::function<void(const MappingProgress&)> progress = {};
  LogSink log = {};

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
  /// One map, or the mini-maps in the order of time. The first has the start pose; each other is in the
  /// frame of its first camera.
  std::vector<LandmarkMap> maps;
  /// Pose of each mini-map in the previous one, whose last keyframe is its first; one fewer than maps.
  std::vector<MiniMapLink> links;
  /// All tracked frames, in the frame of the first map.
  Trajectory trajectory;

  std::size_t frames = 0;
  std::size_t frames_without_depth = 0;
  std::size_t unreadable = 0;
  std::size_t waiting = 0;  ///< frames before tracking began
  std::size_t tracked = 0;
  std::size_t keyframes = 0;
  std::vector<LostStretch> lost;
  double mean_tracked_landmarks = 0.0;  ///< per tracked frame
  /// Over tracked frames that are not keyframes, and were therefore not fitted; pixels.
  std::optional<double> median_reprojection_error;

  std::size_t lost_frames() const;
};

/// The images of one time in a sequence.
struct FrameImages {
  double timestamp_s = 0.0;
  std::string name;  ///< of the colour image
  cv::Mat
      gray;  ///< 8 bit, of the camera's size; empty if it could not be read, because of `defect`
  std::string defect;
  cv::Mat depth_m;  ///< 32-bit float of the same size, 0 if unknown; empty if there is none
};

/// Images from memory, row by row from the top left.
/// @param bgr 8-bit blue, green, red of each pixel
/// @param depth_m of each pixel, 0 if unknown; empty if there is none
/// @throws Error (misuse) for sizes that do not fit such an image
FrameImages frame_images(double timestamp_s, std::uint32_t width, std::uint32_t height,
                         std::span<const std::uint8_t> bgr, std::span<const float> depth_m);

/// Images of a sequence on disk. Thread-safe.
/// @param skip_unreadable return an image that cannot be read as a defect instead of an error
/// @throws Error (input) naming an image that cannot be read or does not have the camera's size
FrameImages frame_images(const RgbdSequence& sequence, std::size_t frame, const Camera& camera,
                         bool skip_unreadable);

/// Builds the map of a whole sequence. Images are read and searched for features on all threads, ahead of
/// the tracking. The result is the same for any number of threads. If tracking never began, there are no
/// maps.
/// @param read_frame returns frame 0 to frames - 1, in the order of time; called from several threads
/// @throws Error (misuse) naming the field of the options or an image that does not have the camera's size;
///        (cancelled); what read_frame throws
MappedSequence map_frames(std::size_t frames,
                          const std::function<FrameImages(std::size_t frame)>& read_frame,
                          const Camera& camera, const MapSequenceOptions& options = {});

/// The same for a sequence on disk; its landmarks get the colours of the images.
/// @throws Error (input) naming an image that cannot be read or does not have the camera's size; (misuse);
///        (cancelled)
MappedSequence map_sequence(const RgbdSequence& sequence, const Camera& camera,
                            const MapSequenceOptions& options = {});

}  // namespace cairn
