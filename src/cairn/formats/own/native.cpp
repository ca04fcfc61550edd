// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <string>
#include <string_view>
#include <unordered_map>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "cairn/core/detail/memory.hpp"
#include "cairn/core/error.hpp"
#include "cairn/core/text.hpp"
#include "cairn/formats/detail/losses.hpp"
#include "cairn/formats/detail/memory_budget.hpp"
#include "cairn/formats/detail/own/numbered_fields.hpp"
#include "cairn/formats/detail/own/record_estimate.hpp"
#include "cairn/formats/map_file.hpp"
#include "cairn/geometry/limits.hpp"
#include "cairn/map/operations.hpp"

namespace cairn {
namespace {

constexpr double kUnknownValue = std::numeric_limits<double>::quiet_NaN();

using detail::NumberedFields;
using detail::unescaped;

// Line number of each row of one kind, run-length encoded: a new entry only if the distance changes.
class RowLines {
 public:
  void add(std::uint64_t row, std::uint64_t line) {
    if (runs_.empty() || line - row != runs_.back().second) runs_.emplace_back(row, line - row);
  }
  std::uint64_t line_of(std::uint64_t row) const {
    const auto after =
        std::upper_bound(runs_.begin(), runs_.end(), row,
                         [](std::uint64_t sought, const auto& run) { return sought < run.first; });
    return row + std::prev(after)->second;
  }

 private:
  std::vector<std::pair<std::uint64_t, std::uint64_t>> runs_;
};

constexpr std::array<const char*, 3> kTranslationNames = {"tx", "ty", "tz"};
constexpr std::array<const char*, 4> kRotationNames = {"qw", "qx", "qy", "qz"};
constexpr std::array<const char*, 3> kPositionNames = {"x", "y", "z"};

template <std::size_t N>
std::array<double, N> numbers(NumberedFields& fields, const std::array<const char*, N>& names) {
  std::array<double, N> result{};
  for (std::size_t i = 0; i < N; ++i) result[i] = fields.number(names[i]);
  return result;
}

Eigen::Vector3d vector3(NumberedFields& fields, const std::array<const char*, 3>& names) {
  return Eigen::Vector3d(numbers(fields, names).data());
}

class NativeReader {
 public:
  NativeReader(ByteSource& source, const Execution& execution)
      : source_(source), execution_(execution) {}

  LandmarkMap read() {
    if (source_.size()) reserve(detail::estimate_records(source_));
    LineReader lines(source_, execution_.log);
    tables_.observations.offsets.push_back(0);
    constexpr std::uint64_t kReportEvery = std::uint64_t{1} << 22;
    std::uint64_t next_report = 0;
    while (const auto line = lines.next()) {
      bytes_read_ = lines.bytes_read();
      read_line(*line, lines);
      if (lines.bytes_read() >= next_report) {
        next_report = lines.bytes_read() + kReportEvery;
        if (execution_.stop.stop_requested()) {
          throw Error(ErrorKind::kCancelled, source_.name(), "reading was cancelled", "");
        }
        if (execution_.progress && source_.size()) {
          // A file may grow while it is read.
          execution_.progress(std::min(
              1.0, static_cast<double>(lines.bytes_read()) / static_cast<double>(*source_.size())));
        }
      }
    }
    reject_if(version_ == 0, source_.name(), "the file is empty", "FRAME and LANDMARK records");
    return finish();
  }

 private:
  void reserve(const detail::RecordCounts& counts) {
    detail::reserve_populated(tables_.frames.ids, counts.frames);
    detail::reserve_populated(tables_.frames.translations, counts.frames);
    detail::reserve_populated(tables_.frames.quaternions, counts.frames);
    frame_index_.reserve(counts.frames);
    detail::reserve_populated(tables_.landmarks.ids, counts.landmarks);
    detail::reserve_populated(tables_.landmarks.positions, counts.landmarks);
    detail::reserve_populated(tables_.landmarks.covariances, counts.landmarks);
    detail::reserve_populated(tables_.observations.offsets, counts.landmarks + 1);
    detail::reserve_populated(tables_.observations.frames, counts.observations);
    detail::reserve_populated(tables_.observations.pixels, counts.observations);
  }

