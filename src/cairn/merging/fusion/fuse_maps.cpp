// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/merging/fusion/fuse_maps.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <utility>

#include <Eigen/LU>
#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/geometry/covariance.hpp"
#include "cairn/map/distinct_descriptors.hpp"
#include "cairn/map/operations.hpp"
#include "cairn/map/turning_columns.hpp"
#include "cairn/merging/detail/association.hpp"

namespace cairn {
namespace {

constexpr std::string_view kStaleColumn = "reprojection_error";

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr std::size_t kBlock = 4096;
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

bool is_known(const Matrix3d& covariance) {
  return !std::isnan(covariance(0, 0));
}

// A map's landmarks in the world frame. Covariances are zero if unknown.
struct WorldLandmarks {
  std::vector<Vector3d> positions;
  std::vector<Matrix3d> covariances;
};

WorldLandmarks in_world(const PlacedMap& placed, const Executor& executor) {
  const LandmarkMap& map = *placed.map;
  const LandmarkTable& landmarks = map.landmarks();
  const Matrix3d linear = placed.world_from_map.linear();
  WorldLandmarks world;
  world.positions.resize(map.landmark_count());
  world.covariances.assign(map.landmark_count(), Matrix3d::Zero());
  executor.for_blocks(map.landmark_count(), kBlock, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      world.positions[i] = placed.world_from_map * landmarks.positions[i];
      if (landmarks.covariances.empty() || !is_known(landmarks.covariances[i])) continue;
      world.covariances[i] = propagated_covariance(linear, landmarks.covariances[i]);
    }
  });
  return world;
}

// How uncertain a point of a map is in the world because the map's pose is.
Matrix3d covariance_by_pose(const PlacedMap& placed, const Matrix7d& of_pose,
                            const Vector3d& in_world) {
  const Eigen::Matrix<double, 3, 7> by_pose =
      point_by_pose(in_world - placed.world_from_map.translation());
  return by_pose * of_pose * by_pose.transpose();
}

Matrix3d symmetric(const Matrix3d& m) {
  return 0.5 * (m + m.transpose());
}

const Matrix7d& relative_covariance(const PlacedMap& placed) {
  return placed.relative_covariance ? *placed.relative_covariance : placed.covariance;
}

// Of a keyframe in the world: of its pose in its map, and of the map's.
std::optional<Matrix6d> pose_covariance(const PlacedMap& placed, FrameIndex frame) {
  const auto& in_map = placed.map->frames().pose_covariances;
  if (in_map.empty() || !in_map[frame.value]) return std::nullopt;
  const Vector3d arm =
      placed.world_from_map.linear() * placed.map->world_from_camera(frame).translation();
  Eigen::Matrix<double, 6, 7> by_pose = Eigen::Matrix<double, 6, 7>::Zero();
  by_pose.topRows<3>() = point_by_pose(arm);
  by_pose.block<3, 3>(3, 3).setIdentity();
  const Matrix6d sum = left_transformed_covariance(*in_map[frame.value], placed.world_from_map) +
                       by_pose * placed.covariance * by_pose.transpose();
  return 0.5 * (sum + sum.transpose());
}

// Which landmark of which map is one of those that a fused landmark combines.
struct Member {
  std::uint32_t map = 0;
  std::uint32_t landmark = 0;
  double probability = 1.0;  // that it is the same as the earlier ones
  std::uint32_t previous = kNoMember;

  static constexpr std::uint32_t kNoMember = std::numeric_limits<std::uint32_t>::max();
};

// An estimate of a position. The uncertainty of the maps' poses moves all landmarks of a map together, so it does not tell
// which of them are better.
struct Estimate {
  Vector3d position;
  Matrix3d covariance;  // by which landmarks are weighted
  Matrix3d
      compared;  // by which they are compared: with that of the poses relative to the largest map's
  Matrix3d stated;  // with that of the poses in the world
};

// The information-weighted mean of all of `measured`. Its covariance is that of a mixture: with probability 1 - wrong all
// are one landmark, otherwise any of them is another. Zero if one of them is exact.
Estimate combined(std::span<const Estimate> measured, double wrong) {
  const std::size_t count = measured.size();
  // Sums of information and of its products with the positions, before and from each measurement.
  struct Sum {
    Matrix3d information = Matrix3d::Zero();
    Vector3d moment = Vector3d::Zero();

    Estimate estimate(const Vector3d& origin) const {
      const Matrix3d covariance = information.inverse();
      return {origin + covariance * moment, covariance, Matrix3d::Zero(), Matrix3d::Zero()};
    }
  };
  // About one of them, since the mean lies among them, far from the world's origin.
  const Vector3d& origin = measured.front().position;
  std::vector<Sum> before(count + 1);
  std::vector<Sum> from(count + 1);
  std::vector<Sum> each(count);
  for (std::size_t k = 0; k < count; ++k) {
    const Matrix3d information = measured[k].covariance.inverse();
    if (!information.allFinite()) return measured[k];
    each[k] = {information, information * (measured[k].position - origin)};
    before[k + 1] = {before[k].information + each[k].information,
                     before[k].moment + each[k].moment};
  }
  for (std::size_t k = count; k-- > 0;) {
    from[k] = {from[k + 1].information + each[k].information, from[k + 1].moment + each[k].moment};
  }
  Estimate all = before[count].estimate(origin);
  Matrix3d more = Matrix3d::Zero();
  for (std::size_t k = 0; k < count; ++k) {
    const Matrix3d weight = all.covariance * each[k].information;
    all.compared += weight * measured[k].compared * weight.transpose();
    all.stated += weight * measured[k].stated * weight.transpose();
    if (wrong == 0.0) continue;
    const Sum others{before[k].information + from[k + 1].information,
                     before[k].moment + from[k + 1].moment};
    const Estimate without = others.estimate(origin);
    const Vector3d apart = without.position - all.position;
    more += without.covariance - all.covariance + apart * apart.transpose();
  }
  more *= wrong / static_cast<double>(count);
  all.covariance = symmetric(all.covariance + more);
  all.compared = symmetric(all.compared + more);
  all.stated = symmetric(all.stated + more);
  return all;
}

