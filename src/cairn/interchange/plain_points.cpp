// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/interchange/plain_points.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <optional>
#include <string>
#include <utility>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/core/number_text.hpp"
#include "cairn/core/text.hpp"
#include "cairn/interchange/detail/record_reader.hpp"

namespace cairn {
namespace {

constexpr std::string_view kNpyMagic = "\x93NUMPY";
constexpr std::size_t kMostColumns = 4096;

bool separates(char c) {
  return is_blank(c) || c == ',' || c == ';';
}

// The words of a line, apart by blanks, or by commas or semicolons with or without blanks.
std::vector<std::string_view> words_of(std::string_view line) {
  std::vector<std::string_view> words;
  for (std::size_t i = 0; i < line.size() && words.size() <= kMostColumns;) {
    if (separates(line[i])) {
      ++i;
      continue;
    }
    std::size_t end = i;
    while (end < line.size() && !separates(line[end])) ++end;
    words.push_back(line.substr(i, end - i));
    i = end;
  }
  return words;
}

std::string lower(std::string_view text) {
  std::string result(text);
  std::transform(result.begin(), result.end(), result.begin(), [](char c) {
    return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  });
  return result;
}

bool is_number(std::string_view word) {
  return parse_number(word).has_value() || lower(word) == "nan" || lower(word) == "inf" ||
         lower(word) == "-inf";
}

// The columns of x, y and z in a line of names; std::nullopt unless all three are named.
std::optional<std::array<std::size_t, 3>> named_columns(
    const std::vector<std::string_view>& words) {
  std::array<std::size_t, 3> columns{};
  constexpr std::array<std::string_view, 3> kNames = {"x", "y", "z"};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto found = std::find_if(words.begin(), words.end(), [&](std::string_view word) {
      return lower(word) == kNames[axis];
    });
    if (found == words.end()) return std::nullopt;
    columns[axis] = static_cast<std::size_t>(found - words.begin());
  }
  return columns;
}

bool is_comment(std::string_view line) {
  return line.starts_with('#') || line.starts_with("//");
}

// Whether the first line that holds anything is a point or names x, y and z.
bool looks_like_points(std::string_view bytes) {
  while (!bytes.empty()) {
    const std::size_t end = bytes.find('\n');
    const std::string_view line = trimmed(bytes.substr(0, end));
    bytes = end == std::string_view::npos ? std::string_view() : bytes.substr(end + 1);
    if (line.empty() || is_comment(line)) continue;
    const auto words = words_of(line);
    return words.size() >= 3 &&
           (std::all_of(words.begin(), words.begin() + 3, is_number) || named_columns(words));
  }
  return false;
}

// Points on their way into a map.
class Points {
 public:
  Points(const std::string& name, const MapReadOptions& options) : name_(name), options_(options) {}

  void add(const Eigen::Vector3d& position) {
    if (!position.allFinite()) {
      ++left_out_;
      return;
    }
    tables_.landmarks.ids.push_back(LandmarkId{tables_.landmarks.ids.size()});
    tables_.landmarks.positions.push_back(position);
  }
  void remark(const std::string& text) const {
    if (options_.log) options_.log(fmt::format("{}: {}", name_, text));
  }
  LandmarkMap finish() && {
    if (left_out_ > 0) {
      remark(fmt::format("{} points without a finite position; left out", left_out_));
    }
    tables_.info.length_unit = LengthUnit::kFree;
    return LandmarkMap(std::move(tables_), [&](MapColumn, std::size_t) { return name_; });
  }

 private:
  std::string name_;
  const MapReadOptions& options_;
  MapTables tables_;
  std::size_t left_out_ = 0;
};

// What stands behind a key in the header of an array, which is a dictionary in Python's notation.
std::string_view value_of(std::string_view header, std::string_view key) {
  const std::size_t place = header.find(key);
  if (place == std::string_view::npos) return {};
  header.remove_prefix(place + key.size());
  const std::size_t colon = header.find(':');
  if (colon == std::string_view::npos) return {};
  header = trimmed(header.substr(colon + 1));
  const bool is_tuple = header.starts_with('(');
  const std::size_t end = header.find_first_of(is_tuple ? ")" : ",}");
  if (end == std::string_view::npos) return {};
  return trimmed(header.substr(0, is_tuple ? end + 1 : end));
}

}  // namespace

