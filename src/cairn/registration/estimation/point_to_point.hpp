// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "cairn/geometry/similarity3.hpp"
#include "cairn/registration/stages.hpp"

namespace cairn {

/// The rigid motion from `from` to `to` with the least weighted sum of squared distances, in closed form
/// (Umeyama 1991, without scale).
///
/// If the points do not determine the rotation, returns the smallest rotation: none about the line
/// of collinear points, the identity for coincident points.
///
/// @param from, to  pairs of points; equally many, at least one
/// @param weights   one per pair, not negative and not all zero; empty: all equal
Rigid3 closest_motion(std::span<const Eigen::Vector3d> from, std::span<const Eigen::Vector3d> to,
                      std::span<const double> weights = {});

/// Least squares on all matches, in closed form; a TransformEstimation.
class PointToPointEstimation {
 public:
  /// @param target         must outlive this
  /// @param source_weights one per source point, the weight of its match; empty: equal weights, as in the
  ///        paper; must outlive this
  explicit PointToPointEstimation(std::span<const Eigen::Vector3d> target,
                                  std::span<const double> source_weights = {})
      : target_(target), source_weights_(source_weights) {}

  Rigid3 operator()(std::span<const Eigen::Vector3d> moved_source,
                    std::span<const Match> matches) const;

 private:
  std::span<const Eigen::Vector3d> target_;
  std::span<const double> source_weights_;
};

static_assert(TransformEstimation<PointToPointEstimation>);

/// A motion of the source that the matches do not determine: the motion changes no match distance.
struct OpenDirection {
  Eigen::Vector3d translation;  ///< shift of the matched points' centroid, per unit of motion
  Eigen::Vector3d rotation;     ///< about the centroid, axis times angle (radians), per unit
  double log_scale = 0.0;       ///< about the centroid; 0 if no scale is estimated
};

/// Converts a small motion from the parameters of PoseEvidence.
template <int kFreedoms>
OpenDirection open_direction(const Eigen::Matrix<double, kFreedoms, 1>& motion, double length) {
  OpenDirection open = {motion.template head<3>(), motion.template segment<3>(3) / length};
  if constexpr (kFreedoms == 7) open.log_scale = motion[6] / length;
  return open;
}

/// How well matched points determine a pose.
struct PoseUncertainty {
  /// Covariance of target_from_source: left perturbation (δt, δφ) in the target frame, in metres
  /// (or the map's unit) and radians. std::nullopt if a direction is unobservable.
  std::optional<Matrix6d> covariance;
  /// The same with the scale, (δt, δφ, δ log s), if the scale is estimated.
  std::optional<Matrix7d> covariance_with_scale;
  std::vector<OpenDirection> unobservable;
};

/// Normal equations of a small motion of the moved source. Parameters: translation of the pivot,
/// and rotation about the pivot times `length`, so that all six are comparable lengths. With a
/// scale, the seventh parameter is the logarithm of scale about the pivot times `length`.
template <int kFreedoms>
struct PoseEvidence {
  using Matrix = Eigen::Matrix<double, kFreedoms, kFreedoms, Eigen::DontAlign>;

  Eigen::Vector3d pivot = Eigen::Vector3d::Zero();  ///< in the target frame
  double length = 1.0;                              ///< approximate spread of the matched points
  Matrix information = Matrix::Zero();              ///< A = Σ w·JᵀJ
  /// B = Σ (w·Jᵀr)(w·Jᵀr)ᵀ over independent terms, corrected for their small number.
  Matrix scatter = Matrix::Zero();
  /// A direction with a standard deviation above this length is unobservable: the evidence extends
  /// no further.
  double reach = std::numeric_limits<double>::infinity();
};

/// Covariance of a pose from its normal equations, by the sandwich estimator A⁻¹·B·A⁻¹. 6 degrees of freedom
/// for a rigid motion, 7 for a similarity.
template <int kFreedoms>
PoseUncertainty pose_uncertainty(const Similarity3& target_from_source,
                                 const PoseEvidence<kFreedoms>& evidence);
extern template PoseUncertainty pose_uncertainty(const Similarity3&, const PoseEvidence<6>&);
extern template PoseUncertainty pose_uncertainty(const Similarity3&, const PoseEvidence<7>&);

/// Covariance of a point-to-point pose from its residuals: the heteroscedasticity-consistent
/// ("sandwich") estimator A⁻¹·B·A⁻¹ with A = Σ w·JᵀJ and B = n/(n-2)·Σ (w·Jᵀr)(w·Jᵀr)ᵀ (White 1980;
/// the factor n/(n-2) corrects for 6 parameters of 3n residuals).
///
/// Assumes correct matches with independent errors. The errors may differ in size and be
/// anisotropic; no landmark covariances are needed. Some nearest-neighbour matches of ICP are
/// wrong, and errors of neighbouring matches are correlated. For an ICP result, the covariance is
/// therefore a lower bound. It does not reflect convergence to a wrong optimum.
///
/// @param moved_source  source points in the target frame, at the pose
/// @param matches       matches at the pose
/// @param source_weights weights of the estimate, one per source point; empty: equal weights
PoseUncertainty pose_uncertainty(const Rigid3& target_from_source,
                                 std::span<const Eigen::Vector3d> moved_source,
                                 std::span<const Eigen::Vector3d> target,
                                 std::span<const Match> matches,
                                 std::span<const double> source_weights = {});

}  // namespace cairn