// The fused map under construction.
class Fusion {
 public:
  Fusion(std::span<const PlacedMap> maps, const FusionOptions& options);

  FusionResult run();

 private:
  void add(std::size_t m);
  void add_frames(std::size_t m);
  void tell_images_apart();
  std::optional<FrameIndex> known_frame(std::size_t m, std::uint32_t i,
                                        std::optional<CameraIndex> camera) const;
  void estimate_variances(std::size_t m, const AssociationResult& association);
  Estimate estimate(std::uint32_t landmark) const;
  void count_fused();
  void append(std::size_t m, std::uint32_t i);
  void set_positions();
  void take_looks(std::size_t m, std::uint32_t i, std::uint32_t landmark);
  void take_further(const DescriptorColumn& theirs, std::uint32_t i, std::uint32_t landmark);
  void set_further();
  void set_columns();
  std::vector<std::vector<bool>> repeated_observations() const;
  void set_observations();
  std::string frames_line(std::size_t m) const;
  // The folder of a map's images; without blanks, at which COLMAP ends a name.
  std::string image_folder(std::size_t m) const {
    std::string folder = maps_[m].name + "/";
    std::replace(folder.begin(), folder.end(), ' ', '_');
    return folder;
  }
  std::string image_name(std::size_t m, const std::string& name) const {
    return has_prefix_[m] && !name.empty() ? image_folder(m) + name : name;
  }
  void set_info();

  bool has_covariance(std::size_t m, std::uint32_t i) const {
    const auto& covariances = maps_[m].map->landmarks().covariances;
    return !covariances.empty() && is_known(covariances[i]);
  }

  std::span<const PlacedMap> maps_;
  const FusionOptions& options_;
  std::vector<std::size_t> order_;  // in which maps are added, whatever order they are given in
  FusionResult result_;
  MapTables tables_;
  std::vector<WorldLandmarks> world_;  // by map
  // By map: variance of its landmarks that their covariances do not explain. Unknown before another map has the same ones.
  std::vector<std::optional<double>> variances_;
  std::vector<std::size_t>
      original_;  // by map: the first one with the same landmarks, mostly itself
  std::vector<Member> members_;
  std::vector<std::uint32_t> last_member_;  // of each fused landmark
  std::vector<Vector3d> positions_;         // of the fused landmarks, so far
  std::vector<Matrix3d> covariances_;       // with the variances
  bool has_colors_ = false;
  std::vector<std::uint32_t> best_observed_;  // observations of the part that gave the descriptor
  bool has_further_ = false;                  // a map with several of a landmark
  std::vector<std::vector<std::uint8_t>> descriptors_;   // if so: bytes of all of each landmark's
  std::vector<std::vector<std::uint32_t>> landmark_of_;  // by map and its landmark
  std::vector<bool> is_shared_;                          // by frame: whether two maps have it
  std::vector<std::size_t> map_of_frame_;                // whose pose it has
  std::vector<bool> has_prefix_;                         // by map: before the names of its images
  std::vector<std::uint32_t> from_map_;
  std::vector<std::uint32_t> from_landmark_;  // index
  std::vector<std::uint32_t> parts_;
};

Fusion::Fusion(std::span<const PlacedMap> maps, const FusionOptions& options)
    : maps_(maps),
      options_(options),
      order_(largest_first(maps)),
      world_(maps.size()),
      variances_(maps.size()),
      original_(maps.size()),
      landmark_of_(maps.size()),
      has_prefix_(maps.size(), false) {
  result_.maps.resize(maps.size());
  for (std::size_t i = 0; i < order_.size(); ++i) {
    const std::size_t m = order_[i];
    const bool is_copy = i > 0 && !precedes(*maps[order_[i - 1]].map, *maps[m].map);
    original_[m] = is_copy ? original_[order_[i - 1]] : m;
  }
  std::size_t landmarks = 0;
  std::size_t frames = 0;
  for (const std::size_t m : order_) {
    const PlacedMap& placed = maps[m];
    require_no_splats(*placed.map, placed.name);
    landmarks += placed.map->landmark_count();
    frames += placed.map->frame_count();
    has_colors_ = has_colors_ || !placed.map->landmarks().colors.empty();
    const auto& descriptors = placed.map->landmarks().descriptors;
    if (!descriptors) continue;
    auto& kept = tables_.landmarks.descriptors;
    if (!kept) kept = DescriptorColumn{descriptors->kind, descriptors->bytes_each, {}, {}};
    const bool fits =
        kept->kind == descriptors->kind && kept->bytes_each == descriptors->bytes_each;
    has_further_ = has_further_ || (fits && descriptors->has_further());
    if (!fits && options_.log) {
      options_.log(
          fmt::format("{}: its descriptors ({}, {} bytes) are left out: a map has one kind",
                      placed.name, printable(descriptors->kind), descriptors->bytes_each));
    }
  }
  constexpr std::size_t kMost = std::numeric_limits<std::uint32_t>::max();
  if (landmarks > kMost || frames > kMost) {
    throw Error(ErrorKind::kInput, "maps",
                fmt::format("{} landmarks, {} frames", landmarks, frames),
                fmt::format("at most {} of each", kMost));
  }
  if (has_colors_) tables_.landmarks.colors.reserve(landmarks);
}

