// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/map/landmark_map.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <numeric>
#include <tuple>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/core/text.hpp"
#include "cairn/geometry/covariance.hpp"
#include "cairn/geometry/limits.hpp"

namespace cairn {
namespace {

void check_size(std::string_view column, std::size_t size, std::size_t rows, bool optional) {
  if (size == rows || (optional && size == 0)) return;
  throw Error(ErrorKind::kInput, column, fmt::format("{} entries", size),
              fmt::format("{}, one a row", rows));
}

std::string text_of(const Eigen::Vector3d& v) {
  return fmt::format("({}, {}, {})", v.x(), v.y(), v.z());
}

constexpr std::string_view kExpectedGeodetic =
    "degrees from -90 to 90 and -180 to 180, metres from -1e9 to 1e9";

// The first of the offsets that do not cut `count` entries into one range for each of `rows`; std::nullopt if they do.
std::optional<std::size_t> wrong_offset(const std::vector<std::uint64_t>& offsets, std::size_t rows,
                                        std::size_t count) {
  if (offsets.size() != rows + 1 || offsets.front() != 0) return 0;
  const auto unsorted = std::is_sorted_until(offsets.begin(), offsets.end());
  if (unsorted != offsets.end()) return static_cast<std::size_t>(unsorted - offsets.begin());
  return offsets.back() == count ? std::nullopt : std::optional(rows);
}

constexpr std::string_view kExpectedOffsets =
    "ascending from 0 to their number, one more than there are landmarks";

double norm_of(const std::array<double, 4>& q) {
  return std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
}

bool is_unit(double norm) {
  return std::abs(norm - 1.0) <= 1e-3;  // false for NaN
}

// Checks the tables of a map.
class Checks {
 public:
  Checks(const MapTables& tables, const EntryPlace& place) : tables_(tables), place_(place) {}

  /// Row numbers sorted by id; empty if already sorted. Refuses duplicate ids.
  template <class Id>
  std::vector<std::uint32_t> sorted_by_id(MapColumn column, std::string_view kind,
                                          const std::vector<Id>& ids) const {
    if (ids.size() > kNoRow) {
      refuse(column, kNoRow, kind, fmt::format("{} of them", ids.size()), "fewer than 2^32");
    }
    const auto not_ascending = [](Id a, Id b) { return a >= b; };
    if (std::adjacent_find(ids.begin(), ids.end(), not_ascending) == ids.end()) return {};
    std::vector<std::uint32_t> order(ids.size());
    std::iota(order.begin(), order.end(), 0U);
    std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
      return ids[a] != ids[b] ? ids[a] < ids[b] : a < b;
    });
    std::uint32_t first = kNoRow;
    for (std::size_t i = 1; i < order.size(); ++i) {
      if (ids[order[i]] == ids[order[i - 1]]) first = std::min(first, order[i]);
    }
    if (first != kNoRow) {
      refuse(column, first, fmt::format("{} {}", kind, ids[first].value), "the id occurs twice",
             "distinct ids");
    }
    return order;
  }

  void run() const {
    check_info();
    check_cameras();
    check_frames();
    check_rigs();
    check_landmarks();
    check_observations();
  }

 private:
  static constexpr std::uint32_t kNoRow = std::numeric_limits<std::uint32_t>::max();

  [[noreturn]] void refuse(MapColumn column, std::size_t row, std::string_view entry,
                           std::string_view what, std::string_view expected) const {
    throw Error(ErrorKind::kInput,
                place_ ? fmt::format("{}: {}", place_(column, row), entry) : std::string(entry),
                what, expected);
  }

  [[noreturn]] void refuse_frame(MapColumn column, std::size_t row, std::string_view what,
                                 std::string_view expected) const {
    refuse(column, row, fmt::format("frame {}", tables_.frames.ids[row].value), what, expected);
  }

  [[noreturn]] void refuse_landmark(MapColumn column, std::size_t row, std::string_view what,
                                    std::string_view expected, std::size_t landmark) const {
    refuse(column, row, fmt::format("landmark {}", tables_.landmarks.ids[landmark].value), what,
           expected);
  }

