// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/atlas/export.hpp"

#include <algorithm>
#include <limits>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/formats/foreign/mcap.hpp"
#include "cairn/formats/map_file.hpp"
#include "cairn/formats/pose_graph_file.hpp"
#include "cairn/formats/trajectory_file.hpp"
#include "cairn/map/operations.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

void write_graph(const AtlasState& state, const fs::path& path) {
  const std::string text = pose_graph_text(pose_graph(state));
  write_file(path, [&](const ByteSink& sink) { sink(text); });
}

void write_g2o_graph(const AtlasState& state, const fs::path& path, const LogSink& log) {
  PoseGraph graph = pose_graph(state);
  const std::size_t left_out =
      std::erase_if(graph.links, [](const Link& link) { return !link.covariance; });
  if (left_out > 0 && log) {
    log(fmt::format("{}: {} links without a covariance of six numbers are left out", path.string(),
                    left_out));
  }
  const G2oGraph g2o = g2o_graph(graph);
  write_file(path, [&](const ByteSink& sink) { write_g2o(g2o, sink); });
}

// A file name for a map that is not in `taken`.
std::string file_name_of(const std::string& name, std::set<std::string>& taken) {
  std::string text;
  for (const char c : name) text += c == '/' || c == '\0' ? '_' : c;
  while (!taken.insert(text).second) text += "~";
  return text + ".cairn";
}

// The files of the atlas itself; of an atlas in a database, none exists.
void refuse_own_file(Atlas& atlas, const fs::path& target) {
  for (const char* const ending : {"", "-wal", "-shm"}) {
    std::error_code ignored;
    if (!fs::equivalent(target, atlas.store().name() + ending, ignored)) continue;
    throw Error(ErrorKind::kMisuse, target.string(), "is a file of the atlas that is exported",
                "another file or folder");
  }
}

void write_folder(Atlas& atlas, const AtlasState& state, const fs::path& folder) {
  std::set<std::string> taken;
  std::vector<std::pair<const AtlasNode*, fs::path>> maps;
  for (const auto& [id, node] : state.nodes) {
    maps.emplace_back(&node, folder / file_name_of(node.name, taken));
  }
  const fs::path graph = folder / "graph.json";
  refuse_own_file(atlas, graph);
  for (const auto& [node, path] : maps) refuse_own_file(atlas, path);
  std::error_code failure;
  fs::create_directories(folder, failure);
  if (failure) throw Error(ErrorKind::kStorage, folder.string(), failure.message(), "a folder");
  for (const auto& [node, path] : maps) write_map(atlas.map(*node), path);
  write_graph(state, graph);
}

void write_component(Atlas& atlas, const AtlasState& state, const AtlasComponent& component,
                     AtlasExport what, const fs::path& path) {
  if (what == AtlasExport::kCloud) {
    write_map(cloud_of(atlas, state, component), path);
  } else if (what == AtlasExport::kRecording) {
    write_file(path, [&](const ByteSink& sink) { write_mcap(atlas, state, component, sink); });
  } else {
    const Trajectory trajectory = keyframes_of(atlas, state, component);
    reject_if(trajectory.empty(), atlas.store().name(), "no keyframe has a time",
              "maps with timestamps");
    write_file(path, [&](const ByteSink& sink) {
      write_trajectory(trajectory, TrajectoryFormat::kTum, sink);
    });
  }
}

}  // namespace

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
    if (!link.connects() || target == indices.end() || source == indices.end()) continue;
    const auto agrees = state.agrees.find(id);
    links.push_back({target->second, source->second, std::string(to_string(link.kind)),
                     link.probability, agrees == state.agrees.end() || agrees->second});
  }
  write_mcap(maps, links, sink);
}

AtlasExport export_of(const fs::path& path) {
  const std::string ending = path.extension().string();
  std::error_code ignored;
  if (ending.empty() || fs::is_directory(path, ignored)) return AtlasExport::kFolder;
  if (ending == ".g2o") return AtlasExport::kG2o;
  if (ending == ".json") return AtlasExport::kGraph;
  if (ending == ".tum") return AtlasExport::kTrajectory;
  if (ending == ".ply") return AtlasExport::kCloud;
  if (ending == ".mcap") return AtlasExport::kRecording;
  throw Error(ErrorKind::kMisuse, path.string(), fmt::format("ending {}", ending),
              ".g2o, .json, .tum, .ply, .mcap, or a folder");
}

void export_atlas(Atlas& atlas, const AtlasState& state, const fs::path& path,
                  std::optional<NodeId> frame, const LogSink& log) {
  const AtlasExport what = export_of(path);
  refuse_own_file(atlas, path);
  if (what == AtlasExport::kFolder) return write_folder(atlas, state, path);
  if (what == AtlasExport::kGraph) return write_graph(state, path);
  if (what == AtlasExport::kG2o) return write_g2o_graph(state, path, log);
  const AtlasComponent component = component_with(state, frame, atlas.store().name());
  write_component(atlas, state, component, what, path);
  const std::size_t others = state.nodes.size() - component.nodes.size();
  if (others > 0 && log) {
    log(fmt::format("{}: left out {} of {} maps, which are not in the frame of {}", path.string(),
                    others, state.nodes.size(), state.nodes.at(component.frame).name));
  }
}

}  // namespace cairn