LandmarkMap read_plain_points(ByteSource& source, const MapReadOptions& options) {
  detail::ReadingProgress progress(options, source.size().value_or(0));
  LineReader lines(source);
  Points points(source.name(), options);
  std::array<std::size_t, 3> columns = {0, 1, 2};
  bool is_first = true;
  bool has_more = false;
  std::uint64_t reported = 0;
  while (const auto next = lines.next()) {
    constexpr std::uint64_t kBlock = std::uint64_t{1} << 20;
    if (lines.bytes_read() - reported >= kBlock) {
      progress.advance(lines.bytes_read() - reported, source.name());
      reported = lines.bytes_read();
    }
    const std::string_view line = trimmed(*next);
    if (line.empty() || is_comment(line)) continue;
    const auto words = words_of(line);
    if (std::exchange(is_first, false)) {
      if (const auto named = named_columns(words)) {
        columns = *named;
        has_more = words.size() > 3;
        continue;
      }
    }
    has_more = has_more || words.size() > 3;
    Eigen::Vector3d position;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto refuse = [&](std::string_view what) {
        throw Error(ErrorKind::kInput,
                    fmt::format("{}:{}: field {} ({})", source.name(), lines.line_number(),
                                columns[axis] + 1, "xyz"[axis]),
                    what, "a decimal number, or nan");
      };
      if (columns[axis] >= words.size())
        refuse(fmt::format("the line has {} fields", words.size()));
      const std::string_view word = words[columns[axis]];
      if (!is_number(word)) refuse(printable(word) + " is not a number");
      position[static_cast<Eigen::Index>(axis)] =
          parse_number(word).value_or(std::numeric_limits<double>::quiet_NaN());
    }
    if (!lines.line_was_terminated()) {
      throw Error(ErrorKind::kInput, fmt::format("{}:{}", source.name(), lines.line_number()),
                  "the last line does not end with a newline: it may have been cut", "a newline");
    }
    points.add(position);
  }
  if (has_more) points.remark("columns other than x, y and z are left out");
  return std::move(points).finish();
}

LandmarkMap read_npy_points(ByteSource& source, const MapReadOptions& options) {
  detail::ReadingProgress progress(options, source.size().value_or(0));
  detail::BinaryRecords in(source, progress);
  for (const char c : kNpyMagic) {
    if (in.u8("magic") != static_cast<std::uint8_t>(c))
      in.refuse("magic", "is not that of .npy", "\\x93NUMPY");
  }
  const std::uint8_t version = in.u8("version");
  in.u8("version");
  if (version < 1 || version > 3) in.refuse("version", fmt::format("{}", version), "1 to 3");
  std::size_t length = in.u8("header size");
  length += std::size_t{in.u8("header size")} << 8;
  if (version > 1) {
    length += std::size_t{in.u8("header size")} << 16;
    length += std::size_t{in.u8("header size")} << 24;
  }
  constexpr std::size_t kLongest = 65536;
  if (length > kLongest) in.refuse("header size", fmt::format("{}", length), "at most 65536");
  std::string header;
  for (std::size_t i = 0; i < length; ++i) header += static_cast<char>(in.u8("header"));
  const std::string_view type = value_of(header, "'descr'");
  const bool is_double = type == "'<f8'";
  if (!is_double && type != "'<f4'") {
    in.refuse("descr", printable(type) + " is no type of positions", "'<f8' or '<f4'");
  }
  if (value_of(header, "'fortran_order'") != "False") {
    in.refuse("fortran_order", printable(value_of(header, "'fortran_order'")), "False");
  }
  const std::string_view shape = value_of(header, "'shape'");
  const std::size_t comma = shape.find(',');
  const std::size_t close = shape.find(')');
  std::optional<std::uint64_t> rows;
  std::optional<std::uint64_t> columns;
  if (comma != std::string_view::npos && close != std::string_view::npos && comma < close) {
    rows = parse_unsigned(trimmed(shape.substr(1, comma - 1)));
    std::string_view second = trimmed(shape.substr(comma + 1, close - comma - 1));
    if (second.ends_with(',')) second.remove_suffix(1);
    columns = parse_unsigned(second);
  }
  if (!rows || columns != 3U) in.refuse("shape", printable(shape), "(N, 3)");
  Points points(source.name(), options);
  for (std::uint64_t i = 0; i < *rows; ++i) {
    Eigen::Vector3d position;
    for (int axis = 0; axis < 3; ++axis) {
      position[axis] = is_double ? in.f64("position") : double{in.f32("position")};
    }
    points.add(position);
  }
  in.expect_end();
  return std::move(points).finish();
}

std::vector<MapFormat> plain_points_formats() {
  return {
      {.name = "xyz",
       .title = "XYZ",
       .holds_frames = false,
       .recognises =
           [](const MapInput& input) {
             return input.source != nullptr && looks_like_points(input.first_bytes);
           },
       .read =
           [](const MapInput& input, const MapReadOptions& options) {
             return read_plain_points(*input.source, options);
           }},
      {.name = "npy",
       .title = "NumPy",
       .holds_frames = false,
       .recognises = [](const MapInput& input) { return input.first_bytes.starts_with(kNpyMagic); },
       .read =
           [](const MapInput& input, const MapReadOptions& options) {
             return read_npy_points(*input.source, options);
           }}};
}

}  // namespace cairn
