// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <array>
#include <cstring>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/core/number_text.hpp"
#include "cairn/core/text.hpp"
#include "cairn/formats/detail/bytes/words.hpp"
#include "cairn/formats/detail/memory_budget.hpp"
#include "cairn/formats/detail/own/point_columns.hpp"
#include "cairn/formats/map_file.hpp"

namespace cairn {
namespace {

using detail::HeadedSource;
using detail::PointField;
using detail::PointTable;
using detail::ScalarType;

constexpr std::string_view kPcdPoints = "points";

// B is bool, as PCL writes it since 1.13.
std::optional<ScalarType> type_of(char letter, int size) {
  if (letter == 'B') return size == 1 ? std::optional(ScalarType::kUint8) : std::nullopt;
  const char kind = letter == 'I' ? 'i' : letter == 'U' ? 'u' : 'f';
  return detail::scalar_type(kind, static_cast<std::size_t>(size));
}

char letter_of(ScalarType type) {
  return is_integer(type) ? detail::scalar(type).kind == 'i' ? 'I' : 'U' : 'F';
}

enum class PcdEncoding { kAscii, kBinary, kBinaryCompressed };

// ---- header

class PcdHeaderReader {
 public:
  PcdHeaderReader(HeadedSource& source, const LogSink& log) : source_(source), log_(log) {}

  void read() {
    while (!encoding_) {
      const std::string_view line = source_.header_line("a line 'DATA ...'");
      if (line.starts_with('#') && !unit_) unit_ = detail::unit_in_comment(trimmed(line.substr(1)));
      detail::split_words(line, words_);
      if (words_.empty() || words_[0].starts_with('#')) continue;
      Entry* const entry = find(words_[0] == "COLUMNS" ? "FIELDS" : words_[0]);
      if (entry == nullptr) {
        refuse(fmt::format("unknown entry {}", printable(words_[0])),
               "VERSION, FIELDS, SIZE, TYPE, COUNT, WIDTH, HEIGHT, VIEWPOINT, POINTS or DATA");
      }
      if (!entry->place.empty()) {
        refuse(fmt::format("{} stands above already", entry->name), "it once");
      }
      entry->place = source_.header_place();
      words_.erase(words_.begin());
      (this->*entry->read)();
    }
    finish();
  }

  PcdEncoding encoding() const { return *encoding_; }
  std::optional<LengthUnit> length_unit() const { return unit_; }
  const std::vector<PointField>& fields() const { return fields_; }
  const std::string& fields_place() const { return entries_[1].place; }
  std::uint64_t points() const { return *points_; }

 private:
  struct Entry {
    std::string_view name;
    void (PcdHeaderReader::*read)();
    std::string place;  // "file:line" once read
  };

  Entry* find(std::string_view name) {
    const auto found = std::find_if(entries_.begin(), entries_.end(),
                                    [&](const Entry& entry) { return entry.name == name; });
    return found == entries_.end() ? nullptr : &*found;
  }

  [[noreturn]] void refuse(std::string_view what, std::string_view expected) const {
    throw Error(ErrorKind::kInput, source_.header_place(), what, expected);
  }

  void expect_words(std::size_t count, std::string_view of_what) const {
    if (words_.size() != count) {
      refuse(fmt::format("{} values", words_.size()), fmt::format("{}, {}", count, of_what));
    }
  }

  std::uint64_t number(std::size_t word) const {
    const auto value = parse_unsigned(words_[word]);
    if (!value || *value >= detail::kPointLimit) {
      refuse(fmt::format("value {} ({})", word + 1, printable(words_[word])),
             "an unsigned integer below 2^32");
    }
    return *value;
  }

  void read_version() {
    expect_words(1, "the version");
    const auto version = parse_number(words_[0]);
    if (!version || *version <= 0.0 || *version > 0.7) {
      refuse(fmt::format("PCD version {}", printable(words_[0])), "0.7 or older");
    }
  }

  void read_fields() {
    if (words_.size() > detail::kFieldLimit) {
      refuse(fmt::format("{} fields", words_.size()),
             fmt::format("at most {}", detail::kFieldLimit));
    }
    for (const std::string_view word : words_) {
      const bool taken =
          word != "_" && std::any_of(fields_.begin(), fields_.end(),
                                     [&](const PointField& field) { return field.name == word; });
      if (taken) {
        refuse(fmt::format("the field {} occurs twice", printable(word)), "distinct names");
      }
      fields_.push_back({.name = std::string(word), .type = {}, .count = 1, .list_count = {}});
    }
    sizes_.assign(fields_.size(), 0);
    letters_.assign(fields_.size(), '\0');
  }

