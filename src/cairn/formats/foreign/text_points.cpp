// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include "cairn/core/error.hpp"
#include "cairn/core/number_text.hpp"
#include "cairn/core/text.hpp"
#include "cairn/formats/detail/bytes/record_reader.hpp"
#include "cairn/formats/detail/foreign/foreign_formats.hpp"
#include "cairn/formats/detail/losses.hpp"
#include "cairn/formats/detail/own/point_columns.hpp"

namespace cairn::detail {
namespace {

using Cells = std::vector<std::string_view>;
using Names = std::vector<std::string>;

constexpr std::size_t kMostColumns = 4096;
constexpr double kNoNumber = std::numeric_limits<double>::quiet_NaN();

// ---- a line and its cells

bool is_comment(std::string_view line) {
  return line.starts_with('#') || line.starts_with("//");
}

// Cells are apart by semicolons if the line has any, else by commas, else by blanks.
char separator_of(std::string_view line) {
  char separator = ' ';
  bool is_quoted = false;
  for (const char c : line) {
    is_quoted = is_quoted != (c == '"');
    if (is_quoted) continue;
    if (c == ';') return c;
    if (c == ',') separator = c;
  }
  return separator;
}

// Cells apart by semicolons or commas may be empty. Each may be in quotes, which are dropped.
void split(std::string_view line, Cells& cells) {
  cells.clear();
  const char separator = separator_of(line);
  const auto separates = [&](char c) { return separator == ' ' ? is_blank(c) : c == separator; };
  for (line = trimmed(line); !line.empty() && cells.size() <= kMostColumns;) {
    bool is_quoted = false;
    std::size_t end = 0;
    for (; end < line.size() && (is_quoted || !separates(line[end])); ++end) {
      is_quoted = is_quoted != (line[end] == '"');
    }
    std::string_view cell = trimmed(line.substr(0, end));
    if (cell.size() > 1 && cell.front() == '"' && cell.back() == '"') {
      cell = cell.substr(1, cell.size() - 2);
    }
    cells.push_back(cell);
    if (end == line.size()) return;
    line = trimmed(line.substr(end + 1));
    if (line.empty()) cells.emplace_back();
  }
}

// A separator may also end a line.
void drop_last_if_empty(Cells& cells) {
  if (!cells.empty() && cells.back().empty()) cells.pop_back();
}

bool is_number(std::string_view word) {
  return parse_number(word).has_value() || lower_case(word) == "nan" || lower_case(word) == "inf" ||
         lower_case(word) == "-inf";
}

// ---- names of columns

Names names_of(const Cells& cells) {
  Names names;
  for (const std::string_view cell : cells) {
    // Names are words.
    std::string& name = names.emplace_back(cell);
    std::replace_if(name.begin(), name.end(), is_blank, '_');
  }
  return names;
}

// A name in small letters, without a unit in brackets, blanks and punctuation.
std::string plain(std::string_view name) {
  std::string result = lower_case(name.substr(0, name.find_first_of("[(")));
  std::erase_if(result, [](char c) { return !((c >= 'a' && c <= 'z') || (c >= '0' && c <= '9')); });
  return result;
}

// The columns of these plain names; std::nullopt unless there are all of them.
std::optional<std::array<std::size_t, 3>> columns_named(const Names& plain_names,
                                                        const std::array<std::string, 3>& sought) {
  std::array<std::size_t, 3> columns{};
  for (std::size_t i = 0; i < 3; ++i) {
    const auto found = std::find(plain_names.begin(), plain_names.end(), sought[i]);
    if (found == plain_names.end()) return std::nullopt;
    columns[i] = static_cast<std::size_t>(found - plain_names.begin());
  }
  return columns;
}

// The columns of x, y and z: "x", "pos_x", "x [m]", "Points:0" and the like.
std::optional<std::array<std::size_t, 3>> position_columns(const Names& names) {
  constexpr std::array<std::string_view, 13> kPositionStems = {
      "",       "pos",        "position",    "point", "points",   "pointsmxyz", "coord",
      "coords", "coordinate", "coordinates", "p",     "location", "world"};
  Names plain_names;
  for (const std::string& name : names) plain_names.push_back(plain(name));
  for (const std::string_view stem : kPositionStems) {
    const std::string s(stem);
    for (const auto& sought :
         {std::array{s + "x", s + "y", s + "z"}, std::array{"x" + s, "y" + s, "z" + s},
          std::array{s + "0", s + "1", s + "2"}}) {
      // Short names with digits have other meanings.
      if (sought[0].back() == '0' && stem.size() < 3) continue;
      if (const auto columns = columns_named(plain_names, sought)) return columns;
    }
  }
  return std::nullopt;
}

// Whether columns are those of a quaternion.
bool names_a_rotation(const Names& names) {
  constexpr std::array<std::string_view, 4> kQuaternion = {"qw", "qx", "qy", "qz"};
  return std::all_of(kQuaternion.begin(), kQuaternion.end(), [&](std::string_view sought) {
    return std::any_of(names.begin(), names.end(),
                       [&](const std::string& name) { return plain(name) == sought; });
  });
}

// The names in a comment above rows of `width` cells; empty unless it has x, y and z and as many names.
Names names_in_comment(std::string_view comment, std::size_t width) {
  Cells cells;
  split(trimmed(comment.substr(std::min(comment.find_first_not_of("#/"), comment.size()))), cells);
  drop_last_if_empty(cells);
  if (cells.size() == width + 1 && cells.front().ends_with(':')) cells.erase(cells.begin());
  Names names = names_of(cells);
  if (names.size() != width || !position_columns(names)) return {};
  return names;
}

// ---- what rows look like

// What a text holds that is no table of points, and what to do with it.
struct OtherContent {
  std::string_view what;
  std::string_view expected;
};
constexpr std::string_view kPosesElsewhere =
    "points; 'cairn evaluate trajectory' takes trajectories in the formats of TUM, EuRoC and KITTI";

// What all rows of a table have in common.
class Survey {
 public:
  struct Column {
    bool is_unsigned = true;  // as text
    bool is_whole = true;     // 0, 1, 2, ...
    bool is_byte = true;      // whole, at most 255
    bool is_share = true;     // from 0 to 1
    bool is_rising = true;    // never falls
    double last = -std::numeric_limits<double>::infinity();
  };

