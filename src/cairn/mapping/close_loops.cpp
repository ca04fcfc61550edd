// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/mapping/close_loops.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>
#include <string>
#include <utility>

#include <fmt/format.h>

#include "cairn/core/detail/progress_share.hpp"
#include "cairn/core/error.hpp"
#include "cairn/formats/content_uuid.hpp"
#include "cairn/geometry/covariance.hpp"
#include "cairn/map/operations.hpp"
#include "cairn/mapping/corrected_trajectory.hpp"
#include "cairn/merging/optimisation/node_extent.hpp"
#include "cairn/merging/optimisation/optimise_poses.hpp"
#include "cairn/merging/recognition/map_index.hpp"
#include "cairn/vision/map_sequence.hpp"

namespace cairn {
namespace {

using Pairs = std::vector<std::pair<std::size_t, std::size_t>>;

std::vector<const LandmarkMap*> pointers_to(const std::vector<LandmarkMap>& maps) {
  std::vector<const LandmarkMap*> pointers;
  for (const LandmarkMap& map : maps) pointers.push_back(&map);
  return pointers;
}

// (target, source), the source later; by source, then target.
Pairs pairs_to_try(const std::vector<LandmarkMap>& maps, const CloseLoopsOptions& options) {
  std::set<std::pair<std::size_t, std::size_t>> by_source;
  if (maps.size() <= options.most_with_all_pairs) {
    for (std::size_t source = 1; source < maps.size(); ++source) {
      for (std::size_t target = 0; target < source; ++target) by_source.emplace(source, target);
    }
  } else {
    RecognitionOptions how;
    how.seed = options.seed;
    MapIndex index(how);
    for (const LandmarkMap& map : maps) index.add(map);
    for (std::size_t i = 0; i < maps.size(); ++i) {
      if (i > 0) by_source.emplace(i, i - 1);
      for (const RecognitionCandidate& found : index.find(i, options.candidates)) {
        by_source.emplace(std::max(i, found.map), std::min(i, found.map));
      }
    }
  }
  Pairs pairs;
  for (const auto& [source, target] : by_source) pairs.emplace_back(target, source);
  return pairs;
}

// The session's nodes, odometry's links, then those of the pairs that are aligned.
PoseGraph session_graph(const MappedSequence& session, const std::vector<MapLink>& links,
                        std::vector<std::size_t>& link_of) {
  std::vector<std::string> names;
  for (std::size_t i = 0; i < session.maps.size(); ++i) names.push_back(fmt::format("{}", i));
  PoseGraph graph = pose_graph(session, names);
  for (std::size_t i = 0; i < links.size(); ++i) {
    const auto link = pose_link(links[i]);
    if (!link) continue;
    graph.links.push_back(*link);
    link_of.push_back(i);
  }
  return graph;
}

// Covariance of a pose after that of its neighbour and of the link between both, neighbour_from_pose.
Matrix7d chained_covariance(const Matrix7d& of_neighbour, const Similarity3& world_from_neighbour,
                            const Matrix6d& of_link, const Similarity3& world_from_pose) {
  Matrix7d sum = covariance_at_point(
      of_neighbour, world_from_pose.translation() - world_from_neighbour.translation());
  sum.topLeftCorner<6, 6>() += left_transformed_covariance(of_link, world_from_neighbour);
  return sum;
}

// Moves the first node to the identity. Its error becomes that of all others.
void move_first_to_identity(OptimisedPoses& poses) {
  auto& nodes = poses.world_from_node;
  const Similarity3 world_from_first = *nodes.front();
  const Similarity3 first_from_world = world_from_first.inverse();
  Matrix7d turn = Matrix7d::Identity();
  turn.topLeftCorner<3, 3>() = turn.block<3, 3>(3, 3) = first_from_world.rigid().rotation();
  const Matrix7d of_first = poses.covariances.front();
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    const Eigen::Vector3d arm = nodes[i]->translation() - world_from_first.translation();
    poses.covariances[i] = propagated_covariance(
        turn, Matrix7d(poses.covariances[i] + covariance_at_point(of_first, arm)));
    nodes[i] = first_from_world * *nodes[i];
  }
  nodes.front() = Similarity3();
  poses.covariances.front().setZero();
}

// Gives nodes without a pose one by odometry from their neighbour, with its covariance.
void place_all(const MappedSequence& session, OptimisedPoses& poses) {
  auto& nodes = poses.world_from_node;
  for (std::size_t i = 1; i < nodes.size(); ++i) {
    if (nodes[i] || !nodes[i - 1]) continue;
    const MiniMapLink& link = session.links[i - 1];
    nodes[i] = *nodes[i - 1] * Similarity3(link.previous_from_next);
    poses.covariances[i] =
        chained_covariance(poses.covariances[i - 1], *nodes[i - 1], link.covariance, *nodes[i]);
  }
  for (std::size_t i = nodes.size() - 1; i > 0; --i) {
    if (nodes[i - 1] || !nodes[i]) continue;
    const MiniMapLink& link = session.links[i - 1];
    nodes[i - 1] = *nodes[i] * Similarity3(link.previous_from_next.inverse());
    poses.covariances[i - 1] = chained_covariance(
        poses.covariances[i], *nodes[i],
        inverse_covariance(link.previous_from_next, link.covariance), *nodes[i - 1]);
  }
  if (nodes.front()->matrix() != Matrix4d::Identity()) move_first_to_identity(poses);
}

std::vector<CorrectedKeyframe> moved_keyframes(const MappedSequence& session,
                                               const AdjustedFusion& fused) {
  std::vector<CorrectedKeyframe> keyframes;
  Rigid3 first_from_map;
  for (std::size_t m = 0; m < session.maps.size(); ++m) {
    const LandmarkMap& map = session.maps[m];
    for (std::uint32_t i = 0; i < map.frame_count(); ++i) {
      const double time = map.frames().timestamps_s[i].value();
      if (!keyframes.empty() && time <= keyframes.back().timestamp_s) continue;
      keyframes.push_back({time, first_from_map * map.world_from_camera(FrameIndex{i}),
                           fused.map.world_from_camera(fused.frames[m][i])});
    }
    if (m < session.links.size()) {
      first_from_map = first_from_map * session.links[m].previous_from_next;
    }
  }
  return keyframes;
}

// Makes a map of one session: numbered from 0, without names of mini-maps.
LandmarkMap finished(LandmarkMap map, const MappedSequence& session, const ClosedLoops& loops,
                     std::size_t min_observations) {
  if (min_observations > 1) map = with_landmarks(map, landmarks_observed(map, min_observations));
  MapTables tables = std::move(map).tables();
  std::erase_if(tables.landmarks.columns, [](const NamedColumn& column) {
    return column.name == kFromMapColumn || column.name == kFromLandmarkColumn ||
           column.name == kFusedColumn;
  });
  for (std::size_t i = 0; i < tables.frames.ids.size(); ++i) tables.frames.ids[i] = FrameId{i};
  for (std::size_t i = 0; i < tables.landmarks.ids.size(); ++i) {
    tables.landmarks.ids[i] = LandmarkId{i};
  }
  auto& poses = tables.frames.pose_covariances;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    // Those that adjusting estimated; the first frame's is zero.
    const std::optional<Matrix6d> marginal = poses[i];
    if (marginal && !marginal->isZero(0.0)) poses.set(i, stated_covariance(*marginal));
  }
  tables.info.provenance = session.maps.front().info().provenance;
  tables.info.provenance.push_back(fmt::format(
      "{} mini-maps of one session, {} loops closed; adjusted: {} observations, root mean square "
      "residual {:.3f} px",
      session.maps.size(), loops.closed, loops.adjustment.observations,
      loops.adjustment.final_rms_px));
  return with_content_uuid(LandmarkMap(std::move(tables)));
}

