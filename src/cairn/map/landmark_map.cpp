// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/map/landmark_map.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/geometry/covariance.hpp"

namespace cairn {
namespace {

[[noreturn]] void refuse(std::string_view where, std::string_view what, std::string_view expected) {
  throw Error(ErrorKind::kInput, where, what, expected);
}

template <class Id>
std::string entry(std::string_view kind, const std::vector<Id>& ids, std::size_t i) {
  return fmt::format("{} {}", kind, ids[i].value);
}

void check_size(std::string_view column, std::size_t size, std::size_t rows, bool optional) {
  if (size == rows || (optional && size == 0)) return;
  refuse(column, fmt::format("{} entries", size), fmt::format("{}, one a row", rows));
}

// Positions sorted by id, or nothing if sorted already. Refuses ids that occur twice.
template <class Id>
std::vector<std::uint32_t> sorted_by_id(std::string_view kind, const std::vector<Id>& ids) {
  if (ids.size() > std::numeric_limits<std::uint32_t>::max()) {
    refuse(kind, fmt::format("{} of them", ids.size()), "fewer than 2^32");
  }
  const auto not_ascending = [](Id a, Id b) { return a >= b; };
  if (std::adjacent_find(ids.begin(), ids.end(), not_ascending) == ids.end()) return {};
  std::vector<std::uint32_t> order(ids.size());
  std::iota(order.begin(), order.end(), 0U);
  if (std::adjacent_find(ids.begin(), ids.end(), [](Id a, Id b) { return a <= b; }) == ids.end()) {
    std::reverse(order.begin(), order.end());
    return order;
  }
  std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    return ids[a] != ids[b] ? ids[a] < ids[b] : a < b;
  });
  const auto twice =
      std::adjacent_find(order.begin(), order.end(),
                         [&](std::uint32_t a, std::uint32_t b) { return ids[a] == ids[b]; });
  if (twice != order.end()) refuse(entry(kind, ids, *twice), "the id occurs twice", "distinct ids");
  return order;
}

template <class Index, class Id>
std::optional<Index> find_sorted(const std::vector<Id>& ids,
                                 const std::vector<std::uint32_t>& order, Id id) {
  if (order.empty()) {
    const auto found = std::lower_bound(ids.begin(), ids.end(), id);
    if (found == ids.end() || *found != id) return std::nullopt;
    return Index{static_cast<std::uint32_t>(found - ids.begin())};
  }
  const auto found = std::lower_bound(order.begin(), order.end(), id,
                                      [&](std::uint32_t i, Id sought) { return ids[i] < sought; });
  if (found == order.end() || ids[*found] != id) return std::nullopt;
  return Index{*found};
}

// Optional columns in which nothing is known say no more than absent ones: one form for one fact.
template <class Column>
void drop_if_unknown(Column& column) {
  const auto known = [](const auto& value) { return value.has_value(); };
  if (std::none_of(column.begin(), column.end(), known)) column.clear();
}

void drop_unknown_columns(MapTables& tables) {
  const auto drop_empty = [](std::optional<std::string>& text) {
    if (text && text->empty()) text.reset();
  };
  drop_empty(tables.info.world_frame);
  drop_empty(tables.info.uuid);
  std::erase(tables.info.provenance, std::string());
  drop_if_unknown(tables.frames.cameras);
  drop_if_unknown(tables.frames.timestamps_s);
  auto& names = tables.frames.image_names;
  if (std::all_of(names.begin(), names.end(), [](const auto& name) { return name.empty(); })) {
    names.clear();
  }
  auto& covariances = tables.landmarks.covariances;
  if (std::all_of(covariances.begin(), covariances.end(),
                  [](const auto& covariance) { return std::isnan(covariance(0, 0)); })) {
    covariances = {};
  }
  drop_if_unknown(tables.landmarks.colors);
  drop_if_unknown(tables.observations.keypoints);
  drop_if_unknown(tables.observations.depths);
  drop_if_unknown(tables.observations.octaves);
  if (tables.landmarks.ids.empty()) tables.observations.offsets.clear();
}

bool is_plain_name(std::string_view name) {
  return !name.empty() &&
         std::all_of(name.begin(), name.end(), [](char c) { return c > ' ' && c < '\x7f'; });
}

void check_info(const MapInfo& info) {
  if (info.gravity && !(std::abs(info.gravity->norm() - 1.0) < 1e-3)) {
    refuse("gravity", "not a unit vector", "norm 1 within 1e-3");
  }
}