FusionResult Fusion::run() {
  for (std::size_t m = 0; m < maps_.size(); ++m) add_frames(m);
  std::size_t added = 0;
  for (const std::size_t m : order_) {
    if (options_.execution.stop.stop_requested()) {
      throw Error(ErrorKind::kCancelled, "merge", "fusion was cancelled", "");
    }
    add(m);
    if (options_.execution.progress) {
      options_.execution.progress(static_cast<double>(++added) / static_cast<double>(maps_.size()));
    }
  }
  count_fused();
  set_positions();
  set_columns();
  set_observations();
  tell_images_apart();
  set_info();
  tables_.landmarks.ids.resize(last_member_.size());
  for (std::size_t i = 0; i < last_member_.size(); ++i) {
    tables_.landmarks.ids[i] = LandmarkId{i};
  }
  result_.map = LandmarkMap(std::move(tables_));
  return std::move(result_);
}

void Fusion::add(std::size_t m) {
  const LandmarkMap& map = *maps_[m].map;
  const WorldLandmarks& world = world_[m] = in_world(maps_[m], options_.execution.executor);
  AssociationResult association;
  if (original_[m] != m) {
    for (std::uint32_t i = 0; i < map.landmark_count(); ++i) {
      association.pairs.push_back({landmark_of_[original_[m]][i], i, 1.0});
    }
  } else if (!positions_.empty()) {
    AssociationOptions how;
    how.min_probability = options_.min_probability;
    how.seed = options_.seed;
    how.execution = options_.execution.without_progress();
    const auto looks = [](const std::optional<DescriptorColumn>& column) {
      return column ? &*column : nullptr;
    };
    std::vector<Matrix3d> covariances = world.covariances;
    for (std::size_t i = 0; i < covariances.size(); ++i) {
      covariances[i] +=
          covariance_by_pose(maps_[m], relative_covariance(maps_[m]), world.positions[i]);
    }
    association =
        associate({positions_, covariances_, looks(tables_.landmarks.descriptors)},
                  {world.positions, covariances, looks(map.landmarks().descriptors)}, how);
  }
  result_.maps[m].landmarks = map.landmark_count();
  result_.maps[m].deviation = association.deviation;
  estimate_variances(m, association);
  landmark_of_[m].resize(map.landmark_count());
  auto next = association.pairs.begin();
  for (std::uint32_t i = 0; i < map.landmark_count(); ++i) {
    if (next != association.pairs.end() && next->second == i) {
      const std::uint32_t landmark = landmark_of_[m][i] = next->first;
      members_.push_back(
          {static_cast<std::uint32_t>(m), i, next->probability,
           std::exchange(last_member_[landmark], static_cast<std::uint32_t>(members_.size()))});
      if (m < from_map_[landmark]) {
        from_map_[landmark] = static_cast<std::uint32_t>(m);
        from_landmark_[landmark] = i;
      }
      take_looks(m, i, landmark);
      ++parts_[landmark];
      ++next;
    } else {
      landmark_of_[m][i] = static_cast<std::uint32_t>(last_member_.size());
      append(m, i);
    }
  }
  for (const Association& pair : association.pairs) {
    const Estimate now = estimate(pair.first);
    positions_[pair.first] = now.position;
    covariances_[pair.first] = now.compared;
  }
  if (has_further_) set_further();
}

// The association finds by how much the landmarks of a map and those of the earlier ones are farther apart than their
// covariances say. Earlier maps whose variance is known already have their part of it in the covariances; the others are
// taken for as good as this one.
void Fusion::estimate_variances(std::size_t m, const AssociationResult& association) {
  if (association.pairs.empty() || original_[m] != m) return;
  std::vector<bool> unknown(maps_.size());
  std::size_t of_unknown = 0;
  for (const Association& pair : association.pairs) {
    const Member& member = members_[last_member_[pair.first]];
    const std::size_t earlier = original_[member.map];
    if (variances_[earlier]) continue;
    unknown[earlier] = true;
    ++of_unknown;
  }
  const double share =
      static_cast<double>(of_unknown) / static_cast<double>(association.pairs.size());
  const double variance = association.deviation * association.deviation / (1.0 + share);
  variances_[m] = variance;
  for (std::size_t k = 0; k < maps_.size(); ++k) {
    if (!unknown[k]) continue;
    variances_[k] = variance;
    result_.maps[k].deviation = association.deviation;
    for (const std::uint32_t landmark : landmark_of_[k]) {
      covariances_[landmark].diagonal().array() += variance;
    }
  }
}

