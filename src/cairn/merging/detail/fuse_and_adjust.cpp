// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/merging/detail/fuse_and_adjust.hpp"

#include <algorithm>
#include <map>
#include <optional>
#include <utility>

#include "cairn/geometry/covariance.hpp"
#include "cairn/geometry/decompositions.hpp"
#include "cairn/map/operations.hpp"

namespace cairn::detail {
namespace {

// Iterations of the solver in all rounds but the last.
constexpr int kIterationsBetween = 15;

// Converts covariances relative to the first frames of groups to covariances in the world. Each of these frames has the
// uncertainty that its map states, and that of the map's pose.
LandmarkMap with_uncertain_references(LandmarkMap map,
                                      std::span<const std::optional<FrameIndex>> references,
                                      std::span<const PlacedMap> maps,
                                      const std::vector<std::vector<FrameIndex>>& frames) {
  std::map<FrameIndex, Matrix7d> of_reference;
  for (std::size_t m = 0; m < maps.size(); ++m) {
    const auto& in_map = maps[m].map->frames().pose_covariances;
    for (std::uint32_t i = 0; i < frames[m].size(); ++i) {
      const FrameIndex frame = frames[m][i];
      if (references[frame.value] != frame || of_reference.contains(frame)) continue;
      Matrix7d covariance =
          covariance_at_point(maps[m].covariance, map.world_from_camera(frame).translation() -
                                                      maps[m].world_from_map.translation());
      if (!in_map.empty() && in_map[i]) {
        covariance.topLeftCorner<6, 6>() +=
            left_transformed_covariance(*in_map[i], maps[m].world_from_map);
      }
      of_reference.emplace(frame, covariance);
    }
  }
  // Of a point that moves with a reference.
  const auto carried_to = [&](const Eigen::Vector3d& point, FrameIndex reference) {
    return covariance_at_point(of_reference.at(reference),
                               point - map.world_from_camera(reference).translation());
  };
  const OptionalColumn<Matrix6d>& relative = map.frames().pose_covariances;
  OptionalColumn<Matrix6d> poses = relative;
  for (std::uint32_t i = 0; i < map.frame_count(); ++i) {
    if (!references[i] || !relative[i]) continue;
    const Eigen::Vector3d centre = map.world_from_camera(FrameIndex{i}).translation();
    const Matrix6d sum = *relative[i] + carried_to(centre, *references[i]).topLeftCorner<6, 6>();
    poses.set(i, Matrix6d(0.5 * (sum + sum.transpose())));
  }
  std::vector<Eigen::Matrix3d> landmarks = map.landmarks().covariances;
  for (std::uint32_t l = 0; l < landmarks.size(); ++l) {
    const auto seen_by = map.observing_frames(LandmarkIndex{l});
    if (seen_by.empty() || !references[seen_by.front().value]) continue;
    const Eigen::Vector3d& position = map.landmarks().positions[l];
    const Matrix7d carried = carried_to(position, *references[seen_by.front().value]);
    const Eigen::Matrix3d sum = landmarks[l] + carried.topLeftCorner<3, 3>();  // NaN where unknown
    landmarks[l] = 0.5 * (sum + sum.transpose());
  }
  MapTables tables = std::move(map).tables();
  tables.frames.pose_covariances = std::move(poses);
  tables.landmarks.covariances = std::move(landmarks);
  return LandmarkMap(std::move(tables));
}

// The map's cameras with adjusted parameters. Those of an image that another map has too may be that map's.
std::vector<Camera> adjusted_cameras(const LandmarkMap& map, const LandmarkMap& adjusted,
                                     std::span<const std::optional<CameraIndex>> now) {
  std::vector<Camera> cameras(map.cameras().begin(), map.cameras().end());
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    if (now[i]) cameras[i].parameters = adjusted.cameras()[now[i]->value].parameters;
  }
  return cameras;
}

// Where a landmark's lines of sight meet: the least-squares point, with the weights of angles. std::nullopt if depths
// were measured, which are more accurate, or if the lines are nearly parallel.
std::optional<Eigen::Vector3d> where_sights_meet(const LandmarkMap& map, LandmarkIndex landmark,
                                                 const Eigen::Vector3d& about) {
  constexpr double kLeastParallax = 1e-4;  // mean squared sine of the angles between them
  const auto seen_by = map.observing_frames(landmark);
  const auto pixels = map.observed_pixels(landmark);
  const ObservationTable& observations = map.observations();
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  double weights = 0.0;
  if (map.frames().cameras.empty()) return std::nullopt;
  for (std::size_t k = 0; k < seen_by.size(); ++k) {
    const std::size_t row = observations.offsets[landmark.value] + k;
    if (!observations.depths.empty() && observations.depths[row]) return std::nullopt;
    const auto camera = map.frames().cameras[seen_by[k].value];
    if (!camera) return std::nullopt;
    const auto sight = unproject(map.cameras()[camera->value], pixels[k]);
    if (!sight) continue;
    const Rigid3 pose = map.world_from_camera(seen_by[k]);
    const Eigen::Vector3d direction = pose.quaternion() * *sight;
    const double weight = 1.0 / (about - pose.translation()).squaredNorm();
    const Eigen::Matrix3d across =
        weight * (Eigen::Matrix3d::Identity() - direction * direction.transpose());
    information += across;
    sum += across * pose.translation();
    weights += weight;
  }
  const bool is_parallel = symmetric_eigenvalues<3>(information)[0] < kLeastParallax * weights;
  if (is_parallel || weights == 0.0) return std::nullopt;
  return information.inverse() * sum;
}

}  // namespace

