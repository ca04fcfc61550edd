// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/merging/fusion/fuse_maps.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
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
#include "cairn/map/turning_columns.hpp"
#include "cairn/merging/detail/association.hpp"
#include "cairn/merging/detail/derivative_by_map.hpp"
#include "cairn/placement/descriptors.hpp"

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

// A map's landmarks in the world frame. Covariances include the pose's, and are zero if unknown.
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
      const Eigen::Matrix<double, 3, 7> by_pose =
          derivative_by_map(world.positions[i] - placed.world_from_map.translation());
      const Matrix3d sum = linear * landmarks.covariances[i] * linear.transpose() +
                           by_pose * placed.covariance * by_pose.transpose();
      world.covariances[i] = 0.5 * (sum + sum.transpose());
    }
  });
  return world;
}

// Of a keyframe in the world: of its pose in its map, and of the map's.
std::optional<Matrix6d> pose_covariance(const PlacedMap& placed, FrameIndex frame) {
  const auto& in_map = placed.map->frames().pose_covariances;
  if (in_map.empty() || !in_map[frame.value]) return std::nullopt;
  const Vector3d arm =
      placed.world_from_map.linear() * placed.map->world_from_camera(frame).translation();
  Eigen::Matrix<double, 6, 7> by_pose = Eigen::Matrix<double, 6, 7>::Zero();
  by_pose.topRows<3>() = derivative_by_map(arm);
  by_pose.block<3, 3>(3, 3).setIdentity();
  const Matrix6d sum = left_transformed_covariance(*in_map[frame.value], placed.world_from_map) +
                       by_pose * placed.covariance * by_pose.transpose();
  return 0.5 * (sum + sum.transpose());
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
  void fuse(std::uint32_t landmark, const Vector3d& position, const Matrix3d& covariance,
            bool known, double probability, double variance);
  void append(std::size_t m, std::uint32_t i, const WorldLandmarks& world);
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
  FusionResult result_;
  MapTables tables_;
  std::vector<std::uint8_t> known_;  // whether all parts have a covariance
  bool has_colors_ = false;
  std::vector<std::uint32_t> best_observed_;  // observations of the part that gave the descriptor
  bool has_further_ = false;                  // a map with several of a landmark
  std::vector<std::vector<std::uint8_t>> descriptors_;   // if so: bytes of all of each landmark's
  std::vector<std::vector<std::uint32_t>> landmark_of_;  // by map and its landmark
  std::vector<bool> is_shared_;                          // by frame: whether two maps have it
  std::vector<bool> has_prefix_;                         // by map: before the names of its images
  std::vector<std::uint32_t> from_map_;
  std::vector<std::uint32_t> from_landmark_;  // index
  std::vector<std::uint32_t> parts_;
};