  void expect_word_per_field() const {
    if (fields_.empty()) refuse("no FIELDS stand above", "them first");
    expect_words(fields_.size(), "one a field");
  }

  void read_size() {
    expect_word_per_field();
    for (std::size_t i = 0; i < words_.size(); ++i) {
      const std::uint64_t size = number(i);
      if (size != 1 && size != 2 && size != 4 && size != 8) {
        refuse(fmt::format("a size of {} bytes for field {}", size, printable(fields_[i].name)),
               "1, 2, 4 or 8");
      }
      sizes_[i] = static_cast<int>(size);
    }
  }

  void read_type() {
    expect_word_per_field();
    for (std::size_t i = 0; i < words_.size(); ++i) {
      if (words_[i].size() != 1 ||
          std::string_view("IUFB").find(words_[i][0]) == std::string_view::npos) {
        refuse(
            fmt::format("type {} for field {}", printable(words_[i]), printable(fields_[i].name)),
            "I, U, F or B");
      }
      letters_[i] = words_[i][0];
    }
  }

  void read_count() {
    expect_word_per_field();
    for (std::size_t i = 0; i < words_.size(); ++i) {
      fields_[i].count = number(i);
      if (fields_[i].count == 0) {
        refuse(fmt::format("a count of 0 for field {}", printable(fields_[i].name)), "1 or more");
      }
    }
  }

  void read_width() { width_ = the_number(); }
  void read_height() { height_ = the_number(); }
  void read_points() { points_ = the_number(); }
  std::uint64_t the_number() const {
    expect_words(1, "the number of points");
    return number(0);
  }

  void read_viewpoint() {
    expect_words(7, "tx ty tz qw qx qy qz");
    constexpr std::array<double, 7> kIdentity = {0, 0, 0, 1, 0, 0, 0};
    bool is_identity = true;
    for (std::size_t i = 0; i < 7; ++i) {
      const auto value = parse_number(words_[i]);
      if (!value) {
        refuse(fmt::format("value {} ({}) is not a number", i + 1, printable(words_[i])),
               "a finite decimal number");
      }
      is_identity = is_identity && *value == kIdentity[i];
    }
    if (!is_identity && log_) {
      log_({fmt::format(
                "{}: the VIEWPOINT is not applied: positions are taken as they stand, as PCL does",
                source_.header_place()),
            RemarkKind::kLoss});
    }
  }

  void read_data() {
    expect_words(1, "ascii, binary or binary_compressed");
    if (words_[0] == "ascii") {
      encoding_ = PcdEncoding::kAscii;
    } else if (words_[0] == "binary") {
      encoding_ = PcdEncoding::kBinary;
    } else if (words_[0] == "binary_compressed") {
      encoding_ = PcdEncoding::kBinaryCompressed;
    } else {
      refuse(fmt::format("unknown kind of data {}", printable(words_[0])),
             "ascii, binary or binary_compressed");
    }
  }

  // Checks and values that need all header entries.
  void finish() {
    for (const std::string_view name : {"FIELDS", "SIZE", "TYPE"}) {
      if (find(name)->place.empty()) refuse(fmt::format("no {} above DATA", name), "it");
    }
    for (std::size_t i = 0; i < fields_.size(); ++i) {
      const auto type = type_of(letters_[i], sizes_[i]);
      reject_if(!type, find("TYPE")->place,
                fmt::format("type {} with {} bytes for field {}", letters_[i], sizes_[i],
                            printable(fields_[i].name)),
                "4 or 8 bytes for F, 1 for B");
      fields_[i].type = *type;
    }
    // Cannot overflow: both are below 2^32.
    if (width_) {
      std::uint64_t area = *width_ * height_.value_or(1);
      if (area == 0 && points_.value_or(0) > 0) {
        // As some exporters of ORB-SLAM write it. The data must hold as many points.
        if (log_) {
          log_(fmt::format("{}: WIDTH times HEIGHT is 0; POINTS, {}, is their number",
                           find("POINTS")->place, *points_));
        }
        area = *points_;
      }
      if (points_ && *points_ != area) {
        throw Error(ErrorKind::kInput, find("POINTS")->place, fmt::format("{} points", *points_),
                    fmt::format("WIDTH times HEIGHT, {}", area));
      }
      if (area >= detail::kPointLimit) refuse(fmt::format("{} points", area), "fewer than 2^32");
      points_ = area;
    }
    if (!points_) refuse("neither WIDTH nor POINTS above DATA", "the number of points");
  }