  void read_line(std::string_view line, const LineReader& lines) {
    NumberedFields fields(line, source_.name(), lines.line_number());
    if (fields.at_end()) return;
    const std::string_view record = fields.word("record");
    line_ = lines.line_number();
    if (record == "LANDMARK") {
      read_landmark(fields);
    } else if (record == "FRAME") {
      read_frame(fields);
    } else if (version_ == 0 && record == "CAIRN") {
      read_version(fields);
      return;
    } else if (version_ >= 2 && record[0] == '#') {
      return;
    } else if (version_ < 2 || !read_extra(record, fields)) {
      fields.refuse_line(
          fmt::format("unknown record {}", printable(record)),
          version_ >= 2 ? fmt::format("a record of version {}", version_) : "FRAME or LANDMARK");
    }
    fields.expect_end(record);
    if (version_ == 0) version_ = 1;
  }

  void read_version(NumberedFields& fields) {
    const std::uint64_t version = fields.unsigned_integer("version");
    if (version != 2 && version != 3) {
      fields.refuse(fmt::format("format version {}", version), "2 or 3");
    }
    fields.expect_end("CAIRN");
    version_ = static_cast<int>(version);
  }

  void read_frame(NumberedFields& fields) {
    FrameTable& frames = tables_.frames;
    const FrameId id{fields.unsigned_integer("id")};
    if (!frame_index_.emplace(id, FrameIndex{static_cast<std::uint32_t>(frames.ids.size())})
             .second) {
      fields.refuse(fmt::format("frame {} stands above already", id.value), "distinct ids");
    }
    if (frames.ids.size() == std::numeric_limits<std::uint32_t>::max()) {
      fields.refuse("too many frames", "fewer than 2^32");
    }
    Eigen::Vector3d translation;
    for (int i = 0; i < 3; ++i) {
      translation[i] = fields.coordinate(kTranslationNames[static_cast<std::size_t>(i)]);
    }
    const std::array<double, 4> q = numbers(fields, kRotationNames);
    frame_lines_.add(frames.ids.size(), line_);
    frames.ids.push_back(id);
    frames.translations.push_back(translation);
    frames.quaternions.push_back(q);
  }

  void read_landmark(NumberedFields& fields) {
    LandmarkTable& landmarks = tables_.landmarks;
    if (landmarks.ids.size() == std::numeric_limits<std::uint32_t>::max()) {
      fields.refuse_line("too many landmarks", "fewer than 2^32");
    }
    const LandmarkId id{fields.unsigned_integer("id")};
    // finish() drops landmarks beyond the limit.
    const Eigen::Vector3d position = vector3(fields, kPositionNames);
    landmark_lines_.add(landmarks.ids.size(), line_);
    landmarks.ids.push_back(id);
    landmarks.positions.push_back(position);
    read_covariance(fields);
    read_observations(fields);
  }

  void read_covariance(NumberedFields& fields) {
    auto& covariances = tables_.landmarks.covariances;
    if (version_ >= 2 && fields.take_unknown()) {
      covariances.emplace_back(Eigen::Matrix3d::Constant(kUnknownValue));
      return;
    }
    constexpr std::array<const char*, 9> kNames = {"c00", "c01", "c02", "c10", "c11",
                                                   "c12", "c20", "c21", "c22"};
    Eigen::Matrix3d covariance;
    for (int i = 0; i < 9; ++i) {
      covariance(i / 3, i % 3) = fields.number(kNames[static_cast<std::size_t>(i)]);
    }
    covariances.push_back(covariance);
  }

  void read_observations(NumberedFields& fields) {
    ObservationTable& observations = tables_.observations;
    const bool unknown = version_ >= 2 && fields.take_unknown();
    if (tables_.landmarks.ids.size() == 1) observations_unknown_ = unknown;
    if (unknown != observations_unknown_) {
      fields.refuse_line("some observation counts are '-' and some are not",
                         "all of them or none, as for the first landmark");
    }
    if (unknown) return;
    const std::uint64_t count = fields.unsigned_integer("n");
    std::uint64_t found = 0;
    for (; found < count && !fields.at_end(); ++found) {
      const FrameId id{fields.unsigned_integer("observing frame")};
      observations.frames.push_back(frame(id, fields));
      const double u = fields.coordinate("u");
      const double v = fields.coordinate("v");
      observations.pixels.push_back({u, v});
    }
    if (found < count) {
      fields.refuse_line(fmt::format("the record ends after {} of {} observations", found, count),
                         "frame_id u v for each observation");
    }
    if (!fields.at_end()) {
      fields.refuse_line(fmt::format("more than the {} observations that were announced", count),
                         "the record to end after them");
    }
    observations.offsets.push_back(observations.frames.size());
  }

