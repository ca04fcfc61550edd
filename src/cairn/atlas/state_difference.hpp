// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "cairn/atlas/store/records.hpp"

namespace cairn {

/// A map whose pose changed.
struct MovedNode {
  NodeId node;
  double shift = 0.0;  ///< of the centre of its landmarks, in the unit of its frame
  double turn_rad = 0.0;
  bool frame_changed = false;  ///< if true, the two numbers are 0
};

/// Difference between two states.
struct AtlasDifference {
  std::vector<NodeId> added_nodes, removed_nodes;
  std::vector<LinkId> added_links, removed_links;
  std::vector<NodeId> placed, no_longer_placed;
  std::vector<MovedNode> moved;
  std::vector<LinkId> now_contradicted, no_longer_contradicted;

  bool empty() const;
};

AtlasDifference difference(const AtlasState& before, const AtlasState& after);

}  // namespace cairn
