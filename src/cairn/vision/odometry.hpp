// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "cairn/core/option_table.hpp"
#include "cairn/geometry/trajectory.hpp"
#include "cairn/map/landmark_map.hpp"
#include "cairn/map/operations.hpp"
#include "cairn/vision/image.hpp"
#include "cairn/vision/sequence.hpp"

namespace cairn {

namespace detail {
class Tracker;
}

/// Detection of corners: oriented FAST corners, evenly spread over the image, with ORB descriptors (Rublee et
/// al., ICCV 2011).
struct FeatureOptions {
  int count = 1000;           ///< number of keypoints per image, 50 to 20000
  int levels = 8;             ///< levels of the image pyramid, 1 to 12
  double scale = 1.2;         ///< ratio between pyramid levels, 1.05 to 2
  int threshold = 20;         ///< FAST threshold, grey levels
  int least_threshold = 7;    ///< FAST threshold in areas without a corner of `threshold`
  double max_depth_m = 10.0;  ///< largest depth in depth images; positive
  /// Baseline of a rectified stereo pair, 0 to 10; 0: depth images. Stereo depths range from twice
  /// the baseline (at least 0.3 m) to the depth with a disparity of one pixel of the corner's
  /// pyramid level.
  double baseline_m = 0.0;

  static const OptionTable table;
  /// @throws Error (misuse) naming the field
  void validate() const;
};

/// Standard deviations of the measurements of an RGB-D or stereo camera.
struct SensorNoise {
  /// Detected corner, in pixels of its pyramid level; positive.
  double pixel = 0.9;
  /// Aligned patch relative to its reference patch, in pixels of its pyramid level; positive.
  double aligned_pixel = 0.4;
  /// Depth z: floor + quadratic·z², in metres (structured light: Khoshelham and Elberink, Sensors
  /// 2012). The floor is positive, the quadratic term not negative.
  double depth_floor_m = 0.001;
  double depth_quadratic = 0.002;
  /// Disparity of a stereo pair, in pixels of its pyramid level; positive.
  double disparity = 0.25;

  static const OptionTable table;
  /// @throws Error (misuse) naming the field
  void validate() const;
};

struct OdometryOptions {
  FeatureOptions features;
  SensorNoise noise;
  /// Returns the pose world_from_camera of the map's first frame; empty: the identity.
  std::function<Rigid3(double timestamp_s)> start = {};
  /// Readout time of a rolling shutter, from an image's first row to its last, seconds; 0 to 1.
  /// 0: global shutter.
  double readout_s = 0.0;
  /// Tracking is lost if fewer landmarks than this are found in a frame. At least 6.
  std::size_t min_tracked = 20;
  /// Number of keyframes that a local bundle adjustment moves. At least 1.
  std::size_t adjusted_keyframes = 8;
  /// Iterations of the final bundle adjustment over all keyframes; 0: none.
  int final_iterations = 10;

  static const OptionTable table;
  /// @throws Error (misuse) naming the field
  void validate() const;
};

/// How landmark covariances are estimated. Both are relative to the landmark's first keyframe.
enum class LandmarkCovariance {
  kRecursive,  ///< updated with each observation; cost is linear in the observations
  kMarginal,   ///< from the whole least-squares problem; at most kMostDenseFrames keyframes
};

struct MapOptions {
  std::size_t min_observations = 1;  ///< leaves out landmarks with fewer observations; at least 1
  LandmarkCovariance covariance = LandmarkCovariance::kRecursive;
  bool descriptors = true;
  /// Largest number of descriptors per landmark, from its most distinct views; 1 to
  /// kMostDescriptorsEach.
  std::size_t descriptors_each = kDistinctViews;

  static const OptionTable table;
  /// @throws Error (misuse) naming the field
  void validate() const;
};

/// The images of one frame.
struct FrameImages {
  double timestamp_s = 0.0;
  std::string name;  ///< name of the colour image
  GrayImage gray;    ///< image of the camera's size; empty if unreadable, see `defect`
  std::string defect;
  DepthImage depth_m;    ///< same size, metres; empty: none
  GrayImage right = {};  ///< right image of a rectified stereo pair, same size; empty: none
};

/// Images from memory, row by row from the top left.
/// @param bgr 8-bit blue, green, red of each pixel
/// @param depth_m depth of each pixel, 0 if unknown; empty: no depth image
/// @throws Error (misuse) if the number of values does not match the size
FrameImages frame_images(double timestamp_s, std::uint32_t width, std::uint32_t height,
                         std::span<const std::uint8_t> bgr, std::span<const float> depth_m);

/// Images of a sequence on disk. Thread-safe.
/// @param skip_unreadable report an unreadable image as FrameImages::defect instead of an error
/// @throws Error (input) naming an image that cannot be read or does not have the camera's size
FrameImages frame_images(const ImageSequence& sequence, std::size_t frame, const Camera& camera,
                         bool skip_unreadable);

enum class FrameStatus {
  kWaiting,  ///< not started: no frame with depth and texture yet
  kTracked,
  kLost,
};

/// Result for one frame.
struct FrameReport {
  FrameStatus status = FrameStatus::kWaiting;
  bool keyframe = false;
  std::size_t landmarks = 0;  ///< found in the frame
  /// Reprojection error of each found landmark, pixels.
  std::vector<float> reprojection_errors;
};

/// Feature-based RGB-D odometry, frame by frame: estimates the pose of each frame in the map built
/// so far, and extends that map. map_sequence() does the same for a whole sequence on several
/// threads.
class Odometry {
 public:
  /// @throws Error (misuse) for a camera with a defect, or options outside their range
  explicit Odometry(const Camera& camera, const OdometryOptions& options = {});
  Odometry(Odometry&&) noexcept;
  Odometry& operator=(Odometry&&) noexcept;
  ~Odometry();

  /// @param images images later than all previous ones
  /// @throws Error (misuse) for images that do not have the camera's size
  FrameReport track(const FrameImages& images);
  /// Completes the map: makes the last frame a keyframe and adjusts all keyframes and landmarks.
  void complete();
  /// Poses of all frames tracked so far, in the map's current state.
  Trajectory trajectory() const;
  /// Map of all keyframes and landmarks.
  /// @throws Error (misuse) naming the field of the options
  LandmarkMap map(const MapOptions& options = {}) const;
  /// Pose world_from_camera of the last frame; std::nullopt if the frame was not tracked.
  std::optional<Rigid3> last_pose() const;

 private:
  std::unique_ptr<detail::Tracker> tracker_;
};

}  // namespace cairn
