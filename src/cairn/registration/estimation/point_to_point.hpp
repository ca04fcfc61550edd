// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>

#include "cairn/registration/concepts.hpp"

namespace cairn {

/// The rigid motion from `from` to `to` with the least weighted sum of squared distances, in closed form
/// (Umeyama 1991, without scale).
///
/// If the points do not determine the rotation, returns the smallest one: none about the line of collinear
/// points, none at all for coincident points.
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

}  // namespace cairn
