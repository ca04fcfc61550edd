// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <limits>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "cairn/geometry/similarity3.hpp"
#include "cairn/registration/concepts.hpp"

namespace cairn {

/// A motion of the source that the matches leave open: it changes none of their distances.
struct OpenDirection {
  Eigen::Vector3d translation;  ///< of the matched points' centroid, per unit of the motion
  Eigen::Vector3d rotation;     ///< about the centroid, axis times angle, per unit of the motion
  double log_scale = 0.0;       ///< about the centroid, where a scale is estimated
};

/// Of a small motion in the parameters of PoseEvidence.
template <int kFreedoms>
OpenDirection open_direction(const Eigen::Matrix<double, kFreedoms, 1>& motion, double length) {
  OpenDirection open = {motion.template head<3>(), motion.template segment<3>(3) / length};
  if constexpr (kFreedoms == 7) open.log_scale = motion[6] / length;
  return open;
}

/// How well matched points determine a pose.
struct PoseUncertainty {
  /// Of target_from_source: left perturbation in the target frame, order (δt, δφ), metres (or the
  /// map's unit) and radians. Nothing where a direction is open.
  std::optional<Matrix6d> covariance;
  /// The same with the scale's, (δt, δφ, δ log s), where one is estimated.
  std::optional<Matrix7d> covariance_with_scale;
  std::vector<OpenDirection> unobservable;
};

/// What matches tell of a small motion of the moved source: its parameters are the translation of a
/// pivot, and the rotation about it times a length, so that all six are lengths and compare. A seventh
/// is the logarithm of a scale about the pivot, times the same length.
template <int kFreedoms>
struct PoseEvidence {
  using Matrix = Eigen::Matrix<double, kFreedoms, kFreedoms, Eigen::DontAlign>;

  Eigen::Vector3d pivot = Eigen::Vector3d::Zero();  ///< in the target frame
  double length = 1.0;                              ///< of the order of the matched points' spread
  Matrix information = Matrix::Zero();              ///< A = Σ w·JᵀJ
  /// B = Σ (w·Jᵀr)(w·Jᵀr)ᵀ over independent terms, times what makes up for their being few.
  Matrix scatter = Matrix::Zero();
  /// A direction with a larger standard deviation, as a length, is open: the evidence reaches no further.
  double reach = std::numeric_limits<double>::infinity();
};

/// The sandwich estimator of pose_uncertainty() for any estimate that solves normal equations: of a
/// rigid motion with 6 freedoms, of a similarity with 7.
template <int kFreedoms>
PoseUncertainty pose_uncertainty(const Similarity3& target_from_source,
                                 const PoseEvidence<kFreedoms>& evidence);
extern template PoseUncertainty pose_uncertainty(const Similarity3&, const PoseEvidence<6>&);
extern template PoseUncertainty pose_uncertainty(const Similarity3&, const PoseEvidence<7>&);

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