void check_frames(const FrameTable& frames, std::size_t camera_count) {
  const std::size_t count = frames.ids.size();
  check_size("frame translations", frames.translations.size(), count, false);
  check_size("frame quaternions", frames.quaternions.size(), count, false);
  check_size("frame cameras", frames.cameras.size(), count, true);
  check_size("frame timestamps", frames.timestamps_s.size(), count, true);
  check_size("frame image names", frames.image_names.size(), count, true);
  for (std::size_t i = 0; i < count; ++i) {
    const auto where = [&] { return entry("frame", frames.ids, i); };
    if (!frames.translations[i].allFinite())
      refuse(where(), "translation is not finite", "numbers");
    const auto& q = frames.quaternions[i];
    const double norm = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    if (!(std::abs(norm - 1.0) <= 1e-3)) {
      refuse(where(), fmt::format("quaternion of norm {}", norm), "norm 1 within 1e-3");
    }
    if (!frames.cameras.empty() && frames.cameras[i] && frames.cameras[i]->value >= camera_count) {
      refuse(where(), "refers to a camera that the map does not have", "the index of a camera");
    }
    if (!frames.timestamps_s.empty() && frames.timestamps_s[i] &&
        !std::isfinite(*frames.timestamps_s[i])) {
      refuse(where(), "timestamp is not finite", "seconds");
    }
  }
}

void check_descriptors(const DescriptorColumn& descriptors, const std::vector<LandmarkId>& ids) {
  auto bytes = descriptors.bytes.begin();
  for (std::size_t i = 0; i < ids.size(); ++i) {
    const auto end = bytes + static_cast<std::ptrdiff_t>(descriptors.bytes_each);
    const std::uint8_t known = descriptors.known[i];
    if (known > 1 || (known == 0 && std::any_of(bytes, end, [](auto byte) { return byte != 0; }))) {
      refuse(entry("landmark", ids, i), "descriptor is neither known nor zero",
             "1 for known, or 0 and all its bytes zero");
    }
    bytes = end;
  }
}

void check_landmarks(const LandmarkTable& landmarks) {
  const std::size_t count = landmarks.ids.size();
  check_size("landmark positions", landmarks.positions.size(), count, false);
  check_size("landmark covariances", landmarks.covariances.size(), count, true);
  check_size("landmark colors", landmarks.colors.size(), count, true);
  if (const auto& descriptors = landmarks.descriptors) {
    check_size("landmark descriptors", descriptors->known.size(), count, false);
    if (descriptors->bytes_each == 0 || descriptors->bytes_each > kMostDescriptorBytes) {
      refuse("landmark descriptors", fmt::format("of {} bytes", descriptors->bytes_each),
             fmt::format("1 to {}", kMostDescriptorBytes));
    }
    if (!is_plain_name(descriptors->kind)) {
      refuse("landmark descriptors", "kind is not a name", "visible ASCII, no blanks");
    }
    check_size("descriptor bytes", descriptors->bytes.size(), count * descriptors->bytes_each,
               false);
    check_descriptors(*descriptors, landmarks.ids);
  }
  if (landmarks.columns.size() > kMostNamedColumns) {
    refuse("named columns", fmt::format("{} of them", landmarks.columns.size()),
           fmt::format("at most {}", kMostNamedColumns));
  }
  for (std::size_t i = 0; i < landmarks.columns.size(); ++i) {
    const NamedColumn& column = landmarks.columns[i];
    check_size("column " + printable(column.name), column.values.size(), count, false);
    if (!is_plain_name(column.name)) {
      refuse("column " + printable(column.name), "not a name", "visible ASCII, no blanks");
    }
    for (std::size_t j = 0; j < i; ++j) {
      if (landmarks.columns[j].name == column.name) {
        refuse("column " + printable(column.name), "occurs twice", "distinct names");
      }
    }
    for (std::size_t j = 0; j < count; ++j) {
      if (std::isinf(column.values[j])) {
        refuse(entry("landmark", landmarks.ids, j), "infinite in column " + printable(column.name),
               "a number, or NaN where unknown");
      }
    }
  }
  for (std::size_t i = 0; i < count; ++i) {
    if (!landmarks.positions[i].allFinite()) {
      refuse(entry("landmark", landmarks.ids, i), "position is not finite", "numbers");
    }
  }
  for (std::size_t i = 0; i < landmarks.covariances.size(); ++i) {
    const Eigen::Matrix3d& covariance = landmarks.covariances[i];
    if (std::isnan(covariance(0, 0))) continue;
    const std::string defect = covariance_defect(covariance);
    if (!defect.empty()) {
      refuse(entry("landmark", landmarks.ids, i), "covariance is " + defect,
             "a symmetric positive semi-definite matrix");
    }
  }
}

