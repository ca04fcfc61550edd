// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <string>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "cairn/core/error.hpp"
#include "cairn/core/text.hpp"
#include "cairn/formats/detail/bytes/npy_array.hpp"
#include "cairn/formats/detail/bytes/record_reader.hpp"
#include "cairn/formats/detail/bytes/words.hpp"
#include "cairn/formats/detail/bytes/zip_archive.hpp"
#include "cairn/formats/detail/foreign/foreign_formats.hpp"
#include "cairn/formats/detail/losses.hpp"
#include "cairn/formats/detail/memory_budget.hpp"
#include "cairn/formats/detail/own/point_columns.hpp"
#include "cairn/geometry/limits.hpp"

namespace cairn::detail {
namespace {

constexpr std::string_view kFurther = "further_descriptors";
constexpr std::string_view kFurtherOffsets = "further_descriptor_offsets";

// Builds a map from points.
class Points {
 public:
  Points(const std::string& name, const Execution& execution)
      : name_(name), execution_(execution) {}

  void add(const Eigen::Vector3d& position) {
    if (!are_coordinates(position)) {
      ++left_out_;
      return;
    }
    tables_.landmarks.ids.push_back(LandmarkId{tables_.landmarks.ids.size()});
    tables_.landmarks.positions.push_back(position);
  }
  LandmarkMap finish() && {
    if (left_out_ > 0) {
      const std::size_t count = left_out_ + tables_.landmarks.ids.size();
      log_remark(execution_.log, name_, far_landmarks_text(left_out_, count), RemarkKind::kLoss);
    }
    tables_.info.length_unit = LengthUnit::kFree;
    return LandmarkMap(std::move(tables_), [&](MapColumn, std::size_t) { return name_; });
  }

 private:
  std::string name_;
  const Execution& execution_;
  MapTables tables_;
  std::size_t left_out_ = 0;
};

// Names in a header are words.
std::string word_of(std::string_view name) {
  std::string word(name);
  std::replace_if(
      word.begin(), word.end(), [](char c) { return is_blank(c) || c == ',' || c == ';'; }, '_');
  return word;
}

// None of these formats can hold frames or observations, as their row in the list of formats states; these
// are not reported as losses.
constexpr Holdings kPositionsOnly{.timestamps = true,
                                  .keypoints = true,
                                  .depths = true,
                                  .octaves = true,
                                  .measured = true,
                                  .colors = false};

// --- Archives of arrays ---------------------------------------------------------------------------

class NpzReader {
 public:
  NpzReader(std::string_view archive, const std::string& name, const Execution& execution)
      : members_(read_zip(archive, name)),
        archive_bytes_(archive.size()),
        name_(name),
        execution_(execution) {}

  LandmarkMap read() {
    for (const auto& [member, bytes] : members_) {
      if (!member.ends_with(".npy")) continue;
      const std::string key = member.substr(0, member.size() - 4);
      const std::string where =
          fmt::format("{}: {}", name_, (key.empty() || is_visible(key)) ? key : printable(key));
      arrays_.emplace(key, NpyArray(bytes, where));
    }
    require_budget();
    const NpyArray& positions = find_positions();
    const std::uint64_t count = positions.shape()[0];
    std::vector<std::uint64_t> rows;
    for (std::uint64_t i = 0; i < count; ++i) {
      const Eigen::Vector3d x(positions.number(3 * i), positions.number(3 * i + 1),
                              positions.number(3 * i + 2));
      if (!are_coordinates(x)) continue;
      rows.push_back(i);
      tables_.landmarks.positions.push_back(x);
    }
    if (rows.size() < count) lost(far_landmarks_text(count - rows.size(), count));
    LandmarkTable& landmarks = tables_.landmarks;
    std::vector<std::string> left_out;
    std::string kind = "unknown";
    for (const auto& [key, array] : arrays_) {
      if (&array == &positions) continue;
      const auto& shape = array.shape();
      const bool is_row = !shape.empty() && shape[0] == count && !array.is_text();
      const auto is_shape = [&](std::initializer_list<std::uint64_t> more) {
        return is_row && std::equal(shape.begin() + 1, shape.end(), more.begin(), more.end());
      };
      if (key == "descriptor_kind" && array.is_text() && array.size() == 1) {
        kind = array.text();
      } else if (key == "ids" && is_shape({})) {
        for (const std::uint64_t i : rows) landmarks.ids.push_back(LandmarkId{array.whole(i)});
      } else if (key == "covariances" && is_shape({3, 3})) {
        for (const std::uint64_t i : rows) landmarks.covariances.push_back(covariance(array, i));
      } else if (key == "colors" && is_shape({3})) {
        for (const std::uint64_t i : rows) landmarks.colors.emplace_back(color(array, i));
      } else if (key == "descriptors" && is_row && shape.size() == 2) {
        take_descriptors(array, rows);
      } else if (key == kFurther || key == kFurtherOffsets) {
        continue;
      } else if (is_shape({})) {
        NamedColumn column{key, {}};
        for (const std::uint64_t i : rows) {
          const double value = array.number(i);
          column.values.push_back(std::isfinite(value) ? value
                                                       : std::numeric_limits<double>::quiet_NaN());
        }
        landmarks.columns.push_back(std::move(column));
      } else {
        left_out.push_back(printable(key));
      }
    }
    take_further(rows, count);
    if (landmarks.descriptors) landmarks.descriptors->kind = kind;
    if (landmarks.ids.empty()) {
      for (std::size_t i = 0; i < rows.size(); ++i) landmarks.ids.push_back(LandmarkId{i});
    }
    if (!left_out.empty()) {
      lost(fmt::format("arrays that are not one entry a point are left out: {}",
                       fmt::join(left_out, ", ")));
    }
    tables_.info.length_unit = LengthUnit::kFree;
    return LandmarkMap(std::move(tables_), [&](MapColumn, std::size_t) { return name_; });
  }