  std::size_t rows() const { return rows_; }
  std::size_t width() const { return columns_.size(); }
  const Column& operator[](std::size_t column) const { return columns_[column]; }
  /// Number of the first line with another number of cells, and that number; 0 if there is none.
  std::uint64_t ragged_line() const { return ragged_line_; }
  std::size_t ragged_width() const { return ragged_width_; }

  void add(const Cells& cells, std::uint64_t line) {
    row_.clear();
    for (const std::string_view cell : cells)
      row_.push_back(parse_number(cell).value_or(kNoNumber));
    if (rows_++ == 0) columns_.resize(cells.size());
    if (cells.size() != width() && ragged_line_ == 0) {
      ragged_line_ = line;
      ragged_width_ = cells.size();
    }
    for (std::size_t i = 0; i < std::min(cells.size(), width()); ++i) {
      Column& column = columns_[i];
      const double value = row_[i];
      column.is_unsigned = column.is_unsigned && parse_unsigned(cells[i]).has_value();
      column.is_whole = column.is_whole && is_whole(value);
      column.is_byte = column.is_byte && is_whole(value) && value <= 255.0;
      column.is_share = column.is_share && value >= 0.0 && value <= 1.0;
      column.is_rising = column.is_rising && value >= column.last;
      column.last = value;
    }
    add_patterns();
  }

