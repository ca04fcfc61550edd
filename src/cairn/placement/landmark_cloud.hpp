// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "cairn/confidence/metric.hpp"
#include "cairn/map/landmark_map.hpp"
#include "cairn/registration/point_set.hpp"

namespace cairn {

/// What one keyframe saw.
struct LandmarkView {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();  ///< of its camera
  std::vector<std::uint32_t> landmarks;              ///< indices in the cloud
};

/// Landmarks as placement sees them: where they are, how exactly, how far each is trusted, and from
/// where they were seen.
struct LandmarkCloud {
  std::vector<Eigen::Vector3d> positions;
  /// Of the positions: one a landmark, zero where unknown; or empty.
  std::vector<Eigen::Matrix3d> covariances;
  /// One a landmark, not negative, of mean 1; or empty: all alike.
  std::vector<double> weights;
  /// A few keyframes that stand for all; empty where nothing is known of them.
  std::vector<LandmarkView> views;
  /// What the landmarks look like: one entry a landmark; nothing where that is unknown.
  std::optional<DescriptorColumn> descriptors;

  std::size_t size() const { return positions.size(); }
  double weight(std::size_t i) const { return weights.empty() ? 1.0 : weights[i]; }

  /// @throws Error (misuse) for columns of different lengths, for numbers that are not finite, weights
  ///         that are negative, views of landmarks that are not there, and descriptors of no bytes or of
  ///         more than kMostDescriptorBytes
  /// @param name of the cloud, for the message
  void validate(std::string_view name) const;
};

/// The same landmarks, all lengths times the scale.
LandmarkCloud scaled(LandmarkCloud cloud, double scale);

/// The landmarks of a map that take part in an alignment, in the order of landmarks_to_align().
/// @param weights nothing: all alike
/// @throws Error (input) where the map lacks the metric's input
LandmarkCloud landmark_cloud(const LandmarkMap& map, const std::optional<Metric>& weights = {},
                             const PointSetOptions& options = {});

}  // namespace cairn