 private:
  void lost(const std::string& text) const {
    log_remark(execution_.log, name_, text, RemarkKind::kLoss);
  }

  const NpyArray& find_positions() const {
    for (const char* key : {"positions", "points", "xyz", "arr_0"}) {
      const auto found = arrays_.find(key);
      if (found == arrays_.end()) continue;
      const auto& shape = found->second.shape();
      if (shape.size() == 2 && shape[1] == 3 && !found->second.is_text()) return found->second;
      throw Error(ErrorKind::kInput, found->second.where() + ": shape",
                  fmt::format("({})", fmt::join(shape, ", ")), "(N, 3)");
    }
    throw Error(ErrorKind::kInput, name_, "has no array of positions",
                "one named positions, points, xyz or arr_0");
  }

  // A byte of an archive may unpack to many, and each of these becomes a number of 8 bytes.
  void require_budget() const {
    std::uint64_t bytes = 0;
    for (const auto& [member, unpacked] : members_) bytes += unpacked.size();
    for (const auto& [key, array] : arrays_) {
      const bool stays_bytes = key == "colors" || key == "descriptors" || key == kFurther;
      bytes += array.is_text() ? 0 : array.size() * (stays_bytes ? 1 : sizeof(double));
    }
    if (bytes <= memory_budget(archive_bytes_)) return;
    throw Error(ErrorKind::kInput, name_, fmt::format("its arrays take {} bytes", bytes),
                "at most 32 times the bytes of the archive and 64 MiB");
  }

  static Eigen::Matrix3d covariance(const NpyArray& array, std::uint64_t row) {
    Eigen::Matrix3d matrix;
    for (std::uint64_t i = 0; i < 9; ++i) {
      matrix(static_cast<Eigen::Index>(i / 3), static_cast<Eigen::Index>(i % 3)) =
          array.number(9 * row + i);
    }
    if (!matrix.allFinite()) matrix.setConstant(std::numeric_limits<double>::quiet_NaN());
    return matrix;
  }

  // Of bytes, or numbers from 0 to 1.
  static Color color(const NpyArray& array, std::uint64_t row) {
    const auto channel = [&](std::uint64_t i) {
      const double value = array.number(3 * row + i) * (array.kind() == 'f' ? 255.0 : 1.0);
      return static_cast<std::uint8_t>(
          std::lround(std::clamp(std::isfinite(value) ? value : 0.0, 0.0, 255.0)));
    };
    return {channel(0), channel(1), channel(2)};
  }

  void take_descriptors(const NpyArray& array, const std::vector<std::uint64_t>& rows) {
    const std::uint64_t each = array.shape()[1];
    reject_if(array.item_size() != 1 || each == 0 || each > kMostDescriptorBytes, array.where(),
              fmt::format("{} numbers of {} bytes a point", each, array.item_size()),
              fmt::format("1 to {} bytes (uint8) a point", kMostDescriptorBytes));
    DescriptorColumn column{{}, static_cast<std::size_t>(each), {}, {}};
    for (const std::uint64_t i : rows) {
      const std::string_view bytes = array.data().substr(i * each, each);
      // Without a mask, a row of zeros says unknown.
      column.known.push_back(bytes.find_first_not_of('\0') == std::string_view::npos ? 0 : 1);
      column.bytes.insert(column.bytes.end(), bytes.begin(), bytes.end());
    }
    tables_.landmarks.descriptors = std::move(column);
  }

