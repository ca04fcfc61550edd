// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "cairn/map/landmark_map.hpp"
#include "cairn/odometry/features.hpp"
#include "cairn/odometry/sensor_model.hpp"
#include "cairn/trajectory/trajectory.hpp"

namespace cairn {

struct OdometryOptions {
  FeatureOptions features;
  SensorNoise noise;
  /// The pose of the first frame that the map is built from, asked for with that frame's time;
  /// empty: the identity.
  std::function<Rigid3(double timestamp_s)> start = {};
  /// Seconds from an image's first row to its last: a rolling shutter; 0: all rows are taken at once.
  /// 0 to 1.
  double readout_s = 0.0;
  /// Fewer landmarks than this found in a frame: tracking is lost. At least 6.
  std::size_t min_tracked = 20;
  /// Keyframes that move in a local bundle adjustment. At least 1.
  std::size_t adjusted_keyframes = 8;
  /// Iterations of the bundle adjustment over all keyframes that completes a map; 0: none.
  int final_iterations = 10;

  /// @throws Error (misuse) naming the field
  void validate() const;
};

enum class FrameStatus {
  kWaiting,  ///< nothing to start from yet: no depth, or no texture
  kTracked,
  kLost,
};

/// What became of one frame.
struct FrameReport {
  FrameStatus status = FrameStatus::kWaiting;
  bool keyframe = false;
  std::size_t landmarks = 0;  ///< found in it
  /// Distance of each of them from where the map says it appears, pixels.
  std::vector<float> reprojection_errors;
};

/// How landmark covariances are found; both are of the position relative to the keyframe that
/// observed the landmark first.
enum class LandmarkCovariance {
  kRecursive,  ///< updated observation by observation; cost grows with the observations only
  kMarginal,   ///< from the whole least-squares problem; at most kMostMarginalKeyframes keyframes
};

struct MapOptions {
  std::size_t min_observations = 1;  ///< landmarks with fewer are left out; at least 1
  LandmarkCovariance covariance = LandmarkCovariance::kRecursive;
  bool descriptors = true;

  /// @throws Error (misuse) naming the field
  void validate() const;
};

/// How one mini-map lies in the one before it.
struct MiniMapLink {
  Rigid3 previous_from_next;
  Matrix6d covariance = Matrix6d::Zero();  ///< of that pose; see link_covariance()
};

/// A map that is complete because another was begun.
struct FinishedMap {
  LandmarkMap map;
  Trajectory trajectory;
  MiniMapLink to_next;
};

/// Feature-based RGB-D odometry: estimates the pose of each frame against the map of landmarks seen
/// so far, and builds that map. Frames come in the order of time.
class Odometry {
 public:
  /// @throws Error (misuse) for a camera with a defect, or options outside their range
  explicit Odometry(const Camera& camera, const OdometryOptions& options = {});
  Odometry(Odometry&&) noexcept;
  Odometry& operator=(Odometry&&) noexcept;
  ~Odometry();

  /// The costly part of a frame that depends on no other. Thread-safe.
  /// @param gray    8 bit, of the camera's size
  /// @param depth_m 32-bit float of the same size, 0 where unknown; empty if there is none
  Features extract(const cv::Mat& gray, const cv::Mat& depth_m) const;

  FrameReport track(double timestamp_s, Features features, std::string image_name = {});

  /// Completes the map: the last frame becomes a keyframe, and all keyframes and landmarks are
  /// adjusted at once.
  void complete();
  /// The poses of all frames tracked in this map so far, as the map has them now.
  Trajectory trajectory() const;
  /// All keyframes, and the landmarks.
  /// @throws Error (misuse) naming the field of the options
  LandmarkMap map(const MapOptions& options = {}) const;

  /// Where the last frame was, in the map; nothing if it was not tracked.
  std::optional<Rigid3> last_pose() const;
  /// Whether a map can begin at the last frame: it was tracked, and has the depth and the texture that
  /// a first frame needs.
  bool can_begin_new_map() const;
  /// Ends the map at the last frame, which becomes its last keyframe, and begins another, in the
  /// frame of that camera, with it as the first keyframe. The two maps share no landmark.
  /// @throws Error (misuse) unless can_begin_new_map()
  FinishedMap begin_new_map(const MapOptions& options = {});

 private:
  class Tracker;
  std::unique_ptr<Tracker> tracker_;
};

}  // namespace cairn
