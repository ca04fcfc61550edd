// SPDX-License-Identifier: BSD-3-Clause
#include <array>
#include <cmath>
#include <functional>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/core/hash.hpp"
#include "cairn/formats/detail/own/binary_layout.hpp"
#include "cairn/formats/own_formats.hpp"

namespace cairn::detail {
namespace {

class BinaryWriter {
 public:
  BinaryWriter(const LandmarkMap& map, const ByteSink& sink, const Progress& progress)
      : map_(map), sink_(sink), progress_(progress) {
    plan_info();
    plan_frames();
    plan_landmarks();
    plan_observations();
    plan_places();
    plan_further_descriptors();
    plan_control_points();
    plan_pose_covariances();
  }

  void write() {
    std::uint64_t end = kHeaderSize + plan_.size() * kTableEntrySize;
    for (const Planned& section : plan_) end = aligned(end) + section.size;
    size_ = aligned(end) + kChecksumSize;
    put(kBinaryMagic);
    put(kBinaryVersion);
    put(std::uint32_t{map_.info().length_unit == LengthUnit::kFree});
    put(size_);
    put(std::uint64_t{map_.frame_count()});
    put(std::uint64_t{map_.landmark_count()});
    put(std::uint64_t{map_.observation_count()});
    put(std::uint64_t{plan_.size()});
    std::uint64_t begin = kHeaderSize + plan_.size() * kTableEntrySize;
    for (const Planned& section : plan_) {
      put(static_cast<std::uint64_t>(section.column));
      put(begin);
      put(section.size);
      begin = aligned(begin + section.size);
    }
    for (const Planned& section : plan_) {
      section.write();
      pad();
    }
    flush();
    const Hash128 hash = hasher_.digest();
    put(hash.low);
    put(hash.high);
    flush();
  }

 private:
  struct Planned {
    MapColumn column;
    std::uint64_t size;
    std::function<void()> write;
  };

  // ---- bytes

  void flush() {
    hasher_.update(buffer_);
    sink_(buffer_);
    buffer_.clear();
    if (progress_) progress_(static_cast<double>(written_) / static_cast<double>(size_));
  }

  void put(std::string_view bytes) {
    written_ += bytes.size();
    while (!bytes.empty()) {
      const std::string_view block = bytes.substr(0, kBinaryBlock - buffer_.size());
      buffer_ += block;
      bytes.remove_prefix(block.size());
      if (buffer_.size() == kBinaryBlock) flush();
    }
  }

  template <class Number>
    requires std::is_arithmetic_v<Number>
  void put(Number number) {
    put(std::string_view(reinterpret_cast<const char*>(&number), sizeof number));
  }

  void pad() { put(std::string_view("\0\0\0\0\0\0\0", aligned(written_) - written_)); }

  static std::uint64_t size_of_text(const std::string& text) { return 4 + text.size(); }

  void put_text(const std::string& text) {
    if (!std::in_range<std::uint32_t>(text.size())) {
      throw Error(ErrorKind::kMisuse, "binary map", fmt::format("a text of {} bytes", text.size()),
                  "fewer than 2^32");
    }
    put(static_cast<std::uint32_t>(text.size()));
    put(text);
  }

  // ---- sections

  // Leaves out an empty section.
  void plan(MapColumn column, std::uint64_t size, std::function<void()> write) {
    if (size > 0) plan_.push_back({column, size, std::move(write)});
  }

  template <class Row>
  void plan_rows(MapColumn column, const std::vector<Row>& rows) {
    const std::string_view bytes(reinterpret_cast<const char*>(rows.data()),
                                 rows.size() * sizeof(Row));
    plan(column, bytes.size(), [this, bytes] { put(bytes); });
  }

  void plan_bytes(MapColumn column, const std::optional<std::string>& text) {
    if (text) plan(column, text->size(), [this, &text] { put(*text); });
  }

  void plan_texts(MapColumn column, const std::vector<std::string>& texts) {
    std::uint64_t size = 0;
    for (const std::string& text : texts) size += size_of_text(text);
    plan(column, size, [this, &texts] {
      for (const std::string& text : texts) put_text(text);
    });
  }