Estimate Fusion::estimate(std::uint32_t landmark) const {
  std::vector<Estimate> measured;
  double wrong = 0.0;
  for (std::uint32_t at = last_member_[landmark]; at != Member::kNoMember;
       at = members_[at].previous) {
    const Member& member = members_[at];
    // A copy, which is added right after its original, is no further evidence.
    if (member.previous != Member::kNoMember &&
        original_[members_[member.previous].map] == original_[member.map]) {
      continue;
    }
    const WorldLandmarks& world = world_[member.map];
    Matrix3d covariance = world.covariances[member.landmark];
    covariance.diagonal().array() += variances_[member.map].value_or(0.0);
    const Vector3d& position = world.positions[member.landmark];
    const PlacedMap& placed = maps_[member.map];
    measured.push_back(
        {position, covariance,
         covariance + covariance_by_pose(placed, relative_covariance(placed), position),
         covariance + covariance_by_pose(placed, placed.covariance, position)});
    wrong += 1.0 - member.probability;
  }
  if (measured.size() == 1) return measured.front();
  // In the order in which the maps were added.
  std::reverse(measured.begin(), measured.end());
  return combined(measured, wrong);
}

void Fusion::count_fused() {
  for (std::size_t m = 0; m < maps_.size(); ++m) {
    for (const std::uint32_t landmark : landmark_of_[m]) {
      result_.maps[m].fused += parts_[landmark] > 1 ? 1 : 0;
    }
  }
}

// What only one map has stays as it is there.
void Fusion::set_positions() {
  LandmarkTable& landmarks = tables_.landmarks;
  const std::size_t count = last_member_.size();
  landmarks.positions = std::move(positions_);
  landmarks.covariances.resize(count);
  std::vector<std::uint8_t> known(count, 1);  // whether all of its landmarks have a covariance
  options_.execution.executor.for_blocks(count, kBlock, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const auto landmark = static_cast<std::uint32_t>(i);
      const Member& last = members_[last_member_[i]];
      bool of_one_map = true;
      for (std::uint32_t at = last_member_[i]; at != Member::kNoMember;
           at = members_[at].previous) {
        if (!has_covariance(members_[at].map, members_[at].landmark)) known[i] = 0;
        of_one_map = of_one_map && original_[members_[at].map] == original_[last.map];
      }
      if (!of_one_map) {
        const Estimate fused = estimate(landmark);
        landmarks.positions[i] = fused.position;
        landmarks.covariances[i] = fused.stated;
      } else {
        landmarks.covariances[i] =
            symmetric(world_[last.map].covariances[last.landmark] +
                      covariance_by_pose(maps_[last.map], maps_[last.map].covariance,
                                         landmarks.positions[i]));
      }
      if (known[i] == 0) landmarks.covariances[i].setConstant(kNan);
    }
  });
  if (std::find(known.begin(), known.end(), std::uint8_t{1}) == known.end()) {
    landmarks.covariances.clear();
  }
}

void Fusion::append(std::size_t m, std::uint32_t i) {
  const auto landmark = static_cast<std::uint32_t>(last_member_.size());
  LandmarkTable& landmarks = tables_.landmarks;
  last_member_.push_back(static_cast<std::uint32_t>(members_.size()));
  members_.push_back({.map = static_cast<std::uint32_t>(m), .landmark = i});
  const Estimate now = estimate(landmark);
  positions_.push_back(now.position);
  covariances_.push_back(now.compared);
  from_map_.push_back(static_cast<std::uint32_t>(m));
  from_landmark_.push_back(i);
  parts_.push_back(1);
  if (has_colors_) landmarks.colors.emplace_back();
  if (landmarks.descriptors) {
    landmarks.descriptors->known.push_back(0);
    landmarks.descriptors->bytes.resize(landmarks.descriptors->bytes.size() +
                                        landmarks.descriptors->bytes_each);
    best_observed_.push_back(0);
    if (has_further_) descriptors_.emplace_back();
  }
  take_looks(m, i, landmark);
}

// Colour: the first known one. Descriptor: that of the part with the most observations; if a map has several
// of a landmark, also the most distinct of all parts.
void Fusion::take_looks(std::size_t m, std::uint32_t i, std::uint32_t landmark) {
  const LandmarkMap& map = *maps_[m].map;
  LandmarkTable& landmarks = tables_.landmarks;
  if (!map.landmarks().colors.empty() && !landmarks.colors[landmark]) {
    landmarks.colors[landmark] = map.landmarks().colors[i];
  }
  const auto& theirs = map.landmarks().descriptors;
  if (!theirs || theirs->known[i] == 0) return;
  DescriptorColumn& ours = *landmarks.descriptors;
  if (theirs->kind != ours.kind || theirs->bytes_each != ours.bytes_each) return;
  const auto observed = static_cast<std::uint32_t>(map.observation_count(LandmarkIndex{i}));
  if (ours.known[landmark] == 0 || observed > best_observed_[landmark]) {
    ours.known[landmark] = 1;
    best_observed_[landmark] = observed;
    const auto from = theirs->descriptor(i, 0);
    std::copy(from.begin(), from.end(),
              ours.bytes.begin() + static_cast<std::ptrdiff_t>(landmark * ours.bytes_each));
  }
  if (has_further_) take_further(*theirs, i, landmark);
}