  [[noreturn]] void refuse_observation(MapColumn column, std::size_t row, std::string_view what,
                                       std::string_view expected) const {
    const auto& offsets = tables_.observations.offsets;
    const auto after = std::upper_bound(offsets.begin(), offsets.end(), row);
    refuse_landmark(column, row, what, expected,
                    static_cast<std::size_t>(after - offsets.begin()) - 1);
  }

  void check_info() const {
    const auto& gravity = tables_.info.gravity;
    if (gravity && !(std::abs(gravity->norm() - 1.0) < 1e-3)) {
      refuse(MapColumn::kGravity, 0, "gravity",
             fmt::format("{} is not a unit vector", text_of(*gravity)), "norm 1 within 1e-3");
    }
    if (tables_.info.georeference) check_georeference(*tables_.info.georeference);
    for (std::size_t i = 0; i < tables_.info.control_points.size(); ++i) check_control_point(i);
  }

  void check_control_point(std::size_t row) const {
    const ControlPoint& point = tables_.info.control_points[row];
    const auto refuse_it = [&](std::string_view what, std::string_view expected) {
      refuse(MapColumn::kControlPoints, row, "control point " + printable(point.name), what,
             expected);
    };
    if (point.name.empty()) refuse_it("has no name", "a name");
    const GeodeticPosition position{point.latitude_deg, point.longitude_deg,
                                    point.altitude_m.value_or(0.0)};
    if (const std::string defect = geodetic_defect(position); !defect.empty()) {
      refuse_it(defect, kExpectedGeodetic);
    }
    for (const ControlPoint::View& view : point.views) {
      if (view.image_name.empty()) refuse_it("is seen by an image without a name", "a name");
      if (!std::isfinite(view.pixel.u) || !std::isfinite(view.pixel.v)) {
        refuse_it("pixel is not finite in " + printable(view.image_name), "finite coordinates");
      }
    }
  }

  void check_georeference(const GeoReference& georeference) const {
    const auto refuse_it = [&](std::string_view what, std::string_view expected) {
      refuse(MapColumn::kGeoReference, 0, "georeference", what, expected);
    };
    if (const std::string defect = geodetic_defect(georeference.origin); !defect.empty()) {
      refuse_it(defect, kExpectedGeodetic);
    }
    const double scale = georeference.scale;
    if (!(scale >= 1.0 / kLargestCoordinate && scale <= kLargestCoordinate)) {
      refuse_it(fmt::format("scale {}", scale), "a scale from 1e-9 to 1e9");
    }
    if (const double norm = norm_of(georeference.quaternion); !is_unit(norm)) {
      refuse_it(fmt::format("quaternion of norm {:.6g}", norm), "norm 1 within 1e-3");
    }
    if (const auto defect = coordinate_defect(georeference.translation); !defect.empty()) {
      refuse_it(fmt::format("translation {} {}", text_of(georeference.translation), defect),
                kExpectedCoordinates);
    }
  }

  void check_gnss(std::size_t row, const GnssFix& fix) const {
    if (const std::string defect = geodetic_defect(fix.position); !defect.empty()) {
      refuse_frame(MapColumn::kGnss, row, "GNSS position: " + defect, kExpectedGeodetic);
    }
    if (fix.accuracy_m && !(*fix.accuracy_m > 0.0 && *fix.accuracy_m <= kLargestCoordinate)) {
      refuse_frame(MapColumn::kGnss, row, fmt::format("GNSS accuracy {}", *fix.accuracy_m),
                   "a positive number of metres, at most 1e9");
    }
  }

  void check_pose_covariance(std::size_t row, const Matrix6d& covariance) const {
    if (const std::string defect = pose_covariance_defect(covariance); !defect.empty()) {
      refuse_frame(MapColumn::kPoseCovariances, row, "pose covariance " + defect,
                   "a symmetric matrix without negative eigenvalues");
    }
  }

  void check_cameras() const {
    std::vector<CameraId> ids;
    for (std::size_t i = 0; i < tables_.cameras.size(); ++i) {
      const Camera& camera = tables_.cameras[i];
      const std::string defect = camera_defect(camera);
      if (!defect.empty()) {
        refuse(MapColumn::kCameras, i, fmt::format("camera {}", camera.id.value), defect,
               "a usable camera");
      }
      ids.push_back(camera.id);
    }
    sorted_by_id(MapColumn::kCameras, "camera", ids);  // refuses duplicate ids
  }

