// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "cairn/geometry/similarity3.hpp"

namespace cairn::detail {

/// A smooth deformation of space. The displacement along each axis is a polynomial of third degree in the
/// coordinates. On a ray from the centre of the fitted region, the displacement is constant beyond twice the
/// region's radius.
class Deformation {
 public:
  static constexpr Eigen::Index kTerms = 20;  ///< products of up to three coordinates
  using Coefficients = Eigen::Matrix<double, 3, kTerms>;

  /// The identity.
  Deformation() = default;
  /// @param radius       radius of the region; positive
  /// @param coefficients coefficients of the polynomials; coordinates (relative to the centre) and displacements are
  ///        in radii
  Deformation(const Eigen::Vector3d& centre, double radius, const Coefficients& coefficients)
      : centre_(centre), radius_(radius), coefficients_(coefficients) {}

  Eigen::Vector3d operator()(const Eigen::Vector3d& x) const;
  /// Derivative of the deformed position with respect to x; the identity beyond twice the region's radius.
  Eigen::Matrix3d derivative(const Eigen::Vector3d& x) const;
  /// The local similarity at x: it maps x to its deformed position and is nearest to the derivative at x. Where the
  /// deformation folds, it is a translation.
  Similarity3 near(const Eigen::Vector3d& x) const;
  /// Whether the deformation mirrors space around x: the determinant of the derivative is not positive.
  bool folds(const Eigen::Vector3d& x) const;

 private:
  Eigen::Vector3d centre_ = Eigen::Vector3d::Zero();
  double radius_ = 1.0;
  Coefficients coefficients_ = Coefficients::Zero();
};

/// A deformation of a map, and further deformations for its cross-validation.
struct CrossFittedDeformation {
  Similarity3 start;        ///< target_from_source before the deformation
  Deformation deformation;  ///< in the target's frame, applied after `start`
  /// Entry i: the deformation fitted to the matches of all folds of the source's landmarks but fold i.
  std::vector<Deformation> of_folds = {};

  Eigen::Vector3d operator()(const Eigen::Vector3d& x_in_source) const {
    return deformation(start * x_in_source);
  }
  /// The local pose around a point.
  Similarity3 near(const Eigen::Vector3d& x_in_source) const {
    return deformation.near(start * x_in_source) * start;
  }
};

/// A deformation and the pairs that agree with it.
struct DeformationFit {
  Deformation deformation;
  std::vector<std::size_t> inliers;  ///< indices of the pairs with a weight of at least 1/4
  double deviation = 0.0;  ///< standard deviation of the weighted residuals, per coordinate
};

/// Fits a deformation to pairs of points, of which some are outliers: iteratively reweighted least squares with the
/// Geman-McClure loss. The width of the loss shrinks from a tenth of the region's radius to four standard deviations
/// of the residuals.
///
/// The coefficients have a normal prior with a standard deviation of a tenth of the radius, or half of that for
/// coefficients of third degree. The translation has no prior.
///
/// @param to     one point for each point of `from`
/// @param region points that define the region's centre and radius
/// @return std::nullopt if the weights sum to less than 20
std::optional<DeformationFit> fit_deformation(std::span<const Eigen::Vector3d> from,
                                              std::span<const Eigen::Vector3d> to,
                                              std::span<const Eigen::Vector3d> region);

}  // namespace cairn::detail
