// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "cairn/core/option_table.hpp"
#include "cairn/geometry/trajectory.hpp"
#include "cairn/map/distinct_descriptors.hpp"
#include "cairn/map/landmark_map.hpp"
#include "cairn/vision/odometry/features.hpp"
#include "cairn/vision/odometry/sensor_model.hpp"

namespace cairn {

struct OdometryOptions {
  FeatureOptions features;
  SensorNoise noise;
  /// Pose of the first frame of the map, called with that frame's time; empty: the identity.
  std::function<Rigid3(double timestamp_s)> start = {};
  /// Readout time of a rolling shutter, from an image's first row to its last, seconds; 0: global shutter.
  /// 0 to 1.
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

enum class FrameStatus {
  kWaiting,  ///< not started: no frame with depth and texture yet
  kTracked,
  kLost,
};

/// Result for one frame.
struct FrameReport {
  FrameStatus status = FrameStatus::kWaiting;
  bool keyframe = false;
  std::size_t landmarks = 0;  ///< found in it
  /// Reprojection error of each of them, pixels.
  std::vector<float> reprojection_errors;
};

/// Estimation of landmark covariances. Both are relative to the keyframe that observed the landmark first.
enum class LandmarkCovariance {
  kRecursive,  ///< updated with each observation; cost is linear in the observations
  kMarginal,   ///< from the whole least-squares problem; at most kMostMarginalKeyframes keyframes
};

struct MapOptions {
  std::size_t min_observations = 1;  ///< leaves out landmarks with fewer; at least 1
  LandmarkCovariance covariance = LandmarkCovariance::kRecursive;
  bool descriptors = true;
  /// Largest number of descriptors per landmark, of its most distinct views; 1 to kMostDescriptorsEach.
  std::size_t descriptors_each = kDistinctViews;

  static const OptionTable table;
  /// @throws Error (misuse) naming the field
  void validate() const;
};

/// Pose of a mini-map in the previous one.
struct MiniMapLink {
  Rigid3 previous_from_next;
  Matrix6d covariance = Matrix6d::Zero();  ///< of that pose, wider than the marginal one
};

/// A map that was completed when another was begun.
struct FinishedMap {
  LandmarkMap map;
  Trajectory trajectory;
  MiniMapLink to_next;
};

/// Feature-based RGB-D odometry: estimates the pose of each frame in the map built so far, and extends that
/// map. Frames must come in the order of time.
class Odometry {
 public:
  /// @throws Error (misuse) for a camera with a defect, or options outside their range
  explicit Odometry(const Camera& camera, const OdometryOptions& options = {});
  Odometry(Odometry&&) noexcept;
  Odometry& operator=(Odometry&&) noexcept;
  ~Odometry();

  /// Extracts the features of a frame: the costly part, independent of other frames. Thread-safe.
  /// @param gray 8 bit, of the camera's size
  /// @param depth_m 32-bit float of the same size, 0 if unknown; empty if there is none
  Features extract(const cv::Mat& gray, const cv::Mat& depth_m) const;

  FrameReport track(double timestamp_s, Features features, std::string image_name = {});

  /// Completes the map: makes the last frame a keyframe and adjusts all keyframes and landmarks.
  void complete();
  /// Poses of all frames tracked in this map so far, in its current state.
  Trajectory trajectory() const;
  /// All keyframes, and the landmarks.
  /// @throws Error (misuse) naming the field of the options
  LandmarkMap map(const MapOptions& options = {}) const;

  /// Pose of the last frame in the map; std::nullopt if it was not tracked.
  std::optional<Rigid3> last_pose() const;
  /// Whether a map can begin at the last frame: it was tracked, and has enough depth and texture.
  bool can_begin_new_map() const;
  /// Ends the map with the last frame as its last keyframe, and begins another with it as the first
  /// keyframe, in the frame of that camera. The two maps share no landmark.
  /// @throws Error (misuse) unless can_begin_new_map()
  FinishedMap begin_new_map(const MapOptions& options = {});

 private:
  class Tracker;
  std::unique_ptr<Tracker> tracker_;
};

}  // namespace cairn
