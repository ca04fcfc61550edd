// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <optional>

#include "cairn/alignment/landmark_cloud.hpp"
#include "cairn/alignment/prepared_cloud.hpp"
#include "cairn/core/execution.hpp"
#include "cairn/registration/icp.hpp"

namespace cairn {

/// Options of refine(). Lengths are in the unit of the maps, or of the target if a scale is estimated.
struct RefineOptions {
  Rigid3 initial = {};  ///< initial target_from_source
  /// Initial scale of the source, which is then estimated with the pose (see RegistrationResult::scale);
  /// positive. std::nullopt: both maps have one scale.
  std::optional<double> scale = {};
  /// Initial kernel scale; matches much farther apart hardly count. std::nullopt: half the extent of the
  /// smaller cloud, which tolerates large initial errors.
  std::optional<double> coarse = {};
  /// Final kernel scale, at most `coarse`. std::nullopt: the expected error of a match, from spacing and
  /// covariances.
  std::optional<double> fine = {};
  /// From `fine` down to this scale, matches are one to one; at most `fine`. std::nullopt: a twelfth of
  /// `fine`, the accuracy of most maps.
  std::optional<double> finest = {};
  /// Kernel scale for the covariance; larger than the errors of single landmarks, because maps bend.
  /// std::nullopt: four times `finest`, at most `fine`.
  std::optional<double> error_scale = {};
  /// Keep the initial pose: matches, scores and covariance are those of this pose.
  bool hold = false;
  /// Also refines from ICP's result, whose match distances are unlimited, and keeps it if its objective is
  /// at least twice as large. ICP converges from larger errors if the maps share most landmarks, else often
  /// to a wrong pose. Not with a scale.
  bool by_icp_too = true;
  bool use_covariances = true;  ///< weight residuals by the landmarks' covariances, if known
  bool one_to_one = false;   ///< match each target landmark only with its nearest source landmark
  int max_iterations = 100;  ///< of each method; at least 1
  /// A landmark overlaps if the other map has one within this distance. std::nullopt: no overlap is
  /// computed.
  std::optional<double> overlap_radius = {};
  bool trace = false;  ///< record score and matches of every iteration

  Execution execution = {};

  /// @throws Error (misuse) naming the field, its value and the constraint
  void validate() const;
};

/// Robust probabilistic refinement of a pose by iteratively reweighted least squares.
///
/// Moves the smaller cloud and matches each of its landmarks with the nearest of the other. A residual r
/// enters with its squared Mahalanobis distance, m² = rᵀ·(s²·R·Cs·Rᵀ + Ct + σ²·I)⁻¹·r with the covariances
/// of both landmarks, under the kernel of Geman and McClure, m²/(1 + m²). The kernel scale σ falls from
/// coarse to fine (graduated non-convexity; Black and Rangarajan 1996). From fine to finest, each landmark
/// of the other cloud is matched at most once, with the nearest.
///
/// The pose covariance is a sandwich estimator, from the change of the objective when the pose is moved and
/// all matches are found anew, and from the gradients of 16 groups of matches. It is enlarged for that
/// small number, so that the 95 % ellipsoid holds 95 % of the errors: 2.4 times for 16 groups and 6 degrees
/// of freedom. Mean squared errors are therefore smaller than its diagonal. There is no covariance for
/// fewer than 12 groups with a match (14 with a scale). A direction is unobservable if moving by two kernel
/// scales along it hardly changes the objective, or if its standard deviation is larger than that.
/// An expected failure (too few landmarks or matches) is a status. The same input gives the same result for
/// any number of threads.
///
/// @throws Error (misuse) for invalid options or clouds
RegistrationResult refine(const LandmarkCloud& source, const LandmarkCloud& target,
                          const RefineOptions& options = {});
RegistrationResult refine(const PreparedCloud& source, const PreparedCloud& target,
                          const RefineOptions& options = {});

}  // namespace cairn
