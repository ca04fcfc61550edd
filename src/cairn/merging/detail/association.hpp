// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "cairn/core/execution.hpp"
#include "cairn/map/landmark_map.hpp"

namespace cairn {

/// Landmarks in one frame, as association sees them.
struct LandmarkSet {
  std::span<const Eigen::Vector3d> positions;
  std::span<const Eigen::Matrix3d> covariances;   ///< of the positions; zero where unknown
  const DescriptorColumn* descriptors = nullptr;  ///< null: none
};

struct AssociationOptions {
  /// Limit of the squared Mahalanobis distance: 99.9 % of chi-squared numbers of 3 degrees of freedom lie
  /// below the default.
  double gate = 16.266;
  double min_probability = 0.5;  ///< from which a pair is taken for one landmark; in [0.5, 1]
  std::uint64_t seed = 0;
  Execution execution = {};
};

/// Two landmarks that are taken for one.
struct Association {
  std::uint32_t first = 0;
  std::uint32_t second = 0;
  double probability = 0.0;
};

struct AssociationResult {
  std::vector<Association> pairs;  ///< by ascending second; each landmark at most once
  /// By how much more than the covariances say the landmarks that are one lie apart: deviation of each
  /// coordinate, in the sets' unit.
  double deviation = 0.0;
  double share = 0.0;  ///< of the second set's landmarks that have a partner, estimated
};

/// Which landmarks of two sets are one.
///
/// A landmark of the second set is one of its nearest in the first, at a distance that the covariances and
/// a common deviation explain, or it has no partner and the first set's landmarks are near it as others on
/// the same surface are. Share and deviation come from the sets by expectation maximisation. A pair is
/// taken if each is the other's likeliest, within the gate, and likelier than not. Descriptors of one kind
/// exclude a pair that they make less alike than 98 % of random pairs. Same input and seed, same result,
/// whatever the number of threads.
AssociationResult associate(const LandmarkSet& first, const LandmarkSet& second,
                            const AssociationOptions& options = {});

}  // namespace cairn
