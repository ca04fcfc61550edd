// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "cairn/evaluation/covariance_calibration.hpp"
#include "cairn/geometry/trajectory.hpp"
#include "cairn/map/landmark_map.hpp"

/// Landmarks in coordinates of the first keyframe that observed them. There, errors exclude the map's drift
/// up to that keyframe, and no common world frame with the truth is needed.
namespace cairn {

/// The observing frame with the lowest id; std::nullopt if no frame observed the landmark or the map has no
/// observations.
std::optional<FrameIndex> first_keyframe(const LandmarkMap& map, LandmarkIndex landmark);

/// Each landmark of the map in its first keyframe, with its covariance rotated alike: one entry per
/// landmark, for calibrate_covariances(). A landmark without observations has no truth.
/// @param truth_in_keyframe true positions in coordinates of the first keyframe, one per landmark
/// @throws Error (input) naming what is missing, for a map without observations or covariances; (misuse)
///        for a wrong number of true positions
std::vector<LandmarkEstimate> estimates_in_first_keyframe(
    const LandmarkMap& map, std::span<const std::optional<Eigen::Vector3d>> truth_in_keyframe);

/// True poses of the map's frames, world_from_camera, one per frame.
using KeyframePoses = std::vector<std::optional<Rigid3>>;

/// Poses of the frames with the same ids in another map; std::nullopt if it has none.
KeyframePoses keyframe_poses(const LandmarkMap& map, const LandmarkMap& truth);

/// Poses nearest in time on a trajectory; std::nullopt if none is within the time difference, or the
/// frame's time is unknown. Frames of several cameras may share a pose.
/// @throws Error (input) if no frame of the map has a time
KeyframePoses keyframe_poses(const LandmarkMap& map, const Trajectory& truth,
                             double max_time_difference_s = 0.02);

/// True positions for estimates_in_first_keyframe: those of the landmarks with the same ids in another map,
/// seen from the true pose of the first keyframe.
/// @param truth_from_keyframe in the world frame of `truth`, one per frame of `map`
/// @return one per landmark of `map`; std::nullopt if its id or the pose of its keyframe is unknown
/// @throws Error (input) if the maps' units of length differ; (misuse) for a wrong number of poses
std::vector<std::optional<Eigen::Vector3d>> true_positions_in_first_keyframe(
    const LandmarkMap& map, const LandmarkMap& truth, const KeyframePoses& truth_from_keyframe);

}  // namespace cairn
