// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "cairn/core/execution.hpp"
#include "cairn/map/landmark_map.hpp"

namespace cairn::detail {

/// Input of the association: landmarks in one frame.
struct LandmarkSet {
  std::span<const Eigen::Vector3d> positions;
  std::span<const Eigen::Matrix3d> covariances;   ///< of the positions; zero if unknown
  const DescriptorColumn* descriptors = nullptr;  ///< null: none
};

/// Largest squared Mahalanobis distance of a pair: the 99.9 % quantile of the chi-squared distribution with 3 degrees of
/// freedom.
constexpr double kAssociationGate = 16.266;

/// Two associated landmarks.
struct Association {
  std::uint32_t first = 0;
  std::uint32_t second = 0;
  double probability = 0.0;
};

struct AssociationResult {
  std::vector<Association> pairs;  ///< by ascending second; each landmark at most once
  /// Deviation of common landmarks beyond their covariances, per coordinate, in the sets' unit.
  double deviation = 0.0;
  double share = 0.0;  ///< estimated share of the second set's landmarks with a partner
};

/// Associates the landmarks of two sets that are the same.
///
/// Model: either a landmark of the second set is the same as one of its nearest landmarks in the first set, at a
/// distance that the covariances and a common deviation explain; or it has no partner, and the landmarks near it are
/// other points of the same surface. Share and deviation are estimated by expectation maximisation. A pair is accepted
/// if each landmark is the other's likeliest partner, the pair is within the gate, and it is more likely than no
/// partner. Descriptors of one kind exclude a pair unless it is more similar than 98 % of random pairs. The same input
/// and seed give the same result for any number of threads.
/// @param min_probability least probability that a pair is one landmark; in [0.5, 1]
AssociationResult associate(const LandmarkSet& first, const LandmarkSet& second,
                            double min_probability = 0.5, const Execution& execution = {});

}  // namespace cairn::detail
