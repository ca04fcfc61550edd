// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "cairn/core/detail/hash.hpp"
#include "cairn/core/detail/memory.hpp"
#include "cairn/core/error.hpp"
#include "cairn/formats/detail/own/binary_layout.hpp"
#include "cairn/formats/map_file.hpp"

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
  BinaryReader(std::string_view bytes, const std::string& source, const Execution& execution)
      : bytes_(bytes), source_(source), execution_(execution) {}

  LandmarkMap read() {
    read_header();
    check_checksum();
    read_table();
    read_unit();
    code_sections(*this, MapParts{tables_.info, tables_.cameras, tables_.rigs, tables_.frames,
                                  tables_.landmarks, tables_.observations});
    return LandmarkMap(std::move(tables_),
                       [this](MapColumn column, std::size_t row) { return place_of(column, row); });
  }

 private:
  // Reads the content of a section in order.
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
    std::string_view rest() { return std::exchange(rest_, {}); }

    template <class Number>
      requires std::is_arithmetic_v<Number>
    void operator()(Number& value, std::string_view what) {
      value = load<Number>(take(sizeof value, what).data());
    }
    void operator()(std::optional<double>& value, std::string_view what) {
      const auto bits = number<std::uint64_t>(what);
      if (bits != kUnknownBits) value = std::bit_cast<double>(bits);
    }
    void operator()(std::string& text, std::string_view what) {
      text = take(number<std::uint32_t>(what), what);
    }
    void filled(std::string& text, std::string_view what) {
      (*this)(text, what);
      if (text.empty()) {
        reader_.refuse(reader_.section(column_).begin, column_, "an empty text", "none");
      }
    }
    void operator()(std::vector<double>& numbers, std::string_view what) {
      const std::uint64_t count = number<std::uint32_t>(what);
      const std::string_view bytes = take(count * sizeof(double), what);
      numbers.resize(count);
      if (count > 0) std::memcpy(numbers.data(), bytes.data(), bytes.size());
    }
    void both(double& value, double& mirrored) { value = mirrored = number<double>(""); }
    template <class Entry, class Describe>
    void list(std::vector<Entry>& entries, std::string_view what, const Describe& describe) {
      for (auto left = number<std::uint32_t>(what); left > 0; --left) {
        describe(entries.emplace_back());
      }
    }
    template <class Number>
    Number number(std::string_view what) {
      Number value{};
      (*this)(value, what);
      return value;
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
    detail::Hasher hasher;
    for (std::uint64_t byte = 0; byte < checksum_place(); byte += kBinaryBlock) {
      hasher.update(
          bytes_.substr(byte, std::min<std::uint64_t>(kBinaryBlock, checksum_place() - byte)));
      report(0.5 * static_cast<double>(byte) / static_cast<double>(bytes_.size()));
    }
    const detail::Hash128 stored{at<std::uint64_t>(checksum_place()),
                                 at<std::uint64_t>(checksum_place() + 8)};
    if (const detail::Hash128 found = hasher.digest(); stored != found) {
      refuse(checksum_place(), "checksum",
             fmt::format("the bytes before are damaged: their XXH3 is {}", to_string(found)),
             to_string(stored));
    }
  }

  void report(double share) const {
    if (execution_.stop.stop_requested()) {
      throw Error(ErrorKind::kCancelled, source_, "reading was cancelled", "");
    }
    if (execution_.progress) execution_.progress(share);
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

  void read_unit() {
    const auto unit = at<std::uint32_t>(kUnitPlace);
    if (unit > 1)
      refuse(kUnitPlace, "unit of length", std::to_string(unit), "0 (metres) or 1 (free)");
    tables_.info.length_unit = unit == 0 ? LengthUnit::kMetres : LengthUnit::kFree;
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

  // Checks that a NaN in a column of doubles is the one that means unknown.
  void expect_unknown(MapColumn column, std::size_t row, double value) const {
    const auto bits = std::bit_cast<std::uint64_t>(value);
    if (bits == kUnknownBits) return;
    refuse(section(column).begin + row * sizeof(double), column,
           fmt::format("{} of the bits {:016x}", value, bits),
           fmt::format("{:016x} where unknown, else a number", kUnknownBits));
  }

  // Whether an entry of doubles is unknown: they are all NaN.
  template <std::size_t kNumbers>
  bool is_unknown(MapColumn column, std::size_t row, const double* numbers) const {
    const bool unknown = std::isnan(numbers[0]);
    for (std::size_t i = 0; i < kNumbers; ++i) {
      if (unknown || std::isnan(numbers[i])) expect_unknown(column, kNumbers * row + i, numbers[i]);
    }
    return unknown;
  }

  // Reads a column of this many bytes per entry; `value_of` may return std::nullopt.
  template <std::size_t kBytes, class Value, class ValueOf>
  void read_optional(MapColumn column, OptionalColumn<Value>& values,
                     const ValueOf& value_of) const {
    Cursor cursor(*this, column);
    values.reserve(section(column).bytes.size() / kBytes);
    bool nothing_known = has(column);
    for (std::size_t row = 0; !cursor.at_end(); ++row) {
      const std::optional<Value> value = value_of(cursor, row);
      values.push_back(value);
      nothing_known = nothing_known && !value;
    }
    refuse_if_unknown(nothing_known, column);
  }

 public:
  // ---- what code_sections() calls

  void text(MapColumn column, std::optional<std::string>& text) const {
    if (has(column)) text = section(column).bytes;
  }
  template <class Entry, class Describe>
  void entry(MapColumn column, std::optional<Entry>& entry, const Describe& describe) const {
    Cursor cursor(*this, column);
    if (has(column)) describe(cursor, entry.emplace());
  }
  template <class Entry, class Describe>
  void entries(MapColumn column, std::vector<Entry>& entries, const Describe& describe) const {
    for (Cursor cursor(*this, column); !cursor.at_end();) describe(cursor, entries.emplace_back());
  }
  template <class Row>
  void rows(MapColumn column, std::vector<Row>& rows) const {
    expect_section(column, sizeof(Row));
    copy(column, rows);
  }

  template <std::size_t kNumbers, class Value, class Describe>
  void numbers(MapColumn column, OptionalColumn<Value>& values, const Describe& describe) const {
    read_optional<8 * kNumbers>(
        column, values, [&](Cursor& cursor, std::size_t row) -> std::optional<Value> {
          Cursor ahead = cursor;
          const auto numbers =
              load<std::array<double, kNumbers>>(cursor.take(8 * kNumbers, "").data());
          if (is_unknown<kNumbers>(column, row, numbers.data())) return std::nullopt;
          Value value{};
          describe(ahead, value);
          return value;
        });
  }

  template <class Value>
  void integers(MapColumn column, OptionalColumn<Value>& values, std::int64_t least,
                std::int64_t most) const {
    read_optional<8>(column, values, [&](Cursor& cursor, std::size_t row) -> std::optional<Value> {
      const auto value = cursor.number<std::int64_t>("");
      if (value == kUnknownInteger) return std::nullopt;
      if (value < least || value > most) {
        refuse(section(column).begin + 8 * row, column, std::to_string(value),
               fmt::format("{} to {}, or {} where unknown", least, most, kUnknownInteger));
      }
      return from_integer<Value>(value);
    });
  }

  void names(MapColumn column, std::vector<std::string>& names) const {
    if (!has(column)) return;
    Cursor cursor(*this, column);
    bool nothing_known = true;
    for (std::uint64_t i = 0; i < frames_; ++i) {
      cursor(names.emplace_back(), "a name");
      nothing_known = nothing_known && names.back().empty();
    }
    if (!cursor.at_end()) {
      refuse(section(column).begin, column, "more names than frames",
             fmt::format("{} names", frames_));
    }
    refuse_if_unknown(nothing_known, column);
  }

  void covariances(std::vector<Eigen::Matrix3d>& covariances) const {
    constexpr MapColumn kColumn = MapColumn::kCovariances;
    copy(kColumn, covariances);
    bool nothing_known = has(kColumn);
    for (std::size_t row = 0; row < covariances.size(); ++row) {
      if (!is_unknown<9>(kColumn, row, covariances[row].data())) nothing_known = false;
    }
    refuse_if_unknown(nothing_known, kColumn);
  }

  void colors(OptionalColumn<Color>& colors) const {
    constexpr MapColumn kColumn = MapColumn::kColors;
    read_optional<4>(kColumn, colors, [&](Cursor& cursor, std::size_t row) -> std::optional<Color> {
      const auto [red, green, blue, known] =
          load<std::array<std::uint8_t, 4>>(cursor.take(4, "").data());
      if (known > 1 || (known == 0 && (red | green | blue) != 0)) {
        refuse(section(kColumn).begin + 4 * row, kColumn,
               fmt::format("{} {} {} {}", red, green, blue, known),
               "red, green, blue and 1, or four zeros where unknown");
      }
      return known == 1 ? std::optional(Color{red, green, blue}) : std::nullopt;
    });
  }

  void descriptors(std::optional<DescriptorColumn>& descriptors) const {
    std::uint64_t bytes_each = 0;
    const bool are_there = has(MapColumn::kDescriptorKind);
    if (are_there) {
      descriptors.emplace();
      Cursor kind(*this, MapColumn::kDescriptorKind);
      bytes_each = kind.number<std::uint32_t>("size of a descriptor");
      descriptors->bytes_each = bytes_each;
      descriptors->kind = kind.rest();
      copy(MapColumn::kKnownDescriptors, descriptors->known);
      copy(MapColumn::kDescriptors, descriptors->bytes);
    }
    expect_section(MapColumn::kKnownDescriptors, are_there ? 1 : 0);
    expect_section(MapColumn::kDescriptors, bytes_each);
    read_further(descriptors);
  }

  void named_columns(std::vector<NamedColumn>& columns) const {
    constexpr MapColumn kColumn = MapColumn::kColumnValues;
    for (Cursor names(*this, MapColumn::kColumnNames); !names.at_end();) {
      names(columns.emplace_back().name, "a name");
    }
    expect_section(kColumn, columns.size() * sizeof(double));
    Cursor cursor(*this, kColumn);
    std::size_t row = 0;
    for (NamedColumn& column : columns) {
      column.values.reserve(landmarks_);
      for (std::size_t i = 0; i < landmarks_; ++i) {
        double value = 0.0;
        cursor(value, "");
        is_unknown<1>(kColumn, row++, &value);
        column.values.push_back(value);
      }
    }
  }

  void offsets(std::vector<std::uint64_t>& offsets) const {
    constexpr MapColumn kColumn = MapColumn::kOffsets;
    copy(kColumn, offsets);
    if (landmarks_ == 0 && has(kColumn)) {
      refuse(section(kColumn).begin, kColumn, "offsets without landmarks", "the section left out");
    }
  }

 private:
  // LandmarkMap checks the order of the offsets.
  void read_further(std::optional<DescriptorColumn>& descriptors) const {
    std::uint64_t bytes = 0;
    if (has(MapColumn::kFurtherOffsets)) {
      const Section& found = section(MapColumn::kFurtherOffsets);
      if (!descriptors) {
        refuse(found.begin, MapColumn::kFurtherOffsets, "no kind of descriptors", "section 16");
      }
      const std::uint64_t bytes_each = descriptors->bytes_each;
      const auto rows = load<std::uint64_t>(found.bytes.data() + found.bytes.size() - 8);
      // A file without further descriptors has no offsets of them. A size of 0 is refused later.
      const std::uint64_t most = bytes_.size() / std::max<std::uint64_t>(bytes_each, 1);
      if (rows == 0 || rows > most) {
        refuse(found.begin + found.bytes.size() - 8, MapColumn::kFurtherOffsets,
               fmt::format("{} further descriptors", rows),
               fmt::format("1 to {} in a file of {} bytes", most, bytes_.size()));
      }
      bytes = rows * bytes_each;
      copy(MapColumn::kFurtherOffsets, descriptors->further_offsets);
      copy(MapColumn::kFurtherDescriptors, descriptors->further);
    }
    expect_section(MapColumn::kFurtherDescriptors, bytes);
  }

  std::string_view bytes_;
  const std::string& source_;
  const Execution& execution_;
  std::uint64_t frames_ = 0;
  std::uint64_t landmarks_ = 0;
  std::uint64_t observations_ = 0;
  std::array<Section, kLayouts.size()> sections_;
  MapTables tables_;
};

}  // namespace
}  // namespace cairn::detail

namespace cairn {

LandmarkMap read_binary(ByteSource& source, const Execution& execution) {
  if (const auto bytes = source.in_memory()) {
    return detail::BinaryReader(*bytes, source.name(), execution).read();
  }
  return detail::BinaryReader(read_all(source), source.name(), execution).read();
}

}  // namespace cairn
