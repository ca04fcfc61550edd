// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/atlas/queries.hpp"

#include <algorithm>
#include <cmath>
#include <deque>
#include <filesystem>
#include <map>
#include <optional>
#include <queue>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>

#include <fmt/format.h>
#include <unistd.h>

#include "cairn/atlas/detail/row_bytes.hpp"
#include "cairn/atlas/store/open_store.hpp"
#include "cairn/core/error.hpp"
#include "cairn/core/version_number.hpp"
#include "cairn/formats/map_file.hpp"
#include "cairn/geometry/covariance.hpp"
#include "cairn/geometry/rigid3.hpp"
#include "cairn/merging/fusion/fuse_maps.hpp"

namespace cairn {
namespace {

template <class Id, class Value>
void compare_keys(const std::map<Id, Value>& before, const std::map<Id, Value>& after,
                  std::vector<Id>& added, std::vector<Id>& removed) {
  for (const auto& [id, value] : after) {
    if (!before.contains(id)) added.push_back(id);
  }
  for (const auto& [id, value] : before) {
    if (!after.contains(id)) removed.push_back(id);
  }
}

bool is_contradicted(const AtlasState& state, LinkId link) {
  const auto agrees = state.agrees.find(link);
  return agrees != state.agrees.end() && !agrees->second;
}

// The maps as one; `kept` keeps what the result refers to.
PlacedMap as_one(Atlas& atlas, const AtlasState& state, const std::vector<NodeId>& nodes,
                 const Execution& execution, std::deque<LandmarkMap>& kept) {
  std::vector<PlacedMap> placed;
  for (const NodeId id : nodes) {
    const AtlasNode& node = state.nodes.at(id);
    kept.push_back(atlas.map(node));
    const AtlasPose& pose = state.poses.at(id);
    placed.push_back({&kept.back(), node.name, pose.frame_from_node, pose.covariance});
  }
  if (placed.size() == 1) return placed.front();
  kept.push_back(fuse_maps(placed, {}, execution).map);
  return {&kept.back(), "", Similarity3(), Matrix7d::Zero()};
}

// Variance of a link without covariance: larger than any stated one.
constexpr double kUnknown = 100.0;

// Squared, as a share of the source's radius; not negative, which a covariance may be by rounding.
double variance_of(const Link& link, const AtlasState& state) {
  const auto covariance = link.full_covariance();
  if (!covariance) return kUnknown;
  const double radius =
      state.nodes.at(link.source).extent.radius * link.target_from_source->scale();
  const Matrix7d& c = *covariance;
  const double variance =
      (c(0, 0) + c(1, 1) + c(2, 2)) / (radius * radius) + c(3, 3) + c(4, 4) + c(5, 5) + c(6, 6);
  return std::isfinite(variance) ? std::max(variance, 0.0) : kUnknown;
}

struct Step {
  NodeId to;
  LinkId link;
  double variance = 0.0;
};

// By map: the links that agree with the poses, in both directions.
std::map<NodeId, std::vector<Step>> steps_of(const AtlasState& state) {
  std::map<NodeId, std::vector<Step>> steps;
  for (const auto& [id, link] : state.links) {
    if (!link.connects()) continue;
    const auto agrees = state.agrees.find(id);
    if (agrees != state.agrees.end() && !agrees->second) continue;
    const double variance = variance_of(link, state);
    steps[link.target].push_back({link.source, id, variance});
    steps[link.source].push_back({link.target, id, variance});
  }
  return steps;
}

// Moves the route's end along its next link.
void extend(AtlasRoute& route, const Link& link, bool forward) {
  const Similarity3 step = forward ? *link.target_from_source : link.target_from_source->inverse();
  std::optional<Matrix7d> covariance = link.full_covariance();
  if (covariance && !forward) {
    covariance = inverse_covariance(*link.target_from_source, *covariance);
  }
  if (!covariance) route.covariance.reset();
  if (route.covariance) {
    // With A the way so far and B the step, A·B has t = s_A·R_A·t_B + t_A: δ_AB = J_A·δ_A + J_B·δ_B.
    const Similarity3& a = route.target_from_source;
    const Eigen::Vector3d arm = a.linear() * step.translation();
    using Matrix = Eigen::Matrix<double, 7, 7>;  // aligned
    Matrix of_a = Matrix::Identity();
    of_a.block<3, 3>(0, 3) = -skew(arm);
    of_a.block<3, 1>(0, 6) = arm;
    Matrix of_b = Matrix::Identity();
    of_b.block<3, 3>(0, 0) = a.linear();
    of_b.block<3, 3>(3, 3) = a.rigid().rotation();
    const Matrix so_far = *route.covariance;
    const Matrix added = *covariance;
    const Matrix sum = of_a * so_far * of_a.transpose() + of_b * added * of_b.transpose();
    route.covariance = 0.5 * (sum + sum.transpose());
  }
  route.target_from_source = route.target_from_source * step;
}

namespace fs = std::filesystem;

// Of all that Atlas::merge() reads; ids alone would not do, because another atlas may have the same.
std::string key_of(const AtlasState& state, std::uint64_t seed) {
  RowBytes bytes;
  bytes.add(std::string_view(kVersion)).add(seed);
  for (const auto& [id, node] : state.nodes) bytes.add(id.value).add(node.name).add(node.map);
  for (const auto& [id, link] : state.links) {
    if (!is_used(state, link)) continue;
    const LinkBlobs blobs = blobs_of(link);
    bytes.add(link.target.value).add(link.source.value).add(static_cast<std::uint64_t>(link.kind));
    bytes.add(link.probability.value_or(-1.0)).add(blobs.target_from_source);
    bytes.add(blobs.covariance).add(blobs.covariance_with_scale);
  }
  for (const auto& [id, pose] : state.poses) {
    const PoseBlobs blobs = blobs_of(pose);
    bytes.add(id.value).add(pose.frame.value).add(blobs.frame_from_node).add(blobs.covariance);
  }
  return "merged world " + hexadecimal(bytes.digest());
}

// The map in a file of this key, which is its last step of provenance.
std::optional<LandmarkMap> kept(const fs::path& path, const std::string& key) {
  std::error_code ignored;
  if (!fs::is_regular_file(path, ignored)) return std::nullopt;
  try {
    MapTables tables = read_map(path).tables();
    auto& steps = tables.info.provenance;
    if (steps.empty() || steps.back() != key) return std::nullopt;
    steps.pop_back();
    return LandmarkMap(std::move(tables));
  } catch (const Error&) {
    return std::nullopt;  // it is damaged, and made anew
  }
}

// @return the map again. What cannot be kept is made anew each time.
LandmarkMap keep(LandmarkMap map, const fs::path& path, const std::string& key) {
  MapTables tables = std::move(map).tables();
  tables.info.provenance.push_back(key);
  LandmarkMap marked(std::move(tables));
  std::error_code ignored;
  try {
    // A link would lead to a file of another name, which is not ours to write.
    if (!fs::is_symlink(path, ignored)) write_map(marked, path);
  } catch (const Error&) {
  }
  tables = std::move(marked).tables();
  tables.info.provenance.pop_back();
  return LandmarkMap(std::move(tables));
}

}  // namespace

bool AtlasDifference::empty() const {
  return added_nodes.empty() && removed_nodes.empty() && added_links.empty() &&
         removed_links.empty() && placed.empty() && no_longer_placed.empty() && moved.empty() &&
         now_contradicted.empty() && no_longer_contradicted.empty();
}

AtlasDifference difference(const AtlasState& before, const AtlasState& after) {
  AtlasDifference result;
  compare_keys(before.nodes, after.nodes, result.added_nodes, result.removed_nodes);
  compare_keys(before.links, after.links, result.added_links, result.removed_links);
  compare_keys(before.poses, after.poses, result.placed, result.no_longer_placed);
  for (const auto& [id, pose] : after.poses) {
    const auto old = before.poses.find(id);
    const auto node = after.nodes.find(id);
    if (old == before.poses.end() || old->second == pose || node == after.nodes.end()) continue;
    MovedNode moved{.node = id};
    moved.frame_changed = old->second.frame != pose.frame;
    if (!moved.frame_changed) {
      const Eigen::Vector3d& centre = node->second.extent.centre;
      moved.shift = (pose.frame_from_node * centre - old->second.frame_from_node * centre).norm();
      moved.turn_rad =
          (old->second.frame_from_node.rigid().inverse() * pose.frame_from_node.rigid()).angle();
    }
    result.moved.push_back(moved);
  }
  for (const auto& [id, link] : after.links) {
    const bool now = is_contradicted(after, id);
    const bool then = is_contradicted(before, id);
    if (now && !then) result.now_contradicted.push_back(id);
    if (then && !now) result.no_longer_contradicted.push_back(id);
  }
  return result;
}

std::vector<NodeId> placed_of_session(const AtlasState& state, const std::string& session) {
  std::vector<NodeId> nodes;
  for (const auto& [id, node] : state.nodes) {
    if (node.session == session && state.poses.contains(id)) nodes.push_back(id);
  }
  return nodes;
}

ChangeResult world_difference(Atlas& atlas, const AtlasState& state,
                              const std::vector<NodeId>& first, const std::vector<NodeId>& second,
                              const ChangeOptions& options, const Execution& execution) {
  std::optional<NodeId> frame;
  for (const auto* const nodes : {&first, &second}) {
    refuse_if(nodes->empty(), atlas.store().name(), "no maps to compare",
              "at least one on each side");
    for (const NodeId id : *nodes) {
      const auto pose = state.poses.find(id);
      const std::string& name = state.nodes.at(id).name;
      refuse_if(pose == state.poses.end(), atlas.store().name(),
                fmt::format("{} has no pose", name), "maps that 'optimize' placed");
      refuse_if(frame && pose->second.frame != *frame, atlas.store().name(),
                fmt::format("{} is not in the frame of the others", name),
                "maps that links connect");
      frame = pose->second.frame;
    }
  }
  for (const NodeId id : first) {
    if (std::find(second.begin(), second.end(), id) == second.end()) continue;
    throw Error(ErrorKind::kMisuse, atlas.store().name(),
                fmt::format("{} is on both sides", state.nodes.at(id).name), "two different sides");
  }
  // Refuses poses of links that were removed.
  component_with(state, first.front(), atlas.store().name());
  std::deque<LandmarkMap> kept;
  const PlacedMap before = as_one(atlas, state, first, execution, kept);
  const PlacedMap after = as_one(atlas, state, second, execution, kept);
  return find_changes(before, after, options, execution);
}

std::optional<AtlasRoute> find_route(const AtlasState& state, NodeId target, NodeId source) {
  std::map<NodeId, std::vector<Step>> steps = steps_of(state);
  // Dijkstra; ties by lower id, so that the result is unique.
  std::map<NodeId, double> sums = {{target, 0.0}};
  std::map<NodeId, std::pair<NodeId, LinkId>> before;
  using Entry = std::pair<double, NodeId>;
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> open;
  open.emplace(0.0, target);
  while (!open.empty()) {
    const auto [sum, node] = open.top();
    open.pop();
    if (sum > sums[node]) continue;
    if (node == source) break;
    for (const Step& step : steps[node]) {
      // Adds a small cost per link, so that the fewest of several exact links are used.
      const double longer = sum + step.variance + 1e-12;
      const auto known = sums.find(step.to);
      if (known != sums.end() && known->second <= longer) continue;
      sums[step.to] = longer;
      before[step.to] = {node, step.link};
      open.emplace(longer, step.to);
    }
  }
  if (!sums.contains(source)) return std::nullopt;

  AtlasRoute route;
  for (NodeId node = source; node != target; node = before.at(node).first) {
    route.nodes.push_back(node);
    route.links.push_back(before.at(node).second);
  }
  route.nodes.push_back(target);
  std::reverse(route.nodes.begin(), route.nodes.end());
  std::reverse(route.links.begin(), route.links.end());
  route.covariance = Matrix7d::Zero();
  for (std::size_t i = 0; i < route.links.size(); ++i) {
    const Link& link = state.links.at(route.links[i]);
    extend(route, link, link.target == route.nodes[i]);
  }
  const auto pose_of_target = state.poses.find(target);
  const auto pose_of_source = state.poses.find(source);
  if (pose_of_target != state.poses.end() && pose_of_source != state.poses.end() &&
      pose_of_target->second.frame == pose_of_source->second.frame) {
    route.optimised =
        pose_of_target->second.frame_from_node.inverse() * pose_of_source->second.frame_from_node;
  }
  return route;
}

LandmarkMap merged_world(Atlas& atlas, const AtlasState& state, const Execution& execution) {
  if (state.nodes.size() == 1) return atlas.map(state.nodes.begin()->second);
  const std::string& location = atlas.store().name();
  // Not is_atlas_file(): to close any descriptor of the file would release SQLite's locks on it.
  const bool is_file = !is_postgres_url(location);
  const fs::path path = merged_world_file(location);
  const std::string key = key_of(state, execution.seed);
  if (is_file) {
    if (auto map = kept(path, key)) return *std::move(map);
  }
  LandmarkMap map = *std::move(atlas.merge({}, {}, state.commit, execution).map);
  if (!is_file || ::access(location.c_str(), W_OK) != 0) return map;
  return keep(std::move(map), path, key);
}

}  // namespace cairn
