// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "cairn/atlas/store/store.hpp"

namespace cairn::testing {

/// Records of an atlas without data.
inline AtlasNode node_of(std::uint64_t id, const std::string& name = {}) {
  AtlasNode node;
  node.id = NodeId{id};
  node.name = name;
  return node;
}

inline Link link_of(std::uint64_t id, std::uint64_t target, std::uint64_t source) {
  Link link;
  link.id = LinkId{id};
  link.target = NodeId{target};
  link.source = NodeId{source};
  return link;
}

inline AtlasPose pose_of(std::uint64_t node, std::uint64_t frame,
                         const Similarity3& frame_from_node = {}) {
  AtlasPose pose;
  pose.node = NodeId{node};
  pose.frame = NodeId{frame};
  pose.frame_from_node = frame_from_node;
  return pose;
}

}  // namespace cairn::testing
