// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/map/operations.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <numeric>
#include <utility>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/core/text.hpp"
#include "cairn/geometry/covariance.hpp"
#include "cairn/geometry/limits.hpp"
#include "cairn/map/column_motion.hpp"

namespace cairn {
namespace {

constexpr std::string_view kUnstatedSizes =
    "the file states no image sizes: those of the cameras follow from the observations";

bool says_unstated_sizes(const std::string& step) {
  return step.ends_with(kUnstatedSizes);
}

constexpr std::uint32_t kDropped = std::numeric_limits<std::uint32_t>::max();

// The rows of an optional column, in a new order.
template <class Column>
Column rows(const Column& column, std::span<const std::uint32_t> kept) {
  Column result;
  if (column.empty()) return result;
  result.reserve(kept.size());
  for (const std::uint32_t row : kept) result.push_back(column[row]);
  return result;
}

FrameTable frame_rows(const FrameTable& frames, std::span<const std::uint32_t> kept) {
  return {rows(frames.ids, kept),          rows(frames.translations, kept),
          rows(frames.quaternions, kept),  rows(frames.cameras, kept),
          rows(frames.timestamps_s, kept), rows(frames.image_names, kept),
          rows(frames.gnss, kept),         rows(frames.pose_covariances, kept),
          rows(frames.instants, kept)};
}

LandmarkTable landmark_rows(const LandmarkTable& landmarks, std::span<const std::uint32_t> kept) {
  LandmarkTable result = {rows(landmarks.ids, kept),
                          rows(landmarks.positions, kept),
                          rows(landmarks.covariances, kept),
                          rows(landmarks.colors, kept),
                          std::nullopt,
                          {}};
  if (landmarks.descriptors) result.descriptors = descriptor_rows(*landmarks.descriptors, kept);
  for (const NamedColumn& column : landmarks.columns) {
    result.columns.push_back({column.name, column.values.visit([&](const auto& values) {
                                return ColumnValues(rows(values, kept));
                              })});
  }
  return result;
}

// Observations of the kept landmarks; `new_frames` maps frames to their new indices, or kDropped.
ObservationTable observation_rows(const ObservationTable& observations,
                                  std::span<const std::uint32_t> kept_landmarks,
                                  std::span<const std::uint32_t> new_frames) {
  ObservationTable result;
  if (observations.offsets.empty()) return result;
  result.offsets.reserve(kept_landmarks.size() + 1);
  result.offsets.push_back(0);
  const auto append = [](auto& to, const auto& from, std::uint64_t i) {
    if (!from.empty()) to.push_back(from[i]);
  };
  for (const std::uint32_t landmark : kept_landmarks) {
    for (std::uint64_t i = observations.offsets[landmark]; i < observations.offsets[landmark + 1];
         ++i) {
      const std::uint32_t frame = new_frames[observations.frames[i].value];
      if (frame == kDropped) continue;
      result.frames.push_back(FrameIndex{frame});
      result.pixels.push_back(observations.pixels[i]);
      append(result.keypoints, observations.keypoints, i);
      append(result.depths, observations.depths, i);
      append(result.octaves, observations.octaves, i);
      append(result.sources, observations.sources, i);
      append(result.sigmas_px, observations.sigmas_px, i);
    }
    result.offsets.push_back(result.frames.size());
  }
  return result;
}

LandmarkMap with_rows(const LandmarkMap& map, std::span<const std::uint32_t> frames,
                      std::span<const std::uint32_t> landmarks) {
  std::vector<std::uint32_t> new_frames(map.frame_count(), kDropped);
  for (std::uint32_t i = 0; i < frames.size(); ++i) new_frames[frames[i]] = i;
  MapTables tables;
  tables.info = map.info();
  tables.info.uuid.reset();
  tables.cameras.assign(map.cameras().begin(), map.cameras().end());
  tables.rigs.assign(map.rigs().begin(), map.rigs().end());
  tables.frames = frame_rows(map.frames(), frames);
  tables.landmarks = landmark_rows(map.landmarks(), landmarks);
  tables.observations = observation_rows(map.observations(), landmarks, new_frames);
  return LandmarkMap(std::move(tables));
}

MapTables copied_tables(const LandmarkMap& map) {
  LandmarkMap copy = map;
  MapTables tables = std::move(copy).tables();
  tables.info.uuid.reset();
  return tables;
}

}  // namespace

bool precedes(const LandmarkMap& a, const LandmarkMap& b) {
  const auto& mine = a.landmarks().positions;
  const auto& theirs = b.landmarks().positions;
  if (mine.size() != theirs.size()) return mine.size() > theirs.size();
  const auto [first, second] = std::mismatch(mine.begin(), mine.end(), theirs.begin());
  return first != mine.end() &&
         std::lexicographical_compare(first->begin(), first->end(), second->begin(), second->end());
}

bool are_one_map(std::span<const Eigen::Vector3d> a, std::span<const Eigen::Vector3d> b) {
  constexpr double kRounding = 1e-7;
  return !a.empty() && std::equal(a.begin(), a.end(), b.begin(), b.end(),
                                  [](const Eigen::Vector3d& one, const Eigen::Vector3d& other) {
                                    return (one - other).norm() <= kRounding * one.norm();
                                  });
}

DescriptorColumn descriptor_rows(const DescriptorColumn& descriptors,
                                 std::span<const std::uint32_t> rows) {
  DescriptorColumn result = {descriptors.kind, descriptors.bytes_each, {}, {}};
  result.known.reserve(rows.size());
  result.bytes.reserve(rows.size() * descriptors.bytes_each);
  for (const std::uint32_t row : rows) {
    result.known.push_back(descriptors.known[row]);
    const auto begin =
        descriptors.bytes.begin() + static_cast<std::ptrdiff_t>(row * descriptors.bytes_each);
    result.bytes.insert(result.bytes.end(), begin,
                        begin + static_cast<std::ptrdiff_t>(descriptors.bytes_each));
  }
  if (!descriptors.has_further()) return result;
  result.further_offsets.reserve(rows.size() + 1);
  result.further_offsets.push_back(0);
  for (const std::uint32_t row : rows) {
    for (std::size_t k = 1; k < descriptors.count(row); ++k) {
      const auto further = descriptors.descriptor(row, k);
      result.further.insert(result.further.end(), further.begin(), further.end());
    }
    result.further_offsets.push_back(result.further.size() / descriptors.bytes_each);
  }
  if (result.further.empty()) result.further_offsets.clear();
  return result;
}

std::vector<std::uint32_t> drop_far_landmarks(MapTables& tables) {
  const std::vector<Eigen::Vector3d>& positions = tables.landmarks.positions;
  std::vector<std::uint32_t> kept;
  std::vector<std::uint32_t> dropped;
  for (std::uint32_t i = 0; i < positions.size(); ++i) {
    if (!are_coordinates(positions[i])) dropped.push_back(i);
  }
  if (dropped.empty()) return dropped;
  for (std::uint32_t i = 0; i < positions.size(); ++i) {
    if (are_coordinates(positions[i])) kept.push_back(i);
  }
  std::vector<std::uint32_t> frames(tables.frames.ids.size());
  std::iota(frames.begin(), frames.end(), 0U);
  tables.observations = observation_rows(tables.observations, kept, frames);
  tables.landmarks = landmark_rows(tables.landmarks, kept);
  tables.info.uuid.reset();
  return dropped;
}

void reorder(MapTables& tables, std::span<const std::uint32_t> frames,
             std::span<const std::uint32_t> landmarks) {
  std::vector<std::uint32_t> new_frames(frames.size());
  for (std::uint32_t i = 0; i < frames.size(); ++i) new_frames[frames[i]] = i;
  tables.observations = observation_rows(tables.observations, landmarks, new_frames);
  tables.frames = frame_rows(tables.frames, frames);
  tables.landmarks = landmark_rows(tables.landmarks, landmarks);
}

std::vector<LandmarkIndex> landmarks_observed(const LandmarkMap& map, std::size_t count) {
  std::vector<LandmarkIndex> result;
  for (std::uint32_t i = 0; i < map.landmark_count(); ++i) {
    if (!map.has_observations() || map.observation_count(LandmarkIndex{i}) >= count) {
      result.push_back(LandmarkIndex{i});
    }
  }
  return result;
}

LandmarkMap with_landmarks(const LandmarkMap& map, std::span<const LandmarkIndex> landmarks) {
  std::vector<std::uint32_t> kept;
  kept.reserve(landmarks.size());
  for (const LandmarkIndex landmark : landmarks) {
    if (landmark.value >= map.landmark_count()) {
      throw Error(ErrorKind::kMisuse, "landmarks", fmt::format("index {}", landmark.value),
                  fmt::format("below {}, the map's number of landmarks", map.landmark_count()));
    }
    kept.push_back(landmark.value);
  }
  std::vector<std::uint32_t> frames(map.frame_count());
  for (std::uint32_t i = 0; i < frames.size(); ++i) frames[i] = i;
  return with_rows(map, frames, kept);
}

LandmarkMap cut_frames(const LandmarkMap& map, FrameId begin, FrameId end) {
  refuse_if(!map.has_observations(), "frames", "the map does not know which frame observed what",
            "a map with observations");
  const auto inside = [&](std::uint32_t frame) {
    const FrameId id = map.frames().ids[frame];
    return begin <= id && id < end;
  };
  std::vector<std::uint32_t> frames;
  for (std::uint32_t i = 0; i < map.frame_count(); ++i) {
    if (inside(i)) frames.push_back(i);
  }
  if (frames.empty()) {
    throw Error(
        ErrorKind::kMisuse, "frames",
        fmt::format("the map has no frame with an id from {} to below {}", begin.value, end.value),
        "a range that holds frames");
  }
  std::vector<std::uint32_t> landmarks;
  for (std::uint32_t i = 0; i < map.landmark_count(); ++i) {
    const auto observing = map.observing_frames(LandmarkIndex{i});
    if (!observing.empty() && std::all_of(observing.begin(), observing.end(),
                                          [&](FrameIndex frame) { return inside(frame.value); })) {
      landmarks.push_back(i);
    }
  }
  return with_rows(map, frames, landmarks);
}

LandmarkMap without_frames(const LandmarkMap& map, std::span<const FrameIndex> frames) {
  std::vector<bool> dropped(map.frame_count(), false);
  for (const FrameIndex frame : frames) dropped[frame.value] = true;
  std::vector<std::uint32_t> kept_frames;
  for (std::uint32_t i = 0; i < map.frame_count(); ++i) {
    if (!dropped[i]) kept_frames.push_back(i);
  }
  std::vector<std::uint32_t> landmarks;
  for (std::uint32_t i = 0; i < map.landmark_count(); ++i) {
    const auto observing = map.observing_frames(LandmarkIndex{i});
    const auto left = std::count_if(observing.begin(), observing.end(),
                                    [&](FrameIndex frame) { return !dropped[frame.value]; });
    if (left >= 2 || left == static_cast<std::ptrdiff_t>(observing.size())) landmarks.push_back(i);
  }
  return with_rows(map, kept_frames, landmarks);
}

LandmarkMap transformed(const LandmarkMap& map, const Similarity3& new_from_old) {
  MapTables tables = copied_tables(map);
  const Rigid3& rigid = new_from_old.rigid();
  const Eigen::Matrix3d rotation = rigid.rotation();
  const double scale = new_from_old.scale();
  if (tables.info.gravity) tables.info.gravity = rotation * *tables.info.gravity;
  if (auto& georeference = tables.info.georeference) {
    georeference = georeference->moved(new_from_old);
  }
  for (std::uint32_t i = 0; i < map.frame_count(); ++i) {
    const Rigid3 pose = map.world_from_camera(FrameIndex{i});
    const Eigen::Quaterniond q = (rigid * pose).quaternion();
    tables.frames.translations[i] = new_from_old * pose.translation();
    tables.frames.quaternions[i] = {q.w(), q.x(), q.y(), q.z()};
  }
  auto& poses = tables.frames.pose_covariances;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    if (const std::optional<Matrix6d> pose = poses[i]) {
      poses.set(i, left_transformed_covariance(*pose, new_from_old));
    }
  }
  for (Eigen::Vector3d& position : tables.landmarks.positions) position = new_from_old * position;
  for (Eigen::Matrix3d& covariance : tables.landmarks.covariances) {
    const Eigen::Matrix3d moved = rotated_covariance(covariance, rotation);
    covariance = scale * scale * 0.5 * (moved + moved.transpose());
  }
  for (Rig& rig : tables.rigs) {
    for (Rig::Mount& mount : rig.mounts) mount.translation *= scale;
  }
  move_columns(tables.landmarks.columns, new_from_old, "map");
  OptionalColumn<double>& depths = tables.observations.depths;
  for (std::size_t i = 0; i < depths.size(); ++i) {
    if (const std::optional<double> depth = depths[i]) depths.set(i, scale * *depth);
  }
  return LandmarkMap(std::move(tables));
}

