// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "cairn/core/executor.hpp"
#include "cairn/placement/landmark_cloud.hpp"
#include "cairn/registration/neighbors/batch_tree.hpp"

namespace cairn {

/// Lengths that a cloud itself gives.
struct CloudScales {
  /// Median distance from the centroid: half the size of the cloud, strays aside.
  double extent = 0.0;
  /// Median distance to the eighth nearest landmark: within it, chance offers several matches.
  double spacing = 0.0;
  /// Median standard deviation of a landmark along an axis, by its covariance; 0 where unknown.
  double noise = 0.0;
};

/// CloudScales::extent alone.
double cloud_extent(const LandmarkCloud& cloud);

/// How many neighbours a landmark's spacing reaches over.
inline constexpr std::size_t kSpacingNeighbors = 8;

/// Distance of each point to its eighth neighbour in a cloud that it is part of; to the farthest in one
/// of fewer landmarks.
/// @param tree of the cloud's positions
std::vector<double> landmark_spacings(std::span<const Eigen::Vector3d> points,
                                      const BatchTree& tree, const Executor& executor);

/// @param tree of the cloud's positions
CloudScales cloud_scales(const LandmarkCloud& cloud, const BatchTree& tree,
                         const Executor& executor);

/// Spacings in the fine scale: at fewer the objective has an optimum wherever a few landmarks happen to
/// meet.
inline constexpr double kSmoothSpacings = 1.5;

/// Where a refinement ends, in fine scales: many maps agree that closely.
inline constexpr double kFinest = 1.0 / 12.0;

/// Scale with which a covariance is measured, in those where the refinement ends: maps are bent by more
/// than their landmarks differ.
inline constexpr double kErrorScale = 4.0;

/// Where the kernel of a robust alignment begins and ends.
struct KernelScales {
  double coarse = 0.0;  ///< half the extent of the smaller cloud: what one start can still reach
  double fine = 0.0;    ///< one and a half times the finer spacing, or the noise of a match if that
                        ///< is more
};

KernelScales kernel_scales(const CloudScales& source, const CloudScales& target);

}  // namespace cairn