  void check_frames() const {
    const FrameTable& frames = tables_.frames;
    const std::size_t count = frames.ids.size();
    check_size("frame translations", frames.translations.size(), count, false);
    check_size("frame quaternions", frames.quaternions.size(), count, false);
    check_size("frame cameras", frames.cameras.size(), count, true);
    check_size("frame timestamps", frames.timestamps_s.size(), count, true);
    check_size("frame image names", frames.image_names.size(), count, true);
    check_size("frame GNSS positions", frames.gnss.size(), count, true);
    check_size("frame pose covariances", frames.pose_covariances.size(), count, true);
    for (std::size_t i = 0; i < count; ++i) {
      if (!are_coordinates(frames.translations[i])) {
        refuse_frame(MapColumn::kTranslations, i,
                     fmt::format("translation {} {}", text_of(frames.translations[i]),
                                 coordinate_defect(frames.translations[i])),
                     kExpectedCoordinates);
      }
      if (const double norm = norm_of(frames.quaternions[i]); !is_unit(norm)) {
        refuse_frame(MapColumn::kQuaternions, i, fmt::format("quaternion of norm {:.6g}", norm),
                     "norm 1 within 1e-3");
      }
      if (!frames.cameras.empty() && frames.cameras[i] &&
          frames.cameras[i]->value >= tables_.cameras.size()) {
        refuse_frame(MapColumn::kFrameCameras, i, "refers to a camera that the map does not have",
                     "the index of a camera");
      }
      if (!frames.timestamps_s.empty() && frames.timestamps_s[i] &&
          !(std::abs(*frames.timestamps_s[i]) <= kLargestTimestamp)) {
        const bool is_number = std::isfinite(*frames.timestamps_s[i]);
        refuse_frame(MapColumn::kTimestamps, i,
                     is_number ? fmt::format("timestamp {}", *frames.timestamps_s[i])
                               : "timestamp is not finite",
                     "seconds, from -1e20 to 1e20");
      }
      if (!frames.gnss.empty() && frames.gnss[i]) check_gnss(i, *frames.gnss[i]);
      if (!frames.pose_covariances.empty() && frames.pose_covariances[i]) {
        check_pose_covariance(i, *frames.pose_covariances[i]);
      }
    }
  }

  void check_rigs() const {
    std::vector<RigId> ids;
    std::vector<std::optional<std::size_t>> rig_of(tables_.cameras.size());
    for (std::size_t i = 0; i < tables_.rigs.size(); ++i) {
      const Rig& rig = tables_.rigs[i];
      ids.push_back(rig.id);
      const auto refuse_it = [&](std::string_view what, std::string_view expected) {
        refuse(MapColumn::kRigs, i, fmt::format("rig {}", rig.id.value), what, expected);
      };
      if (rig.mounts.empty()) refuse_it("has no camera", "at least one");
      for (const Rig::Mount& mount : rig.mounts) {
        if (mount.camera.value >= rig_of.size()) {
          refuse_it("refers to a camera that the map does not have", "the index of a camera");
        }
        auto& of_camera = rig_of[mount.camera.value];
        if (std::exchange(of_camera, i)) {
          refuse_it(fmt::format("camera {} is in a rig already",
                                tables_.cameras[mount.camera.value].id.value),
                    "a camera in one rig, once");
        }
        if (const double norm = norm_of(mount.quaternion); !is_unit(norm)) {
          refuse_it(fmt::format("quaternion of norm {:.6g}", norm), "norm 1 within 1e-3");
        }
        if (const auto defect = coordinate_defect(mount.translation); !defect.empty()) {
          refuse_it(fmt::format("translation {} {}", text_of(mount.translation), defect),
                    kExpectedCoordinates);
        }
      }
    }
    sorted_by_id(MapColumn::kRigs, "rig", ids);
    check_instants(rig_of);
  }

