// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "cairn/geometry/similarity3.hpp"

namespace cairn::detail {

/// A smooth deformation of space: each coordinate's displacement is a polynomial of third degree. Beyond twice the
/// radius of the region that it was fitted to, it is a translation along each ray from the region's centre.
class Deformation {
 public:
  static constexpr Eigen::Index kTerms = 20;  ///< products of up to three coordinates
  using Coefficients = Eigen::Matrix<double, 3, kTerms>;

  /// The identity.
  Deformation() = default;
  /// @param radius       of the region; positive
  /// @param coefficients of the displacement in radii, for coordinates from the centre in radii
  Deformation(const Eigen::Vector3d& centre, double radius, const Coefficients& coefficients)
      : centre_(centre), radius_(radius), coefficients_(coefficients) {}

  Eigen::Vector3d operator()(const Eigen::Vector3d& x) const;
  /// Derivative of the deformed position with respect to x; beyond the region the identity.
  Eigen::Matrix3d derivative(const Eigen::Vector3d& x) const;
  /// The similarity that maps x to its deformed position and is nearest to the derivative there; a translation where
  /// the deformation folds.
  Similarity3 near(const Eigen::Vector3d& x) const;
  /// Whether the deformation turns space inside out at x.
  bool folds(const Eigen::Vector3d& x) const;

 private:
  Eigen::Vector3d centre_ = Eigen::Vector3d::Zero();
  double radius_ = 1.0;
  Coefficients coefficients_ = Coefficients::Zero();
};

/// A deformation of a map, and those by which it is tested.
struct CrossFittedDeformation {
  Similarity3 start;        ///< target_from_source, before the deformation
  Deformation deformation;  ///< of the target's frame
  /// For each fold of the source's landmarks: as the matches of the other folds show it.
  std::vector<Deformation> of_folds = {};

  Eigen::Vector3d operator()(const Eigen::Vector3d& x_in_source) const {
    return deformation(start * x_in_source);
  }
  /// The pose that holds around a point.
  Similarity3 near(const Eigen::Vector3d& x_in_source) const {
    return deformation.near(start * x_in_source) * start;
  }
};

/// A deformation and the pairs that agree with it.
struct DeformationFit {
  Deformation deformation;
  std::vector<std::size_t> inliers;  ///< indices of the pairs whose weight is 1/4 and more
  double deviation = 0.0;            ///< of the weighted residuals, per coordinate
};

/// Fits a deformation to pairs of points, some of them outliers: iteratively reweighted least squares with the
/// Geman-McClure loss. Its width shrinks from a tenth of the region's radius to four deviations of the residuals.
///
/// The coefficients have a normal prior: a standard deviation of a tenth of the radius, half of that for those of
/// third degree. A translation is free.
///
/// @param to     one for each of `from`
/// @param region points whose centre and radius are the region's
/// @return std::nullopt if the weights sum to less than 20
std::optional<DeformationFit> fit_deformation(std::span<const Eigen::Vector3d> from,
                                              std::span<const Eigen::Vector3d> to,
                                              std::span<const Eigen::Vector3d> region);

}  // namespace cairn::detail
