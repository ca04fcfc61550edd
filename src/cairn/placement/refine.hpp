// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <optional>

#include "cairn/core/execution.hpp"
#include "cairn/placement/landmark_cloud.hpp"
#include "cairn/placement/prepared_cloud.hpp"
#include "cairn/registration/icp.hpp"

namespace cairn {

/// How to refine a pose robustly. Lengths are in the unit of the maps; where a scale is estimated, of the
/// target.
struct RefineOptions {
  Rigid3 initial = {};  ///< target_from_source to start from
  /// Of the source, to start from, where it is to be estimated with the pose (see RegistrationResult::scale);
  /// positive. Nothing: both maps are of one scale.
  std::optional<double> scale = {};
  /// Scale of the kernel in the beginning: matches much farther apart hardly count. Nothing: half the
  /// extent of the smaller cloud, from which a pose far off is still drawn in.
  std::optional<double> coarse = {};
  /// Scale in the end, at most `coarse`. Nothing: what landmarks that are one differ by, from their
  /// spacing and covariances.
  std::optional<double> fine = {};
  /// From `fine` down to this scale, matches are one to one: how closely most maps agree shows there. At
  /// most `fine`. Nothing: a twelfth of `fine`.
  std::optional<double> finest = {};
  /// Scale with which the covariance is measured: maps are bent by more than their landmarks differ. Nothing:
  /// four times `finest`, at most `fine`.
  std::optional<double> error_scale = {};
  /// Keep the initial pose as it is: matches, scores and covariance are those of this pose.
  bool hold = false;
  /// Also from where the paper's base ICP leads, whose matches may be ever so far: that is the result if
  /// it fits twice as well. Where the maps share most of what they hold, ICP is drawn in from farther off;
  /// where they do not, it is led astray. Not with a scale.
  bool by_icp_too = true;
  bool use_covariances = true;  ///< weigh residuals by the landmarks' covariances, where known
  bool one_to_one = false;  ///< match a target landmark only with the source landmark closest to it
  int max_iterations = 100;  ///< of either method; at least 1
  /// Within which distance landmarks count as overlapping; nothing: overlap is not computed.
  std::optional<double> overlap_radius = {};
  bool trace = false;  ///< keep score and matches of every iteration

  Execution execution = {};

  /// @throws Error (misuse) naming the field, its value and what it may be
  void validate() const;
};

/// Robust probabilistic refinement of a pose: iteratively reweighted least squares.
///
/// The smaller of the two clouds is moved: each of its landmarks is matched with the nearest of the
/// other. The residual r of a match counts by its Mahalanobis distance,
/// m² = rᵀ·(s²·R·Cs·Rᵀ + Ct + σ²·I)⁻¹·r with the covariances of both landmarks, under the kernel of Geman
/// and McClure, m²/(1 + m²), whose scale σ falls from coarse to fine as the iteration proceeds
/// (graduated non-convexity; Black and Rangarajan 1996). From there to the finest scale a landmark of the
/// other cloud is matched once, with the nearest.
///
/// The covariance of the pose is a sandwich estimator. Its parts are what the objective does when the
/// pose is moved and all matches are found anew, and the pulls of 16 groups of matched landmarks. It is
/// made larger for these being few, so that the 95 % ellipsoid holds as many errors: 2.4 times for 16
/// groups and 6 freedoms, so mean squared errors are smaller than its diagonal. There is none for fewer
/// than 12 groups with a match (14 with a scale). A direction counts as unobservable if landmarks fit about
/// as well two scales of the kernel along it, or if its standard deviation is larger than that.
/// An expected failure (too few landmarks or matches) is a status. Same input, same result, whatever
/// the executor's number of threads.
///
/// @throws Error (misuse) for invalid options or clouds
RegistrationResult refine(const LandmarkCloud& source, const LandmarkCloud& target,
                          const RefineOptions& options = {});
RegistrationResult refine(const PreparedCloud& source, const PreparedCloud& target,
                          const RefineOptions& options = {});

}  // namespace cairn
