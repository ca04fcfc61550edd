// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "cairn/core/detail/memory.hpp"
#include "cairn/core/error.hpp"
#include "cairn/core/hash.hpp"
#include "cairn/formats/detail/own/binary_layout.hpp"
#include "cairn/formats/own_formats.hpp"

namespace cairn::detail {
namespace {

struct Section {
  std::string_view bytes;
  std::uint64_t begin = 0;  // in the file
};

template <class Number>
Number load(const char* bytes) {
  Number value;
  std::memcpy(&value, bytes, sizeof value);
  return value;
}

class BinaryReader {
 public:
  BinaryReader(std::string_view bytes, const std::string& source, const MapReadOptions& options)
      : bytes_(bytes), source_(source), options_(options) {}

  LandmarkMap read() {
    read_header();
    check_checksum();
    read_table();
    read_info();
    read_cameras();
    read_frames();
    read_landmarks();
    read_observations();
    return LandmarkMap(std::move(tables_),
                       [this](MapColumn column, std::size_t row) { return place_of(column, row); });
  }

 private:
  // Reads entries of varying size from a section, in order.
  class Cursor {
   public:
    Cursor(const BinaryReader& reader, MapColumn column)
        : reader_(reader), column_(column), rest_(reader.section(column).bytes) {}

    bool at_end() const { return rest_.empty(); }

    std::string_view take(std::uint64_t size, std::string_view what) {
      if (size > rest_.size()) {
        const Section& section = reader_.section(column_);
        reader_.refuse(section.begin + section.bytes.size() - rest_.size(), column_,
                       fmt::format("{}: the section ends after {} bytes", what, rest_.size()),
                       fmt::format("{} bytes", size));
      }
      const std::string_view bytes = rest_.substr(0, size);
      rest_.remove_prefix(size);
      return bytes;
    }

    template <class Number>
    Number number(std::string_view what) {
      return load<Number>(take(sizeof(Number), what).data());
    }

    std::string_view rest() { return std::exchange(rest_, {}); }

    std::string text(std::string_view what) {
      return std::string(take(number<std::uint32_t>(what), what));
    }

   private:
    const BinaryReader& reader_;
    MapColumn column_;
    std::string_view rest_;
  };

  [[noreturn]] void refuse(std::uint64_t byte, std::string_view field, std::string_view what,
                           std::string_view expected) const {
    throw Error(ErrorKind::kInput, fmt::format("{}: byte {}: {}", source_, byte, field), what,
                expected);
  }
  [[noreturn]] void refuse(std::uint64_t byte, MapColumn column, std::string_view what,
                           std::string_view expected) const {
    refuse(byte, kLayouts[index_of(column)].name, what, expected);
  }

  // Place of an entry in the file; of its section if entries vary in size.
  std::string place_of(MapColumn column, std::size_t row) const {
    const Layout& layout = kLayouts[index_of(column)];
    const std::uint64_t bytes_each =
        column == MapColumn::kColumnValues ? sizeof(double) : layout.bytes_each;
    return fmt::format("{}: byte {}: {}", source_, section(column).begin + row * bytes_each,
                       layout.name);
  }

  // ---- the frame of the file

  template <class Number>
  Number at(std::uint64_t byte) const {
    return load<Number>(bytes_.data() + byte);
  }

  std::uint64_t checksum_place() const { return bytes_.size() - kChecksumSize; }

  void read_header() {
    if (!bytes_.starts_with(kBinaryMagic)) {
      refuse(0, "magic", printable(bytes_.substr(0, kBinaryMagic.size())), printable(kBinaryMagic));
    }
    constexpr std::uint64_t kSmallest = kHeaderSize + kChecksumSize;
    if (bytes_.size() < kSmallest) {
      refuse(bytes_.size(), "size", fmt::format("the file ends after {} bytes", bytes_.size()),
             fmt::format("at least {}", kSmallest));
    }
    if (const auto version = at<std::uint32_t>(kVersionPlace); version != kBinaryVersion) {
      refuse(kVersionPlace, "version", fmt::format("format version {}", version),
             std::to_string(kBinaryVersion));
    }
    if (const auto size = at<std::uint64_t>(kSizePlace); size != bytes_.size()) {
      refuse(kSizePlace, "size",
             size > bytes_.size() ? fmt::format("the file ends after {} bytes", bytes_.size())
                                  : fmt::format("the file goes on to byte {}", bytes_.size()),
             fmt::format("{} bytes, as it states", size));
    }
  }