void Fusion::take_further(const DescriptorColumn& theirs, std::uint32_t i, std::uint32_t landmark) {
  std::vector<std::uint8_t>& all = descriptors_[landmark];
  const bool is_first = all.empty();
  for (std::size_t k = 0; k < theirs.count(i); ++k) {
    const auto bytes = theirs.descriptor(i, k);
    all.insert(all.end(), bytes.begin(), bytes.end());
  }
  if (is_first) return;
  const DescriptorColumn& ours = *tables_.landmarks.descriptors;
  std::vector<std::span<const std::uint8_t>> rows = {
      std::span(ours.bytes).subspan(landmark * ours.bytes_each, ours.bytes_each)};
  for (std::size_t at = 0; at < all.size(); at += ours.bytes_each) {
    rows.push_back(std::span(all).subspan(at, ours.bytes_each));
  }
  const DescriptorNorm norm =
      is_binary(ours.kind) ? DescriptorNorm::kHamming : DescriptorNorm::kSquared;
  std::vector<std::uint8_t> kept;
  for (const std::size_t row : distinct_descriptors(rows, 0, kDistinctViews, norm)) {
    kept.insert(kept.end(), rows[row].begin(), rows[row].end());
  }
  all = std::move(kept);
}

// Of all landmarks so far; the first of each is its representative.
void Fusion::set_further() {
  DescriptorColumn& ours = *tables_.landmarks.descriptors;
  ours.further_offsets.assign(1, 0);
  ours.further.clear();
  for (const std::vector<std::uint8_t>& all : descriptors_) {
    if (!all.empty()) {
      ours.further.insert(ours.further.end(),
                          all.begin() + static_cast<std::ptrdiff_t>(ours.bytes_each), all.end());
    }
    ours.further_offsets.push_back(ours.further.size() / ours.bytes_each);
  }
}

void Fusion::add_frames(std::size_t m) {
  const LandmarkMap& map = *maps_[m].map;
  const Similarity3& world_from_map = maps_[m].world_from_map;
  const FrameTable& theirs = map.frames();
  FrameTable& frames = tables_.frames;
  std::vector<FrameIndex>& own = result_.frames.emplace_back();
  std::vector<CameraIndex> camera_of;
  for (Camera camera : map.cameras()) {
    auto found = std::find_if(tables_.cameras.begin(), tables_.cameras.end(), [&](Camera other) {
      other.id = camera.id;
      return other == camera;
    });
    if (found == tables_.cameras.end()) {
      camera.id = CameraId{tables_.cameras.size()};
      tables_.cameras.push_back(std::move(camera));
      found = tables_.cameras.end() - 1;
    }
    camera_of.push_back(CameraIndex{static_cast<std::uint32_t>(found - tables_.cameras.begin())});
  }
  for (std::uint32_t i = 0; i < map.frame_count(); ++i) {
    std::optional<CameraIndex> camera;
    if (!theirs.cameras.empty() && theirs.cameras[i]) camera = camera_of[theirs.cameras[i]->value];
    Vector3d translation = theirs.translations[i];
    std::array<double, 4> quaternion = theirs.quaternions[i];
    if (!maps_[m].is_in_world()) {
      const Rigid3 pose = map.world_from_camera(FrameIndex{i});
      const Eigen::Quaterniond q = (world_from_map.rigid() * pose).quaternion();
      translation = world_from_map * pose.translation();
      quaternion = {q.w(), q.x(), q.y(), q.z()};
    }
    if (const auto known = known_frame(m, i, camera)) {
      const std::uint32_t f = known->value;
      own.push_back(*known);
      is_shared_[f] = true;
      if (!precedes(map, *maps_[map_of_frame_[f]].map)) continue;
      map_of_frame_[f] = m;
      frames.translations[f] = translation;
      frames.quaternions[f] = quaternion;
      frames.pose_covariances.set(f, pose_covariance(maps_[m], FrameIndex{i}));
      continue;
    }
    own.push_back(FrameIndex{static_cast<std::uint32_t>(frames.ids.size())});
    is_shared_.push_back(false);
    map_of_frame_.push_back(m);
    frames.ids.push_back(FrameId{frames.ids.size()});
    frames.translations.push_back(translation);
    frames.quaternions.push_back(quaternion);
    frames.cameras.push_back(camera);
    frames.timestamps_s.push_back(theirs.timestamps_s.empty() ? std::nullopt
                                                              : theirs.timestamps_s[i]);
    frames.image_names.push_back(theirs.image_names.empty() ? std::string()
                                                            : theirs.image_names[i]);
    frames.gnss.push_back(theirs.gnss.empty() ? std::nullopt : theirs.gnss[i]);
    frames.pose_covariances.push_back(pose_covariance(maps_[m], FrameIndex{i}));
  }
}

