// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <vector>

#include "cairn/atlas/store/records.hpp"

namespace cairn {

/// A way from one map to another over links.
struct AtlasRoute {
  std::vector<NodeId> nodes;       ///< from the target to the source
  std::vector<AtlasLinkId> links;  ///< one fewer
  Similarity3 target_from_source;  ///< along the links
  /// Left perturbation in the target's frame, (δt, δφ, δ log s), to first order, the links' errors taken as
  /// independent. Empty if a link has no covariance.
  std::optional<Matrix7d> covariance;
  /// As optimisation placed them, which all links take part in; nothing unless both are in one frame.
  std::optional<Similarity3> optimised;
};

/// The route over aligned links that agree with the poses whose transform is the most certain: of least sum
/// of the links' variances.
/// @return std::nullopt if none connects them
std::optional<AtlasRoute> find_route(const AtlasState& state, NodeId target, NodeId source);

}  // namespace cairn
