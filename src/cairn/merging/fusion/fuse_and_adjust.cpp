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
    result.frames = std::move(fused.frames);
    AdjustOptions how = options.adjustment;
    how.execution.progress =
        stage_of(options.adjustment.execution.progress, round / rounds, (round + 1) / rounds);
    if (!last) {
      how.covariances = false;
      how.max_iterations = std::min(how.max_iterations, kIterationsBetween);
    }
    if (noise) how.noise = noise;
    AdjustResult adjusted = adjust(fused.map, how);
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