  /// std::nullopt if the rows may be points.
  std::optional<OtherContent> other() const {
    if (is_colmap_) {
      return OtherContent{"COLMAP's points3D.txt under another name",
                          "the name points3D.txt, beside cameras.txt and images.txt"};
    }
    if (ragged_line_ != 0) return std::nullopt;
    if (is_trajectory_) {
      return OtherContent{"a trajectory (timestamp tx ty tz qx qy qz qw)", kPosesElsewhere};
    }
    if (is_poses_) return OtherContent{"poses (tx ty tz qx qy qz qw)", kPosesElsewhere};
    if (is_matrices_) {
      return OtherContent{"poses, each line a matrix of 12 or 16 numbers", kPosesElsewhere};
    }
    if (is_quaternions_) return OtherContent{"quaternions", "points"};
    if (is_stacked_ && rows_ % 4 == 0) return OtherContent{"a transform of 4x4 numbers", "points"};
    return std::nullopt;
  }

  /// Whether the first column may be a time or an id: it never falls, or holds whole numbers.
  bool starts_with_a_key() const { return columns_[0].is_whole || columns_[0].is_rising; }

  /// Names of the columns of rows that begin with x y z, as far as the rows tell: the empty name for others. Empty if
  /// nothing tells that they begin so.
  Names guess() const {
    Names names(width());
    std::copy_n(std::array{"x", "y", "z"}.begin(), 3, names.begin());
    const auto name = [&](std::size_t first, std::initializer_list<const char*> of) {
      std::copy(of.begin(), of.end(), names.begin() + static_cast<std::ptrdiff_t>(first));
    };
    if (width() == 4) {
      if (starts_with_a_key() || !(columns_[3].is_whole || columns_[3].is_share)) return {};
      name(3, {"intensity"});
      return names;
    }
    if (has_normals(3)) {
      name(3, {"nx", "ny", "nz"});
      if (has_bytes(6)) name(6, {"red", "green", "blue"});
      return names;
    }
    if (has_bytes(3) && has_bytes(4) && !has_normals(6)) return names;  // which are the colours?
    if (has_bytes(3)) {
      name(3, {"red", "green", "blue"});
      if (has_normals(6)) name(6, {"nx", "ny", "nz"});
      return names;
    }
    if (!has_bytes(4)) return {};
    name(3, {"intensity", "red", "green", "blue"});
    return names;
  }

 private:
  static bool is_whole(double value) {
    return value >= 0.0 && value <= 9007199254740992.0 && std::floor(value) == value;
  }
  // Whether numbers of the row are a vector of length 1.
  bool is_unit(std::size_t first, std::size_t count) const {
    if (first + count > row_.size()) return false;
    const Eigen::Map<const Eigen::VectorXd> vector(&row_[first], static_cast<Eigen::Index>(count));
    return std::abs(vector.squaredNorm() - 1.0) < kUnitTolerance;
  }
  // Whether the row begins, at `first`, with three rows of four numbers that begin with a rotation.
  bool is_motion(std::size_t first) const {
    if (row_.size() < first + 12) return false;
    const Eigen::Map<const Eigen::Matrix<double, 3, 4, Eigen::RowMajor>> rows(&row_[first]);
    const Eigen::Matrix3d rotation = rows.leftCols<3>();
    // False for NaN.
    return ((rotation * rotation.transpose() - Eigen::Matrix3d::Identity()).array().abs() <
            kUnitTolerance)
        .all();
  }
  bool ends_a_matrix(std::size_t first) const {
    return row_[first] == 0.0 && row_[first + 1] == 0.0 && row_[first + 2] == 0.0 &&
           row_[first + 3] == 1.0;
  }
  bool has_bytes(std::size_t first) const {
    if (width() < first + 3) return false;
    return columns_[first].is_byte && columns_[first + 1].is_byte && columns_[first + 2].is_byte;
  }
  bool has_normals(std::size_t first) const {
    return (first == 3 && normals_at_3_) || (first == 6 && normals_at_6_);
  }