  void check_instants(const std::vector<std::optional<std::size_t>>& rig_of) const {
    const FrameTable& frames = tables_.frames;
    check_size("frame instants", frames.instants.size(), frames.ids.size(), true);
    std::vector<std::tuple<InstantId, std::size_t, CameraIndex, std::size_t>> taken;
    for (std::size_t i = 0; i < frames.instants.size(); ++i) {
      if (!frames.instants[i]) continue;
      const auto camera = frames.cameras.empty() ? std::nullopt : frames.cameras[i];
      if (!camera || !rig_of[camera->value]) {
        refuse_frame(MapColumn::kInstants, i, "has an instant, but no camera of a rig",
                     "an instant of images of rigs only");
      }
      taken.emplace_back(*frames.instants[i], *rig_of[camera->value], *camera, i);
    }
    std::sort(taken.begin(), taken.end());
    for (std::size_t i = 1; i < taken.size(); ++i) {
      const auto& [instant, rig, camera, row] = taken[i];
      const auto& [last_instant, last_rig, last_camera, last_row] = taken[i - 1];
      if (instant != last_instant || (rig == last_rig && camera != last_camera)) continue;
      refuse_frame(MapColumn::kInstants, row,
                   fmt::format("instant {} is that of frame {} too, of {}", instant.value,
                               frames.ids[last_row].value,
                               rig == last_rig ? "the same camera" : "another rig"),
                   "an instant of one rig, with one image of a camera");
    }
  }

  void check_descriptors(const DescriptorColumn& descriptors) const {
    const auto refuse_kind = [&](std::string_view what, std::string_view expected) {
      refuse(MapColumn::kDescriptorKind, 0, "landmark descriptors", what, expected);
    };
    const std::size_t count = tables_.landmarks.ids.size();
    check_size("landmark descriptors", descriptors.known.size(), count, false);
    if (descriptors.bytes_each == 0 || descriptors.bytes_each > kMostDescriptorBytes) {
      refuse_kind(fmt::format("of {} bytes", descriptors.bytes_each),
                  fmt::format("1 to {}", kMostDescriptorBytes));
    }
    if (!is_visible(descriptors.kind)) {
      refuse_kind("kind is not a name", "visible ASCII, no blanks");
    }
    check_size("descriptor bytes", descriptors.bytes.size(), count * descriptors.bytes_each, false);
    auto bytes = descriptors.bytes.begin();
    for (std::size_t i = 0; i < count; ++i) {
      const auto end = bytes + static_cast<std::ptrdiff_t>(descriptors.bytes_each);
      const std::uint8_t known = descriptors.known[i];
      if (known > 1 ||
          (known == 0 && std::any_of(bytes, end, [](auto byte) { return byte != 0; }))) {
        refuse_landmark(MapColumn::kKnownDescriptors, i, "descriptor is neither known nor zero",
                        "1 for known, or 0 and all its bytes zero", i);
      }
      bytes = end;
    }
    check_further(descriptors);
  }

  void check_further(const DescriptorColumn& descriptors) const {
    const auto& offsets = descriptors.further_offsets;
    const std::size_t count = tables_.landmarks.ids.size();
    if (offsets.empty()) {
      check_size("further descriptor bytes", descriptors.further.size(), 0, false);
      return;
    }
    if (const auto wrong =
            wrong_offset(offsets, count, descriptors.further.size() / descriptors.bytes_each)) {
      refuse(MapColumn::kFurtherOffsets, *wrong, "offsets of further descriptors",
             "do not cut the further descriptors into one range a landmark", kExpectedOffsets);
    }
    check_size("further descriptor bytes", descriptors.further.size(),
               offsets.back() * descriptors.bytes_each, false);
    for (std::size_t i = 0; i < count; ++i) {
      const std::uint64_t further = offsets[i + 1] - offsets[i];
      if (further > 0 && descriptors.known[i] == 0) {
        refuse_landmark(MapColumn::kFurtherOffsets, i, "further descriptors without a first one",
                        "a descriptor that represents the landmark", i);
      }
      if (further >= kMostDescriptorsEach) {
        refuse_landmark(MapColumn::kFurtherOffsets, i, fmt::format("{} descriptors", further + 1),
                        fmt::format("at most {}", kMostDescriptorsEach), i);
      }
    }
  }