  void check_checksum() {
    Hasher hasher;
    for (std::uint64_t byte = 0; byte < checksum_place(); byte += kBinaryBlock) {
      hasher.update(
          bytes_.substr(byte, std::min<std::uint64_t>(kBinaryBlock, checksum_place() - byte)));
      report(0.5 * static_cast<double>(byte) / static_cast<double>(bytes_.size()));
    }
    const Hash128 stored{at<std::uint64_t>(checksum_place()),
                         at<std::uint64_t>(checksum_place() + 8)};
    if (const Hash128 found = hasher.digest(); stored != found) {
      refuse(checksum_place(), "checksum",
             fmt::format("the bytes before are damaged: their XXH3 is {}", to_string(found)),
             to_string(stored));
    }
  }

  void report(double share) const {
    if (options_.stop.stop_requested()) {
      throw Error(ErrorKind::kCancelled, source_, "reading was cancelled", "");
    }
    if (options_.progress) options_.progress(share);
  }

  void read_table() {
    // The least size of an entry bounds the number of entries.
    const auto count_at = [&](std::uint64_t byte, std::string_view what, std::uint64_t bytes_each) {
      const auto count = at<std::uint64_t>(byte);
      const std::uint64_t most = std::min<std::uint64_t>(std::numeric_limits<std::uint32_t>::max(),
                                                         bytes_.size() / bytes_each);
      if (count > most) {
        refuse(byte, what, fmt::format("{} {}", count, what),
               fmt::format("at most {} in a file of {} bytes", most, bytes_.size()));
      }
      return count;
    };
    frames_ = count_at(kFramesPlace, "frames", 8 + 24 + 32);
    landmarks_ = count_at(kLandmarksPlace, "landmarks", 8 + 24);
    observations_ = count_at(kObservationsPlace, "observations", 4 + 16);
    const std::uint64_t count = count_at(kSectionsPlace, "sections", kTableEntrySize);
    std::uint64_t end = kHeaderSize + count * kTableEntrySize;
    if (end > checksum_place()) {
      refuse(kSectionsPlace, "sections",
             fmt::format("the table of {} sections ends at byte {}", count, end),
             fmt::format("an end before the checksum at {}", checksum_place()));
    }
    std::uint64_t last = 0;
    for (std::uint64_t i = 0; i < count; ++i) {
      read_table_entry(kHeaderSize + i * kTableEntrySize, last, end);
    }
    expect_padding(end);
    if (aligned(end) != checksum_place()) {
      refuse(end, "sections", "bytes that belong to no section",
             fmt::format("the checksum at byte {}", aligned(end)));
    }
  }

  // `last`: the section before; `end`: where it ends.
  void read_table_entry(std::uint64_t byte, std::uint64_t& last, std::uint64_t& end) {
    const auto number = at<std::uint64_t>(byte);
    const auto begin = at<std::uint64_t>(byte + 8);
    const auto size = at<std::uint64_t>(byte + 16);
    if (number == 0 || number > kLayouts.size()) {
      refuse(byte, "section", fmt::format("{} is no section", number),
             fmt::format("1 to {}", kLayouts.size()));
    }
    const Layout& layout = kLayouts[number - 1];
    if (number <= last) {
      refuse(byte, "section",
             fmt::format("{} ({}) {}", number, layout.name,
                         number == last ? "occurs twice" : fmt::format("stands below {}", last)),
             "each at most once, in the order of their numbers");
    }
    expect_padding(end);
    if (begin != aligned(end)) {
      refuse(byte + 8, layout.name, fmt::format("begins at byte {}", begin),
             fmt::format("byte {}", aligned(end)));
    }
    if (size == 0 || begin > checksum_place() || size > checksum_place() - begin) {
      refuse(byte + 16, layout.name, fmt::format("{} bytes", size),
             fmt::format("1 to {}, before the checksum",
                         checksum_place() - std::min(begin, checksum_place())));
    }
    if (layout.bytes_each > 0) expect_size(byte + 16, layout, size, layout.bytes_each);
    sections_[number - 1] = {bytes_.substr(begin, size), begin};
    last = number;
    end = begin + size;
  }

  // Up to the next multiple of the alignment.
  void expect_padding(std::uint64_t begin) const {
    for (std::uint64_t byte = begin; byte < std::min(aligned(begin), bytes_.size()); ++byte) {
      if (bytes_[byte] != 0) refuse(byte, "padding", printable(bytes_.substr(byte, 1)), "zero");
    }
  }