  void add_patterns() {
    const std::size_t size = row_.size();
    const auto keep = [](bool& pattern, bool holds) { pattern = pattern && holds; };
    keep(is_trajectory_, size >= 8 && is_unit(4, 4));
    keep(is_poses_, size >= 7 && is_unit(3, 4));
    keep(is_quaternions_, size == 4 && is_unit(0, 4));
    const bool has_key = size % 4 == 1;  // a time or number before the matrix
    keep(is_matrices_, ((size == 12 || size == 13) && is_motion(has_key ? 1 : 0)) ||
                           ((size == 16 || size == 17) && ends_a_matrix(has_key ? 13 : 12)));
    keep(is_stacked_, size == 4 && (rows_ % 4 != 0 || ends_a_matrix(0)));
    keep(normals_at_3_, is_unit(3, 3));
    keep(normals_at_6_, is_unit(6, 3));
    const auto are_whole = [&](std::size_t first, std::size_t end, double most) {
      for (std::size_t i = first; i < end; ++i) {
        if (!is_whole(row_[i]) || row_[i] > most) return false;
      }
      return true;
    };
    // POINT3D_ID X Y Z R G B ERROR, then pairs.
    constexpr double kLargestId = 9007199254740992.0;
    keep(is_colmap_, size >= 8 && size % 2 == 0 && are_whole(0, 1, kLargestId) &&
                         are_whole(4, 7, 255.0) && are_whole(8, size, kLargestId));
  }

  static constexpr double kUnitTolerance = 1e-2;

  std::vector<Column> columns_;
  std::vector<double> row_;  // the last one
  std::size_t rows_ = 0;
  std::uint64_t ragged_line_ = 0;
  std::size_t ragged_width_ = 0;
  bool is_trajectory_ = true;
  bool is_poses_ = true;
  bool is_quaternions_ = true;
  bool is_matrices_ = true;
  bool is_stacked_ = true;
  bool is_colmap_ = true;
  bool normals_at_3_ = true;
  bool normals_at_6_ = true;
};

// ---- which column is which

struct Layout {
  Names names;  ///< one a column; empty if it is left out
  std::vector<ScalarType> types;
  std::uint64_t header_line = 0;  ///< 0: the names are in a comment, or nowhere
};

// Finds out what the columns of a text are, from its header or from all of its rows.
class LayoutFinder {
 public:
  LayoutFinder(ByteSource& source, const Execution& execution)
      : name_(source.name()), execution_(execution), lines_(source) {}

  Layout find() {
    const bool is_survey_needed = read_head();
    if (is_survey_needed) survey_rows();
    if (layout_.names.empty()) guess_names();
    choose_types();
    return std::move(layout_);
  }

 private:
  [[noreturn]] void refuse_line(std::uint64_t line, std::string_view what,
                                std::string_view expected) const {
    throw Error(ErrorKind::kInput, fmt::format("{}:{}", name_, line), what, expected);
  }

  // The next line with cells. @return false at the end
  bool next_row() {
    while (const auto next = lines_.next()) {
      const std::string_view line = trimmed(*next);
      if (is_comment(line)) {
        if (survey_.rows() == 0 && layout_.names.empty()) comments_.emplace_back(line);
        if (comments_.size() > kMostComments) comments_.erase(comments_.begin());
      } else if (!line.empty()) {
        split(line, cells_);
        return true;
      }
    }
    return false;
  }

