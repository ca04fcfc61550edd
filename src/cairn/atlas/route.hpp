// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <vector>

#include "cairn/atlas/store/records.hpp"

namespace cairn {

/// A chain of links from one map to another.
struct AtlasRoute {
  std::vector<NodeId> nodes;       ///< from the target to the source
  std::vector<LinkId> links;       ///< one fewer than nodes
  Similarity3 target_from_source;  ///< along the links
  /// Left perturbation in the target's frame, (δt, δφ, δ log s), to first order, for independent errors of
  /// the links. std::nullopt if a link has no covariance.
  std::optional<Matrix7d> covariance;
  /// By the optimised poses, which use all links; std::nullopt unless both maps are in one frame.
  std::optional<Similarity3> optimised;
};

/// The most certain chain of aligned links that agree with the poses: the least sum of the links'
/// variances.
/// @return std::nullopt if no chain connects the maps
std::optional<AtlasRoute> find_route(const AtlasState& state, NodeId target, NodeId source);

}  // namespace cairn