LandmarkMap with_length_unit(const LandmarkMap& map, LengthUnit unit) {
  MapTables tables = copied_tables(map);
  tables.info.length_unit = unit;
  return LandmarkMap(std::move(tables));
}

LandmarkMap with_georeference(const LandmarkMap& map,
                              const std::optional<GeoReference>& georeference) {
  MapTables tables = copied_tables(map);
  tables.info.georeference = georeference;
  return LandmarkMap(std::move(tables));
}

LandmarkMap in_enu_frame(const LandmarkMap& map) {
  const auto& georeference = map.info().georeference;
  reject_if(!georeference, "map", "has no georeference", "a map whose place on the Earth is known");
  const LandmarkMap moved = transformed(map, georeference->enu_from_map());
  // Set directly, to avoid the rounding of a pose times its inverse.
  return with_georeference(with_length_unit(moved, LengthUnit::kMetres),
                           GeoReference{.origin = georeference->origin});
}

LandmarkMap with_column(const LandmarkMap& map, const std::string& name, ColumnValues values) {
  MapTables tables = copied_tables(map);
  auto& columns = tables.landmarks.columns;
  const auto found = std::find_if(columns.begin(), columns.end(),
                                  [&](const NamedColumn& column) { return column.name == name; });
  if (found != columns.end()) {
    found->values = std::move(values);
  } else {
    columns.push_back({name, std::move(values)});
  }
  return LandmarkMap(std::move(tables));
}