  // The names, if there are any. @return whether more must be known of the rows than that
  bool read_head() {
    if (!next_row()) {
      layout_.names = {"x", "y", "z"};
      return false;
    }
    Names names = names_of(cells_);
    if (position_columns(names)) {
      while (names.back().empty()) names.pop_back();
      layout_.header_line = lines_.line_number();
      take(std::move(names));
      return has_typed_columns() && next_row();
    }
    drop_last_if_empty(cells_);
    const bool is_header = std::none_of(cells_.begin(), cells_.end(), is_number);
    for (const std::string& comment : comments_) {
      if (Names in_comment = names_in_comment(comment, cells_.size()); !in_comment.empty()) {
        take(std::move(in_comment));
        return has_typed_columns();
      }
    }
    if (is_header) {
      refuse_line(lines_.line_number(), "the table names no columns x, y and z",
                  "names such as x,y,z or pos_x,pos_y,pos_z");
    }
    if (cells_.size() < 3) {
      refuse_line(lines_.line_number(), fmt::format("the line has {} fields", cells_.size()),
                  "3 or more");
    }
    if (cells_.size() > 3) return true;
    layout_.names = {"x", "y", "z"};
    return false;
  }

  void take(Names names) {
    reject_if(names_a_rotation(names), name_, "holds poses: some of its columns are a quaternion",
              kPosesElsewhere);
    const auto axes = *position_columns(names);
    for (std::size_t i = 0; i < 3; ++i) names[axes[i]] = std::string(1, "xyz"[i]);
    // Tables of pandas begin with a column of row numbers without a name.
    if (names[0].empty() && std::find(names.begin(), names.end(), "id") == names.end()) {
      names[0] = "id";
    }
    Names sorted = names;
    std::sort(sorted.begin(), sorted.end());
    for (std::size_t i = 1; i < sorted.size(); ++i) {
      if (sorted[i].empty() || sorted[i] != sorted[i - 1]) continue;
      throw Error(ErrorKind::kInput, name_,
                  fmt::format("two columns have the name {}", printable(sorted[i])),
                  "distinct names");
    }
    layout_.names = std::move(names);
  }

  std::optional<std::array<std::size_t, 3>> channels() const {
    Names plain_names;
    for (const std::string& name : layout_.names) plain_names.push_back(plain(name));
    const auto words = columns_named(plain_names, {"red", "green", "blue"});
    return words ? words : columns_named(plain_names, {"r", "g", "b"});
  }
  std::optional<std::size_t> id() const {
    const auto found = std::find(layout_.names.begin(), layout_.names.end(), "id");
    if (found == layout_.names.end()) return std::nullopt;
    return static_cast<std::size_t>(found - layout_.names.begin());
  }
  bool has_typed_columns() const { return channels() || id(); }

  void survey_rows() {
    Execution stop_only;
    stop_only.stop = execution_.stop;
    ReadingProgress progress(stop_only, 0);
    const bool is_named = !layout_.names.empty();
    do {
      constexpr std::size_t kEvery = 65536;
      if (survey_.rows() % kEvery == 0) progress.advance(0, name_);
      if (is_named) {
        if (cells_.size() > layout_.names.size()) drop_last_if_empty(cells_);
      } else {
        drop_last_if_empty(cells_);
        require_numbers();
      }
      survey_.add(cells_, lines_.line_number());
    } while (next_row());
  }

  void require_numbers() const {
    const auto word = std::find_if_not(cells_.begin(), cells_.end(), is_number);
    if (word == cells_.end()) return;
    // IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME
    if (word - cells_.begin() == 9 && survey_.rows() == 0) {
      double square = 0.0;
      for (std::size_t i = 1; i < 5; ++i) square += std::pow(*parse_number(cells_[i]), 2.0);
      reject_if(std::abs(square - 1.0) < 1e-2, name_,
                "holds COLMAP's images.txt under another name",
                "the name images.txt, beside cameras.txt and points3D.txt");
    }
    throw Error(
        ErrorKind::kInput,
        fmt::format("{}:{}: field {}", name_, lines_.line_number(), word - cells_.begin() + 1),
        printable(*word) + " is not a number", "numbers, or a first line that names the columns");
  }