  void check_named_columns() const {
    const auto& columns = tables_.landmarks.columns;
    const std::size_t count = tables_.landmarks.ids.size();
    if (columns.size() > kMostNamedColumns) {
      refuse(MapColumn::kColumnNames, kMostNamedColumns, "named columns",
             fmt::format("{} of them", columns.size()),
             fmt::format("at most {}", kMostNamedColumns));
    }
    for (std::size_t i = 0; i < columns.size(); ++i) {
      const NamedColumn& column = columns[i];
      const std::string name = "column " + printable(column.name);
      check_size(name, column.values.size(), count, false);
      if (!is_visible(column.name)) {
        refuse(MapColumn::kColumnNames, i, name, "not a name", "visible ASCII, no blanks");
      }
      for (std::size_t j = 0; j < i; ++j) {
        if (columns[j].name == column.name) {
          refuse(MapColumn::kColumnNames, i, name, "occurs twice", "distinct names");
        }
      }
      for (std::size_t j = 0; j < count; ++j) {
        if (std::isinf(column.values[j])) {
          refuse_landmark(MapColumn::kColumnValues, i * count + j, "infinite in " + name,
                          "a number, or NaN where unknown", j);
        }
      }
    }
  }

  void check_landmarks() const {
    const LandmarkTable& landmarks = tables_.landmarks;
    const std::size_t count = landmarks.ids.size();
    check_size("landmark positions", landmarks.positions.size(), count, false);
    check_size("landmark covariances", landmarks.covariances.size(), count, true);
    check_size("landmark colors", landmarks.colors.size(), count, true);
    if (landmarks.descriptors) check_descriptors(*landmarks.descriptors);
    check_named_columns();
    for (std::size_t i = 0; i < count; ++i) {
      if (!are_coordinates(landmarks.positions[i])) {
        refuse_landmark(MapColumn::kPositions, i,
                        fmt::format("position {} {}", text_of(landmarks.positions[i]),
                                    coordinate_defect(landmarks.positions[i])),
                        kExpectedCoordinates, i);
      }
    }
    for (std::size_t i = 0; i < landmarks.covariances.size(); ++i) {
      const Eigen::Matrix3d& covariance = landmarks.covariances[i];
      if (std::isnan(covariance(0, 0))) continue;
      const std::string defect = landmark_covariance_defect(covariance);
      if (!defect.empty()) {
        refuse_landmark(MapColumn::kCovariances, i, "covariance is " + defect,
                        "a symmetric positive semi-definite matrix", i);
      }
    }
  }

  void check_observations() const {
    const ObservationTable& observations = tables_.observations;
    const std::size_t count = observations.frames.size();
    check_size("observation pixels", observations.pixels.size(), count, false);
    check_size("observation keypoints", observations.keypoints.size(), count, true);
    check_size("observation depths", observations.depths.size(), count, true);
    check_size("observation octaves", observations.octaves.size(), count, true);
    check_size("observation sources", observations.sources.size(), count, true);
    check_size("observation sigmas", observations.sigmas_px.size(), count, true);
    if (observations.offsets.empty()) {
      if (count > 0) {
        refuse(MapColumn::kOffsets, 0, "observation offsets", "missing",
               "one a landmark and one more");
      }
      return;
    }
    if (const auto wrong =
            wrong_offset(observations.offsets, tables_.landmarks.ids.size(), count)) {
      refuse(MapColumn::kOffsets, *wrong, "observation offsets",
             "do not cut the observations into one range a landmark", kExpectedOffsets);
    }
    const std::size_t frame_count = tables_.frames.ids.size();
    for (std::size_t i = 0; i < count; ++i) {
      if (observations.frames[i].value >= frame_count) {
        refuse_observation(MapColumn::kObservingFrames, i,
                           "observed by a frame that the map does not have",
                           "the index of a frame");
      }
      const Pixel& pixel = observations.pixels[i];
      const std::string_view defect = coordinate_defect({pixel.u, pixel.v});
      if (!defect.empty()) {
        refuse_observation(MapColumn::kPixels, i,
                           fmt::format("pixel ({}, {}) {}", pixel.u, pixel.v, defect),
                           kExpectedCoordinates);
      }
    }
    for (std::size_t i = 0; i < observations.depths.size(); ++i) {
      if (!observations.depths[i]) continue;
      const std::string_view defect = coordinate_defect({*observations.depths[i]});
      if (!defect.empty()) {
        refuse_observation(MapColumn::kDepths, i, fmt::format("depth {}", defect),
                           "metres, from -1e9 to 1e9");
      }
    }
    for (std::size_t i = 0; i < observations.sigmas_px.size(); ++i) {
      if (!observations.sigmas_px[i]) continue;
      const double sigma = *observations.sigmas_px[i];
      if (sigma > 0.0 && sigma <= kLargestCoordinate) continue;
      refuse_observation(MapColumn::kPixelSigmas, i, fmt::format("sigma {}", sigma),
                         "a positive number of pixels, at most 1e9");
    }
  }