LandmarkMap with_camera(const LandmarkMap& map, const Camera& camera) {
  MapTables tables = copied_tables(map);
  tables.cameras = {camera};
  tables.rigs.clear();
  tables.frames.instants.clear();
  std::erase_if(tables.info.provenance, says_unstated_sizes);
  tables.frames.cameras.assign(map.frame_count(), CameraIndex{0});
  return LandmarkMap(std::move(tables));
}

bool states_image_sizes(const MapInfo& info) {
  return std::none_of(info.provenance.begin(), info.provenance.end(), says_unstated_sizes);
}

void note_unstated_image_sizes(MapInfo& info) {
  info.provenance.emplace_back(kUnstatedSizes);
}

bool is_binary(std::string_view kind) {
  constexpr std::array<std::string_view, 6> kBinary = {"ORB",   "BRIEF", "BRISK",
                                                       "AKAZE", "FREAK", "LATCH"};
  return std::find(kBinary.begin(), kBinary.end(), kind) != kBinary.end();
}

DescriptorNorm descriptor_norm(std::string_view kind) {
  return is_binary(kind) ? DescriptorNorm::kHamming : DescriptorNorm::kSquared;
}

bool are_alike(const Eigen::Vector3d& a, const Eigen::Vector3d& b, double cosine,
               double most_ratio) {
  const double here = a.norm();
  const double there = b.norm();
  return a.dot(b) > cosine * here * there && here < most_ratio * there && there < most_ratio * here;
}

