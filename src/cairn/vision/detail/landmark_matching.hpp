// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "cairn/vision/detail/landmark_graph.hpp"

namespace cairn::detail {

/// A keypoint of a frame matched with a landmark.
struct LandmarkMatch {
  std::uint32_t keypoint = 0;
  LandmarkIndex landmark;
  int distance = 0;  ///< distance of the descriptors, bits
};

/// Expected place and appearance of a landmark in a frame.
struct ExpectedAppearance {
  Eigen::Vector2d pixel;
  double octave = 0.0;    ///< not rounded
  double cos_view = 1.0;  ///< cosine of the angle to the landmark's mean viewing direction
};

/// std::nullopt if the landmark is outside the image, behind the camera, seen from the side, or much too
/// near or far.
std::optional<ExpectedAppearance> expected_appearance(const SensorModel& sensor, cv::Size image,
                                                      const TrackedLandmark& landmark,
                                                      const Rigid3& camera_from_world,
                                                      const Eigen::Vector3d& camera_centre);

/// Matches landmarks with the keypoints near their expected places. Each keypoint gets at most one
/// landmark, the most similar; keypoints in `taken` get none. Ordered by keypoint.
/// @param appearances   one per entry of `landmarks`
/// @param radius_pixels on the finest pyramid level; scaled with the octave
/// @param max_distance  of descriptors, bits
/// @param max_ratio     best to second best distance
std::vector<LandmarkMatch> match_near(const LandmarkGraph& graph, const Features& features,
                                      std::span<const LandmarkIndex> landmarks,
                                      std::span<const ExpectedAppearance> appearances,
                                      const std::vector<bool>& taken, double radius_pixels,
                                      int max_distance = 80, double max_ratio = 0.85);

/// Matches a frame's keypoints with the landmarks of a keyframe by descriptor alone: mutual nearest
/// neighbours that are clearly better than the second best. Ordered by keypoint.
std::vector<LandmarkMatch> match_by_descriptor(const LandmarkGraph& graph, std::uint32_t keyframe,
                                               const Features& features);

/// Keeps the matches whose rotation between landmark and keypoint agrees with most others', because a true
/// change of view rotates all patches alike.
/// @param turns one per match, radians
std::vector<LandmarkMatch> keep_common_turn(std::vector<LandmarkMatch> matches,
                                            std::span<const float> turns);

}  // namespace cairn::detail
