// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/close_loops.hpp"

#include <algorithm>
#include <numbers>
#include <utility>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/formats/map_file.hpp"
#include "cairn/geometry/covariance.hpp"
#include "cairn/map/operations.hpp"
#include "cairn/vision/detail/corrected_trajectory.hpp"

namespace cairn {
namespace {

// More mini-maps are recognised first.
constexpr std::size_t kMiniMapsTriedInFull = 20;

std::vector<MergeInput> inputs_of(const MappedSequence& session) {
  std::vector<MergeInput> inputs;
  for (std::size_t i = 0; i < session.maps.size(); ++i) {
    inputs.push_back({fmt::format("mini-map {}", i), &session.maps[i], "the session"});
  }
  return inputs;
}

// Covariance of a pose after that of its neighbour and of the link between both, neighbour_from_pose.
Matrix7d chained_covariance(const Matrix7d& of_neighbour, const Similarity3& world_from_neighbour,
                            const Matrix6d& of_link, const Similarity3& world_from_pose) {
  Matrix7d sum = covariance_at_point(
      of_neighbour, world_from_pose.translation() - world_from_neighbour.translation());
  sum.topLeftCorner<6, 6>() += left_transformed_covariance(of_link, world_from_neighbour);
  return sum;
}

// Moves the first map to the identity. Its error becomes that of all others.
void move_first_to_identity(std::vector<MergedMap>& maps) {
  const Similarity3 world_from_first = *maps.front().world_from_map;
  const Similarity3 first_from_world = world_from_first.inverse();
  Matrix7d turn = Matrix7d::Identity();
  turn.topLeftCorner<3, 3>() = turn.block<3, 3>(3, 3) = first_from_world.rigid().rotation();
  const Matrix7d of_first = maps.front().covariance;
  for (MergedMap& map : maps) {
    const Eigen::Vector3d arm = map.world_from_map->translation() - world_from_first.translation();
    map.covariance =
        propagated_covariance(turn, Matrix7d(map.covariance + covariance_at_point(of_first, arm)));
    map.world_from_map = first_from_world * *map.world_from_map;
  }
  maps.front().world_from_map = Similarity3();
  maps.front().covariance.setZero();
}

// Gives maps without a pose one by odometry from their neighbour, with its covariance.
void place_all(const MappedSequence& session, std::vector<MergedMap>& maps) {
  for (std::size_t i = 1; i < maps.size(); ++i) {
    const MergedMap& before = maps[i - 1];
    if (maps[i].placed || !before.placed) continue;
    const Link& link = session.links[i - 1];
    maps[i].placed = true;
    maps[i].world_from_map = *before.world_from_map * *link.target_from_source;
    maps[i].covariance = chained_covariance(before.covariance, *before.world_from_map,
                                            *link.covariance, *maps[i].world_from_map);
  }
  for (std::size_t i = maps.size() - 1; i > 0; --i) {
    const MergedMap& after = maps[i];
    if (maps[i - 1].placed || !after.placed) continue;
    const Link& link = session.links[i - 1];
    maps[i - 1].placed = true;
    maps[i - 1].world_from_map = *after.world_from_map * link.target_from_source->inverse();
    maps[i - 1].covariance =
        chained_covariance(after.covariance, *after.world_from_map,
                           inverse_covariance(link.target_from_source->rigid(), *link.covariance),
                           *maps[i - 1].world_from_map);
  }
  if (maps.front().world_from_map->matrix() != Matrix4d::Identity()) move_first_to_identity(maps);
}

std::vector<detail::CorrectedKeyframe> moved_keyframes(
    const MappedSequence& session, const LandmarkMap& merged,
    const std::vector<std::vector<FrameIndex>>& frames) {
  std::vector<detail::CorrectedKeyframe> keyframes;
  Rigid3 first_from_map;
  for (std::size_t m = 0; m < session.maps.size(); ++m) {
    const LandmarkMap& map = session.maps[m];
    for (std::uint32_t i = 0; i < map.frame_count(); ++i) {
      const double time = map.frames().timestamps_s[i].value();
      if (!keyframes.empty() && time <= keyframes.back().timestamp_s) continue;
      keyframes.push_back({time, first_from_map * map.world_from_camera(FrameIndex{i}),
                           merged.world_from_camera(frames[m][i])});
    }
    if (m < session.links.size()) {
      first_from_map = first_from_map * session.links[m].target_from_source->rigid();
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

void take_largest_moves(const std::vector<detail::CorrectedKeyframe>& keyframes,
                        ClosedLoops& loops) {
  for (const detail::CorrectedKeyframe& one : keyframes) {
    const Vector6d moved = one.before.difference_to(one.after);
    loops.largest_shift_m = std::max(loops.largest_shift_m, moved.head<3>().norm());
    loops.largest_turn_rad = std::max(loops.largest_turn_rad, moved.tail<3>().norm());
  }
}

}  // namespace

ClosedLoops close_loops(const MappedSequence& session, const MergeOptions& options,
                        std::size_t min_observations, const Execution& execution) {
  options.validate();
  refuse_if(session.maps.empty() || session.links.size() + 1 != session.maps.size(), "session",
            fmt::format("{} maps, {} links", session.maps.size(), session.links.size()),
            "a map or more, each linked with the next");
  ClosedLoops result;
  const std::size_t count = session.maps.size();
  if (count < 2) return result;
  const std::vector<MergeInput> inputs = inputs_of(session);
  MergeOptions how = options;
  how.stated = session.links;
  if (!how.links.candidates && count > kMiniMapsTriedInFull) {
    how.links.candidates = kDefaultCandidates;
  }
  MergeResult merged = place_maps(inputs, how, execution.stage(0.0, 0.5));
  const std::size_t tried = merged.links.size() - session.links.size();
  result.odometry_refuted = static_cast<std::size_t>(std::count(
      merged.used.begin() + static_cast<std::ptrdiff_t>(tried), merged.used.end(), false));
  result.links.assign(merged.links.begin(),
                      merged.links.begin() + static_cast<std::ptrdiff_t>(tried));
  result.used.assign(merged.used.begin(), merged.used.begin() + static_cast<std::ptrdiff_t>(tried));
  for (std::size_t i = 0; i < tried; ++i) {
    const auto [first, last] =
        std::minmax(result.links[i].target.value, result.links[i].source.value);
    if (result.used[i] && last > first + 1) ++result.closed;
  }
  if (result.closed == 0) return result;

  place_all(session, merged.maps);
  FusionOptions fusing = options;
  fusing.straighten = false;
  fusing.adjust = true;
  const std::vector<std::vector<FrameIndex>> frames =
      fuse_placed(inputs, fusing, merged, execution.stage(0.5, 1.0));
  reject_if(!merged.adjustment, "session", "its maps cannot be adjusted",
            "maps whose keyframes have cameras");
  result.adjustment = *merged.adjustment;
  const std::vector<detail::CorrectedKeyframe> keyframes =
      moved_keyframes(session, *merged.map, frames);
  take_largest_moves(keyframes, result);
  result.trajectory = detail::corrected(session.trajectory, keyframes);
  result.map = finished(*std::move(merged.map), session, result, min_observations);
  return result;
}

MiniMapLength usual_length_to_close_loops() {
  MiniMapLength length;
  length.metres = 1.0;
  length.turn_rad = std::numbers::pi / 4.0;
  return length;
}

LoopClosedSequence map_and_close_loops(const ImageSequence& sequence, const Camera& camera,
                                       const MapSequenceOptions& mapping,
                                       const MergeOptions& options, const Execution& execution) {
  options.validate();
  MapSequenceOptions in_pieces = mapping;
  if (!in_pieces.mini_maps) in_pieces.mini_maps = usual_length_to_close_loops();
  // Observed once in a mini-map, a landmark may have more observations in the map.
  in_pieces.map.min_observations = 1;
  in_pieces.map.descriptors = true;  // to align by
  LoopClosedSequence result;
  Execution mapping_it = execution.without_progress();
  result.mapped = map_sequence(sequence, camera, in_pieces, mapping_it);
  result.mini_maps = result.mapped.maps.size();
  if (result.mapped.maps.empty()) return result;
  result.loops = close_loops(result.mapped, options, mapping.map.min_observations, execution);
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
    mapping_it.log = {};  // avoids repeated remarks
    result.mapped = map_sequence(sequence, camera, in_one, mapping_it);
  }
  return result;
}

}  // namespace cairn
