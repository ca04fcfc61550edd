// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

/// Whether landmark covariances say how far the landmarks really are off.
///
/// If an error e is Gaussian with the covariance P that the map states, its normalised square
/// eᵀP⁻¹e (NEES) follows the chi-squared distribution with 3 degrees of freedom: mean 3, and below
/// 7.8147 for 95 % of the landmarks (Bar-Shalom, Li and Kirubarajan, "Estimation with Applications to
/// Tracking and Navigation", 2001, section 5.4). A larger mean tells of covariances that are too
/// small.
namespace cairn {

/// Mean of the NEES of a right covariance: the dimension.
inline constexpr double kExpectedNees = 3.0;
/// 95 % quantile of the chi-squared distribution with 3 degrees of freedom.
inline constexpr double kNees95 = 7.814727903251179;

/// One landmark as a map has it, beside the truth. Estimate, truth and covariance are in one frame,
/// whose error is no error of the landmark: best that of the first keyframe to observe it.
struct LandmarkEstimate {
  Eigen::Vector3d estimate = Eigen::Vector3d::Zero();
  std::optional<Eigen::Vector3d> truth;       ///< nothing if unknown
  std::optional<Eigen::Matrix3d> covariance;  ///< of the estimate; nothing if unknown
  std::optional<double> depth;  ///< at the first observing keyframe, along the optical axis
  std::optional<std::size_t> observations;
};

struct CovarianceCalibrationOptions {
  /// Lower bounds of the bins; each reaches to the next, the last has no end.
  std::vector<double> depth_bins = {0.0, 1.0, 2.0, 3.0, 4.0};     ///< ascending; the map's unit
  std::vector<std::size_t> observation_bins = {2, 3, 5, 10, 20};  ///< ascending

  /// @throws Error (misuse) naming the field
  void validate() const;
};

/// The normalised errors of some landmarks.
struct NeesStatistics {
  std::size_t count = 0;
  double mean = 0.0;       ///< kExpectedNees if the covariances are right
  double median = 0.0;     ///< 2.366 if they are; outliers do not move it
  double inside_95 = 0.0;  ///< share within the 95 % ellipsoid, 0.95 if they are
};

/// Landmarks whose depth or number of observations lies in [from, to).
template <class Bound>
struct NeesBin {
  Bound from{};
  std::optional<Bound> to;                   ///< nothing: without end
  std::optional<NeesStatistics> statistics;  ///< nothing if the bin is empty
};

struct CovarianceCalibration {
  std::optional<NeesStatistics> all;  ///< nothing if no landmark could be judged
  std::vector<NeesBin<double>> by_depth;
  std::vector<NeesBin<std::size_t>> by_observations;
  std::vector<std::optional<double>> nees;  ///< one a landmark; nothing if it could not be judged

  // Why landmarks could not be judged; each landmark counts once.
  std::size_t without_truth = 0;
  std::size_t without_covariance = 0;
  std::size_t singular =
      0;  ///< a covariance that is certain of a direction cannot be normalised by
};

/// eᵀP⁻¹e; nothing if P is not positive definite, its smallest eigenvalue at most 1e-14 of its
/// largest.
/// @param covariance symmetric
std::optional<double> normalised_squared_error(const Eigen::Vector3d& error,
                                               const Eigen::Matrix3d& covariance);

/// Judges covariances by the errors they are of, over all landmarks and in bins.
CovarianceCalibration calibrate_covariances(std::span<const LandmarkEstimate> landmarks,
                                            const CovarianceCalibrationOptions& options = {});

}  // namespace cairn