std::vector<Pixel> pixels_in(const LandmarkMap& map, FrameIndex frame) {
  const ObservationTable& observations = map.observations();
  std::vector<Pixel> pixels;
  for (std::size_t k = 0; k < observations.frames.size(); ++k) {
    if (observations.frames[k] == frame) pixels.push_back(observations.pixels[k]);
  }
  return pixels;
}

// Whether two lists of pixels are of one image: a quarter of the shorter list is within a pixel of the other. Each map
// tracks its own features, to tenths of a pixel; among those of two images a few in a hundred coincide.
bool show_one_image(std::vector<Pixel> few, std::vector<Pixel> many) {
  constexpr double kWithin = 1.0;
  if (few.size() > many.size()) std::swap(few, many);
  std::sort(many.begin(), many.end(), [](const Pixel& a, const Pixel& b) { return a.u < b.u; });
  std::size_t common = 0;
  for (const Pixel& pixel : few) {
    const auto is_left = [](const Pixel& a, double u) { return a.u < u; };
    auto other = std::lower_bound(many.begin(), many.end(), pixel.u - kWithin, is_left);
    const auto in_reach = [&] { return other != many.end() && other->u <= pixel.u + kWithin; };
    while (in_reach() && std::abs(other->v - pixel.v) > kWithin) ++other;
    common += in_reach() ? 1 : 0;
  }
  return 4 * common >= few.size();
}

// The frame of an earlier map that is the same keyframe: the last of one mini-map is the first of the next.
std::optional<FrameIndex> Fusion::known_frame(std::size_t m, std::uint32_t i,
                                              std::optional<CameraIndex> camera) const {
  const FrameTable& theirs = maps_[m].map->frames();
  const bool is_last = i + 1 == maps_[m].map->frame_count();
  if (i > 0 && !is_last) return std::nullopt;
  if (theirs.timestamps_s.empty() || !theirs.timestamps_s[i]) return std::nullopt;
  const std::string name = theirs.image_names.empty() ? std::string() : theirs.image_names[i];
  const auto is_same = [&](std::size_t k, FrameIndex frame, std::size_t in_earlier) {
    const std::uint32_t f = frame.value;
    if (tables_.frames.timestamps_s[f] != theirs.timestamps_s[i] ||
        tables_.frames.image_names[f] != name || tables_.frames.cameras[f] != camera) {
      return false;
    }
    // Maps whose clocks start at 0 have equal times, too.
    return show_one_image(
        pixels_in(*maps_[k].map, FrameIndex{static_cast<std::uint32_t>(in_earlier)}),
        pixels_in(*maps_[m].map, FrameIndex{i}));
  };
  for (std::size_t k = 0; k < m; ++k) {
    const std::vector<FrameIndex>& earlier = result_.frames[k];
    if (earlier.empty()) continue;
    if (i == 0 && is_same(k, earlier.back(), earlier.size() - 1)) return earlier.back();
    if (is_last && is_same(k, earlier.front(), 0)) return earlier.front();
  }
  return std::nullopt;
}

// Captures number their images alike, and programs find an image by its name: images of different maps that share one
// are told apart by the names of their maps.
void Fusion::tell_images_apart() {
  std::vector<std::string>& names = tables_.frames.image_names;
  std::vector<std::size_t> map_of(names.size());  // the first map of each frame
  for (std::size_t m = maps_.size(); m-- > 0;) {
    for (const FrameIndex frame : result_.frames[m]) map_of[frame.value] = m;
  }
  std::string example;
  std::size_t alike = 0;
  for (bool changed = true; changed;) {
    changed = false;
    std::vector<bool> next = has_prefix_;
    std::map<std::string, std::size_t> map_with;
    for (std::size_t i = 0; i < names.size(); ++i) {
      if (names[i].empty()) continue;
      const std::size_t m = map_of[i];
      const auto [other, is_new] = map_with.emplace(image_name(m, names[i]), m);
      if (is_new || other->second == m) continue;
      alike += names[i] == other->first ? 1 : 0;
      if (has_prefix_[m] && has_prefix_[other->second]) continue;
      if (example.empty()) {
        example = fmt::format("{} of {} and {}", printable(names[i]), maps_[other->second].name,
                              maps_[m].name);
      }
      next[m] = next[other->second] = changed = true;
    }
    has_prefix_ = std::move(next);
  }
  if (example.empty()) return;
  std::string folders;
  std::size_t renamed = 0;
  for (std::size_t m = 0; m < maps_.size(); ++m) {
    if (!has_prefix_[m]) continue;
    constexpr std::size_t kShown = 4;
    if (++renamed <= kShown) folders += (renamed > 1 ? ", " : "") + image_folder(m);
    if (renamed == kShown + 1) folders += ", ...";
  }
  for (std::size_t i = 0; i < names.size(); ++i) names[i] = image_name(map_of[i], names[i]);
  if (options_.log) {
    options_.log(fmt::format(
        "names that images of different maps share: {}, e.g. {}; the names of all images of these "
        "{} maps begin with the map's name now. Programs find the images if those of each map are "
        "copied into a folder of that name: {}",
        alike, example, renamed, folders));
  }
}

