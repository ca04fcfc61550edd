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
  FrameIndex frame = {};                             ///< keyframe of the map
};

/// Input of the placement: landmark positions, their covariances, weights and descriptors, and the
/// keyframes that saw them.
struct LandmarkCloud {
  std::vector<Eigen::Vector3d> positions;
  /// Of the positions: one per landmark, zero if unknown; or empty.
  std::vector<Eigen::Matrix3d> covariances;
  /// One per landmark, not negative, mean 1; or empty: all equal.
  std::vector<double> weights;
  /// A few representative keyframes; empty if unknown.
  std::vector<LandmarkView> views;
  /// One row per landmark; std::nullopt if unknown.
  std::optional<DescriptorColumn> descriptors;

  std::size_t size() const { return positions.size(); }
  double weight(std::size_t i) const { return weights.empty() ? 1.0 : weights[i]; }

  /// @throws Error (misuse) for columns of different lengths, numbers that are not finite, negative
  ///        weights, views of missing landmarks, descriptors of 0 or more than kMostDescriptorBytes
  ///        bytes, and further descriptors that no landmark has
  /// @param name of the cloud, for the message
  void validate(std::string_view name) const;
};

/// The same landmarks, all lengths multiplied by the scale.
LandmarkCloud scaled(LandmarkCloud cloud, double scale);

/// The landmarks of a map that take part in an alignment, in the order of landmarks_to_align().
/// @param weights std::nullopt: all equal
/// @throws Error (input) if the map lacks the metric's input
LandmarkCloud landmark_cloud(const LandmarkMap& map, const std::optional<Metric>& weights = {},
                             const PointSetOptions& options = {});

}  // namespace cairn