std::uint64_t descriptor_difference(std::span<const std::uint8_t> a,
                                    std::span<const std::uint8_t> b, DescriptorNorm norm) {
  std::uint64_t sum = 0;
  if (norm == DescriptorNorm::kSquared) {
    for (std::size_t i = 0; i < a.size(); ++i) {
      const int by = int{a[i]} - int{b[i]};
      sum += static_cast<std::uint64_t>(by * by);
    }
    return sum;
  }
  for (std::size_t i = 0; i < a.size(); i += sizeof(std::uint64_t)) {
    const std::size_t count = std::min(sizeof(std::uint64_t), a.size() - i);
    std::uint64_t word_a = 0;
    std::uint64_t word_b = 0;
    std::memcpy(&word_a, a.data() + i, count);
    std::memcpy(&word_b, b.data() + i, count);
    sum += static_cast<std::uint64_t>(std::popcount(word_a ^ word_b));
  }
  return sum;
}

std::vector<std::uint8_t> descriptor_bytes(std::span<const float> values) {
  double squares = 0.0;
  for (const float value : values) squares += double{value} * double{value};
  const double rms = std::sqrt(squares / static_cast<double>(values.size()));
  constexpr double kSteps = 31.875;  // a byte's range for 4 times the root mean square, both ways
  std::vector<std::uint8_t> bytes;
  for (const float value : values) {
    const double step = std::round(127.5 + kSteps * double{value} / rms);
    bytes.push_back(static_cast<std::uint8_t>(std::clamp(step, 0.0, 255.0)));
  }
  return bytes;
}