void Fusion::set_columns() {
  const std::size_t count = last_member_.size();
  std::vector<NamedColumn>& columns = tables_.landmarks.columns;
  std::vector<double> from_map(count);
  std::vector<double> from_landmark(count);
  std::vector<double> parts(count);
  constexpr std::uint64_t kExact = std::uint64_t{1} << 53;
  for (std::size_t i = 0; i < count; ++i) {
    from_map[i] = from_map_[i];
    const std::uint64_t id = maps_[from_map_[i]].map->landmarks().ids[from_landmark_[i]].value;
    from_landmark[i] = id <= kExact ? static_cast<double>(id) : kNan;
    parts[i] = parts_[i];
  }
  columns.push_back({kFromMapColumn, std::move(from_map)});
  columns.push_back({kFromLandmarkColumn, std::move(from_landmark)});
  columns.push_back({kFusedColumn, std::move(parts)});
  for (const std::size_t m : order_) {
    for (const NamedColumn& theirs :
         transformed_columns(maps_[m].map->landmarks().columns, maps_[m].world_from_map)) {
      // Not copied, because the landmarks have moved; it can be computed from the observations.
      if (theirs.name == kStaleColumn) continue;
      const std::string& name = theirs.name;
      if (name == kFromMapColumn || name == kFromLandmarkColumn || name == kFusedColumn) continue;
      auto found = std::find_if(columns.begin(), columns.end(),
                                [&](const NamedColumn& column) { return column.name == name; });
      if (found == columns.end()) {
        columns.push_back({name, std::vector<double>(count, kNan)});
        found = columns.end() - 1;
      }
      for (std::uint32_t i = 0; i < theirs.values.size(); ++i) {
        double& value = found->values[landmark_of_[m][i]];
        if (std::isnan(value)) value = theirs.values[i];
      }
    }
  }
}

// By map and observation: whether its landmark has one in the same frame already, because two maps share the
// frame. Empty for a map without any.
std::vector<std::vector<bool>> Fusion::repeated_observations() const {
  std::vector<std::vector<bool>> repeated(maps_.size());
  if (std::find(is_shared_.begin(), is_shared_.end(), true) == is_shared_.end()) return repeated;
  std::set<std::pair<std::uint32_t, FrameIndex>> seen;
  for (const std::size_t m : order_) {
    const ObservationTable& theirs = maps_[m].map->observations();
    if (theirs.offsets.empty()) continue;
    for (std::size_t i = 0; i < landmark_of_[m].size(); ++i) {
      for (std::uint64_t k = theirs.offsets[i]; k < theirs.offsets[i + 1]; ++k) {
        const FrameIndex frame = result_.frames[m][theirs.frames[k].value];
        if (!is_shared_[frame.value] || seen.emplace(landmark_of_[m][i], frame).second) continue;
        repeated[m].resize(theirs.frames.size(), false);
        repeated[m][k] = true;
      }
    }
  }
  return repeated;
}

void Fusion::set_observations() {
  ObservationTable& observations = tables_.observations;
  bool any = false;
  bool keypoints = false;
  bool depths = false;
  bool octaves = false;
  bool sources = false;
  bool sigmas = false;
  for (const PlacedMap& placed : maps_) {
    const ObservationTable& theirs = placed.map->observations();
    any = any || !theirs.offsets.empty();
    keypoints = keypoints || !theirs.keypoints.empty();
    depths = depths || !theirs.depths.empty();
    octaves = octaves || !theirs.octaves.empty();
    sources = sources || !theirs.sources.empty();
    sigmas = sigmas || !theirs.sigmas_px.empty();
    if (!placed.map->has_observations() && options_.log) {
      options_.log(placed.name +
                   ": does not know who observed its landmarks, which count as not observed");
    }
  }
  if (!any) return;
  const std::vector<std::vector<bool>> repeated = repeated_observations();
  observations.offsets.assign(last_member_.size() + 1, 0);
  for (std::size_t m = 0; m < maps_.size(); ++m) {
    const ObservationTable& theirs = maps_[m].map->observations();
    if (theirs.offsets.empty()) continue;
    for (std::size_t i = 0; i < landmark_of_[m].size(); ++i) {
      std::uint64_t& count = observations.offsets[landmark_of_[m][i] + 1];
      for (std::uint64_t k = theirs.offsets[i]; k < theirs.offsets[i + 1]; ++k) {
        count += repeated[m].empty() || !repeated[m][k] ? 1 : 0;
      }
    }
  }
  for (std::size_t i = 1; i < observations.offsets.size(); ++i) {
    observations.offsets[i] += observations.offsets[i - 1];
  }
  const std::size_t count = observations.offsets.back();
  observations.frames.resize(count);
  observations.pixels.resize(count);
  if (keypoints) observations.keypoints.resize(count);
  if (depths) observations.depths.resize(count);
  if (octaves) observations.octaves.resize(count);
  if (sources) observations.sources.resize(count);
  if (sigmas) observations.sigmas_px.resize(count);
  std::vector<std::uint64_t> next(observations.offsets.begin(), observations.offsets.end() - 1);
  for (std::size_t m = 0; m < maps_.size(); ++m) {
    const ObservationTable& theirs = maps_[m].map->observations();
    if (theirs.offsets.empty()) continue;
    const double scale = maps_[m].world_from_map.scale();
    for (std::size_t i = 0; i < landmark_of_[m].size(); ++i) {
      for (std::uint64_t k = theirs.offsets[i]; k < theirs.offsets[i + 1]; ++k) {
        if (!repeated[m].empty() && repeated[m][k]) continue;
        const std::uint64_t to = next[landmark_of_[m][i]]++;
        observations.frames[to] = result_.frames[m][theirs.frames[k].value];
        observations.pixels[to] = theirs.pixels[k];
        if (!theirs.keypoints.empty()) observations.keypoints[to] = theirs.keypoints[k];
        if (!theirs.depths.empty() && theirs.depths[k]) {
          observations.depths[to] = scale * *theirs.depths[k];
        }
        if (!theirs.octaves.empty()) observations.octaves[to] = theirs.octaves[k];
        // A patch defines the landmark of its own map, not the fused one.
        const bool defines =
            !theirs.sources.empty() && theirs.sources[k] == PixelSource::kReference;
        if (defines && parts_[landmark_of_[m][i]] > 1) continue;
        if (!theirs.sources.empty()) observations.sources[to] = theirs.sources[k];
        if (!theirs.sigmas_px.empty()) observations.sigmas_px[to] = theirs.sigmas_px[k];
      }
    }
  }
}