  void plan_numbers(MapColumn column, const OptionalColumn<double>& values) {
    plan(column, 8 * values.size(), [this, &values] {
      for (const auto& value : values) put(value.value_or(kUnknownNumber));
    });
  }

  // `integer_of(value)`: the stored integer of a known value.
  template <class Value, class IntegerOf = std::identity>
  void plan_integers(MapColumn column, const OptionalColumn<Value>& values,
                     IntegerOf integer_of = {}) {
    plan(column, 8 * values.size(), [this, &values, integer_of] {
      for (const auto& value : values) {
        put(value ? std::int64_t{integer_of(*value)} : kUnknownInteger);
      }
    });
  }

  void plan_info() {
    const MapInfo& info = map_.info();
    plan_bytes(MapColumn::kWorldFrame, info.world_frame);
    if (info.gravity) {
      plan(MapColumn::kGravity, 24, [this, &gravity = *info.gravity] {
        for (const double component : gravity) put(component);
      });
    }
    plan_bytes(MapColumn::kUuid, info.uuid);
    plan_texts(MapColumn::kProvenance, info.provenance);
    std::uint64_t size = 0;
    for (const Camera& camera : map_.cameras()) {
      size += 8 + 4 + 4 + size_of_text(camera.model) + 4 + 8 * camera.parameters.size();
    }
    plan(MapColumn::kCameras, size, [this] {
      for (const Camera& camera : map_.cameras()) {
        put(camera.id.value);
        put(camera.width);
        put(camera.height);
        put_text(camera.model);
        put(static_cast<std::uint32_t>(camera.parameters.size()));
        for (const double parameter : camera.parameters) put(parameter);
      }
    });
  }

  void plan_frames() {
    const FrameTable& frames = map_.frames();
    plan_rows(MapColumn::kFrameIds, frames.ids);
    plan_rows(MapColumn::kTranslations, frames.translations);
    plan_rows(MapColumn::kQuaternions, frames.quaternions);
    plan_integers(MapColumn::kFrameCameras, frames.cameras, [](CameraIndex i) { return i.value; });
    plan_numbers(MapColumn::kTimestamps, frames.timestamps_s);
    plan_texts(MapColumn::kImageNames, frames.image_names);
  }

  void plan_landmarks() {
    const LandmarkTable& landmarks = map_.landmarks();
    plan_rows(MapColumn::kLandmarkIds, landmarks.ids);
    plan_rows(MapColumn::kPositions, landmarks.positions);
    plan(MapColumn::kCovariances, 72 * landmarks.covariances.size(), [this, &landmarks] {
      for (const Eigen::Matrix3d& covariance : landmarks.covariances) {
        const bool known = !std::isnan(covariance(0, 0));
        for (const double entry : covariance.reshaped()) put(known ? entry : kUnknownNumber);
      }
    });
    plan(MapColumn::kColors, 4 * landmarks.colors.size(), [this, &landmarks] {
      for (const auto& color : landmarks.colors) {
        const Color rgb = color.value_or(Color{});
        for (const std::uint8_t value : {rgb.red, rgb.green, rgb.blue}) put(value);
        put(std::uint8_t{color.has_value()});
      }
    });
    if (const auto& descriptors = landmarks.descriptors) {
      plan(MapColumn::kDescriptorKind, 4 + descriptors->kind.size(), [this, &descriptors] {
        put(static_cast<std::uint32_t>(descriptors->bytes_each));
        put(descriptors->kind);
      });
      plan_rows(MapColumn::kKnownDescriptors, descriptors->known);
      plan_rows(MapColumn::kDescriptors, descriptors->bytes);
    }
    std::uint64_t size = 0;
    for (const NamedColumn& column : landmarks.columns) size += size_of_text(column.name);
    plan(MapColumn::kColumnNames, size, [this, &landmarks] {
      for (const NamedColumn& column : landmarks.columns) put_text(column.name);
    });
    plan(MapColumn::kColumnValues, 8 * landmarks.columns.size() * map_.landmark_count(),
         [this, &landmarks] {
           for (const NamedColumn& column : landmarks.columns) {
             for (const double value : column.values)
               put(std::isnan(value) ? kUnknownNumber : value);
           }
         });
  }