std::vector<std::size_t> distinct_descriptors(
    std::span<const std::span<const std::uint8_t>> descriptors, std::size_t first, std::size_t most,
    DescriptorNorm norm) {
  constexpr std::size_t kMost = 64;
  const std::size_t count = std::min(descriptors.size(), kMost);
  std::vector<std::uint64_t> nearest(count, std::numeric_limits<std::uint64_t>::max());
  std::vector<std::size_t> chosen = {first};
  while (chosen.size() < most) {
    for (std::size_t i = 0; i < count; ++i) {
      nearest[i] = std::min(
          nearest[i], descriptor_difference(descriptors[i], descriptors[chosen.back()], norm));
    }
    const auto farthest = std::max_element(nearest.begin(), nearest.end());
    if (farthest == nearest.end() || *farthest == 0) break;
    chosen.push_back(static_cast<std::size_t>(farthest - nearest.begin()));
  }
  return chosen;
}

void append_descriptors(DescriptorColumn& column,
                        std::span<const std::span<const std::uint8_t>> descriptors) {
  const std::size_t row = column.known.size();
  column.known.push_back(descriptors.empty() ? 0 : 1);
  if (descriptors.empty()) {
    column.bytes.resize(column.bytes.size() + column.bytes_each);
  } else {
    column.bytes.insert(column.bytes.end(), descriptors[0].begin(), descriptors[0].end());
  }
  if (descriptors.size() > 1) {
    column.further_offsets.resize(row + 1, column.further.size() / column.bytes_each);
    for (const auto& further : descriptors.subspan(1)) {
      column.further.insert(column.further.end(), further.begin(), further.end());
    }
  }
  if (column.has_further()) {
    column.further_offsets.resize(row + 2, column.further.size() / column.bytes_each);
  }
}

namespace {

std::size_t medoid_of(std::span<const std::span<const std::uint8_t>> descriptors,
                      DescriptorNorm norm) {
  constexpr std::size_t kMost = 64;
  descriptors = descriptors.first(std::min(descriptors.size(), kMost));
  std::size_t best = 0;
  std::uint64_t least = std::numeric_limits<std::uint64_t>::max();
  for (std::size_t i = 0; i < descriptors.size(); ++i) {
    std::uint64_t sum = 0;
    for (const auto& other : descriptors) sum += descriptor_difference(descriptors[i], other, norm);
    if (sum < least) {
      least = sum;
      best = i;
    }
  }
  return best;
}

}  // namespace

void append_distinct(DescriptorColumn& column,
                     std::span<const std::span<const std::uint8_t>> descriptors,
                     DescriptorNorm norm) {
  std::vector<std::span<const std::uint8_t>> chosen;
  if (!descriptors.empty()) {
    for (const std::size_t i :
         distinct_descriptors(descriptors, medoid_of(descriptors, norm), kDistinctViews, norm)) {
      chosen.push_back(descriptors[i]);
    }
  }
  append_descriptors(column, chosen);
}

std::unordered_map<CameraIndex, Rigid3> cameras_from_rigs(std::span<const Rig> rigs) {
  std::unordered_map<CameraIndex, Rigid3> result;
  for (const Rig& rig : rigs) {
    for (const Rig::Mount& mount : rig.mounts) {
      result.emplace(mount.camera, mount.camera_from_rig());
    }
  }
  return result;
}

RigidFrames rigid_frames(std::span<const Rig> rigs, const FrameTable& frames) {
  const std::size_t count = frames.ids.size();
  RigidFrames result{std::vector<std::uint32_t>(count), std::vector<Rigid3>(count)};
  std::iota(result.lead.begin(), result.lead.end(), 0U);
  const auto from_rig = cameras_from_rigs(rigs);
  std::unordered_map<InstantId, std::uint32_t> lead_of;
  for (std::uint32_t i = 0; i < frames.instants.size(); ++i) {
    const std::optional<InstantId> instant = frames.instants[i];
    if (!instant) continue;
    const std::uint32_t lead = lead_of.emplace(*instant, i).first->second;
    if (lead == i) continue;
    result.lead[i] = lead;
    result.camera_from_lead[i] =
        from_rig.at(*frames.cameras[i]) * from_rig.at(*frames.cameras[lead]).inverse();
  }
  return result;
}