  std::uint64_t rows(Per per) const {
    switch (per) {
      case Per::kFile:
        return 1;
      case Per::kFrame:
        return frames_;
      case Per::kLandmark:
        return landmarks_;
      case Per::kOffset:
        return landmarks_ + 1;
      case Per::kObservation:
        return observations_;
    }
    return 0;
  }

  // Cannot overflow: a file has fewer than 2^32 rows, and their sizes are small.
  void expect_size(std::uint64_t byte, const Layout& layout, std::uint64_t size,
                   std::uint64_t bytes_each) const {
    if (size == rows(layout.per) * bytes_each) return;
    refuse(byte, layout.name, fmt::format("{} bytes", size),
           fmt::format("{}: {} times {}", rows(layout.per) * bytes_each, rows(layout.per),
                       bytes_each));
  }

  // ---- sections

  const Section& section(MapColumn column) const { return sections_[index_of(column)]; }

  bool has(MapColumn column) const { return !section(column).bytes.empty(); }

  // Checks that a section has this size; if it is 0, that the section is absent.
  void expect_section(MapColumn column, std::uint64_t bytes_each) const {
    const Layout& layout = kLayouts[index_of(column)];
    const Section& found = section(column);
    expect_size(has(column) ? found.begin : kSectionsPlace, layout, found.bytes.size(), bytes_each);
  }

  void refuse_if_unknown(bool nothing_known, MapColumn column) const {
    if (nothing_known) {
      refuse(section(column).begin, column, "nothing is known in it", "the section left out");
    }
  }

  // For columns with the same layout in the file and in memory.
  template <class Row>
  void copy(MapColumn column, std::vector<Row>& rows) const {
    const std::string_view bytes = section(column).bytes;
    reserve_populated(rows, bytes.size() / sizeof(Row));
    rows.resize(bytes.size() / sizeof(Row));
    if (!bytes.empty()) std::memcpy(static_cast<void*>(rows.data()), bytes.data(), bytes.size());
    report(0.5 +
           0.5 * static_cast<double>(section(column).begin) / static_cast<double>(bytes_.size()));
  }

  template <class Row>
  void copy_required(MapColumn column, std::vector<Row>& rows) const {
    expect_section(column, sizeof(Row));
    copy(column, rows);
  }

  // Checks that a NaN in a column of doubles is the one that means unknown.
  void expect_unknown(MapColumn column, std::size_t row, double value) const {
    const auto bits = std::bit_cast<std::uint64_t>(value);
    if (bits == kUnknownBits) return;
    refuse(section(column).begin + row * sizeof(double), column,
           fmt::format("{} of the bits {:016x}", value, bits),
           fmt::format("{:016x} where unknown, else a number", kUnknownBits));
  }

  // Reads a column of this many bytes per entry; `value_of` may return std::nullopt.
  template <std::size_t kBytes = 8, class Value, class ValueOf>
  void read_optional(MapColumn column, OptionalColumn<Value>& values,
                     const ValueOf& value_of) const {
    const std::string_view bytes = section(column).bytes;
    values.reserve(bytes.size() / kBytes);
    bool nothing_known = has(column);
    for (std::size_t byte = 0; byte < bytes.size(); byte += kBytes) {
      const std::optional<Value> value = value_of(bytes.data() + byte, byte / kBytes);
      values.push_back(value);
      nothing_known = nothing_known && !value;
    }
    refuse_if_unknown(nothing_known, column);
  }

  // Whether an entry of doubles is unknown: they are all NaN.
  template <std::size_t kNumbers>
  bool is_unknown(MapColumn column, std::size_t row, const double* numbers) const {
    if (!std::isnan(numbers[0])) return false;
    for (std::size_t i = 0; i < kNumbers; ++i) {
      expect_unknown(column, kNumbers * row + i, numbers[i]);
    }
    return true;
  }

  void read_numbers(MapColumn column, OptionalColumn<double>& values) const {
    read_optional(column, values, [&](const char* bytes, std::size_t row) {
      const auto value = load<double>(bytes);
      const bool unknown = is_unknown<1>(column, row, &value);
      return unknown ? std::nullopt : std::optional(value);
    });
  }

