// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "cairn/alignment/prepared_map.hpp"
#include "cairn/core/execution.hpp"
#include "cairn/registration/neighbors/batch_tree.hpp"

namespace cairn::detail {

/// Characteristic lengths of a cloud.
struct CloudScales {
  /// Median distance of the landmarks from the centroid: half the cloud's size, without outliers.
  double extent = 0.0;
  /// Median distance of a landmark to its eighth nearest neighbour; within this distance, several matches arise by
  /// chance.
  double spacing = 0.0;
  /// Median standard deviation of a landmark along an axis, from its covariance; 0 if unknown.
  double noise = 0.0;
};

/// CloudScales::extent alone.
double cloud_extent(const LandmarkCloud& cloud);

/// CloudScales::noise alone.
double cloud_noise(const LandmarkCloud& cloud);

/// Whether the covariances are of no use, because their noise exceeds a tenth of the extent. They are then
/// placeholders, e.g. the identity, or the cloud is too small for them.
bool has_placeholder_covariances(const LandmarkCloud& cloud);

/// Number of neighbours that define a landmark's spacing.
inline constexpr std::size_t kSpacingNeighbors = 8;

/// Distance of each point to its eighth neighbour in its cloud, or to the farthest one in a smaller cloud.
/// @param tree search tree of the cloud's positions
std::vector<double> landmark_spacings(std::span<const Eigen::Vector3d> points,
                                      const BatchTree& tree, const Executor& executor);

/// @param tree search tree of the cloud's positions
CloudScales cloud_scales(const LandmarkCloud& cloud, const BatchTree& tree,
                         const Executor& executor);

/// The fine kernel scale, in spacings. With a smaller scale, the objective has an optimum wherever a few landmarks
/// coincide.
inline constexpr double kSmoothSpacings = 1.5;

/// Kernel scale at which a refinement ends, in fine scales: the accuracy of many maps.
inline constexpr double kFinest = 1.0 / 12.0;

/// Kernel scale for a covariance, in units of the scale at which the refinement ends. It is larger than that scale,
/// because maps bend.
inline constexpr double kErrorScale = 4.0;

/// Kernel scales at which a robust alignment begins and ends.
struct KernelScales {
  double coarse =
      0.0;  ///< half the extent of the smaller cloud: the largest error that one start can correct
  /// One and a half times the smaller of the two clouds' spacings, or one and a half times the noise of a match if that
  /// is larger. Noise of more than a tenth of the smaller cloud's extent is ignored.
  double fine = 0.0;
};

KernelScales kernel_scales(const CloudScales& source, const CloudScales& target);

}  // namespace cairn::detail