  HeadedSource& source_;
  const LogSink& log_;
  std::vector<std::string_view> words_;
  std::array<Entry, 10> entries_ = {{
      {"VERSION", &PcdHeaderReader::read_version, {}},
      {"FIELDS", &PcdHeaderReader::read_fields, {}},
      {"SIZE", &PcdHeaderReader::read_size, {}},
      {"TYPE", &PcdHeaderReader::read_type, {}},
      {"COUNT", &PcdHeaderReader::read_count, {}},
      {"WIDTH", &PcdHeaderReader::read_width, {}},
      {"HEIGHT", &PcdHeaderReader::read_height, {}},
      {"VIEWPOINT", &PcdHeaderReader::read_viewpoint, {}},
      {"POINTS", &PcdHeaderReader::read_points, {}},
      {"DATA", &PcdHeaderReader::read_data, {}},
  }};
  std::vector<PointField> fields_;
  std::vector<int> sizes_;
  std::vector<char> letters_;
  std::optional<std::uint64_t> width_;
  std::optional<std::uint64_t> height_;
  std::optional<std::uint64_t> points_;
  std::optional<PcdEncoding> encoding_;
  std::optional<LengthUnit> unit_;
};

// ---- compressed data

/// Decompresses LibLZF data. A control byte c below 32 precedes c + 1 literal bytes. Any other precedes a
/// copy of earlier output: three bits for its length minus 2 (if all are set, the next byte is added), then
/// 13 bits for its distance minus 1.
/// @return the byte and the reason if `in` does not decompress to `out.size()` bytes; std::nullopt if it does
std::optional<std::pair<std::size_t, std::string_view>> decompress_lzf(std::string_view in,
                                                                       std::vector<char>& out) {
  constexpr std::string_view kCut = "the compressed data ends within an instruction";
  constexpr std::string_view kOverflow = "the compressed data holds more than announced";
  std::size_t from = 0;
  std::size_t to = 0;
  while (from < in.size()) {
    const std::size_t start = from;
    const auto next_byte = [&] { return static_cast<unsigned char>(in[from++]); };
    const std::size_t control = next_byte();
    if (control < 32) {
      const std::size_t length = control + 1;
      if (length > in.size() - from) return std::pair{start, kCut};
      if (length > out.size() - to) return std::pair{start, kOverflow};
      std::memcpy(out.data() + to, in.data() + from, length);
      from += length;
      to += length;
      continue;
    }
    std::size_t length = (control >> 5) + 2;
    const bool is_long = length == 9;
    if (in.size() - from < (is_long ? 2U : 1U)) return std::pair{start, kCut};
    if (is_long) length += next_byte();
    const std::size_t distance = ((control & 31U) << 8 | next_byte()) + 1;
    if (distance > to) {
      return std::pair{start, std::string_view("the compressed data refers to before its start")};
    }
    if (length > out.size() - to) return std::pair{start, kOverflow};
    // Byte by byte, because source and destination may overlap.
    for (std::size_t i = 0; i < length; ++i, ++to) out[to] = out[to - distance];
  }
  if (to < out.size()) {
    return std::pair{from, std::string_view("the compressed data holds less than announced")};
  }
  return std::nullopt;
}

// The next `count` bytes, or fewer at the end. Memory grows with the bytes present, not with `count`.
std::string take(HeadedSource& source, std::uint64_t count) {
  std::string bytes;
  if (const auto remaining = source.remaining()) {
    bytes.reserve(static_cast<std::size_t>(std::min(count, *remaining)));
  }
  while (bytes.size() < count) {
    const std::string_view block = source.peek(1);
    const std::size_t size =
        static_cast<std::size_t>(std::min<std::uint64_t>(block.size(), count - bytes.size()));
    if (size == 0) break;
    bytes.append(block.substr(0, size));
    source.consume(size);
  }
  return bytes;
}

[[noreturn]] void refuse_at(const HeadedSource& source, std::uint64_t offset, std::string_view what,
                            std::string_view expected) {
  throw Error(ErrorKind::kInput, fmt::format("{}: byte {}", source.name(), offset), what, expected);
}

// Reads points from compressed data, which is stored field by field.
void read_compressed_points(HeadedSource& source, std::uint64_t points, PointTable& table) {
  table.expect_binary();
  const std::uint64_t begin = source.offset();
  const std::string sizes = take(source, 8);
  if (sizes.size() < 8) {
    refuse_at(source, source.offset(), "the file ends before the compressed data",
              "its two sizes of 4 bytes each");
  }
  const std::uint64_t compressed_size = detail::load_scalar<std::uint32_t>(sizes.data());
  const std::uint64_t size = detail::load_scalar<std::uint32_t>(sizes.data() + 4);

  // PCL leaves padding out of compressed data, other programs may not; the size decides.
  std::uint64_t bytes_used = 0;
  std::uint64_t bytes_padded = 0;
  for (const PointField& field : table.fields()) {
    const std::uint64_t field_size = field.count * detail::size_of(field.type);
    bytes_padded += field_size;
    if (field.name != "_") bytes_used += field_size;
  }
  // Divides, because the product could overflow: the header may declare 2^47 bytes per point.
  const auto fits = [&](std::uint64_t bytes) {
    return points == 0 ? size == 0 : size % points == 0 && size / points == bytes;
  };
  const bool has_padding = !fits(bytes_used);
  if (has_padding && !fits(bytes_padded)) {
    refuse_at(source, begin + 4, fmt::format("an uncompressed size of {} bytes", size),
              fmt::format("{} points of {} bytes", points, bytes_used));
  }

  // Three bytes decompress to at most 264, so a larger size is refused before memory is allocated.
  std::string compressed = take(source, compressed_size);
  if (compressed.size() < compressed_size) {
    refuse_at(source, source.offset(),
              fmt::format("the file ends after {} bytes of compressed data", compressed.size()),
              fmt::format("{} bytes", compressed_size));
  }
  if (size > compressed_size * 88) {
    refuse_at(source, begin + 4,
              fmt::format("{} bytes announced to be compressed into {}", size, compressed_size),
              "at most 88 times as many");
  }
  // Memory per point: the decompressed bytes, a position, and all other values as doubles.
  const std::uint64_t width = bytes_padded + sizeof(double) * (3 + table.fields().size());
  const std::uint64_t budget = detail::memory_budget(compressed_size);
  if (points > 0 && width > budget / points) {
    refuse_at(source, begin,
              fmt::format("{} points of {} fields out of {} compressed bytes", points,
                          table.fields().size(), compressed_size),
              "memory of at most 32 times the compressed bytes and 64 MiB");
  }
  std::vector<char> bytes(static_cast<std::size_t>(size));
  if (const auto defect = decompress_lzf(compressed, bytes)) {
    refuse_at(source, begin + 8 + defect->first, defect->second,
              fmt::format("{} bytes compressed with LZF", size));
  }
  compressed = {};

  std::vector<const char*> columns;
  const char* next = bytes.data();
  for (const PointField& field : table.fields()) {
    columns.push_back(next);
    if (field.name != "_" || has_padding) {
      next += points * field.count * detail::size_of(field.type);
    }
  }
  table.append_columns(columns, static_cast<std::size_t>(points));
}

// Skips the zeros, up to a page of memory, that PCL writes after binary data.
void skip_page_filling(HeadedSource& source) {
  constexpr std::size_t kLargestPage = std::size_t{1} << 16;
  const std::string_view rest = source.peek(kLargestPage + 1).substr(0, kLargestPage);
  source.consume(std::min(rest.find_first_not_of('\0'), rest.size()));
}

}  // namespace

LandmarkMap read_pcd(ByteSource& source, const Execution& execution) {
  HeadedSource headed(source, execution);
  PcdHeaderReader header(headed, execution.log);
  header.read();
  PointTable table(detail::PointFormat::kPcd, source.name(), header.fields_place(), header.fields(),
                   execution);
  if (header.encoding() == PcdEncoding::kAscii) {
    detail::TextRows rows(headed, execution.log);
    detail::read_text_points(rows, headed, header.points(), kPcdPoints, table);
    rows.expect_end();
  } else {
    if (header.encoding() == PcdEncoding::kBinary) {
      detail::read_binary_points(headed, header.points(), kPcdPoints, false, table);
    } else {
      read_compressed_points(headed, header.points(), table);
    }
    skip_page_filling(headed);
    headed.expect_end();
  }
  return std::move(table).finish(header.length_unit());
}

void write_pcd(const LandmarkMap& map, const ByteSink& sink, const MapWriteOptions& options) {
  const detail::PointRows rows(
      map, detail::PointFormat::kPcd,
      options.double_precision ? detail::ScalarType::kFloat64 : detail::ScalarType::kFloat32);
  std::string names = "FIELDS";
  std::string sizes = "SIZE";
  std::string types = "TYPE";
  std::string counts = "COUNT";
  for (const PointField& field : rows.fields()) {
    names += ' ' + field.name;
    sizes += fmt::format(" {}", detail::size_of(field.type));
    types += fmt::format(" {}", letter_of(field.type));
    counts += " 1";
  }
  rows.write(
      fmt::format("# .PCD v0.7 - Point Cloud Data file format\n# {}\n"
                  "VERSION 0.7\n{}\n{}\n{}\n{}\nWIDTH {}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 "
                  "0\nPOINTS {}\nDATA {}\n",
                  detail::unit_comment(map.info().length_unit), names, sizes, types, counts,
                  map.landmark_count(), map.landmark_count(), options.ascii ? "ascii" : "binary"),
      options.ascii, sink);
}

}  // namespace cairn