  template <class Integer, class Value>
  void read_integers(MapColumn column, OptionalColumn<Value>& values) const {
    read_optional(column, values, [&](const char* bytes, std::size_t row) {
      const auto value = load<std::int64_t>(bytes);
      if (value == kUnknownInteger) return std::optional<Value>();
      if (!std::in_range<Integer>(value)) {
        refuse(section(column).begin + 8 * row, column, std::to_string(value),
               fmt::format("{} to {}, or {} where unknown", std::numeric_limits<Integer>::min(),
                           std::numeric_limits<Integer>::max(), kUnknownInteger));
      }
      return std::optional(Value{static_cast<Integer>(value)});
    });
  }

  void read_sources(OptionalColumn<PixelSource>& sources) const {
    constexpr auto kColumn = MapColumn::kPixelSources;
    read_optional(kColumn, sources, [&](const char* bytes, std::size_t row) {
      const auto value = load<std::int64_t>(bytes);
      if (value == kUnknownInteger) return std::optional<PixelSource>();
      if (value < 0 || value >= static_cast<std::int64_t>(kPixelSourceCount)) {
        refuse(section(kColumn).begin + 8 * row, kColumn, std::to_string(value),
               fmt::format("0 to {}, or {} where unknown", kPixelSourceCount - 1, kUnknownInteger));
      }
      return std::optional(static_cast<PixelSource>(value));
    });
  }

  void read_info() {
    MapInfo& info = tables_.info;
    const auto unit = at<std::uint32_t>(kUnitPlace);
    if (unit > 1)
      refuse(kUnitPlace, "unit of length", std::to_string(unit), "0 (metres) or 1 (free)");
    info.length_unit = unit == 0 ? LengthUnit::kMetres : LengthUnit::kFree;
    const auto text = [&](MapColumn column, std::optional<std::string>& value) {
      if (has(column)) value = section(column).bytes;
    };
    text(MapColumn::kWorldFrame, info.world_frame);
    text(MapColumn::kUuid, info.uuid);
    if (has(MapColumn::kGravity)) {
      std::memcpy(info.gravity.emplace().data(), section(MapColumn::kGravity).bytes.data(), 24);
    }
    if (has(MapColumn::kGeoReference)) read_georeference();
    read_control_points();
    for (Cursor texts(*this, MapColumn::kProvenance); !texts.at_end();) {
      info.provenance.push_back(texts.text("a text"));
      if (info.provenance.back().empty()) {
        refuse(section(MapColumn::kProvenance).begin, MapColumn::kProvenance, "an empty text",
               "none");
      }
    }
  }

  static GeodeticPosition geodetic(const char* bytes) {
    return {load<double>(bytes), load<double>(bytes + 8), load<double>(bytes + 16)};
  }

  void read_georeference() {
    const char* const bytes = section(MapColumn::kGeoReference).bytes.data();
    GeoReference& result = tables_.info.georeference.emplace();
    result.origin = geodetic(bytes);
    result.scale = load<double>(bytes + 24);
    std::memcpy(result.quaternion.data(), bytes + 32, sizeof result.quaternion);
    std::memcpy(result.translation.data(), bytes + 64, 24);
  }

  void read_control_points() {
    for (Cursor bytes(*this, MapColumn::kControlPoints); !bytes.at_end();) {
      ControlPoint& point = tables_.info.control_points.emplace_back();
      point.latitude_deg = bytes.number<double>("latitude");
      point.longitude_deg = bytes.number<double>("longitude");
      const auto altitude = bytes.number<std::uint64_t>("altitude");
      if (altitude != kUnknownBits) point.altitude_m = std::bit_cast<double>(altitude);
      point.name = bytes.text("name");
      for (auto views = bytes.number<std::uint32_t>("number of images"); views > 0; --views) {
        const auto u = bytes.number<double>("u");
        const auto v = bytes.number<double>("v");
        point.views.push_back({bytes.text("image"), Pixel{u, v}});
      }
    }
  }

  void read_gnss() {
    constexpr MapColumn kColumn = MapColumn::kGnss;
    constexpr std::size_t kNumbers = 4;
    read_optional<kNumbers * sizeof(double)>(
        kColumn, tables_.frames.gnss, [&](const char* bytes, std::size_t row) {
          const auto numbers = load<std::array<double, kNumbers>>(bytes);
          if (is_unknown<kNumbers>(kColumn, row, numbers.data())) return std::optional<GnssFix>();
          GnssFix fix{{numbers[0], numbers[1], numbers[2]}, numbers[3]};
          if (std::isnan(numbers[3])) {
            expect_unknown(kColumn, kNumbers * row + 3, numbers[3]);
            fix.accuracy_m.reset();
          }
          return std::optional(fix);
        });
  }

