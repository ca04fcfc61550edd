// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/atlas/export.hpp"

#include <algorithm>
#include <limits>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "cairn/interchange/mcap.hpp"
#include "cairn/map/operations.hpp"

namespace cairn {

Trajectory keyframes_of(Atlas& atlas, const AtlasState& state, const AtlasComponent& component) {
  std::vector<TimedPose> poses;
  for (const NodeId id : component.nodes) {
    const LandmarkMap map = atlas.map(state.nodes.at(id));
    const Similarity3& world_from_node = state.poses.at(id).frame_from_node;
    const auto& times = map.frames().timestamps_s;
    for (std::uint32_t i = 0; i < map.frame_count(); ++i) {
      if (times.empty() || !times[i]) continue;
      const Rigid3 pose = map.world_from_camera(FrameIndex{i});
      poses.push_back({*times[i], Rigid3(world_from_node.rigid().quaternion() * pose.quaternion(),
                                         world_from_node * pose.translation())});
    }
  }
  std::stable_sort(poses.begin(), poses.end(), [](const TimedPose& a, const TimedPose& b) {
    return a.timestamp_s < b.timestamp_s;
  });
  const auto end = std::unique(poses.begin(), poses.end(), [](const auto& a, const auto& b) {
    return a.timestamp_s == b.timestamp_s;
  });
  poses.erase(end, poses.end());
  return Trajectory(std::move(poses));
}

LandmarkMap cloud_of(Atlas& atlas, const AtlasState& state, const AtlasComponent& component) {
  MapTables tables;
  NamedColumn nodes{kNodeColumn, {}};
  LandmarkTable& all = tables.landmarks;
  tables.info.length_unit = state.nodes.at(component.frame).length_unit;
  for (const NodeId id : component.nodes) {
    const LandmarkMap map =
        transformed(atlas.map(state.nodes.at(id)), state.poses.at(id).frame_from_node);
    const LandmarkTable& landmarks = map.landmarks();
    for (std::size_t i = 0; i < map.landmark_count(); ++i) {
      all.ids.push_back(LandmarkId{all.ids.size()});
      all.positions.push_back(landmarks.positions[i]);
      all.covariances.push_back(
          landmarks.covariances.empty()
              ? Eigen::Matrix3d::Constant(std::numeric_limits<double>::quiet_NaN())
              : landmarks.covariances[i]);
      all.colors.push_back(landmarks.colors.empty() ? std::nullopt : landmarks.colors[i]);
      nodes.values.push_back(static_cast<double>(id.value));
    }
  }
  all.columns.push_back(std::move(nodes));
  return LandmarkMap(std::move(tables));
}

void write_mcap(Atlas& atlas, const AtlasState& state, const AtlasComponent& component,
                const ByteSink& sink) {
  std::map<NodeId, std::size_t> indices;
  std::vector<McapMap> maps;
  for (const NodeId id : component.nodes) {
    const AtlasNode& node = state.nodes.at(id);
    indices[id] = maps.size();
    maps.push_back({node.name, state.poses.at(id).frame_from_node,
                    [&atlas, &node] { return atlas.map(node); }});
  }
  std::vector<McapLink> links;
  for (const auto& [id, link] : state.links) {
    const auto target = indices.find(link.target);
    const auto source = indices.find(link.source);
    if (!link.is_aligned() || target == indices.end() || source == indices.end()) continue;
    const auto agrees = state.agrees.find(id);
    links.push_back({target->second, source->second, std::string(to_string(link.kind)),
                     link.probability, agrees == state.agrees.end() || agrees->second});
  }
  write_mcap(maps, links, sink);
}

}  // namespace cairn