  // After the descriptors. @param count of all points, of which `rows` are kept
  void take_further(const std::vector<std::uint64_t>& rows, std::uint64_t count) {
    const auto further = arrays_.find(std::string(kFurther));
    const auto offsets = arrays_.find(std::string(kFurtherOffsets));
    if (further == arrays_.end() && offsets == arrays_.end()) return;
    const auto& descriptors = tables_.landmarks.descriptors;
    const NpyArray& named = further == arrays_.end() ? offsets->second : further->second;
    const auto require = [&](bool valid, std::string_view what, std::string_view expected) {
      if (!valid) throw Error(ErrorKind::kInput, named.where(), what, expected);
    };
    require(further != arrays_.end() && offsets != arrays_.end() && descriptors,
            "further descriptors are not complete",
            fmt::format("the arrays descriptors, {} and {}", kFurther, kFurtherOffsets));
    const std::size_t each = descriptors->bytes_each;
    const auto& shape = further->second.shape();
    require(further->second.item_size() == 1 && shape.size() == 2 && shape[1] == each,
            fmt::format("shape ({})", fmt::join(shape, ", ")),
            fmt::format("(M, {}) of uint8, as the descriptors", each));
    const auto& lengths = offsets->second.shape();
    require(!offsets->second.is_text() && lengths.size() == 1 && lengths[0] == count + 1,
            fmt::format("{} of shape ({})", kFurtherOffsets, fmt::join(lengths, ", ")),
            fmt::format("({})", count + 1));
    // All points' first; the rows that are kept follow.
    std::uint64_t last = 0;
    for (std::uint64_t i = 0; i <= count; ++i) {
      const std::uint64_t offset = offsets->second.whole(i);
      require(offset >= last && offset <= shape[0] && (i > 0 || offset == 0),
              fmt::format("offset {} is {}", i, offset),
              fmt::format("ascending from 0 to {}", shape[0]));
      last = offset;
    }
    DescriptorColumn& column = *tables_.landmarks.descriptors;
    column.further_offsets.push_back(0);
    for (const std::uint64_t i : rows) {
      const std::uint64_t begin = offsets->second.whole(i);
      const std::uint64_t end = offsets->second.whole(i + 1);
      const std::string_view bytes =
          further->second.data().substr(begin * each, (end - begin) * each);
      column.further.insert(column.further.end(), bytes.begin(), bytes.end());
      column.further_offsets.push_back(column.further.size() / each);
    }
  }

  std::map<std::string, std::string> members_;
  std::uint64_t archive_bytes_;
  std::string name_;
  const Execution& execution_;
  std::map<std::string, NpyArray> arrays_;
  MapTables tables_;
};

std::string position_bytes(const LandmarkMap& map) {
  std::string bytes;
  bytes.reserve(24 * map.landmark_count());
  for (const Eigen::Vector3d& x : map.landmarks().positions) {
    for (int i = 0; i < 3; ++i) append_scalar(bytes, x[i]);
  }
  return bytes;
}

}  // namespace

bool is_archive_of_arrays(const MapInput& input) {
  const std::string_view bytes = input.first_bytes;
  constexpr std::size_t kName =
      30;  // a name begins there, its length is before the length of the extra field
  if (!bytes.starts_with("PK\x03\x04") || bytes.size() < kName) return false;
  const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(bytes[i]); };
  return bytes.substr(kName, byte(26) + 256U * byte(27)).ends_with(".npy");
}

LandmarkMap read_npy_points(ByteSource& source, const Execution& execution) {
  ReadingProgress progress(execution, source.size().value_or(0));
  BinaryRecords in(source, progress);
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
  const NpyHeader parsed = parse_npy_header(header, source.name());
  const bool is_double = parsed.type == "<f8";
  if (!is_double && parsed.type != "<f4") {
    in.refuse("descr", printable(parsed.type) + " is no type of positions", "'<f8' or '<f4'");
  }
  if (parsed.is_fortran) in.refuse("fortran_order", "True", "False");
  if (parsed.shape.size() != 2 || parsed.shape[1] != 3) {
    in.refuse("shape", fmt::format("({})", fmt::join(parsed.shape, ", ")), "(N, 3)");
  }
  Points points(source.name(), execution);
  for (std::uint64_t i = 0; i < parsed.shape[0]; ++i) {
    Eigen::Vector3d position;
    for (int axis = 0; axis < 3; ++axis) {
      position[axis] = is_double ? in.f64("position") : double{in.f32("position")};
    }
    points.add(position);
  }
  in.expect_end();
  return std::move(points).finish();
}

LandmarkMap read_npz_points(ByteSource& source, const Execution& execution) {
  std::string archive = read_all(source);
  NpzReader reader(archive, source.name(), execution);
  archive = {};  // it is unpacked
  return reader.read();
}