  const MapTables& tables_;
  const EntryPlace& place_;
};

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

// Removes an optional column without known entries, so that equal content has one form.
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
  drop_if_unknown(tables.frames.gnss);
  drop_if_unknown(tables.frames.pose_covariances);
  drop_if_unknown(tables.frames.instants);
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
  if (auto& descriptors = tables.landmarks.descriptors;
      descriptors && descriptors->further.empty()) {
    descriptors->further_offsets.clear();
  }
  drop_if_unknown(tables.observations.keypoints);
  drop_if_unknown(tables.observations.depths);
  drop_if_unknown(tables.observations.octaves);
  drop_if_unknown(tables.observations.sources);
  drop_if_unknown(tables.observations.sigmas_px);
  if (tables.landmarks.ids.empty()) tables.observations.offsets.clear();
}

}  // namespace

std::vector<std::string_view> column_names(std::span<const NamedColumn> columns) {
  std::vector<std::string_view> names;
  for (const NamedColumn& column : columns) names.push_back(column.name);
  return names;
}

std::string_view to_string(PixelSource source) {
  switch (source) {
    case PixelSource::kCorner:
      return "corner";
    case PixelSource::kPatch:
      return "patch";
    case PixelSource::kReference:
      return "reference";
  }
  return "unknown";
}

LandmarkMap::LandmarkMap(MapTables tables, const EntryPlace& place) : tables_(std::move(tables)) {
  const Checks checks(tables_, place);
  frames_by_id_ = checks.sorted_by_id(MapColumn::kFrameIds, "frame", tables_.frames.ids);
  landmarks_by_id_ =
      checks.sorted_by_id(MapColumn::kLandmarkIds, "landmark", tables_.landmarks.ids);
  checks.run();
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

Rigid3 Rig::Mount::camera_from_rig() const {
  return {Eigen::Quaterniond(quaternion[0], quaternion[1], quaternion[2], quaternion[3]),
          translation};
}

Similarity3 GeoReference::enu_from_map() const {
  return {scale,
          Rigid3(Eigen::Quaterniond(quaternion[0], quaternion[1], quaternion[2], quaternion[3]),
                 translation)};
}

GeoReference GeoReference::moved(const Similarity3& new_from_old) const {
  const Similarity3 enu_from_new = enu_from_map() * new_from_old.inverse();
  const Eigen::Quaterniond q = enu_from_new.rigid().quaternion();
  return {origin, enu_from_new.scale(), {q.w(), q.x(), q.y(), q.z()}, enu_from_new.translation()};
}

bool GeoReference::is_enu() const {
  constexpr double kTolerance = 1e-9;
  constexpr double kTolerance_m = 1e-6;
  return std::abs(scale - 1.0) <= kTolerance && enu_from_map().rigid().angle() <= kTolerance &&
         translation.norm() <= kTolerance_m;
}

GeodeticPosition GeoReference::geodetic(const Eigen::Vector3d& x_in_map) const {
  return geodetic_from_ecef(ecef_from_enu(origin) * (enu_from_map() * x_in_map));
}

Eigen::Vector3d GeoReference::in_map(const GeodeticPosition& position) const {
  return enu_from_map().inverse() *
         (ecef_from_enu(origin).inverse() * ecef_from_geodetic(position));
}

}  // namespace cairn