LandmarkMap moved_with_frames(const LandmarkMap& map, const Similarity3& world_from_map,
                              const LandmarkMap& adjusted, std::span<const FrameIndex> frames,
                              std::span<const std::optional<CameraIndex>> cameras) {
  LandmarkMap in_world = transformed(map, world_from_map);
  std::vector<Rigid3> moves;  // of the frames
  for (std::uint32_t i = 0; i < map.frame_count(); ++i) {
    moves.push_back(adjusted.world_from_camera(frames[i]) *
                    in_world.world_from_camera(FrameIndex{i}).inverse());
  }
  MapTables tables = std::move(in_world).tables();
  tables.cameras = adjusted_cameras(map, adjusted, cameras);
  for (std::uint32_t i = 0; i < map.frame_count(); ++i) {
    tables.frames.translations[i] = adjusted.frames().translations[frames[i].value];
    tables.frames.quaternions[i] = adjusted.frames().quaternions[frames[i].value];
  }
  LandmarkTable& landmarks = tables.landmarks;
  for (std::uint32_t l = 0; l < map.landmark_count(); ++l) {
    const auto seen_by = map.observing_frames(LandmarkIndex{l});
    if (seen_by.empty()) continue;
    const Rigid3& move = moves[seen_by.front().value];
    landmarks.positions[l] = move * landmarks.positions[l];
    if (landmarks.covariances.empty()) continue;
    const Eigen::Matrix3d turned =
        rotated_covariance(landmarks.covariances[l], move.rotation());  // NaN where unknown, still
    landmarks.covariances[l] = 0.5 * (turned + turned.transpose());
  }
  LandmarkMap posed(std::move(tables));
  std::vector<Eigen::Vector3d> positions = posed.landmarks().positions;
  for (std::uint32_t l = 0; l < posed.landmark_count(); ++l) {
    const auto met = where_sights_meet(posed, LandmarkIndex{l}, positions[l]);
    if (met) positions[l] = *met;
  }
  tables = std::move(posed).tables();
  tables.landmarks.positions = std::move(positions);
  return LandmarkMap(std::move(tables));
}

MergedPlaced fuse_and_adjust(std::span<const PlacedMap> maps, const FusionOptions& options,
                             const Execution& execution) {
  MergedPlaced result;
  MergeAdjustment& adjustment = result.adjustment.emplace();
  std::vector<PlacedMap> placed(maps.begin(), maps.end());
  std::vector<LandmarkMap> moved(maps.size());
  const double rounds = options.matching_rounds + 1;
  Execution fusing = execution.without_progress();
  std::optional<MeasurementNoise> noise;  // estimated in the first round
  for (int round = 0; round <= options.matching_rounds; ++round) {
    const bool last = round == options.matching_rounds;
    FusionResult fused = fuse_maps(placed, options, fusing);
    fusing.log = {};  // avoids repeated remarks
    result.maps = std::move(fused.maps);
    result.frames = std::move(fused.frames);
    AdjustOptions how = options.adjustment;
    if (!last) {
      how.covariances = false;
      how.max_iterations = std::min(how.max_iterations, kIterationsBetween);
    }
    if (noise) how.noise = noise;
    AdjustResult adjusted =
        adjust(fused.map, how, execution.stage(round / rounds, (round + 1) / rounds));
    noise = adjusted.noise;
    result.map = std::move(adjusted.map);
    adjustment.converged = adjusted.converged;
    adjustment.iterations += adjusted.iterations;
    adjustment.observations = adjusted.observations;
    if (round == 0) adjustment.initial_rms_px = adjusted.initial_rms_px;
    adjustment.final_rms_px = adjusted.final_rms_px;
    adjustment.matching_rounds = round;
    if (last) {
      if (!adjusted.covariance_references.empty()) {
        result.map = with_uncertain_references(std::move(result.map),
                                               adjusted.covariance_references, maps, result.frames);
      } else if (!adjusted.why_no_covariances.empty() && execution.log) {
        execution.log("the adjusted map has no covariances: " + adjusted.why_no_covariances);
      }
      break;
    }
    for (std::size_t m = 0; m < maps.size(); ++m) {
      // Back in its own frame, because its pose is as uncertain as before; only its drift is corrected.
      moved[m] = moved_with_frames(*maps[m].map, maps[m].world_from_map, result.map,
                                   result.frames[m], fused.cameras[m]);
      if (!maps[m].is_in_world()) {
        moved[m] = transformed(moved[m], maps[m].world_from_map.inverse());
      }
      placed[m].map = &moved[m];
    }
  }
  return result;
}

}  // namespace cairn::detail
