// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "cairn/core/ids.hpp"
#include "cairn/geometry/rigid3.hpp"
#include "cairn/vision/detail/features.hpp"
#include "cairn/vision/detail/patch_alignment.hpp"
#include "cairn/vision/detail/sensor_model.hpp"

namespace cairn::detail {

/// A frame whose observations are part of the map.
struct Keyframe {
  std::size_t frame = 0;  ///< position in the sequence
  double timestamp_s = 0.0;
  std::string image_name;
  Rigid3 world_from_camera;
  Features features;
  /// One entry per keypoint.
  std::vector<std::optional<LandmarkIndex>> landmarks;
  std::vector<bool> depth_disagrees;
  /// For keypoints that are no corners: descriptor of what the image shows there; std::nullopt if unknown.
  /// Their descriptors in `features` are copies of their landmarks' descriptors.
  std::vector<std::optional<Descriptor>> shown = {};
};

/// A keypoint of a keyframe, matched with a landmark.
struct KeypointReference {
  std::uint32_t keyframe = 0;
  std::uint32_t keypoint = 0;

  friend bool operator==(const KeypointReference&, const KeypointReference&) = default;
};

/// A landmark's appearance in one keyframe, to which all its observations are aligned.
struct LandmarkAppearance {
  KeypointReference seen_at;
  ReferencePatch patch;
  /// Increase of the surface's depth per pixel to the right and downwards, as a share of its depth.
  Eigen::Vector2d slope = Eigen::Vector2d::Zero();
};

struct TrackedLandmark {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  std::vector<KeypointReference> observations;  ///< oldest first; empty: the landmark was removed
  std::optional<LandmarkAppearance> appearance;
  Descriptor descriptor{};  ///< of all observations' descriptors, the one nearest to the others
  Eigen::Vector3d viewing_direction = Eigen::Vector3d::UnitZ();  ///< mean, camera to landmark
  /// Distance at which the landmark appears on the finest pyramid level.
  double reference_distance_m = 1.0;
  std::uint32_t expected = 0;  ///< frames that should have observed it
  std::uint32_t found = 0;     ///< frames that observed it
  std::size_t last_seen = 0;   ///< frame

  bool gone() const { return observations.empty(); }
};

/// The map under construction: keyframes, landmarks, and the matches of keypoints with landmarks, which are
/// consistent on both sides.
class LandmarkGraph {
 public:
  explicit LandmarkGraph(const SensorModel& sensor) : sensor_(&sensor) {}

  std::vector<Keyframe>& keyframes() { return keyframes_; }
  const std::vector<Keyframe>& keyframes() const { return keyframes_; }
  std::vector<TrackedLandmark>& landmarks() { return landmarks_; }
  const std::vector<TrackedLandmark>& landmarks() const { return landmarks_; }
  TrackedLandmark& landmark(LandmarkIndex index) { return landmarks_[index.value]; }
  const TrackedLandmark& landmark(LandmarkIndex index) const { return landmarks_[index.value]; }
  /// Linear map from pixels of a camera's image to pixels of the pyramid level of the landmark's patch.
  /// std::nullopt without a patch, or if the landmark is behind either camera.
  std::optional<Eigen::Matrix2d> patch_from_image(const TrackedLandmark& landmark,
                                                  const Rigid3& camera_from_world) const;
  const SensorModel& sensor() const { return *sensor_; }

  /// Appends a keyframe without observations. @return its index
  std::uint32_t add_keyframe(Keyframe keyframe);
  /// Adds a landmark at a keypoint with depth.
  LandmarkIndex add_landmark(KeypointReference reference);
  /// The keypoint must be free, and the keyframe must not observe the landmark yet.
  void observe(LandmarkIndex index, KeypointReference reference);
  /// Removes an observation, and the patch of its landmark if the patch was taken there.
  void forget(KeypointReference reference);
  void remove(LandmarkIndex index);
  /// Moves `from`'s observations to `into`, except those of keyframes that `into` already has.
  void merge(LandmarkIndex from, LandmarkIndex into);
  /// Updates descriptor, viewing direction and reference distance from the observations.
  void refresh(LandmarkIndex index);

  bool observes(std::uint32_t keyframe, LandmarkIndex index) const;
  PointMeasurement measurement(KeypointReference reference) const;
  /// Keyframes that share landmarks with this one, with the number of shared landmarks; most first.
  std::vector<std::pair<std::uint32_t, std::size_t>> covisible(std::uint32_t keyframe) const;

 private:
  const SensorModel* sensor_;
  std::vector<Keyframe> keyframes_;
  std::vector<TrackedLandmark> landmarks_;
};

}  // namespace cairn::detail