  void read_pose_covariances() {
    constexpr MapColumn kColumn = MapColumn::kPoseCovariances;
    read_optional<kUpperTriangle * sizeof(double)>(
        kColumn, tables_.frames.pose_covariances, [&](const char* bytes, std::size_t row) {
          const auto numbers = load<std::array<double, kUpperTriangle>>(bytes);
          if (is_unknown<kUpperTriangle>(kColumn, row, numbers.data())) {
            return std::optional<Matrix6d>();
          }
          Matrix6d covariance = Matrix6d::Zero();
          const double* next = numbers.data();
          for (int i = 0; i < 6; ++i) {
            for (int j = i; j < 6; ++j) covariance(i, j) = covariance(j, i) = *next++;
          }
          return std::optional(covariance);
        });
  }

  void read_cameras() {
    for (Cursor cursor(*this, MapColumn::kCameras); !cursor.at_end();) {
      Camera& camera = tables_.cameras.emplace_back();
      camera.id = CameraId{cursor.number<std::uint64_t>("id")};
      camera.width = cursor.number<std::uint32_t>("width");
      camera.height = cursor.number<std::uint32_t>("height");
      camera.model = cursor.text("model");
      const std::uint64_t count = cursor.number<std::uint32_t>("number of parameters");
      const std::string_view bytes = cursor.take(count * sizeof(double), "parameters");
      camera.parameters.resize(count);
      if (count > 0) std::memcpy(camera.parameters.data(), bytes.data(), bytes.size());
    }
  }

  void read_frames() {
    FrameTable& frames = tables_.frames;
    copy_required(MapColumn::kFrameIds, frames.ids);
    copy_required(MapColumn::kTranslations, frames.translations);
    copy_required(MapColumn::kQuaternions, frames.quaternions);
    read_integers<std::uint32_t>(MapColumn::kFrameCameras, frames.cameras);
    read_numbers(MapColumn::kTimestamps, frames.timestamps_s);
    read_gnss();
    read_pose_covariances();
    if (!has(MapColumn::kImageNames)) return;
    Cursor names(*this, MapColumn::kImageNames);
    bool nothing_known = true;
    for (std::uint64_t i = 0; i < frames_; ++i) {
      frames.image_names.push_back(names.text("a name"));
      nothing_known = nothing_known && frames.image_names.back().empty();
    }
    if (!names.at_end()) {
      refuse(section(MapColumn::kImageNames).begin, MapColumn::kImageNames,
             "more names than frames", fmt::format("{} names", frames_));
    }
    refuse_if_unknown(nothing_known, MapColumn::kImageNames);
  }

  void read_landmarks() {
    LandmarkTable& landmarks = tables_.landmarks;
    copy_required(MapColumn::kLandmarkIds, landmarks.ids);
    copy_required(MapColumn::kPositions, landmarks.positions);
    copy(MapColumn::kCovariances, landmarks.covariances);
    check_unknown_covariances();
    read_colors();
    read_descriptors();
    read_named_columns();
  }

  void check_unknown_covariances() const {
    const auto& covariances = tables_.landmarks.covariances;
    bool nothing_known = !covariances.empty();
    for (std::size_t row = 0; row < covariances.size(); ++row) {
      const double* const numbers = covariances[row].data();
      if (!is_unknown<9>(MapColumn::kCovariances, row, numbers)) nothing_known = false;
    }
    refuse_if_unknown(nothing_known, MapColumn::kCovariances);
  }

  void read_colors() {
    constexpr MapColumn kColumn = MapColumn::kColors;
    read_optional<4>(kColumn, tables_.landmarks.colors, [&](const char* bytes, std::size_t row) {
      const auto [red, green, blue, known] = load<std::array<std::uint8_t, 4>>(bytes);
      if (known > 1 || (known == 0 && (red | green | blue) != 0)) {
        refuse(section(kColumn).begin + 4 * row, kColumn,
               fmt::format("{} {} {} {}", red, green, blue, known),
               "red, green, blue and 1, or four zeros where unknown");
      }
      return known == 1 ? std::optional(Color{red, green, blue}) : std::nullopt;
    });
  }

