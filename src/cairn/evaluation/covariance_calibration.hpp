// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "cairn/geometry/trajectory.hpp"
#include "cairn/map/landmark_map.hpp"

/// Calibration of landmark covariances: whether they match the actual errors.
///
/// If an error e is Gaussian with the stated covariance P, its normalised square eᵀP⁻¹e (NEES) follows the
/// chi-squared distribution with 3 degrees of freedom: mean 3, and below 7.8147 for 95 % of the landmarks
/// (Bar-Shalom, Li and Kirubarajan, "Estimation with Applications to Tracking and Navigation", 2001,
/// section 5.4). A larger mean indicates covariances that are too small.
namespace cairn {

/// Mean NEES of calibrated covariances: the dimension.
inline constexpr double kExpectedNees = 3.0;
/// 95 % quantile of the chi-squared distribution with 3 degrees of freedom.
inline constexpr double kNees95 = 7.814727903251179;

/// A landmark's estimated and true position. Estimate, truth and covariance are in one frame. The
/// error of this frame must not count, so the frame of the first observing keyframe is best.
struct LandmarkEstimate {
  Eigen::Vector3d estimate = Eigen::Vector3d::Zero();
  std::optional<Eigen::Vector3d> truth;       ///< std::nullopt if unknown
  std::optional<Eigen::Matrix3d> covariance;  ///< of the estimate; std::nullopt if unknown
  std::optional<double> depth;  ///< in the first observing keyframe, along the optical axis
  std::optional<std::size_t> observations;
};

/// Normalised errors of a set of landmarks.
struct NeesStatistics {
  std::size_t count = 0;
  double mean = 0.0;       ///< kExpectedNees if calibrated
  double median = 0.0;     ///< 2.366 if calibrated; robust to outliers
  double inside_95 = 0.0;  ///< share within the 95 % ellipsoid; 0.95 if calibrated
};

/// Landmarks whose depth or number of observations is in [from, to).
template <class Bound>
struct NeesBin {
  Bound from{};
  std::optional<Bound> to;                   ///< std::nullopt: unbounded
  std::optional<NeesStatistics> statistics;  ///< std::nullopt if the bin is empty
};

struct CovarianceCalibration {
  std::optional<NeesStatistics> all;      ///< std::nullopt if no landmark could be evaluated
  std::vector<NeesBin<double>> by_depth;  ///< bins from 0, 1, 2, 3 and 4 in the map's unit
  std::vector<NeesBin<std::size_t>> by_observations;  ///< bins from 2, 3, 5, 10 and 20
  std::vector<std::optional<double>> nees;  ///< one per landmark; std::nullopt if not evaluated

  // Landmarks not evaluated, by reason; each counts once.
  std::size_t without_truth = 0;
  std::size_t without_covariance = 0;
  std::size_t singular = 0;  ///< singular covariance
};

/// eᵀP⁻¹e; std::nullopt if P is not positive definite, that is, its smallest eigenvalue is at most
/// 1e-14 times its largest.
/// @param covariance symmetric
std::optional<double> normalised_squared_error(const Eigen::Vector3d& error,
                                               const Eigen::Matrix3d& covariance);

/// Compares covariances with the errors, over all landmarks and in bins.
CovarianceCalibration calibrate_covariances(std::span<const LandmarkEstimate> landmarks);

// Landmarks in coordinates of the first keyframe that observed them. In this frame, errors exclude
// the map's drift up to the keyframe, and no common world frame with the truth is needed.

/// The observing frame with the lowest id; std::nullopt if no frame observed the landmark or the map has no
/// observations.
std::optional<FrameIndex> first_keyframe(const LandmarkMap& map, LandmarkIndex landmark);

/// Positions and covariances of the landmarks in coordinates of their first keyframes: one entry
/// per landmark, for calibrate_covariances(). A landmark without observations has no truth.
/// @param truth_in_keyframe true positions in coordinates of the first keyframe, one per landmark
/// @throws Error (input) naming the missing data, for a map without observations or covariances;
///        (misuse) for a wrong number of true positions
std::vector<LandmarkEstimate> estimates_in_first_keyframe(
    const LandmarkMap& map, std::span<const std::optional<Eigen::Vector3d>> truth_in_keyframe);

/// True poses of the map's frames, world_from_camera, one per frame.
using KeyframePoses = std::vector<std::optional<Rigid3>>;

/// For each frame of `map`, the pose of the frame with the same id in `truth`; std::nullopt if
/// `truth` has no such frame.
KeyframePoses keyframe_poses(const LandmarkMap& map, const LandmarkMap& truth);

/// Poses nearest in time on a trajectory; std::nullopt if no pose is within the time difference, or
/// if the frame's time is unknown. Frames of several cameras may share a pose.
/// @throws Error (input) if no frame of the map has a time
KeyframePoses keyframe_poses(const LandmarkMap& map, const Trajectory& truth,
                             double max_time_difference_s = 0.02);

/// True positions for estimates_in_first_keyframe(): positions of the landmarks with the same ids
/// in `truth`, in coordinates of the true first keyframe.
/// @param truth_from_keyframe poses in the world frame of `truth`, one per frame of `map`
/// @return one per landmark of `map`; std::nullopt if its id or the pose of its keyframe is unknown
/// @throws Error (input) if the maps' units of length differ; (misuse) for a wrong number of poses
std::vector<std::optional<Eigen::Vector3d>> true_positions_in_first_keyframe(
    const LandmarkMap& map, const LandmarkMap& truth, const KeyframePoses& truth_from_keyframe);

}  // namespace cairn