void check_observations(const ObservationTable& observations, const LandmarkTable& landmarks,
                        std::size_t frame_count) {
  const std::size_t count = observations.frames.size();
  check_size("observation pixels", observations.pixels.size(), count, false);
  check_size("observation keypoints", observations.keypoints.size(), count, true);
  check_size("observation depths", observations.depths.size(), count, true);
  check_size("observation octaves", observations.octaves.size(), count, true);
  const auto& offsets = observations.offsets;
  if (offsets.empty()) {
    if (count > 0) refuse("observation offsets", "missing", "one a landmark and one more");
    return;
  }
  if (offsets.size() != landmarks.ids.size() + 1 || offsets.front() != 0 ||
      offsets.back() != count || !std::is_sorted(offsets.begin(), offsets.end())) {
    refuse("observation offsets", "do not cut the observations into one range a landmark",
           "ascending from 0 to their number, one more than there are landmarks");
  }
  for (std::size_t i = 0; i < landmarks.ids.size(); ++i) {
    for (std::uint64_t j = offsets[i]; j < offsets[i + 1]; ++j) {
      const auto where = [&] { return entry("landmark", landmarks.ids, i); };
      if (observations.frames[j].value >= frame_count) {
        refuse(where(), "observed by a frame that the map does not have", "the index of a frame");
      }
      const Pixel& pixel = observations.pixels[j];
      if (!std::isfinite(pixel.u) || !std::isfinite(pixel.v)) {
        refuse(where(), "pixel is not finite", "numbers");
      }
      if (!observations.depths.empty() && observations.depths[j] &&
          !std::isfinite(*observations.depths[j])) {
        refuse(where(), "depth is not finite", "metres");
      }
    }
  }
}

}  // namespace

LandmarkMap::LandmarkMap(MapTables tables)
    : tables_(std::move(tables)),
      frames_by_id_(sorted_by_id("frame", tables_.frames.ids)),
      landmarks_by_id_(sorted_by_id("landmark", tables_.landmarks.ids)) {
  check_info(tables_.info);
  std::vector<CameraId> camera_ids;
  for (const Camera& camera : tables_.cameras) {
    const std::string defect = camera_defect(camera);
    if (!defect.empty())
      refuse(fmt::format("camera {}", camera.id.value), defect, "a usable camera");
    camera_ids.push_back(camera.id);
  }
  sorted_by_id("camera", camera_ids);  // refuses an id that occurs twice
  check_frames(tables_.frames, tables_.cameras.size());
  check_landmarks(tables_.landmarks);
  check_observations(tables_.observations, tables_.landmarks, frame_count());
  drop_unknown_columns(tables_);
}

Rigid3 LandmarkMap::world_from_camera(FrameIndex frame) const {
  const auto& q = tables_.frames.quaternions[frame.value];
  return {Eigen::Quaterniond(q[0], q[1], q[2], q[3]), tables_.frames.translations[frame.value]};
}

std::optional<Eigen::Matrix3d> LandmarkMap::covariance(LandmarkIndex landmark) const {
  if (!has_covariances()) return std::nullopt;
  const Eigen::Matrix3d& covariance = tables_.landmarks.covariances[landmark.value];
  if (std::isnan(covariance(0, 0))) return std::nullopt;
  return covariance;
}

std::size_t LandmarkMap::observation_count(LandmarkIndex landmark) const {
  return observing_frames(landmark).size();
}

std::span<const FrameIndex> LandmarkMap::observing_frames(LandmarkIndex landmark) const {
  const auto& offsets = tables_.observations.offsets;
  if (offsets.empty()) return {};
  return std::span(tables_.observations.frames)
      .subspan(offsets[landmark.value], offsets[landmark.value + 1] - offsets[landmark.value]);
}

std::span<const Pixel> LandmarkMap::observed_pixels(LandmarkIndex landmark) const {
  const auto& offsets = tables_.observations.offsets;
  if (offsets.empty()) return {};
  return std::span(tables_.observations.pixels)
      .subspan(offsets[landmark.value], offsets[landmark.value + 1] - offsets[landmark.value]);
}

std::optional<FrameIndex> LandmarkMap::find(FrameId id) const {
  return find_sorted<FrameIndex>(tables_.frames.ids, frames_by_id_, id);
}

std::optional<LandmarkIndex> LandmarkMap::find(LandmarkId id) const {
  return find_sorted<LandmarkIndex>(tables_.landmarks.ids, landmarks_by_id_, id);
}

const NamedColumn* LandmarkMap::column(std::string_view name) const {
  const auto& columns = tables_.landmarks.columns;
  const auto found = std::find_if(columns.begin(), columns.end(),
                                  [&](const NamedColumn& column) { return column.name == name; });
  return found == columns.end() ? nullptr : &*found;
}

}  // namespace cairn
