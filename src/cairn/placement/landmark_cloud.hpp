// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "cairn/confidence/metric.hpp"
#include "cairn/map/landmark_map.hpp"
#include "cairn/registration/point_set.hpp"

namespace cairn {

/// Landmarks as placement sees them: where they are, how exactly, and how far each is trusted.
struct LandmarkCloud {
  std::vector<Eigen::Vector3d> positions;
  /// Of the positions: one a landmark, zero where unknown; or empty.
  std::vector<Eigen::Matrix3d> covariances;
  /// One a landmark, not negative, of mean 1; or empty: all alike.
  std::vector<double> weights;

  std::size_t size() const { return positions.size(); }
  double weight(std::size_t i) const { return weights.empty() ? 1.0 : weights[i]; }

  /// @throws Error (misuse) for columns of different lengths, and for numbers that are not finite or
  ///         weights that are negative
  /// @param name of the cloud, for the message
  void validate(std::string_view name) const;
};

/// The landmarks of a map that take part in an alignment, in the order of landmarks_to_align().
/// @param weights nothing: all alike
/// @throws Error (input) where the map lacks the metric's input
LandmarkCloud landmark_cloud(const LandmarkMap& map, const std::optional<Metric>& weights = {},
                             const PointSetOptions& options = {});

}  // namespace cairn