LandmarkMap without_descriptors(LandmarkMap map) {
  MapTables tables = std::move(map).tables();
  tables.landmarks.descriptors.reset();
  return with_content_uuid(LandmarkMap(std::move(tables)));
}

void take_largest_moves(const std::vector<CorrectedKeyframe>& keyframes, ClosedLoops& loops) {
  for (const CorrectedKeyframe& one : keyframes) {
    const Vector6d moved = one.before.difference_to(one.after);
    loops.largest_shift_m = std::max(loops.largest_shift_m, moved.head<3>().norm());
    loops.largest_turn_rad = std::max(loops.largest_turn_rad, moved.tail<3>().norm());
  }
}

}  // namespace

void CloseLoopsOptions::validate() const {
  links.validate();
  FuseAndAdjustOptions how;
  how.fusion.min_probability = fusion_probability;
  how.adjustment = adjustment;
  how.matching_rounds = matching_rounds;
  how.validate();
  const auto at_least = [](std::size_t least, std::size_t value, std::string_view field) {
    if (value >= least) return;
    throw Error(ErrorKind::kMisuse, fmt::format("CloseLoopsOptions.{}", field),
                fmt::format("{}", value), fmt::format("at least {}", least));
  };
  at_least(2, most_with_all_pairs, "most_with_all_pairs");
  at_least(1, candidates, "candidates");
  at_least(1, min_observations, "min_observations");
}

