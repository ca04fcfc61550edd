// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "cairn/core/ids.hpp"
#include "cairn/geometry/rigid3.hpp"
#include "cairn/odometry/features.hpp"
#include "cairn/odometry/patch_alignment.hpp"
#include "cairn/odometry/sensor_model.hpp"

namespace cairn {

/// A frame whose observations build the map.
struct Keyframe {
  std::size_t frame = 0;  ///< position in the sequence
  double timestamp_s = 0.0;
  std::string image_name;
  Rigid3 world_from_camera;
  Features features;
  /// One entry a keypoint.
  std::vector<std::optional<LandmarkIndex>> landmarks;
  std::vector<bool> depth_disagrees;
};

/// Keypoint of a keyframe, taken to be of one landmark.
struct KeypointReference {
  std::uint32_t keyframe = 0;
  std::uint32_t keypoint = 0;

  friend bool operator==(const KeypointReference&, const KeypointReference&) = default;
};

/// What a landmark looked like in one keyframe; all its observations are aligned with that.
struct LandmarkAppearance {
  KeypointReference seen_at;
  ReferencePatch patch;
  /// By how much the surface is farther away a pixel to the right, and below, as a share of its depth.
  Eigen::Vector2d slope = Eigen::Vector2d::Zero();
};

struct TrackedLandmark {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  std::vector<KeypointReference> observations;  ///< oldest first; empty: the landmark is gone
  std::optional<LandmarkAppearance> appearance;
  Descriptor descriptor{};  ///< the one nearest to all of its observations
  Eigen::Vector3d viewing_direction = Eigen::Vector3d::UnitZ();  ///< mean, camera to landmark
  double reference_distance_m = 1.0;  ///< where it would appear on the finest pyramid level
  std::uint32_t expected = 0;         ///< frames that should have seen it
  std::uint32_t found = 0;            ///< frames that did
  std::size_t last_seen = 0;          ///< frame

  bool gone() const { return observations.empty(); }
};

/// The map while it is being built: keyframes, landmarks and which keypoint is of which landmark.
/// Both sides of that relation always agree.
class LandmarkGraph {
 public:
  explicit LandmarkGraph(const SensorModel& sensor) : sensor_(&sensor) {}

  std::vector<Keyframe>& keyframes() { return keyframes_; }
  const std::vector<Keyframe>& keyframes() const { return keyframes_; }
  std::vector<TrackedLandmark>& landmarks() { return landmarks_; }
  const std::vector<TrackedLandmark>& landmarks() const { return landmarks_; }
  TrackedLandmark& landmark(LandmarkIndex index) { return landmarks_[index.value]; }
  const TrackedLandmark& landmark(LandmarkIndex index) const { return landmarks_[index.value]; }
  /// How the image of a landmark's patch changes from where it was cut to a camera: the linear map
  /// from pixels of the image to pixels of the patch's pyramid level. Nothing without a patch, or if the landmark is behind either camera.
  std::optional<Eigen::Matrix2d> patch_from_image(const TrackedLandmark& landmark,
                                                  const Rigid3& camera_from_world) const;
  const SensorModel& sensor() const { return *sensor_; }

  /// Appends a keyframe without observations; its index.
  std::uint32_t add_keyframe(Keyframe keyframe);
  /// A new landmark where a keypoint with depth is.
  LandmarkIndex add_landmark(KeypointReference reference);
  /// The keypoint must be free, and the landmark not observed by that keyframe.
  void observe(LandmarkIndex index, KeypointReference reference);
  /// A landmark whose patch was cut there loses that too.
  void forget(KeypointReference reference);
  void remove(LandmarkIndex index);
  /// `from`'s observations go to `into`, except those of keyframes that `into` has already.
  void merge(LandmarkIndex from, LandmarkIndex into);
  /// Descriptor, viewing direction and reference distance, from the observations as they are.
  void refresh(LandmarkIndex index);

  bool observes(std::uint32_t keyframe, LandmarkIndex index) const;
  PointMeasurement measurement(KeypointReference reference) const;
  /// Keyframes that share landmarks with one, and how many; most first.
  std::vector<std::pair<std::uint32_t, std::size_t>> covisible(std::uint32_t keyframe) const;

 private:
  const SensorModel* sensor_;
  std::vector<Keyframe> keyframes_;
  std::vector<TrackedLandmark> landmarks_;
};

}  // namespace cairn
