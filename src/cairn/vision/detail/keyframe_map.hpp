// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "cairn/vision/detail/landmark_graph.hpp"
#include "cairn/vision/detail/landmark_matching.hpp"
#include "cairn/vision/odometry.hpp"

namespace cairn::detail {

/// A frame during tracking.
struct TrackedFrame {
  std::size_t number = 0;  ///< position in the sequence
  double timestamp_s = 0.0;
  std::string image_name;
  Features features;
  Rigid3 world_from_camera;
  std::vector<std::optional<LandmarkIndex>> landmarks;  ///< one per keypoint
};

/// Whether a camera sees enough new area after this motion for a keyframe.
bool is_new_view(const Rigid3& motion);

/// Landmarks that a frame should observe.
struct ExpectedLandmarks {
  std::vector<LandmarkIndex> landmarks;
  std::vector<ExpectedAppearance> appearances;  ///< one per landmark
};

/// The map under construction, with the functions that find its landmarks in a frame of approximately known
/// pose and make that frame a keyframe.
class KeyframeMap {
 public:
  /// @throws Error (misuse) for a defective camera or options out of range
  KeyframeMap(const Camera& camera, const FeatureOptions& features, const SensorNoise& noise);
  KeyframeMap(const KeyframeMap&) = delete;
  KeyframeMap& operator=(const KeyframeMap&) = delete;

  const FeatureExtractor& extractor() const { return extractor_; }
  const SensorModel& sensor() const { return sensor_; }
  cv::Size image() const { return image_; }
  const LandmarkGraph& graph() const { return graph_; }
  LandmarkGraph& graph() { return graph_; }

  ExpectedLandmarks expected_in(const TrackedFrame& frame) const;
  /// The landmarks already matched in the frame, and the expected ones matched with corners within the
  /// radius (see match_near()).
  std::vector<LandmarkMatch> match_corners(const TrackedFrame& frame,
                                           const ExpectedLandmarks& expected, double radius) const;
  /// Moves the keypoints to where their landmarks' patches match best. @return the matches whose patches match
  std::vector<LandmarkMatch> align(TrackedFrame& frame,
                                   std::span<const LandmarkMatch> matches) const;
  /// Searches for the patches of landmarks that should be visible but match no corner, and adds them to the
  /// frame as keypoints.
  std::vector<LandmarkMatch> find_without_corners(TrackedFrame& frame,
                                                  const ExpectedLandmarks& expected,
                                                  std::span<const LandmarkMatch> matches) const;
  /// Counts which of the expected landmarks the frame observes.
  void note_found(const TrackedFrame& frame, const ExpectedLandmarks& expected);

  /// Adds a keyframe with the frame's observations, and new landmarks at unmatched corners with depth. Merges new
  /// landmarks that turn out to be known. The keyframe's images stay until drop_images() of its features.
  /// @return its index
  std::uint32_t add_keyframe(const TrackedFrame& frame);
  /// Corrects a keyframe for the motion during its readout: its pose, which is fitted to the landmarks that other
  /// keyframes observe too, and the landmarks that it alone observes. The first keyframe keeps its pose, because it
  /// fixes the map in the world.
  void correct_keyframe(std::uint32_t index, const RowMotion& motion);
  /// Removes landmarks that should have been observed again but were not.
  void cull(std::uint32_t newest);
  /// Replaces the sensor's noise by the estimate from the residuals. However often this is called, the estimate stays
  /// within its limits about the configured noise.
  void adopt_estimated_noise();
  /// Removes all keyframes and landmarks, and returns to the configured noise: estimates from successive maps
  /// must not compound.
  void clear();

  /// @param landmark_covariances one per landmark of the graph
  /// @param pose_covariances     one per keyframe, or none
  LandmarkMap to_map(const MapOptions& options,
                     const std::vector<Eigen::Matrix3d>& landmark_covariances,
                     const std::vector<Matrix6d>& pose_covariances) const;

 private:
  // Place and octave of a landmark's patch in a frame.
  struct FoundPatch {
    Pixel raw;
    int octave = 0;
  };
  std::optional<FoundPatch> find_patch(const Features& features, LandmarkIndex landmark,
                                       const Rigid3& camera_from_world, const Pixel& start) const;
  // Where a frame shows a point.
  std::optional<Pixel> seen_at(const RowMotion& motion, const Eigen::Vector3d& x_in_camera) const;
  Pixel pixel_in_map(const Keyframe& keyframe, const Keypoint& keypoint) const;
  std::vector<LandmarkIndex> worth_seeking(const ExpectedLandmarks& expected,
                                           std::span<const LandmarkMatch> matches) const;
  void cut_patch(const KeypointReference& reference);
  void merge_known_landmarks(std::uint32_t keyframe);

  SensorModel sensor_with(const SensorNoise& noise) const;

  Camera camera_;
  cv::Size image_;
  FeatureExtractor extractor_;
  SensorNoise configured_noise_;
  SensorModel sensor_;
  LandmarkGraph graph_;
};

}  // namespace cairn::detail