ClosedLoops close_loops(const MappedSequence& session, const CloseLoopsOptions& options) {
  options.validate();
  if (session.maps.empty() || session.links.size() + 1 != session.maps.size()) {
    throw Error(ErrorKind::kMisuse, "session",
                fmt::format("{} maps, {} links", session.maps.size(), session.links.size()),
                "a map or more, each linked with the next");
  }
  ClosedLoops result;
  const std::size_t count = session.maps.size();
  if (count < 2) return result;
  LinkOptions how = options.links;
  how.seed = options.seed;
  how.execution = options.execution;
  how.execution.progress = stage_of(options.execution.progress, 0.0, 0.5);
  result.links = link_maps(pointers_to(session.maps), pairs_to_try(session.maps, options), how);
  result.used.assign(result.links.size(), false);

  std::vector<std::size_t> link_of;
  const PoseGraph graph = session_graph(session, result.links, link_of);
  std::vector<NodeExtent> extents;
  for (const LandmarkMap& map : session.maps) extents.push_back(node_extent(map));
  OptimisedPoses poses = optimise_poses(graph, extents);
  const std::size_t of_odometry = session.links.size();
  for (std::size_t i = 0; i < of_odometry; ++i) {
    if (!poses.agrees[i]) ++result.odometry_refuted;
  }
  for (std::size_t i = 0; i < link_of.size(); ++i) {
    if (!poses.agrees[of_odometry + i]) continue;
    const MapLink& link = result.links[link_of[i]];
    result.used[link_of[i]] = true;
    if (std::max(link.target, link.source) > std::min(link.target, link.source) + 1) {
      ++result.closed;
    }
  }
  if (result.closed == 0) return result;

  place_all(session, poses);
  std::vector<PlacedMap> placed;
  for (std::size_t i = 0; i < count; ++i) {
    placed.push_back({&session.maps[i], fmt::format("mini-map {}", i), *poses.world_from_node[i],
                      poses.covariances[i]});
  }
  FuseAndAdjustOptions fusing;
  fusing.fusion.min_probability = options.fusion_probability;
  fusing.fusion.seed = options.seed;
  fusing.fusion.execution = options.execution.without_progress();
  fusing.fusion.log = options.log;
  fusing.adjustment = options.adjustment;
  fusing.adjustment.execution = options.execution;
  fusing.adjustment.execution.progress = stage_of(options.execution.progress, 0.5, 1.0);
  fusing.matching_rounds = options.matching_rounds;
  AdjustedFusion fused = fuse_and_adjust(placed, fusing);
  result.adjustment = fused.adjustment;
  const std::vector<CorrectedKeyframe> keyframes = moved_keyframes(session, fused);
  take_largest_moves(keyframes, result);
  result.trajectory = corrected(session.trajectory, keyframes);
  result.map = finished(std::move(fused.map), session, result, options.min_observations);
  return result;
}

MiniMapLength usual_length_to_close_loops() {
  MiniMapLength length;
  length.metres = 1.0;
  length.turn_rad = std::numbers::pi / 4.0;
  return length;
}

LoopClosedSequence map_and_close_loops(const RgbdSequence& sequence, const Camera& camera,
                                       const MapSequenceOptions& mapping,
                                       const CloseLoopsOptions& options) {
  options.validate();
  MapSequenceOptions in_pieces = mapping;
  if (!in_pieces.mini_maps) in_pieces.mini_maps = usual_length_to_close_loops();
  // Observed once in a mini-map, a landmark may have more observations in the map.
  in_pieces.map.min_observations = 1;
  in_pieces.map.descriptors = true;  // to align by
  LoopClosedSequence result;
  result.mapped = map_sequence(sequence, camera, in_pieces);
  result.mini_maps = result.mapped.maps.size();
  if (result.mapped.maps.empty()) return result;
  CloseLoopsOptions how = options;
  how.min_observations = std::max(options.min_observations, mapping.map.min_observations);
  result.loops = close_loops(result.mapped, how);
  if (result.loops.map) {
    MappedSequence& mapped = result.mapped;
    mapped.maps.clear();
    mapped.maps.push_back(mapping.map.descriptors
                              ? std::move(*result.loops.map)
                              : without_descriptors(std::move(*result.loops.map)));
    mapped.links.clear();
    mapped.trajectory = std::move(result.loops.trajectory);
    mapped.keyframes = mapped.maps.front().frame_count();
    result.loops.map.reset();
    result.loops.trajectory = {};
  } else {
    MapSequenceOptions in_one = mapping;
    in_one.mini_maps.reset();
    in_one.log = {};  // avoids repeated remarks
    result.mapped = map_sequence(sequence, camera, in_one);
  }
  return result;
}

}  // namespace cairn