Fusion::Fusion(std::span<const PlacedMap> maps, const FusionOptions& options)
    : maps_(maps), options_(options), landmark_of_(maps.size()), has_prefix_(maps.size(), false) {
  std::size_t landmarks = 0;
  std::size_t frames = 0;
  for (const PlacedMap& placed : maps) {
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
  for (std::size_t m = 0; m < maps_.size(); ++m) {
    if (options_.execution.stop.stop_requested()) {
      throw Error(ErrorKind::kCancelled, "merge", "fusion was cancelled", "");
    }
    add_frames(m);
    add(m);
    if (options_.execution.progress) {
      options_.execution.progress(static_cast<double>(m + 1) / static_cast<double>(maps_.size()));
    }
  }
  for (std::size_t i = 0; i < known_.size(); ++i) {
    if (known_[i] == 0) tables_.landmarks.covariances[i].setConstant(kNan);
  }
  if (std::find(known_.begin(), known_.end(), std::uint8_t{1}) == known_.end()) {
    tables_.landmarks.covariances.clear();
  }
  set_columns();
  set_observations();
  tell_images_apart();
  set_info();
  tables_.landmarks.ids.resize(known_.size());
  for (std::size_t i = 0; i < known_.size(); ++i) tables_.landmarks.ids[i] = LandmarkId{i};
  result_.map = LandmarkMap(std::move(tables_));
  return std::move(result_);
}

void Fusion::add(std::size_t m) {
  const LandmarkMap& map = *maps_[m].map;
  const WorldLandmarks world = in_world(maps_[m], options_.execution.executor);
  LandmarkTable& landmarks = tables_.landmarks;
  AssociationResult association;
  if (m > 0) {
    AssociationOptions how;
    how.min_probability = options_.min_probability;
    how.seed = options_.seed;
    how.execution = options_.execution.without_progress();
    const auto looks = [](const std::optional<DescriptorColumn>& column) {
      return column ? &*column : nullptr;
    };
    association =
        associate({landmarks.positions, landmarks.covariances, looks(landmarks.descriptors)},
                  {world.positions, world.covariances, looks(map.landmarks().descriptors)}, how);
  }
  MapFusion& fusion = result_.maps.emplace_back();
  fusion.landmarks = map.landmark_count();
  fusion.fused = association.pairs.size();
  fusion.deviation = association.deviation;
  const double variance = association.deviation * association.deviation;
  landmark_of_[m].resize(map.landmark_count());
  auto next = association.pairs.begin();
  for (std::uint32_t i = 0; i < map.landmark_count(); ++i) {
    if (next != association.pairs.end() && next->second == i) {
      landmark_of_[m][i] = next->first;
      fuse(next->first, world.positions[i], world.covariances[i], has_covariance(m, i),
           next->probability, variance);
      take_looks(m, i, next->first);
      ++parts_[next->first];
      ++next;
    } else {
      landmark_of_[m][i] = static_cast<std::uint32_t>(known_.size());
      append(m, i, world);
    }
  }
  if (has_further_) set_further();
}

// Information-weighted mean, with the covariance of a mixture: with the association's probability the pair is
// one landmark, otherwise two, either of which the fused one represents.
void Fusion::fuse(std::uint32_t landmark, const Vector3d& position, const Matrix3d& covariance,
                  bool known, double probability, double variance) {
  Vector3d& mean = tables_.landmarks.positions[landmark];
  Matrix3d& spread = tables_.landmarks.covariances[landmark];
  // A part without covariance has only the common deviation of the maps.
  const Matrix3d half = 0.5 * variance * Matrix3d::Identity();
  const Matrix3d a = spread + (known_[landmark] != 0 ? 1.0 : 2.0) * half;
  const Matrix3d b = covariance + (known ? 1.0 : 2.0) * half;
  const Matrix3d gain = a * (a + b).inverse();
  if (!gain.allFinite()) return;  // both are exact
  const Vector3d apart = position - mean;
  const Vector3d moved = gain * apart;
  const Vector3d back = moved - apart;
  const Matrix3d one = a - gain * a;
  const Matrix3d two = 0.5 * (a + moved * moved.transpose() + b + back * back.transpose());
  const Matrix3d mixture = probability * one + (1.0 - probability) * two;
  mean += moved;
  spread = 0.5 * (mixture + mixture.transpose());
  if (!known) known_[landmark] = 0;
}

void Fusion::append(std::size_t m, std::uint32_t i, const WorldLandmarks& world) {
  const auto landmark = static_cast<std::uint32_t>(known_.size());
  LandmarkTable& landmarks = tables_.landmarks;
  landmarks.positions.push_back(world.positions[i]);
  landmarks.covariances.push_back(world.covariances[i]);
  known_.push_back(has_covariance(m, i) ? 1 : 0);
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
    if (const auto known = known_frame(m, i, camera)) {
      own.push_back(*known);
      is_shared_[known->value] = true;
      continue;
    }
    own.push_back(FrameIndex{static_cast<std::uint32_t>(frames.ids.size())});
    is_shared_.push_back(false);
    frames.ids.push_back(FrameId{frames.ids.size()});
    if (maps_[m].is_in_world()) {
      frames.translations.push_back(theirs.translations[i]);
      frames.quaternions.push_back(theirs.quaternions[i]);
    } else {
      const Rigid3 pose = map.world_from_camera(FrameIndex{i});
      const Eigen::Quaterniond q = (world_from_map.rigid() * pose).quaternion();
      frames.translations.push_back(world_from_map * pose.translation());
      frames.quaternions.push_back({q.w(), q.x(), q.y(), q.z()});
    }
    frames.cameras.push_back(camera);
    frames.timestamps_s.push_back(theirs.timestamps_s.empty() ? std::nullopt
                                                              : theirs.timestamps_s[i]);
    frames.image_names.push_back(theirs.image_names.empty() ? std::string()
                                                            : theirs.image_names[i]);
    frames.gnss.push_back(theirs.gnss.empty() ? std::nullopt : theirs.gnss[i]);
    frames.pose_covariances.push_back(pose_covariance(maps_[m], FrameIndex{i}));
  }
}

// The frame of an earlier map that is the same keyframe: the last of one mini-map is the first of the next.
std::optional<FrameIndex> Fusion::known_frame(std::size_t m, std::uint32_t i,
                                              std::optional<CameraIndex> camera) const {
  const FrameTable& theirs = maps_[m].map->frames();
  const bool is_last = i + 1 == maps_[m].map->frame_count();
  if (i > 0 && !is_last) return std::nullopt;
  if (theirs.timestamps_s.empty() || !theirs.timestamps_s[i]) return std::nullopt;
  const std::string name = theirs.image_names.empty() ? std::string() : theirs.image_names[i];
  const auto is_same = [&](FrameIndex frame) {
    const std::uint32_t f = frame.value;
    return tables_.frames.timestamps_s[f] == theirs.timestamps_s[i] &&
           tables_.frames.image_names[f] == name && tables_.frames.cameras[f] == camera;
  };
  for (std::size_t k = 0; k < m; ++k) {
    const std::vector<FrameIndex>& earlier = result_.frames[k];
    if (earlier.empty()) continue;
    if (i == 0 && is_same(earlier.back())) return earlier.back();
    if (is_last && is_same(earlier.front())) return earlier.front();
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
  const std::size_t count = known_.size();
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
  for (std::size_t m = 0; m < maps_.size(); ++m) {
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
  for (std::size_t m = 0; m < maps_.size(); ++m) {
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
  observations.offsets.assign(known_.size() + 1, 0);
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
    line += fmt::format(", {} landmarks, of which {} were fused with earlier ones",
                        result_.maps[m].landmarks, result_.maps[m].fused);
    line += frames_line(m);
    info.provenance.push_back(std::move(line));
  }
}

}  // namespace

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