void hold_rigs(MapTables& tables) {
  FrameTable& frames = tables.frames;
  const RigidFrames rigid = rigid_frames(tables.rigs, frames);
  for (std::size_t i = 0; i < frames.ids.size(); ++i) {
    if (rigid.leads(i)) continue;
    const std::uint32_t lead = rigid.lead[i];
    const auto& of_lead = frames.quaternions[lead];
    const Rigid3 pose = Rigid3(Eigen::Quaterniond(of_lead[0], of_lead[1], of_lead[2], of_lead[3]),
                               frames.translations[lead]) *
                        rigid.camera_from_lead[i].inverse();
    const Eigen::Quaterniond q = pose.quaternion();
    frames.translations[i] = pose.translation();
    frames.quaternions[i] = {q.w(), q.x(), q.y(), q.z()};
  }
}

namespace {

constexpr std::size_t kMostOfLandmark = 8;  // descriptors to compare
constexpr std::size_t kUnset = std::numeric_limits<std::size_t>::max();

}  // namespace

ModelDescriptors::ModelDescriptors(const LandmarkMap& model,
                                   const std::function<bool(LandmarkIndex)>& has_descriptor)
    : model_(model) {
  const ObservationTable& observations = model_.observations();
  wanted_.resize(model_.frame_count());
  if (observations.keypoints.empty()) return;
  first_.push_back(0);
  for (std::uint32_t i = 0; i < model_.landmark_count(); ++i) {
    const std::uint64_t first = observations.offsets[i];
    const std::uint64_t end = has_descriptor && !has_descriptor(LandmarkIndex{i})
                                  ? first
                                  : std::min(observations.offsets[i + 1], first + kMostOfLandmark);
    for (std::uint64_t k = first; k < end; ++k) {
      if (!observations.keypoints[k]) continue;
      wanted_[observations.frames[k].value].push_back(
          {places_.size(), *observations.keypoints[k], observations.pixels[k]});
      places_.push_back(kUnset);
    }
    first_.push_back(places_.size());
  }
}

bool ModelDescriptors::are_near(
    FrameIndex frame,
    const std::function<std::optional<Pixel>(std::uint32_t keypoint)>& pixel) const {
  const auto& cameras = model_.frames().cameras;
  const auto camera = cameras.empty() ? std::nullopt : cameras[frame.value];
  const double most = camera ? 0.05 * model_.cameras()[camera->value].width : 50.0;
  std::size_t near = 0;
  for (const Wanted& one : wanted(frame)) {
    const auto at = pixel(one.keypoint);
    if (at && std::hypot(at->u - one.pixel.u, at->v - one.pixel.v) <= most) ++near;
  }
  return 2 * near >= wanted(frame).size();
}

void ModelDescriptors::set(const Wanted& wanted, std::span<const std::uint8_t> descriptor) {
  std::size_t& place = places_[wanted.rank];
  if (place == kUnset) {
    place = bytes_.size();
    bytes_.resize(place + descriptor.size());
  }
  std::copy(descriptor.begin(), descriptor.end(),
            bytes_.begin() + static_cast<std::ptrdiff_t>(place));
}

void ModelDescriptors::set(const Wanted& wanted, std::span<const float> descriptor) {
  constexpr float kMost = 1e6F;
  const bool are_finite = std::ranges::all_of(
      descriptor, [](float value) { return std::isfinite(value) && std::abs(value) < kMost; });
  const bool any = std::ranges::any_of(descriptor, [](float value) { return value != 0.0F; });
  if (are_finite && any) set(wanted, descriptor_bytes(descriptor));
}

std::optional<DescriptorColumn> ModelDescriptors::column(std::string kind,
                                                         std::size_t bytes_each) const {
  if (bytes_.empty()) return std::nullopt;
  const DescriptorNorm norm = descriptor_norm(kind);
  DescriptorColumn column{std::move(kind), bytes_each, {}, {}};
  std::vector<std::span<const std::uint8_t>> of_landmark;
  for (std::size_t i = 0; i < model_.landmark_count(); ++i) {
    of_landmark.clear();
    for (std::size_t rank = first_[i]; rank < first_[i + 1]; ++rank) {
      if (places_[rank] == kUnset) continue;
      of_landmark.push_back(std::span(bytes_).subspan(places_[rank], bytes_each));
    }
    append_distinct(column, of_landmark, norm);
  }
  return column;
}

}  // namespace cairn