  void guess_names() {
    if (const auto other = survey_.other()) {
      throw Error(ErrorKind::kInput, name_, fmt::format("holds {}", other->what), other->expected);
    }
    if (survey_.ragged_line() != 0) {
      refuse_line(survey_.ragged_line(),
                  fmt::format("the line has {} fields", survey_.ragged_width()),
                  fmt::format("{}, as the first line has", survey_.width()));
    }
    layout_.names = survey_.guess();
    // The name says that the first columns are x, y and z, unless the content contradicts.
    const std::string ending = lower_case(std::filesystem::path(name_).extension().string());
    if (layout_.names.empty() && ending.starts_with(".xyz") && !survey_.starts_with_a_key()) {
      layout_.names = {"x", "y", "z"};
      layout_.names.resize(survey_.width());
    }
    if (layout_.names.empty()) {
      throw Error(
          ErrorKind::kInput, name_,
          fmt::format("its lines have {} numbers, and nothing says which are x, y and z{}",
                      survey_.width(),
                      survey_.starts_with_a_key() ? "; the first may be a time or an id" : ""),
          "a first line that names the columns, such as 'id x y z'");
    }
    Names taken = layout_.names;
    std::erase(taken, std::string());
    log_remark(execution_.log, name_,
               fmt::format("the columns have no names; taken as {}", fmt::join(taken, " ")));
  }

  // Colours and ids are whole numbers throughout.
  void choose_types() {
    layout_.types.assign(layout_.names.size(), ScalarType::kFloat64);
    if (survey_.rows() == 0) return;
    const auto is_all = [&](std::size_t column, bool Survey::Column::*property) {
      return column < survey_.width() && survey_[column].*property;
    };
    if (const auto rgb = channels();
        rgb && std::all_of(rgb->begin(), rgb->end(), [&](std::size_t column) {
          return is_all(column, &Survey::Column::is_byte);
        })) {
      for (std::size_t i = 0; i < 3; ++i) {
        layout_.names[(*rgb)[i]] = std::array{"red", "green", "blue"}[i];
        layout_.types[(*rgb)[i]] = ScalarType::kUint8;
      }
    }
    if (const auto column = id(); column && is_all(*column, &Survey::Column::is_unsigned)) {
      layout_.types[*column] = ScalarType::kUint64;
    }
  }

  static constexpr std::size_t kMostComments = 16;

  std::string name_;
  const Execution& execution_;
  LineReader lines_;
  Cells cells_;  // of the last row
  std::vector<std::string> comments_;
  Survey survey_;
  Layout layout_;
};

// ---- the rows

class TableReader {
 public:
  TableReader(ByteSource& source, Layout layout, const Execution& execution)
      : source_(source),
        layout_(std::move(layout)),
        execution_(execution),
        lines_(source, execution.log) {}

  LandmarkMap read() {
    Cells cells;
    std::optional<PointTable> table;
    ReadingProgress progress(execution_, source_.size().value_or(0));
    std::uint64_t reported = 0;
    std::string row;
    while (const auto next = lines_.next()) {
      constexpr std::uint64_t kBlock = std::uint64_t{1} << 20;
      if (lines_.bytes_read() - reported >= kBlock) {
        progress.advance(lines_.bytes_read() - reported, source_.name());
        reported = lines_.bytes_read();
      }
      const std::string_view line = trimmed(*next);
      if (line.empty() || is_comment(line) || lines_.line_number() <= layout_.header_line) continue;
      split(line, cells);
      if (cells.size() == layout_.names.size() + 1) drop_last_if_empty(cells);
      if (cells.size() != layout_.names.size()) {
        refuse(fmt::format("the line has {} fields", cells.size()),
               fmt::format("{}, as the first line {}", layout_.names.size(),
                           layout_.header_line > 0 ? "names" : "has"));
      }
      if (!table) table.emplace(start(cells));
      row.clear();
      for (const std::size_t i : kept_) {
        if (layout_.types[i] == ScalarType::kUint8) {
          row += fmt::format("{:.0f}", parse_number(cells[i]).value_or(kNoNumber));  // of 1.28e+02
        } else {
          row += cells[i].empty() ? std::string_view("nan") : cells[i];
        }
        row += ' ';
      }
      table->append_text(row, lines_.line_number());
    }
    if (table) return std::move(*table).finish(LengthUnit::kFree);
    MapTables none;
    none.info.length_unit = LengthUnit::kFree;
    return LandmarkMap(std::move(none));
  }

