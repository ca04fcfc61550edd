// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "cairn/evaluation/covariance_calibration.hpp"
#include "cairn/map/landmark_map.hpp"
#include "cairn/trajectory/trajectory.hpp"

/// Landmarks in coordinates of the first keyframe that observed them. There an estimate can be held
/// against the truth without the drift of the map up to that keyframe, which is no error of the
/// landmark, and without a common world frame of both.
namespace cairn {

/// Of the frames that observed a landmark the one of the lowest id; nothing if none did, or the map
/// does not know its observations.
std::optional<FrameIndex> first_keyframe(const LandmarkMap& map, LandmarkIndex landmark);

/// The map's landmarks, each in its first keyframe, with covariances turned alike: one a landmark of
/// the map, ready for calibrate_covariances(). A landmark that no frame observed has no truth.
/// @param truth_in_keyframe true positions in the first keyframe's coordinates, one a landmark
/// @throws Error (input) naming what is missing, of a map without observations or covariances;
///         (misuse) for another number of true positions
std::vector<LandmarkEstimate> estimates_in_first_keyframe(
    const LandmarkMap& map, std::span<const std::optional<Eigen::Vector3d>> truth_in_keyframe);

/// True poses of the map's frames, world_from_camera, one a frame.
using KeyframePoses = std::vector<std::optional<Rigid3>>;

/// The poses of the frames with the same ids in another map; nothing where it has none.
KeyframePoses keyframe_poses(const LandmarkMap& map, const LandmarkMap& truth);

/// The poses nearest in time on a trajectory; nothing where none is nearer than the difference given,
/// or the time of the frame is unknown. Frames of several cameras may share a pose.
/// @throws Error (input) if the map knows the time of none of its frames
KeyframePoses keyframe_poses(const LandmarkMap& map, const Trajectory& truth,
                             double max_time_difference_s = 0.02);

/// True positions for estimates_in_first_keyframe: those of the landmarks with the same ids in
/// another map, seen from the true pose of the first keyframe.
/// @param truth_from_keyframe in the world frame of `truth`, one a frame of `map`
/// @return one a landmark of `map`; nothing where its id, or the pose of its keyframe, is unknown
/// @throws Error (input) if the maps' units of length differ; (misuse) for another number of poses
std::vector<std::optional<Eigen::Vector3d>> true_positions_in_first_keyframe(
    const LandmarkMap& map, const LandmarkMap& truth, const KeyframePoses& truth_from_keyframe);

}  // namespace cairn
