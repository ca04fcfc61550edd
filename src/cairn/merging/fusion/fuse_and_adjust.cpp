// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/merging/fusion/fuse_and_adjust.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include "cairn/core/detail/progress_share.hpp"
#include "cairn/core/error.hpp"
#include "cairn/map/operations.hpp"

namespace cairn {
namespace {

constexpr int kMostMatchingRounds = 10;
// Iterations of the solver in all rounds but the last.
constexpr int kIterationsBetween = 15;

// By map and its frame: its index where all frames follow one another.
std::vector<std::vector<FrameIndex>> consecutive_frames(std::span<const PlacedMap> maps) {
  std::vector<std::vector<FrameIndex>> frames(maps.size());
  std::uint32_t next = 0;
  for (std::size_t m = 0; m < maps.size(); ++m) {
    for (std::size_t i = 0; i < maps[m].map->frame_count(); ++i) {
      frames[m].push_back(FrameIndex{next++});
    }
  }
  return frames;
}

void check_shared(std::span<const PlacedMap> maps, std::span<const SharedFrame> shared) {
  for (const SharedFrame& one : shared) {
    if (one.map < one.other_map && one.other_map < maps.size() &&
        one.frame.value < maps[one.map].map->frame_count() &&
        one.other_frame.value < maps[one.other_map].map->frame_count()) {
      continue;
    }
    throw Error(ErrorKind::kMisuse, "FuseAndAdjustOptions.shared_frames",
                fmt::format("frame {} of map {}, frame {} of map {}", one.frame.value, one.map,
                            one.other_frame.value, one.other_map),
                "frames of two of the maps, the earlier map first");
  }
}

template <class Column>
void keep_rows(Column& column, const std::vector<std::size_t>& rows) {
  if (column.empty()) return;
  Column kept;
  kept.reserve(rows.size());
  for (const std::size_t row : rows) kept.push_back(std::as_const(column)[row]);
  column = std::move(kept);
}

// Merges each pair of frames into one. If it then has two observations of a landmark, keeps the first.
LandmarkMap with_frames_joined(LandmarkMap map, std::span<const SharedFrame> shared,
                               std::vector<std::vector<FrameIndex>>& frames) {
  if (shared.empty()) return map;
  constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();
  std::vector<std::uint32_t> stands_for(map.frame_count(), kNone);
  for (const SharedFrame& one : shared) {
    stands_for[frames[one.other_map][one.other_frame.value].value] =
        frames[one.map][one.frame.value].value;
  }
  std::vector<std::size_t> kept;
  std::vector<std::uint32_t> now(map.frame_count());
  for (std::uint32_t i = 0; i < map.frame_count(); ++i) {
    if (stands_for[i] == kNone) {
      now[i] = static_cast<std::uint32_t>(kept.size());
      kept.push_back(i);
    } else {
      now[i] = now[stands_for[i]];
    }
  }
  for (auto& of_map : frames) {
    for (FrameIndex& frame : of_map) frame = FrameIndex{now[frame.value]};
  }
  MapTables tables = std::move(map).tables();
  keep_rows(tables.frames.ids, kept);
  keep_rows(tables.frames.translations, kept);
  keep_rows(tables.frames.quaternions, kept);
  keep_rows(tables.frames.cameras, kept);
  keep_rows(tables.frames.timestamps_s, kept);
  keep_rows(tables.frames.image_names, kept);
  keep_rows(tables.frames.gnss, kept);
  keep_rows(tables.frames.pose_covariances, kept);
  ObservationTable& observations = tables.observations;
  if (observations.offsets.empty()) return LandmarkMap(std::move(tables));
  std::vector<std::size_t> rows;
  std::vector<std::uint64_t> offsets = {0};
  for (std::size_t l = 0; l + 1 < observations.offsets.size(); ++l) {
    const std::size_t first = rows.size();
    for (std::uint64_t k = observations.offsets[l]; k < observations.offsets[l + 1]; ++k) {
      FrameIndex& frame = observations.frames[k];
      frame = FrameIndex{now[frame.value]};
      const bool seen =
          std::any_of(rows.begin() + static_cast<std::ptrdiff_t>(first), rows.end(),
                      [&](std::size_t row) { return observations.frames[row] == frame; });
      if (!seen) rows.push_back(k);
    }
    offsets.push_back(rows.size());
  }
  observations.offsets = std::move(offsets);
  keep_rows(observations.frames, rows);
  keep_rows(observations.pixels, rows);
  keep_rows(observations.keypoints, rows);
  keep_rows(observations.depths, rows);
  keep_rows(observations.octaves, rows);
  keep_rows(observations.sources, rows);
  keep_rows(observations.sigmas_px, rows);
  return LandmarkMap(std::move(tables));
}

}  // namespace

void FuseAndAdjustOptions::validate() const {
  fusion.validate();
  adjustment.validate();
  if (matching_rounds >= 0 && matching_rounds <= kMostMatchingRounds) return;
  throw Error(ErrorKind::kMisuse, "FuseAndAdjustOptions.matching_rounds",
              fmt::format("{}", matching_rounds), fmt::format("0 to {}", kMostMatchingRounds));
}

LandmarkMap moved_with_frames(const LandmarkMap& map, const Similarity3& world_from_map,
                              const LandmarkMap& adjusted, std::span<const FrameIndex> frames) {
  const double scale = world_from_map.scale();
  LandmarkMap copy = map;
  MapTables tables = std::move(copy).tables();
  std::vector<Rigid3> camera_from_map;
  std::vector<Rigid3> world_from_camera;
  for (std::uint32_t i = 0; i < map.frame_count(); ++i) {
    camera_from_map.push_back(map.world_from_camera(FrameIndex{i}).inverse());
    world_from_camera.push_back(adjusted.world_from_camera(frames[i]));
    tables.frames.translations[i] = adjusted.frames().translations[frames[i].value];
    tables.frames.quaternions[i] = adjusted.frames().quaternions[frames[i].value];
  }
  LandmarkTable& landmarks = tables.landmarks;
  for (std::uint32_t l = 0; l < map.landmark_count(); ++l) {
    const auto seen_by = map.observing_frames(LandmarkIndex{l});
    Eigen::Matrix3d linear = world_from_map.linear();
    if (seen_by.empty()) {
      landmarks.positions[l] = world_from_map * landmarks.positions[l];
    } else {
      const std::uint32_t first = seen_by.front().value;
      landmarks.positions[l] =
          world_from_camera[first] * (scale * (camera_from_map[first] * landmarks.positions[l]));
      linear = scale * (world_from_camera[first] * camera_from_map[first]).rotation();
    }
    if (landmarks.covariances.empty()) continue;
    const Eigen::Matrix3d turned =
        linear * landmarks.covariances[l] * linear.transpose();  // NaN where unknown, still
    landmarks.covariances[l] = 0.5 * (turned + turned.transpose());
  }
  ObservationTable& observations = tables.observations;
  for (std::size_t k = 0; scale != 1.0 && k < observations.depths.size(); ++k) {
    const std::optional<double> depth = std::as_const(observations.depths)[k];
    if (depth) observations.depths[k] = scale * *depth;
  }
  return LandmarkMap(std::move(tables));
}

AdjustedFusion fuse_and_adjust(std::span<const PlacedMap> maps,
                               const FuseAndAdjustOptions& options) {
  options.validate();
  check_shared(maps, options.shared_frames);
  AdjustedFusion result;
  std::vector<PlacedMap> placed(maps.begin(), maps.end());
  std::vector<LandmarkMap> moved(maps.size());
  const double rounds = options.matching_rounds + 1;
  FusionOptions fusion = options.fusion;
  fusion.execution.progress = {};
  std::optional<MeasurementNoise> noise;  // estimated in the first round
  for (int round = 0; round <= options.matching_rounds; ++round) {
    const bool last = round == options.matching_rounds;
    FusionResult fused = fuse_maps(placed, fusion);
    fusion.log = {};  // avoids repeated remarks
    result.maps = std::move(fused.maps);
    result.frames = consecutive_frames(maps);
    const LandmarkMap joined =
        with_frames_joined(std::move(fused.map), options.shared_frames, result.frames);
    AdjustOptions how = options.adjustment;
    how.execution.progress =
        stage_of(options.adjustment.execution.progress, round / rounds, (round + 1) / rounds);
    if (!last) {
      how.covariances = false;
      how.max_iterations = std::min(how.max_iterations, kIterationsBetween);
    }
    if (noise) how.noise = noise;
    AdjustResult adjusted = adjust(joined, how);
    noise = adjusted.noise;
    result.map = std::move(adjusted.map);
    result.adjustment.converged = adjusted.converged;
    result.adjustment.iterations += adjusted.iterations;
    result.adjustment.observations = adjusted.observations;
    if (round == 0) result.adjustment.initial_rms_px = adjusted.initial_rms_px;
    result.adjustment.final_rms_px = adjusted.final_rms_px;
    result.adjustment.matching_rounds = round;
    if (last) break;
    for (std::size_t m = 0; m < maps.size(); ++m) {
      // Back in its own frame, because its pose is as uncertain as before; only its drift is corrected.
      moved[m] =
          moved_with_frames(*maps[m].map, maps[m].world_from_map, result.map, result.frames[m]);
      if (!maps[m].is_in_world()) {
        moved[m] = transformed(moved[m], maps[m].world_from_map.inverse());
      }
      placed[m].map = &moved[m];
    }
  }
  return result;
}

}  // namespace cairn
