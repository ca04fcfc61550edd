// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
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
  /// The pose of the first frame that the map is built from.
  Rigid3 start;
  /// Fewer landmarks than this found in a frame: tracking is lost. At least 6.
  std::size_t min_tracked = 20;
  /// Keyframes that move in a local bundle adjustment. At least 1.
  std::size_t adjusted_keyframes = 8;

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
  /// Distance of each of them from where the map says it appears, pixels of its octave.
  std::vector<float> reprojection_errors;
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

  /// The poses of all frames tracked so far, as the map has them now.
  Trajectory trajectory() const;
  /// Landmarks with at least that many observations, and all keyframes.
  LandmarkMap map(std::size_t min_observations = 1) const;

 private:
  class Tracker;
  std::unique_ptr<Tracker> tracker_;
};

}  // namespace cairn