  void plan_observations() {
    const ObservationTable& observations = map_.observations();
    plan_rows(MapColumn::kOffsets, observations.offsets);
    plan_rows(MapColumn::kObservingFrames, observations.frames);
    plan_rows(MapColumn::kPixels, observations.pixels);
    plan_integers(MapColumn::kKeypoints, observations.keypoints);
    plan_numbers(MapColumn::kDepths, observations.depths);
    plan_integers(MapColumn::kOctaves, observations.octaves);
    plan_integers(MapColumn::kPixelSources, observations.sources,
                  [](PixelSource source) { return static_cast<std::int64_t>(source); });
    plan_numbers(MapColumn::kPixelSigmas, observations.sigmas_px);
  }

  void put_geodetic(const GeodeticPosition& position) {
    for (const double value : {position.latitude_deg, position.longitude_deg, position.altitude_m})
      put(value);
  }

  // Georeference and GNSS positions.
  void plan_control_points() {
    const auto& points = map_.info().control_points;
    std::uint64_t size = 0;
    for (const ControlPoint& point : points) {
      size += 3 * 8 + size_of_text(point.name) + 4;
      for (const ControlPoint::View& view : point.views) {
        size += 2 * 8 + size_of_text(view.image_name);
      }
    }
    plan(MapColumn::kControlPoints, size, [this, &points] {
      for (const ControlPoint& point : points) {
        put(point.latitude_deg);
        put(point.longitude_deg);
        put(point.altitude_m.value_or(kUnknownNumber));
        put_text(point.name);
        put(static_cast<std::uint32_t>(point.views.size()));
        for (const ControlPoint::View& view : point.views) {
          put(view.pixel.u);
          put(view.pixel.v);
          put_text(view.image_name);
        }
      }
    });
  }

  void plan_places() {
    if (const auto& georeference = map_.info().georeference) {
      plan(MapColumn::kGeoReference, 88, [this, &georeference] {
        put_geodetic(georeference->origin);
        put(georeference->scale);
        for (const double value : georeference->quaternion) put(value);
        for (const double value : georeference->translation) put(value);
      });
    }
    const auto& gnss = map_.frames().gnss;
    plan(MapColumn::kGnss, 32 * gnss.size(), [this, &gnss] {
      for (const auto& fix : gnss) {
        if (fix) {
          put_geodetic(fix->position);
          put(fix->accuracy_m.value_or(kUnknownNumber));
        } else {
          for (int i = 0; i < 4; ++i) put(kUnknownNumber);
        }
      }
    });
  }

  void plan_pose_covariances() {
    const auto& covariances = map_.frames().pose_covariances;
    plan(MapColumn::kPoseCovariances, sizeof(double) * kUpperTriangle * covariances.size(),
         [this, &covariances] {
           const Matrix6d unknown = Matrix6d::Constant(kUnknownNumber);
           for (const std::optional<Matrix6d>& one : covariances) {
             const Matrix6d& covariance = one ? *one : unknown;
             for (int row = 0; row < 6; ++row) {
               for (int column = row; column < 6; ++column) put(covariance(row, column));
             }
           }
         });
  }

  void plan_further_descriptors() {
    const auto& descriptors = map_.landmarks().descriptors;
    if (!descriptors) return;
    plan_rows(MapColumn::kFurtherOffsets, descriptors->further_offsets);
    plan_rows(MapColumn::kFurtherDescriptors, descriptors->further);
  }

  const LandmarkMap& map_;
  const ByteSink& sink_;
  const Progress& progress_;
  std::vector<Planned> plan_;
  Hasher hasher_;
  std::string buffer_;
  std::uint64_t size_ = 0;
  std::uint64_t written_ = 0;
};

}  // namespace
}  // namespace cairn::detail

namespace cairn {

void write_binary(const LandmarkMap& map, const ByteSink& sink, const Progress& progress) {
  detail::BinaryWriter(map, sink, progress).write();
}

}  // namespace cairn