// A point of one name and place is the same one.
void add_control_points(const std::vector<ControlPoint>& more, std::vector<ControlPoint>& all) {
  for (const ControlPoint& point : more) {
    const auto same = std::find_if(all.begin(), all.end(), [&](const ControlPoint& other) {
      return other.name == point.name && other.latitude_deg == point.latitude_deg &&
             other.longitude_deg == point.longitude_deg && other.altitude_m == point.altitude_m;
    });
    if (same == all.end()) {
      all.push_back(point);
      continue;
    }
    for (const ControlPoint::View& view : point.views) {
      if (std::find(same->views.begin(), same->views.end(), view) == same->views.end()) {
        same->views.push_back(view);
      }
    }
  }
}

// Which frames are a map's: consecutive ones, and those that an earlier map has too.
std::string Fusion::frames_line(std::size_t m) const {
  // New frames come behind all others.
  std::uint32_t known = 0;
  for (std::size_t k = 0; k < m; ++k) {
    for (const FrameIndex frame : result_.frames[k]) known = std::max(known, frame.value + 1);
  }
  std::string line;
  std::vector<FrameIndex> own;
  for (std::size_t i = 0; i < result_.frames[m].size(); ++i) {
    const FrameIndex frame = result_.frames[m][i];
    if (frame.value >= known) {
      own.push_back(frame);
    } else {
      line += fmt::format("; frame {} is its {} too", frame.value, i == 0 ? "first" : "last");
    }
  }
  if (own.empty()) return line;
  return fmt::format("; frames {} to {} are its {}{} in their order", own.front().value,
                     own.back().value, line.empty() ? "" : "other ", own.size()) +
         line;
}

void Fusion::set_info() {
  const PlacedMap& placed_first = maps_.front();
  const MapInfo& first = placed_first.map->info();
  MapInfo& info = tables_.info;
  info.length_unit = first.length_unit;
  info.gravity = first.gravity;
  if (placed_first.is_in_world()) {
    info.world_frame = first.world_frame;
  } else if (info.gravity) {
    info.gravity = placed_first.world_from_map.rigid().rotation() * *info.gravity;
  }
  for (std::size_t m = 0; m < maps_.size(); ++m) {
    const MapInfo& theirs = maps_[m].map->info();
    if (theirs.georeference && !info.georeference) {
      info.georeference = maps_[m].is_in_world()
                              ? *theirs.georeference
                              : theirs.georeference->moved(maps_[m].world_from_map);
    }
    std::vector<ControlPoint> points = theirs.control_points;
    for (ControlPoint& point : points) {
      for (ControlPoint::View& view : point.views) view.image_name = image_name(m, view.image_name);
    }
    add_control_points(points, info.control_points);
    for (const std::string& line : theirs.provenance) {
      info.provenance.push_back(fmt::format("{}: {}", maps_[m].name, line));
    }
    std::string line = fmt::format("map {} of a merge: {}", m, maps_[m].name);
    if (theirs.uuid) line += fmt::format(", uuid {}", *theirs.uuid);
    line += fmt::format(", {} landmarks, of which {} were fused with those of other maps",
                        result_.maps[m].landmarks, result_.maps[m].fused);
    line += frames_line(m);
    info.provenance.push_back(std::move(line));
  }
}

}  // namespace

std::vector<std::size_t> largest_first(std::span<const PlacedMap> maps) {
  std::vector<std::size_t> order(maps.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return precedes(*maps[a].map, *maps[b].map);
  });
  return order;
}

bool PlacedMap::is_in_world() const {
  return world_from_map.matrix() == Matrix4d::Identity();
}

void FusionOptions::validate() const {
  if (min_probability >= 0.5 && min_probability <= 1.0) return;
  throw Error(ErrorKind::kMisuse, "FusionOptions.min_probability",
              fmt::format("{}", min_probability), "0.5 to 1");
}

FusionResult fuse_maps(std::span<const PlacedMap> maps, const FusionOptions& options) {
  options.validate();
  if (maps.empty()) throw Error(ErrorKind::kMisuse, "maps", "none", "at least one map");
  return Fusion(maps, options).run();
}

}  // namespace cairn