void write_xyz_points(const LandmarkMap& map, const ByteSink& sink, const Execution& execution) {
  TextOutput out(sink);
  for (const Eigen::Vector3d& x : map.landmarks().positions) {
    out.words(x.x(), x.y(), x.z());
    out.line();
  }
  out.flush();
  log_losses(execution.log, map, kPositionsOnly, "XYZ");
}

void write_csv_points(const LandmarkMap& map, const ByteSink& sink, const Execution& execution) {
  const PointRows rows(map, PointFormat::kPly, ScalarType::kFloat64);
  std::string header;
  for (const PointField& field : rows.fields()) {
    if (!header.empty()) header += ' ';
    header += word_of(field.name);
  }
  rows.write(header + '\n', true, [&](std::string_view bytes) {
    std::string text(bytes);
    std::replace(text.begin(), text.end(), ' ', ',');
    sink(text);
  });
  const std::vector<std::string_view> columns = column_names(map.landmarks().columns);
  Holdings holdings = kPositionsOnly;
  holdings.colors = true;
  holdings.covariances = true;
  holdings.columns = columns;
  log_losses(execution.log, map, holdings, "CSV");
}

void write_npy_points(const LandmarkMap& map, const ByteSink& sink, const Execution& execution) {
  sink(npy_bytes("<f8", {map.landmark_count(), 3}, position_bytes(map)));
  log_losses(execution.log, map, kPositionsOnly, ".npy");
}

void write_npz_points(const LandmarkMap& map, const ByteSink& sink, const Execution& execution) {
  const LandmarkTable& landmarks = map.landmarks();
  const std::uint64_t count = map.landmark_count();
  ZipWriter zip(sink);
  std::string bytes;
  const auto add = [&](const std::string& name, std::string_view type,
                       const std::vector<std::uint64_t>& shape) {
    zip.add(name + ".npy", npy_bytes(type, shape, bytes));
    bytes.clear();
  };
  bytes = position_bytes(map);
  add("positions", "<f8", {count, 3});
  for (const LandmarkId id : landmarks.ids) append_scalar(bytes, id.value);
  add("ids", "<u8", {count});
  if (!landmarks.covariances.empty()) {
    for (const Eigen::Matrix3d& c : landmarks.covariances) {
      for (int i = 0; i < 9; ++i) append_scalar(bytes, c(i / 3, i % 3));
    }
    add("covariances", "<f8", {count, 3, 3});
  }
  const bool all_colors =
      !landmarks.colors.empty() && std::all_of(landmarks.colors.begin(), landmarks.colors.end(),
                                               [](const auto& color) { return color.has_value(); });
  if (all_colors) {
    for (const auto& color : landmarks.colors) {
      bytes += {static_cast<char>(color->red), static_cast<char>(color->green),
                static_cast<char>(color->blue)};
    }
    add("colors", "|u1", {count, 3});
  }
  if (const auto& descriptors = landmarks.descriptors) {
    bytes.assign(descriptors->bytes.begin(), descriptors->bytes.end());
    add("descriptors", "|u1", {count, descriptors->bytes_each});
    bytes = descriptors->kind;
    add("descriptor_kind", fmt::format("|S{}", descriptors->kind.size()), {});
    if (descriptors->has_further()) {
      bytes.assign(descriptors->further.begin(), descriptors->further.end());
      add("further_descriptors", "|u1",
          {descriptors->further_offsets.back(), descriptors->bytes_each});
      for (const std::uint64_t offset : descriptors->further_offsets) append_scalar(bytes, offset);
      add("further_descriptor_offsets", "<u8", {count + 1});
    }
  }
  std::vector<std::string_view> columns;
  constexpr std::array<std::string_view, 12> kTaken = {
      "positions",   "points",       "xyz",         "arr_0",           "ids",
      "covariances", "colors",       "descriptors", "descriptor_kind", "observations",
      kFurther,      kFurtherOffsets};
  for (const NamedColumn& column : landmarks.columns) {
    const bool is_taken = std::find(kTaken.begin(), kTaken.end(), column.name) != kTaken.end();
    if (is_taken || column.name.find_first_of("/\\") != std::string::npos) continue;
    columns.push_back(column.name);
    for (const double value : column.values) append_scalar(bytes, value);
    add(column.name, "<f8", {count});
  }
  if (map.has_observations() && count > 0) {
    for (std::uint32_t i = 0; i < count; ++i) {
      append_scalar(bytes, std::uint64_t{map.observation_count(LandmarkIndex{i})});
    }
    add("observations", "<u8", {count});
  }
  zip.finish();
  Holdings holdings = kPositionsOnly;
  holdings.colors = all_colors;
  holdings.covariances = true;
  holdings.descriptors = "*";
  holdings.further_descriptors = true;
  holdings.columns = columns;
  log_losses(execution.log, map, holdings, ".npz");
}

}  // namespace cairn::detail
