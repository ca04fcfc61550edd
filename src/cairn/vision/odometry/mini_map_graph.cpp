// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/odometry/mini_map_graph.hpp"

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/formats/content_uuid.hpp"

namespace cairn {

PoseGraph pose_graph(const MappedSequence& mapped, std::span<const std::string> names) {
  if (names.size() != mapped.maps.size()) {
    throw Error(ErrorKind::kMisuse, "names", fmt::format("{} of them", names.size()),
                fmt::format("{}, one a mini-map", mapped.maps.size()));
  }
  std::string uuids;
  for (const LandmarkMap& map : mapped.maps) uuids += map.info().uuid.value_or(content_uuid(map));
  const std::string session = uuid_of(uuids);
  PoseGraph graph;
  Similarity3 world_from_node;
  for (std::size_t i = 0; i < mapped.maps.size(); ++i) {
    graph.nodes.push_back({NodeId{i}, names[i], session, world_from_node});
    if (i >= mapped.links.size()) continue;
    const MiniMapLink& link = mapped.links[i];
    world_from_node = world_from_node * Similarity3(link.previous_from_next);
    graph.links.push_back({.target = NodeId{i},
                           .source = NodeId{i + 1},
                           .kind = LinkKind::kOdometry,
                           .target_from_source = Similarity3(link.previous_from_next),
                           .covariance = link.covariance});
  }
  return graph;
}

}  // namespace cairn