  FrameIndex frame(FrameId id, const NumberedFields& fields) {
    // Consecutive observations often name neighbouring frames, stored in order.
    const auto found = frame_index_.find(id);
    if (found == frame_index_.end()) {
      fields.refuse(fmt::format("frame {} is unknown", id.value), "the id of a FRAME record above");
    }
    return found->second;
  }

  // ---- versions 2 and 3

  bool read_extra(std::string_view record, NumberedFields& fields) {
    if (record == "META") {
      read_meta(fields);
    } else if (record == "CAMERA") {
      read_camera(fields);
    } else if (record == "DESCRIPTORS") {
      read_descriptor_kind(fields);
    } else if (record == "COLUMN") {
      read_column(fields);
    } else if (record == "TIME" || record == "VIEW" || record == "IMAGE" || record == "GNSS") {
      read_frame_extra(record, fields);
    } else if (record == "POSE_COVARIANCE" && version_ >= 3) {
      read_pose_covariance(fields);
    } else if (record == "RIG" && version_ >= 3) {
      read_mount(fields);
    } else if (record == "INSTANT" && version_ >= 3) {
      read_frame_extra(record, fields);
    } else if (record == "COLOR" || record == "DESCRIPTOR" || record == "VALUE" ||
               record == "DETAIL" || record == "MEASURED") {
      read_landmark_extra(record, fields);
    } else {
      return false;
    }
    return true;
  }

  // For the message of a later check.
  void note_line(MapColumn column, std::size_t row = 0) { lines_[{column, row}] = line_; }

  static void refuse_second(bool is_second, const NumberedFields& fields) {
    if (is_second) fields.refuse_line("the same is said above already", "it once");
  }

  void read_meta(NumberedFields& fields) {
    MapInfo& info = tables_.info;
    const std::string_view key = fields.word("key");
    if (key == "length_unit") {
      refuse_second(length_unit_known_, fields);
      length_unit_known_ = true;
      const std::string_view unit = fields.word("length_unit");
      if (unit != "metres" && unit != "free") {
        fields.refuse(printable(unit) + " is no unit of length", "metres or free");
      }
      info.length_unit = unit == "metres" ? LengthUnit::kMetres : LengthUnit::kFree;
    } else if (key == "world_frame") {
      refuse_second(info.world_frame.has_value(), fields);
      info.world_frame = unescaped(fields.rest("world_frame"), fields);
    } else if (key == "gravity") {
      refuse_second(info.gravity.has_value(), fields);
      info.gravity = vector3(fields, kPositionNames);
      note_line(MapColumn::kGravity);
    } else if (key == "georeference") {
      refuse_second(info.georeference.has_value(), fields);
      info.georeference = georeference(fields);
      note_line(MapColumn::kGeoReference);
    } else if (key == "control_point") {
      note_line(MapColumn::kControlPoints, info.control_points.size());
      info.control_points.push_back(control_point(fields));
    } else if (key == "control_view") {
      if (info.control_points.empty()) {
        fields.refuse_line("no control point stands above", "META control_point before it");
      }
      const double u = fields.number("u");
      const double v = fields.number("v");
      info.control_points.back().views.push_back(
          {unescaped(fields.rest("image"), fields), Pixel{u, v}});
    } else if (key == "uuid") {
      refuse_second(info.uuid.has_value(), fields);
      info.uuid = unescaped(fields.rest("uuid"), fields);
    } else if (key == "provenance") {
      info.provenance.push_back(unescaped(fields.rest("provenance"), fields));
    } else {
      fields.refuse(printable(key) + " is no key",
                    "length_unit, world_frame, gravity, georeference, control_point, control_view, "
                    "uuid or provenance");
    }
  }

  static GeodeticPosition geodetic(NumberedFields& fields) {
    const auto [latitude, longitude, altitude] =
        numbers<3>(fields, {"latitude", "longitude", "altitude"});
    return {latitude, longitude, altitude};
  }

  static GeoReference georeference(NumberedFields& fields) {
    GeoReference result;
    result.origin = geodetic(fields);
    result.scale = fields.number("scale");
    result.quaternion = numbers(fields, kRotationNames);
    result.translation = vector3(fields, kTranslationNames);
    return result;
  }