 private:
  [[noreturn]] void refuse(std::string_view what, std::string_view expected) const {
    throw Error(ErrorKind::kInput, fmt::format("{}:{}", source_.name(), lines_.line_number()), what,
                expected);
  }

  // The first row decides which columns hold numbers.
  PointTable start(const Cells& cells) {
    std::vector<PointField> fields;
    std::vector<std::string> of_text;
    std::vector<std::size_t> without_name;
    for (std::size_t i = 0; i < layout_.names.size(); ++i) {
      const std::string& name = layout_.names[i];
      if (name.empty()) {
        without_name.push_back(i + 1);
        continue;
      }
      if (!cells[i].empty() && !is_number(cells[i])) {
        if (name == "x" || name == "y" || name == "z") {
          refuse(fmt::format("{} {} is not a number", name, printable(cells[i])),
                 "a decimal number, or nan");
        }
        of_text.push_back(printable(name));
        continue;
      }
      kept_.push_back(i);
      PointField field;
      field.name = name;
      field.type = layout_.types[i];
      fields.push_back(std::move(field));
    }
    const auto lost = [&](std::string_view what, const auto& which) {
      if (which.empty()) return;
      log_remark(execution_.log, source_.name(),
                 fmt::format("columns {} are left out: {}", what, fmt::join(which, ", ")),
                 RemarkKind::kLoss);
    };
    lost("that hold no numbers", of_text);
    lost("without a name", without_name);
    return {PointFormat::kPly, source_.name(), source_.name(), std::move(fields), execution_};
  }

  ByteSource& source_;
  Layout layout_;
  const Execution& execution_;
  LineReader lines_;
  std::vector<std::size_t> kept_;
};

}  // namespace

bool is_points_text(const MapInput& input) {
  if (input.source == nullptr) return false;
  std::string_view bytes = input.first_bytes;
  if (bytes.find('\0') != std::string_view::npos) return false;
  Cells cells;
  std::vector<std::string_view> comments;
  while (!bytes.empty()) {
    const std::size_t end = bytes.find('\n');
    const std::string_view line = trimmed(bytes.substr(0, end));
    bytes = end == std::string_view::npos ? std::string_view() : bytes.substr(end + 1);
    if (line.empty()) continue;
    if (is_comment(line)) {
      comments.push_back(line);
      continue;
    }
    split(line, cells);
    if (cells.size() >= 3 && (std::all_of(cells.begin(), cells.begin() + 3, is_number) ||
                              position_columns(names_of(cells)))) {
      return true;
    }
    // A table with names: the reader says which are missing.
    if (cells.size() >= 3 && separator_of(line) != ' ' &&
        std::none_of(cells.begin(), cells.end(), [](std::string_view cell) {
          return cell.find_first_of("+-.0123456789{[<") == 0;
        })) {
      Cells next;
      split(bytes.substr(0, bytes.find('\n')), next);
      return next.size() == cells.size();
    }
    drop_last_if_empty(cells);
    return std::any_of(comments.begin(), comments.end(), [&](std::string_view comment) {
      return !names_in_comment(comment, cells.size()).empty();
    });
  }
  return false;
}

LandmarkMap read_plain_points(ByteSource& source, const Execution& execution) {
  // A pipe cannot be read a second time.
  std::string bytes;
  std::optional<MemoryReader> memory;
  if (!source.size()) {
    bytes = read_all(source);
    memory.emplace(bytes, source.name());
  }
  ByteSource& again = memory ? static_cast<ByteSource&>(*memory) : source;
  Layout layout = LayoutFinder(again, execution).find();
  again.rewind();
  return TableReader(again, std::move(layout), execution).read();
}

}  // namespace cairn::detail