  void read_descriptors() {
    std::uint64_t bytes_each = 0;
    if (has(MapColumn::kDescriptorKind)) {
      DescriptorColumn& descriptors = tables_.landmarks.descriptors.emplace();
      Cursor kind(*this, MapColumn::kDescriptorKind);
      bytes_each = kind.number<std::uint32_t>("size of a descriptor");
      descriptors.bytes_each = bytes_each;
      descriptors.kind = kind.rest();
      copy(MapColumn::kKnownDescriptors, descriptors.known);
      copy(MapColumn::kDescriptors, descriptors.bytes);
    }
    expect_section(MapColumn::kKnownDescriptors, has(MapColumn::kDescriptorKind) ? 1 : 0);
    expect_section(MapColumn::kDescriptors, bytes_each);
    read_further(bytes_each);
  }

  // LandmarkMap checks the order of the offsets.
  void read_further(std::uint64_t bytes_each) {
    std::uint64_t bytes = 0;
    if (has(MapColumn::kFurtherOffsets)) {
      const Section& found = section(MapColumn::kFurtherOffsets);
      if (!has(MapColumn::kDescriptorKind)) {
        refuse(found.begin, MapColumn::kFurtherOffsets, "no kind of descriptors", "section 16");
      }
      const auto rows = load<std::uint64_t>(found.bytes.data() + found.bytes.size() - 8);
      // A file without further descriptors has no offsets of them. A size of 0 is refused later.
      const std::uint64_t most = bytes_.size() / std::max<std::uint64_t>(bytes_each, 1);
      if (rows == 0 || rows > most) {
        refuse(found.begin + found.bytes.size() - 8, MapColumn::kFurtherOffsets,
               fmt::format("{} further descriptors", rows),
               fmt::format("1 to {} in a file of {} bytes", most, bytes_.size()));
      }
      bytes = rows * bytes_each;
      DescriptorColumn& descriptors = *tables_.landmarks.descriptors;
      copy(MapColumn::kFurtherOffsets, descriptors.further_offsets);
      copy(MapColumn::kFurtherDescriptors, descriptors.further);
    }
    expect_section(MapColumn::kFurtherDescriptors, bytes);
  }

  void read_named_columns() {
    auto& columns = tables_.landmarks.columns;
    for (Cursor names(*this, MapColumn::kColumnNames); !names.at_end();) {
      columns.push_back({names.text("a name"), {}});
    }
    expect_section(MapColumn::kColumnValues, columns.size() * sizeof(double));
    const char* next = section(MapColumn::kColumnValues).bytes.data();
    for (std::size_t i = 0; i < columns.size(); ++i) {
      std::vector<double>& values = columns[i].values;
      values.resize(landmarks_);
      for (std::size_t j = 0; j < landmarks_; ++j, next += sizeof(double)) {
        values[j] = load<double>(next);
        if (std::isnan(values[j]))
          expect_unknown(MapColumn::kColumnValues, i * landmarks_ + j, values[j]);
      }
    }
  }

  void read_observations() {
    ObservationTable& observations = tables_.observations;
    copy(MapColumn::kOffsets, observations.offsets);
    if (landmarks_ == 0 && has(MapColumn::kOffsets)) {
      refuse(section(MapColumn::kOffsets).begin, MapColumn::kOffsets, "offsets without landmarks",
             "the section left out");
    }
    copy_required(MapColumn::kObservingFrames, observations.frames);
    copy_required(MapColumn::kPixels, observations.pixels);
    read_integers<std::uint32_t>(MapColumn::kKeypoints, observations.keypoints);
    read_numbers(MapColumn::kDepths, observations.depths);
    read_integers<std::int32_t>(MapColumn::kOctaves, observations.octaves);
    read_sources(observations.sources);
    read_numbers(MapColumn::kPixelSigmas, observations.sigmas_px);
  }

  std::string_view bytes_;
  const std::string& source_;
  const MapReadOptions& options_;
  std::uint64_t frames_ = 0;
  std::uint64_t landmarks_ = 0;
  std::uint64_t observations_ = 0;
  std::array<Section, kLayouts.size()> sections_;
  MapTables tables_;
};

}  // namespace
}  // namespace cairn::detail

namespace cairn {

LandmarkMap read_binary(ByteSource& source, const MapReadOptions& options) {
  if (const auto bytes = source.in_memory()) {
    return detail::BinaryReader(*bytes, source.name(), options).read();
  }
  return detail::BinaryReader(read_all(source), source.name(), options).read();
}

}  // namespace cairn