  static ControlPoint control_point(NumberedFields& fields) {
    ControlPoint point;
    point.latitude_deg = fields.number("latitude");
    point.longitude_deg = fields.number("longitude");
    if (!fields.take_unknown()) point.altitude_m = fields.number("altitude");
    point.name = unescaped(fields.rest("name"), fields);
    return point;
  }

  void read_camera(NumberedFields& fields) {
    Camera camera;
    camera.id = CameraId{fields.unsigned_integer("id")};
    if (camera_index_.contains(camera.id)) {
      fields.refuse(fmt::format("camera {} stands above already", camera.id.value), "distinct ids");
    }
    camera.model = std::string(fields.word("model"));
    camera.width = fields.integer<std::uint32_t>("width", "an unsigned integer of 32 bits");
    camera.height = fields.integer<std::uint32_t>("height", "an unsigned integer of 32 bits");
    while (!fields.at_end()) camera.parameters.push_back(fields.number("parameter"));
    const std::string defect = camera_defect(camera);
    if (!defect.empty()) fields.refuse_line(defect, "a usable camera");
    camera_index_.emplace(camera.id,
                          CameraIndex{static_cast<std::uint32_t>(tables_.cameras.size())});
    tables_.cameras.push_back(std::move(camera));
  }

  CameraIndex camera(NumberedFields& fields) const {
    const CameraId id{fields.unsigned_integer("camera")};
    const auto found = camera_index_.find(id);
    if (found == camera_index_.end()) {
      fields.refuse(fmt::format("camera {} is unknown", id.value),
                    "the id of a CAMERA record above");
    }
    return found->second;
  }

  // Records of one rig follow each other.
  void read_mount(NumberedFields& fields) {
    const RigId id{fields.unsigned_integer("rig")};
    std::vector<Rig>& rigs = tables_.rigs;
    if (rigs.empty() || rigs.back().id != id) rigs.push_back({id, {}});
    Rig::Mount& mount = rigs.back().mounts.emplace_back();
    mount.camera = camera(fields);
    mount.quaternion = numbers(fields, kRotationNames);
    mount.translation = vector3(fields, kTranslationNames);
    note_line(MapColumn::kRigs, rigs.size() - 1);
  }

  static std::string name(NumberedFields& fields, const char* field) {
    const std::string_view text = fields.word(field);
    if (!is_visible(text)) fields.refuse(printable(text) + " is not a name", "visible ASCII");
    return std::string(text);
  }

  void read_descriptor_kind(NumberedFields& fields) {
    auto& descriptors = tables_.landmarks.descriptors;
    refuse_second(descriptors.has_value(), fields);
    descriptors.emplace();
    descriptors->kind = name(fields, "kind");
    descriptors->bytes_each = fields.integer<std::uint32_t>("bytes", "an unsigned integer");
    if (descriptors->bytes_each == 0 || descriptors->bytes_each > kMostDescriptorBytes) {
      fields.refuse(fmt::format("{} bytes", descriptors->bytes_each),
                    fmt::format("1 to {}", kMostDescriptorBytes));
    }
  }

  void read_column(NumberedFields& fields) {
    std::string column = name(fields, "name");
    refuse_second(find_column(column) != nullptr, fields);
    if (tables_.landmarks.columns.size() == kMostNamedColumns) {
      fields.refuse_line("too many columns", fmt::format("at most {}", kMostNamedColumns));
    }
    tables_.landmarks.columns.push_back({std::move(column), {}});
  }

  NamedColumn* find_column(std::string_view name) {
    auto& columns = tables_.landmarks.columns;
    const auto found = std::find_if(columns.begin(), columns.end(),
                                    [&](const NamedColumn& column) { return column.name == name; });
    return found == columns.end() ? nullptr : &*found;
  }

  void read_pose_covariance(NumberedFields& fields) {
    FrameTable& frames = tables_.frames;
    const std::size_t row = frame(FrameId{fields.unsigned_integer("frame")}, fields).value;
    frames.pose_covariances.resize(frames.ids.size());
    refuse_second(frames.pose_covariances.known()[row] != 0, fields);
    Matrix6d covariance = Matrix6d::Zero();
    for (int i = 0; i < 6; ++i) {
      for (int k = i; k < 6; ++k) covariance(i, k) = covariance(k, i) = fields.number("covariance");
    }
    frames.pose_covariances.set(row, covariance);
    note_line(MapColumn::kPoseCovariances, row);
  }

