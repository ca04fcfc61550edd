// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "cairn/registration/concepts.hpp"

namespace cairn {

/// A motion of the source that the matches leave open: it changes none of their distances.
struct OpenDirection {
  Eigen::Vector3d translation;  ///< of the matched points' centroid, per unit of the motion
  Eigen::Vector3d rotation;     ///< about the centroid, axis times angle, per unit of the motion
};

/// How well matched points determine a pose.
struct PoseUncertainty {
  /// Of target_from_source: left perturbation in the target frame, order (δt, δφ), metres (or the
  /// map's unit) and radians. Nothing where a direction is open.
  std::optional<Matrix6d> covariance;
  std::vector<OpenDirection> unobservable;
};

/// What matches tell of a small motion of the moved source: its parameters are the translation of a
/// pivot, and the rotation about it times a length, so that all six are lengths and compare.
struct PoseEvidence {
  Eigen::Vector3d pivot = Eigen::Vector3d::Zero();  ///< in the target frame
  double length = 1.0;                              ///< of the order of the matched points' spread
  Matrix6d information = Matrix6d::Zero();          ///< A = Σ w·JᵀJ
  Matrix6d scatter = Matrix6d::Zero();  ///< Σ (w·Jᵀr)(w·Jᵀr)ᵀ over independent terms
  double count = 0.0;                   ///< of the scatter's independent terms; above 2
};

/// The sandwich estimator of pose_uncertainty() for any estimate that solves normal equations.
PoseUncertainty pose_uncertainty(const Rigid3& target_from_source, const PoseEvidence& evidence);

/// Covariance of a point-to-point pose from the scatter of its own residuals: the
/// heteroscedasticity-consistent ("sandwich") estimator A⁻¹·B·A⁻¹ with A = Σ w·JᵀJ and
/// B = n/(n-2)·Σ (w·Jᵀr)(w·Jᵀr)ᵀ (White 1980; the factor is for 6 parameters from 3n residuals).
///
/// It assumes that the matches are right and their errors independent of each other; it needs neither
/// equal nor isotropic errors and no landmark covariances. Nearest-neighbour matches between different
/// landmarks are wrong in part and alike next to each other, so of an ICP result this is a lower
/// bound: it does not know of a pose in a wrong basin.
///
/// @param moved_source  source points in the target frame, at the pose
/// @param matches       at the pose
/// @param source_weights weights that the estimate used, one a source point; or empty
PoseUncertainty pose_uncertainty(const Rigid3& target_from_source,
                                 std::span<const Eigen::Vector3d> moved_source,
                                 std::span<const Eigen::Vector3d> target,
                                 std::span<const Match> matches,
                                 std::span<const double> source_weights = {});

}  // namespace cairn
