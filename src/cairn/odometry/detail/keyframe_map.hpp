// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "cairn/odometry/detail/landmark_matching.hpp"
#include "cairn/odometry/landmark_graph.hpp"
#include "cairn/odometry/odometry.hpp"

namespace cairn {

/// A frame while it is looked at.
struct TrackedFrame {
  std::size_t number = 0;  ///< position in the sequence
  double timestamp_s = 0.0;
  std::string image_name;
  Features features;
  Rigid3 world_from_camera;
  std::vector<std::optional<LandmarkIndex>> landmarks;  ///< one a keypoint
};

/// Whether a camera that moved so far sees enough that is new to make a keyframe.
bool is_new_view(const Rigid3& motion);

/// Landmarks that a frame should see.
struct ExpectedLandmarks {
  std::vector<LandmarkIndex> landmarks;
  std::vector<ExpectedAppearance> appearances;  ///< one for each
};

/// The map while it is built, with what it takes to find its landmarks in a frame whose pose is about
/// known, and to make that frame a keyframe.
class KeyframeMap {
 public:
  /// @throws Error (misuse) for a camera with a defect, or options outside their range
  KeyframeMap(const Camera& camera, const FeatureOptions& features, const SensorNoise& noise);
  KeyframeMap(const KeyframeMap&) = delete;
  KeyframeMap& operator=(const KeyframeMap&) = delete;

  const FeatureExtractor& extractor() const { return extractor_; }
  const SensorModel& sensor() const { return sensor_; }
  cv::Size image() const { return image_; }
  const LandmarkGraph& graph() const { return graph_; }
  LandmarkGraph& graph() { return graph_; }

  ExpectedLandmarks expected_in(const TrackedFrame& frame) const;
  /// The landmarks that the frame has already, and those of the expected that are matched to corners
  /// within the radius (see MatchingOptions).
  std::vector<LandmarkMatch> match_corners(const TrackedFrame& frame,
                                           const ExpectedLandmarks& expected, double radius) const;
  /// Puts the keypoints where the patches of their landmarks fit best; the matches whose patches do.
  std::vector<LandmarkMatch> align(TrackedFrame& frame,
                                   std::span<const LandmarkMatch> matches) const;
  /// Landmarks that should be visible but are at no corner: their patches are looked for where they
  /// should be, and become keypoints of the frame.
  std::vector<LandmarkMatch> find_without_corners(TrackedFrame& frame,
                                                  const ExpectedLandmarks& expected,
                                                  std::span<const LandmarkMatch> matches) const;
  /// Counts which of the expected landmarks the frame has.
  void note_found(const TrackedFrame& frame, const ExpectedLandmarks& expected);

  /// A keyframe with the frame's observations, and new landmarks where it has corners with depth but
  /// none that is known; new ones that turn out to be known are merged. Its images stay until
  /// drop_images() of its features.
  /// @return its index
  std::uint32_t add_keyframe(const TrackedFrame& frame);
  /// Removes landmarks that should have been seen again and were not.
  void cull(std::uint32_t newest);
  /// Takes the noise that the residuals tell of for the sensor's.
  void adopt_estimated_noise();
  /// Forgets keyframes and landmarks.
  void clear() { graph_ = LandmarkGraph(sensor_); }

  /// @param covariances one a landmark of the graph
  LandmarkMap to_map(const MapOptions& options,
                     const std::vector<Eigen::Matrix3d>& covariances) const;

 private:
  // Where a landmark's patch is found in a frame, and on which octave.
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

  Camera camera_;
  cv::Size image_;
  FeatureExtractor extractor_;
  SensorModel sensor_;
  LandmarkGraph graph_;
};

}  // namespace cairn