  void read_frame_extra(std::string_view record, NumberedFields& fields) {
    FrameTable& frames = tables_.frames;
    const std::size_t row = frame(FrameId{fields.unsigned_integer("frame")}, fields).value;
    const std::size_t count = frames.ids.size();
    if (record == "TIME") {
      frames.timestamps_s.resize(count);
      refuse_second(frames.timestamps_s[row].has_value(), fields);
      frames.timestamps_s[row] = fields.number("seconds");
    } else if (record == "VIEW") {
      frames.cameras.resize(count);
      refuse_second(frames.cameras[row].has_value(), fields);
      frames.cameras[row] = camera(fields);
    } else if (record == "INSTANT") {
      frames.instants.resize(count);
      refuse_second(frames.instants[row].has_value(), fields);
      frames.instants[row] =
          InstantId{fields.integer<std::uint32_t>("instant", "an unsigned integer of 32 bits")};
      note_line(MapColumn::kInstants, row);
    } else if (record == "GNSS") {
      frames.gnss.resize(count);
      refuse_second(frames.gnss[row].has_value(), fields);
      GnssFix fix{geodetic(fields), std::nullopt};
      if (!fields.take_unknown()) fix.accuracy_m = fields.number("accuracy");
      frames.gnss[row] = fix;
      note_line(MapColumn::kGnss, row);
    } else {
      frames.image_names.resize(count);
      refuse_second(!frames.image_names[row].empty(), fields);
      frames.image_names[row] = unescaped(fields.rest("image"), fields);
    }
  }

  void read_landmark_extra(std::string_view record, NumberedFields& fields) {
    LandmarkTable& landmarks = tables_.landmarks;
    const LandmarkId id{fields.unsigned_integer("landmark")};
    if (landmarks.ids.empty() || landmarks.ids.back() != id) {
      fields.refuse(fmt::format("landmark {} is not the one directly above", id.value),
                    "the id of the LANDMARK record above");
    }
    const std::size_t row = landmarks.ids.size() - 1;
    if (record == "COLOR") {
      landmarks.colors.resize(row + 1);
      refuse_second(landmarks.colors[row].has_value(), fields);
      const auto red = color_value(fields, "red");
      const auto green = color_value(fields, "green");
      const auto blue = color_value(fields, "blue");
      landmarks.colors[row] = Color{red, green, blue};
    } else if (record == "DESCRIPTOR") {
      read_descriptor(row, fields);
    } else if (record == "VALUE") {
      const std::string_view name = fields.word("column");
      NamedColumn* const column = find_column(name);
      if (column == nullptr) {
        fields.refuse(printable(name) + " is no column", "the name of a COLUMN record above");
      }
      require_budget(line_);
      column->values.resize(row + 1, kUnknownValue);
      refuse_second(!std::isnan(column->values[row]), fields);
      column->values.set(row, fields.number("value"));
    } else if (record == "MEASURED") {
      read_measured(fields);
    } else {
      read_detail(fields);
    }
  }

  static std::uint8_t color_value(NumberedFields& fields, const char* name) {
    return fields.integer<std::uint8_t>(name, "an integer from 0 to 255");
  }

  void read_descriptor(std::size_t row, NumberedFields& fields) {
    auto& descriptors = tables_.landmarks.descriptors;
    if (!descriptors) fields.refuse_line("no DESCRIPTORS record stands above", "one");
    require_budget(line_);
    descriptors->known.resize(row + 1);
    descriptors->bytes.resize((row + 1) * descriptors->bytes_each);
    const bool is_further = descriptors->known[row] != 0;
    refuse_second(is_further && version_ < 3, fields);
    const std::string_view hex = fields.word("descriptor");
    if (hex.size() != 2 * descriptors->bytes_each) {
      fields.refuse(fmt::format("{} hexadecimal digits", hex.size()),
                    fmt::format("{}, two a byte", 2 * descriptors->bytes_each));
    }
    std::uint8_t* const bytes = is_further
                                    ? room_for_further(row, fields)
                                    : descriptors->bytes.data() + row * descriptors->bytes_each;
    for (std::size_t i = 0; i < descriptors->bytes_each; ++i) {
      const int high = detail::hex_value(hex[2 * i]);
      const int low = detail::hex_value(hex[2 * i + 1]);
      if (high < 0 || low < 0) fields.refuse("not hexadecimal", "digits 0-9 and a-f");
      bytes[i] = static_cast<std::uint8_t>(high * 16 + low);
    }
    descriptors->known[row] = 1;
  }

  // For one more descriptor of the last landmark. Until the end, there are offsets only up to this landmark.
  std::uint8_t* room_for_further(std::size_t row, const NumberedFields& fields) {
    DescriptorColumn& descriptors = *tables_.landmarks.descriptors;
    const std::size_t rows = descriptors.further.size() / descriptors.bytes_each;
    descriptors.further_offsets.resize(row + 1, rows);
    if (rows - descriptors.further_offsets[row] + 1 >= kMostDescriptorsEach) {
      fields.refuse_line("too many descriptors of one landmark",
                         fmt::format("at most {}", kMostDescriptorsEach));
    }
    descriptors.further.resize(descriptors.further.size() + descriptors.bytes_each);
    return descriptors.further.data() + rows * descriptors.bytes_each;
  }

  // Of the last landmark, once for each kind of record.
  // @param landmarks number of landmarks read before the last record of the kind
  std::pair<std::size_t, std::size_t> last_observations(std::size_t& landmarks,
                                                        const NumberedFields& fields) const {
    refuse_second(landmarks == tables_.landmarks.ids.size(), fields);
    landmarks = tables_.landmarks.ids.size();
    const std::size_t end = tables_.observations.frames.size();
    return {observations_unknown_ ? end : tables_.observations.offsets.end()[-2], end};
  }

  void read_detail(NumberedFields& fields) {
    ObservationTable& observations = tables_.observations;
    const auto [begin, end] = last_observations(detailed_, fields);
    observations.keypoints.resize(end);
    observations.depths.resize(end);
    observations.octaves.resize(end);
    for (std::size_t i = begin; i < end; ++i) {
      if (!fields.take_unknown()) {
        observations.keypoints[i] =
            fields.integer<std::uint32_t>("keypoint", "an unsigned integer of 32 bits, or -");
      }
      if (!fields.take_unknown()) observations.depths[i] = fields.coordinate("depth");
      if (!fields.take_unknown()) {
        observations.octaves[i] = fields.integer<std::int32_t>("octave", "an integer, or -");
      }
    }
  }

  void read_measured(NumberedFields& fields) {
    ObservationTable& observations = tables_.observations;
    const auto [begin, end] = last_observations(measured_, fields);
    observations.sources.resize(end);
    observations.sigmas_px.resize(end);
    for (std::size_t i = begin; i < end; ++i) {
      if (!fields.take_unknown()) observations.sources[i] = source_of(fields);
      if (fields.take_unknown()) continue;
      const double sigma = fields.number("sigma");
      if (!(sigma > 0.0 && sigma <= kLargestCoordinate)) {
        fields.refuse(fmt::format("{}", sigma), "a positive number of pixels, at most 1e9, or -");
      }
      observations.sigmas_px[i] = sigma;
    }
  }

  static PixelSource source_of(NumberedFields& fields) {
    const std::string_view word = fields.word("source");
    for (std::size_t i = 0; i < kPixelSourceCount; ++i) {
      if (const auto source = static_cast<PixelSource>(i); word == to_string(source)) return source;
    }
    fields.refuse(printable(word) + " is no way to measure a pixel",
                  "corner, patch, reference or -");
  }

  // Bytes of the descriptors and named columns of all landmarks so far.
  std::uint64_t room_of_columns() const {
    const LandmarkTable& landmarks = tables_.landmarks;
    const auto& descriptors = landmarks.descriptors;
    std::uint64_t each = sizeof(double) * landmarks.columns.size();
    if (descriptors) each += descriptors->bytes_each;
    if (descriptors && descriptors->has_further()) each += sizeof(std::uint64_t);
    return landmarks.ids.size() * each;
  }

  // @param line that asks for more; 0 at the end
  void require_budget(std::uint64_t line) const {
    if (room_of_columns() <= detail::memory_budget(bytes_read_)) return;
    throw Error(ErrorKind::kInput,
                line > 0 ? fmt::format("{}:{}", source_.name(), line) : source_.name(),
                fmt::format("descriptors and columns of {} landmarks take {} bytes",
                            tables_.landmarks.ids.size(), room_of_columns()),
                "at most 32 times the bytes of the file and 64 MiB");
  }

  LandmarkMap finish() {
    require_budget(0);
    FrameTable& frames = tables_.frames;
    LandmarkTable& landmarks = tables_.landmarks;
    ObservationTable& observations = tables_.observations;
    const auto fill = [](std::size_t rows, auto&... columns) {
      ((columns.empty() ? void() : columns.resize(rows)), ...);
    };
    fill(frames.ids.size(), frames.cameras, frames.timestamps_s, frames.image_names, frames.gnss,
         frames.pose_covariances, frames.instants);
    fill(landmarks.ids.size(), landmarks.colors);
    fill(observations.frames.size(), observations.keypoints, observations.depths,
         observations.octaves, observations.sources, observations.sigmas_px);
    for (NamedColumn& column : landmarks.columns)
      column.values.resize(landmarks.ids.size(), kUnknownValue);
    if (auto& descriptors = landmarks.descriptors) {
      descriptors->known.resize(landmarks.ids.size());
      descriptors->bytes.resize(landmarks.ids.size() * descriptors->bytes_each);
      if (descriptors->has_further()) {
        descriptors->further_offsets.resize(landmarks.ids.size() + 1,
                                            descriptors->further.size() / descriptors->bytes_each);
      }
    }
    if (observations_unknown_) observations.offsets = {};
    const std::size_t count = landmarks.ids.size();
    far_landmarks_ = drop_far_landmarks(tables_);
    if (!far_landmarks_.empty()) {
      detail::log_remark(execution_.log, source_.name(),
                         detail::far_landmarks_text(far_landmarks_.size(), count),
                         RemarkKind::kLoss);
    }
    return LandmarkMap(std::move(tables_),
                       [this](MapColumn column, std::size_t row) { return place_of(column, row); });
  }

  std::uint64_t line_of_landmark(std::uint64_t row) const {
    for (const std::uint32_t far : far_landmarks_) row += far <= row ? 1 : 0;
    return landmark_lines_.line_of(row);
  }

  // Place of a row, for the checks that LandmarkMap makes.
  std::string place_of(MapColumn column, std::size_t row) const {
    switch (column) {
      case MapColumn::kGravity:
        return fmt::format("{}:{}: fields 3-5 (x y z)", source_.name(), lines_.at({column, row}));
      case MapColumn::kGeoReference:
      case MapColumn::kControlPoints:
      case MapColumn::kGnss:
      case MapColumn::kPoseCovariances:
      case MapColumn::kRigs:
      case MapColumn::kInstants:
        return fmt::format("{}:{}", source_.name(), lines_.at({column, row}));
      case MapColumn::kQuaternions:
        return fmt::format("{}:{}: fields 6-9 (qw qx qy qz)", source_.name(),
                           frame_lines_.line_of(row));
      case MapColumn::kLandmarkIds:
        return fmt::format("{}:{}: field 2 (id)", source_.name(), line_of_landmark(row));
      case MapColumn::kCovariances:
        return fmt::format("{}:{}: fields 6-14 (c00 ... c22)", source_.name(),
                           line_of_landmark(row));
      default:
        return source_.name();
    }
  }

  ByteSource& source_;
  const Execution& execution_;
  MapTables tables_;
  int version_ = 0;  // 0: no record seen yet
  std::uint64_t line_ = 0;
  std::uint64_t bytes_read_ = 0;
  bool length_unit_known_ = false;
  bool observations_unknown_ = false;
  std::size_t detailed_ = 0;  // number of landmarks read before the last DETAIL
  std::size_t measured_ = 0;  // the same for MEASURED
  std::map<std::pair<MapColumn, std::size_t>, std::uint64_t> lines_;  // of rows of rare columns
  RowLines frame_lines_;
  RowLines landmark_lines_;
  std::vector<std::uint32_t> far_landmarks_;  // rows that were dropped, ascending
  std::unordered_map<FrameId, FrameIndex> frame_index_;
  std::unordered_map<CameraId, CameraIndex> camera_index_;
};

}  // namespace

LandmarkMap read_native(ByteSource& source, const Execution& execution) {
  return NativeReader(source, execution).read();
}

}  // namespace cairn
