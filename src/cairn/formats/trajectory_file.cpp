// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/formats/trajectory_file.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <map>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include <Eigen/LU>
#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/core/number_text.hpp"
#include "cairn/core/text.hpp"
#include "cairn/formats/detail/bytes/words.hpp"
#include "cairn/geometry/limits.hpp"

namespace cairn {
namespace {

constexpr std::array<std::pair<TrajectoryFormat, std::string_view>, 3> kNames = {
    {{TrajectoryFormat::kTum, "tum"},
     {TrajectoryFormat::kEuroc, "euroc"},
     {TrajectoryFormat::kKitti, "kitti"}}};

constexpr std::string_view kTumRecord = "timestamp tx ty tz qx qy qz qw";
constexpr std::string_view kKittiRecord = "the 12 numbers of [R | t], row by row";
constexpr double kNanoseconds = 1e9;

bool is_comment(std::string_view line) {
  const std::size_t first = line.find_first_not_of(kBlanks);
  return first == std::string_view::npos || line[first] == '#';
}

// Words separated by commas, of which some may be empty, or by blanks.
std::vector<std::string_view> words_of(std::string_view line, bool commas) {
  if (!commas) return detail::words_of(line);
  std::vector<std::string_view> words;
  for (std::size_t end = 0; end != std::string_view::npos;) {
    end = line.find(',');
    words.push_back(trimmed(line.substr(0, end)));
    line.remove_prefix(end == std::string_view::npos ? line.size() : end + 1);
  }
  return words;
}

bool is_rotation(const Eigen::Matrix3d& matrix) {
  constexpr double kTolerance = 1e-2;
  return (matrix * matrix.transpose() - Eigen::Matrix3d::Identity()).norm() < kTolerance &&
         matrix.determinant() > 0.0;
}

bool is_unit(const Eigen::Quaterniond& quaternion) {
  return std::abs(quaternion.norm() - 1.0) <= 1e-2;
}

// What programs write in place of a number that they do not know: NaN, infinity, or an empty cell.
bool is_unknown(std::string_view word) {
  if (word.empty()) return true;
  double value = 0.0;
  const char* const end = word.data() + word.size();
  const auto [stop, error] = std::from_chars(word.data(), end, value);
  return error == std::errc{} && stop == end && !std::isfinite(value);
}

bool has_unknown(std::span<const std::string_view> words) {
  return std::any_of(words.begin(), words.end(), is_unknown);
}

// Names of columns have no number among them.
bool is_header(const std::vector<std::string_view>& words) {
  return std::none_of(words.begin(), words.end(),
                      [](std::string_view word) { return is_unknown(word) || parse_number(word); });
}

// Place of each field in a row.
enum Field : std::size_t { kTime, kX, kY, kZ, kQx, kQy, kQz, kQw, kFields };
constexpr std::array<std::string_view, kFields> kFieldNames = {"timestamp", "tx", "ty", "tz",
                                                               "qx",        "qy", "qz", "qw"};

struct Columns {
  std::array<std::size_t, kFields> places = {0, 1, 2, 3, 4, 5, 6, 7};
  std::size_t least = kFields;  // number of columns
  std::size_t most = kFields;
  std::optional<double> units_per_second;  // of the times, if a header names their unit

  bool has_real_part_first() const { return places[kQw] < places[kQx]; }
};

// The letters and digits of a column's name in lower case, split by everything else.
std::vector<std::string> tokens_of(std::string_view name) {
  std::vector<std::string> tokens(1);
  for (const char c : name) {
    if (std::isalnum(static_cast<unsigned char>(c)) != 0) {
      tokens.back() += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    } else if (!tokens.back().empty()) {
      tokens.emplace_back();
    }
  }
  if (tokens.back().empty()) tokens.pop_back();
  return tokens;
}

template <std::size_t N>
bool is_one_of(std::string_view word, const std::array<std::string_view, N>& words) {
  return std::find(words.begin(), words.end(), word) != words.end();
}

// The field that a column's name ("p_RS_R_x [m]", "pose.orientation.w", "t") means.
std::optional<Field> field_named(std::string_view name) {
  constexpr std::array<std::string_view, 6> kTimes = {"t",     "ts",        "time",
                                                      "times", "timestamp", "stamp"};
  constexpr std::array<std::string_view, 7> kPositions = {"",         "t",     "p",          "pos",
                                                          "position", "trans", "translation"};
  constexpr std::array<std::string_view, 5> kQuaternions = {"q", "quat", "quaternion", "ori",
                                                            "orientation"};
  std::vector<std::string> tokens = tokens_of(name.substr(0, name.find_first_of("[(")));
  if (tokens.empty()) return std::nullopt;
  const char axis = tokens.back().back();
  constexpr std::string_view kAxes = "xyzw";
  if (const std::size_t which = kAxes.find(axis); which != std::string_view::npos) {
    // "qx" and "q_x" are one; of "p_RS_R_x" and "pose_position_x" the first and last tell what it is.
    tokens.back().pop_back();
    if (tokens.back().empty() && tokens.size() > 1) tokens.pop_back();
    const bool has_frames = tokens.front().size() == 1;
    const std::string& kind = has_frames ? tokens.front() : tokens.back();
    if (is_one_of(kind, kQuaternions)) return static_cast<Field>(kQx + which);
    if (is_one_of(kind, kPositions) && axis != 'w') return static_cast<Field>(kX + which);
    return std::nullopt;
  }
  const bool is_time = std::any_of(tokens.begin(), tokens.end(),
                                   [&](const auto& token) { return is_one_of(token, kTimes); });
  return is_time ? std::optional(kTime) : std::nullopt;
}

std::optional<double> time_unit_named(std::string_view name) {
  constexpr std::array<std::pair<std::string_view, double>, 9> kUnits = {
      {{"ns", kNanoseconds},
       {"nsec", kNanoseconds},
       {"nanoseconds", kNanoseconds},
       {"us", 1e6},
       {"usec", 1e6},
       {"microseconds", 1e6},
       {"ms", 1e3},
       {"msec", 1e3},
       {"milliseconds", 1e3}}};
  for (const std::string& token : tokens_of(name)) {
    for (const auto& [unit, per_second] : kUnits) {
      if (token == unit) return per_second;
    }
  }
  return std::nullopt;
}

// The columns that a line of names gives; std::nullopt unless it names every field.
std::optional<Columns> named_columns(std::string_view line) {
  line.remove_prefix(std::min(line.find_first_not_of(" \t\r#%"), line.size()));
  const auto names = words_of(line, line.find(',') != std::string_view::npos);
  Columns columns;
  columns.least = columns.most = names.size();
  std::array<bool, kFields> known{};
  for (std::size_t i = 0; i < names.size(); ++i) {
    const auto field = field_named(names[i]);
    if (!field || known[*field]) continue;
    known[*field] = true;
    columns.places[*field] = i;
    if (*field == kTime) columns.units_per_second = time_unit_named(names[i]);
  }
  const bool all = std::all_of(known.begin(), known.end(), [](bool is) { return is; });
  return all ? std::optional(columns) : std::nullopt;
}

// Without names, rows between commas are EuRoC's or TUM's, and EuRoC's may have more columns.
Columns unnamed_columns(bool commas) {
  Columns columns;
  if (commas) columns.most = 64;
  return columns;
}

// A line of a known format, with errors that name the field.
class Record {
 public:
  Record(std::vector<std::string_view> words, std::string place, std::string_view expected)
      : words_(std::move(words)), place_(std::move(place)), expected_(expected) {}

  [[noreturn]] void refuse(const std::string& what) const {
    throw Error(ErrorKind::kInput, place_, what, expected_);
  }
  void require_fields(std::size_t least, std::size_t most) const {
    if (words_.size() >= least && words_.size() <= most) return;
    refuse(fmt::format("{} fields", words_.size()));
  }
  double number(std::size_t field, std::string_view name = {}) const {
    const auto value = parse_number(words_[field]);
    if (!value) {
      throw Error(ErrorKind::kInput, where(field, name),
                  printable(words_[field]) + " is not a number", "a finite decimal number");
    }
    return *value;
  }
  double coordinate(std::size_t field, std::string_view name = {}) const {
    const double value = number(field, name);
    if (std::abs(value) <= kLargestCoordinate) return value;
    throw Error(ErrorKind::kInput, where(field, name),
                printable(words_[field]) + " is beyond the limit", kExpectedCoordinates);
  }
  double time(std::size_t field) const {
    const double value = number(field, kFieldNames[kTime]);
    if (std::abs(value) <= kLargestTimestamp) return value;
    throw Error(ErrorKind::kInput, where(field, kFieldNames[kTime]), printable(words_[field]),
                "seconds, from -1e20 to 1e20");
  }
  const std::vector<std::string_view>& words() const { return words_; }
  const std::string& place() const { return place_; }

 private:
  std::string where(std::size_t field, std::string_view name) const {
    return name.empty() ? fmt::format("{}: field {}", place_, field + 1)
                        : fmt::format("{}: field {} ({})", place_, field + 1, name);
  }

  std::vector<std::string_view> words_;
  std::string place_;
  std::string_view expected_;
};

Rigid3 kitti_pose(const Record& record) {
  Eigen::Matrix3d rotation;
  Eigen::Vector3d translation;
  for (int row = 0; row < 3; ++row) {
    const auto first = static_cast<std::size_t>(4 * row);
    for (int column = 0; column < 3; ++column) {
      rotation(row, column) = record.number(first + static_cast<std::size_t>(column));
    }
    translation(row) = record.coordinate(first + 3);
  }
  if (!is_rotation(rotation)) {
    throw Error(ErrorKind::kInput, record.place(), "R is not a rotation",
                "an orthonormal matrix of determinant 1, within 1e-2");
  }
  return {Eigen::Quaterniond(rotation).normalized(), translation};
}

// A row before its columns have a meaning.
struct Row {
  double time = 0.0;
  std::optional<std::int64_t> whole_time;   // which a double may not hold
  std::optional<std::int64_t> nanoseconds;  // the same, if it is in nanoseconds
  std::array<double, kFields> fields{};     // those of Columns; the time is 0
  std::uint64_t line = 0;
};

struct Rows {
  std::vector<Row> rows;
  Columns columns;
  bool commas = false;
  bool named = false;
};

// Rows that were left out, for a remark that counts them.
class LeftOut {
 public:
  void add(std::uint64_t line) { first_line_ = count_++ == 0 ? line : std::min(line, first_line_); }
  std::size_t count() const { return count_; }
  void report(const LogSink& log, std::string_view source, std::size_t of,
              std::string_view why) const {
    if (count_ == 0 || !log) return;
    log({fmt::format("{}: {} of {} poses left out, the first in line {}: {}", source, count_, of,
                     first_line_, why),
         RemarkKind::kLoss});
  }

 private:
  std::size_t count_ = 0;
  std::uint64_t first_line_ = 0;
};

constexpr std::string_view kUnknownPoses = "their numbers are unknown (NaN or empty)";

Row row_of(const Record& record, const Columns& columns, std::uint64_t line) {
  Row row;
  row.line = line;
  row.time = record.time(columns.places[kTime]);
  const std::string_view word = record.words()[columns.places[kTime]];
  std::int64_t whole = 0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), whole);
  if (error == std::errc() && end == word.data() + word.size()) row.whole_time = whole;
  for (std::size_t i = kX; i < kFields; ++i) {
    row.fields[i] = i < kQx ? record.coordinate(columns.places[i], kFieldNames[i])
                            : record.number(columns.places[i], kFieldNames[i]);
  }
  const Eigen::Map<const Eigen::Vector4d> quaternion(&row.fields[kQx]);
  if (!is_unit(Eigen::Quaterniond(quaternion))) {
    throw Error(ErrorKind::kInput, record.place(),
                fmt::format("quaternion of norm {:.6g}", quaternion.norm()), "norm 1 within 1e-2");
  }
  return row;
}

Rows read_rows(ByteSource& source, const LogSink& log) {
  Rows result;
  LeftOut unknown;
  std::optional<Columns> comment;
  bool begun = false;
  LineReader lines(source, log);
  while (const auto line = lines.next()) {
    if (is_comment(*line)) {
      if (begun) continue;
      if (const auto named = named_columns(*line)) comment = named;
      continue;
    }
    const std::uint64_t number = lines.line_number();
    if (!begun) result.commas = line->find(',') != std::string_view::npos;
    const Record record(words_of(*line, result.commas), fmt::format("{}:{}", source.name(), number),
                        result.named ? "as many as there are names of columns" : kTumRecord);
    if (!begun) {
      begun = true;
      const bool header = is_header(record.words());
      const auto named = header ? named_columns(*line) : comment;
      if (header && !named) record.refuse("neither a pose nor the names of such columns");
      // Other comments mention the columns in sentences.
      result.named = named && (header || named->most == record.words().size());
      result.columns = result.named ? *named : unnamed_columns(result.commas);
      if (header) continue;
    }
    record.require_fields(result.columns.least, result.columns.most);
    std::array<std::string_view, kFields> words;
    for (std::size_t i = 0; i < kFields; ++i) words[i] = record.words()[result.columns.places[i]];
    if (has_unknown(words)) {
      unknown.add(number);
    } else {
      result.rows.push_back(row_of(record, result.columns, number));
    }
  }
  unknown.report(log, source.name(), result.rows.size() + unknown.count(), kUnknownPoses);
  reject_if(result.rows.empty(), source.name(), "no poses", fmt::format("lines of {}", kTumRecord));
  return result;
}

// Gives unnamed columns between commas their meaning: that of TUM, or of EuRoC if the times are whole numbers.
void name_columns(Rows& rows, const std::string& source, const LogSink& log) {
  if (!rows.commas || rows.named) return;
  const bool is_euroc = std::all_of(rows.rows.begin(), rows.rows.end(),
                                    [](const Row& row) { return row.whole_time.has_value(); });
  if (is_euroc) {
    rows.columns.places = {0, 1, 2, 3, 5, 6, 7, 4};
    for (Row& row : rows.rows) {
      std::rotate(&row.fields[kQx], &row.fields[kQy], row.fields.data() + kFields);
    }
  }
  if (log) {
    log(fmt::format("{}: no line names the columns; read as {}", source,
                    is_euroc ? "nanoseconds px py pz qw qx qy qz" : kTumRecord));
  }
}

// Brings the times to seconds. Nothing but nanoseconds reaches 1e17: those are three years, as seconds three billion.
void convert_times(Rows& rows, const std::string& source, const LogSink& log) {
  constexpr double kLeastNanoseconds = 1e17;
  constexpr double kMostSeconds = 1e11;  // some thousand years
  double largest = 0.0;
  bool whole = true;
  for (const Row& row : rows.rows) {
    largest = std::max(largest, std::abs(row.time));
    whole = whole && row.whole_time;
  }
  double unit = rows.columns.units_per_second.value_or(1.0);
  const bool is_euroc = rows.commas && rows.columns.has_real_part_first() && whole;
  if (!rows.columns.units_per_second && (is_euroc || largest >= kLeastNanoseconds)) {
    unit = kNanoseconds;
    if (!is_euroc && log) {
      log(fmt::format("{}: times up to {:.4g} are read as nanoseconds", source, largest));
    }
  }
  for (Row& row : rows.rows) {
    if (row.whole_time) {
      const auto per_second = static_cast<std::int64_t>(unit);
      row.time = static_cast<double>(*row.whole_time / per_second) +
                 static_cast<double>(*row.whole_time % per_second) / unit;
      if (unit == kNanoseconds) row.nanoseconds = row.whole_time;
    } else {
      row.time /= unit;
    }
  }
  largest /= unit;
  reject_if(largest >= kLeastNanoseconds, source, fmt::format("times up to {:.4g} s", largest),
            "less than 1e17 s");
  if (largest > kMostSeconds && log) {
    log(
        fmt::format("{}: times up to {:.4g} are read as seconds; milliseconds or microseconds need "
                    "a header that says so, such as 'timestamp_ms tx ty tz qx qy qz qw'",
                    source, largest));
  }
}

bool same_pose(const Row& a, const Row& b) {
  return a.fields == b.fields;
}

// Orders the rows by time, and keeps the first of those with one time.
void order_by_time(Rows& rows, const std::string& source, const LogSink& log) {
  const auto earlier = [](const Row& a, const Row& b) { return a.time < b.time; };
  auto& all = rows.rows;
  if (!std::is_sorted(all.begin(), all.end(), earlier)) {
    if (log) log(source + ": the poses are not in the order of time; sorted");
    std::stable_sort(all.begin(), all.end(), earlier);
  }
  LeftOut repeated;
  std::size_t contradictions = 0;
  std::vector<Row> kept;
  for (const Row& row : all) {
    if (kept.empty() || row.time != kept.back().time) {
      kept.push_back(row);
      continue;
    }
    repeated.add(row.line);
    if (!same_pose(row, kept.back())) ++contradictions;
  }
  if (2 * contradictions > all.size()) {
    throw Error(
        ErrorKind::kInput, source,
        fmt::format("{} of {} poses have the time of another pose", contradictions, all.size()),
        "a time of its own for each pose");
  }
  repeated.report(log, source, all.size(), "they have the time of one before");
  all = std::move(kept);
}

Trajectory read_named(ByteSource& source, const LogSink& log) {
  Rows rows = read_rows(source, log);
  name_columns(rows, source.name(), log);
  convert_times(rows, source.name(), log);
  order_by_time(rows, source.name(), log);
  std::vector<TimedPose> poses;
  poses.reserve(rows.rows.size());
  for (const Row& row : rows.rows) {
    const auto& f = row.fields;
    poses.push_back({row.time,
                     Rigid3(Eigen::Quaterniond(f[kQw], f[kQx], f[kQy], f[kQz]),
                            Eigen::Vector3d(f[kX], f[kY], f[kZ])),
                     row.nanoseconds});
  }
  return Trajectory(std::move(poses));
}

Trajectory read_kitti(ByteSource& source, std::span<const double> times, const LogSink& log) {
  std::vector<TimedPose> poses;
  LeftOut unknown;
  std::size_t count = 0;
  LineReader lines(source, log);
  while (const auto line = lines.next()) {
    if (is_comment(*line)) continue;
    const Record record(words_of(*line, false),
                        fmt::format("{}:{}", source.name(), lines.line_number()), kKittiRecord);
    if (!times.empty() && count == times.size()) {
      throw Error(ErrorKind::kInput, record.place(),
                  fmt::format("more poses than the {} times", times.size()), "as many");
    }
    record.require_fields(12, 12);
    const double time_s = times.empty() ? static_cast<double>(count) : times[count];
    ++count;
    if (has_unknown(record.words())) {
      unknown.add(lines.line_number());
    } else {
      poses.push_back({time_s, kitti_pose(record)});
    }
  }
  reject_if(!times.empty() && count < times.size(), source.name(),
            fmt::format("{} poses and {} times", count, times.size()), "as many");
  unknown.report(log, source.name(), count, kUnknownPoses);
  reject_if(poses.empty(), source.name(), "no poses", fmt::format("lines of {}", kKittiRecord));
  return Trajectory(std::move(poses));
}

std::vector<double> read_times(const std::filesystem::path& path, const LogSink& log) {
  FileReader file(path);
  std::vector<double> times;
  LineReader lines(file, log);
  while (const auto line = lines.next()) {
    if (is_comment(*line)) continue;
    const Record record(words_of(*line, false),
                        fmt::format("{}:{}", file.name(), lines.line_number()),
                        "one time in seconds");
    record.require_fields(1, 1);
    const double time = record.number(0);
    if (!times.empty() && time <= times.back()) {
      record.refuse("does not come after the time before");
    }
    times.push_back(time);
  }
  return times;
}

// The number of a pose's file in 7-Scenes' folders, "frame-000012.pose.txt".
std::optional<std::uint64_t> number_of_pose_file(const std::string& name) {
  constexpr std::string_view kBefore = "frame-";
  constexpr std::string_view kAfter = ".pose.txt";
  if (!name.starts_with(kBefore) || !name.ends_with(kAfter)) return std::nullopt;
  return parse_unsigned(
      std::string_view(name).substr(kBefore.size(), name.size() - kBefore.size() - kAfter.size()));
}

// A file for each pose, of a 4 x 4 matrix.
Trajectory read_pose_files(const std::filesystem::path& folder, const LogSink& log) {
  std::map<std::uint64_t, std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    const auto number = number_of_pose_file(entry.path().filename().string());
    if (number) files.emplace(*number, entry.path());
  }
  reject_if(files.empty(), folder.string(), "no poses", "files frame-000000.pose.txt, as 7-Scenes");
  std::vector<TimedPose> poses;
  for (const auto& [number, file] : files) {
    const std::string name = file.string();
    std::string text = read_file(file);
    std::ranges::replace(text, '\n', ' ');
    const Record record(detail::words_of(text), name, "the 16 numbers of a 4 x 4 matrix");
    record.require_fields(16, 16);
    if (!has_unknown(record.words()))
      poses.push_back({static_cast<double>(number), kitti_pose(record)});
  }
  if (const std::size_t unknown = files.size() - poses.size(); unknown > 0 && log) {
    log({fmt::format("{}: {} of {} poses left out: {}", folder.string(), unknown, files.size(),
                     kUnknownPoses),
         RemarkKind::kLoss});
  }
  return Trajectory(std::move(poses));
}

// ICL-NUIM's world and cameras have y up, which is left-handed; its images have their first row at the top.
Trajectory with_y_down(const Trajectory& y_up) {
  std::vector<TimedPose> poses;
  for (const TimedPose& pose : y_up.poses()) {
    const Eigen::Quaterniond q = pose.world_from_camera.quaternion();
    const Eigen::Vector3d& t = pose.world_from_camera.translation();
    poses.push_back({pose.timestamp_s, Rigid3(Eigen::Quaterniond(q.w(), -q.x(), q.y(), -q.z()),
                                              {t.x(), -t.y(), t.z()})});
  }
  return Trajectory(std::move(poses));
}

// Reads a long beginning, because long comments may precede the first record.
TrajectoryFormat format_of(ByteSource& source) {
  constexpr std::size_t kBeginning = std::size_t{1} << 16;
  std::string beginning(kBeginning, '\0');
  std::size_t size = 0;
  while (size < kBeginning) {
    const std::size_t count = source.read(beginning.data() + size, kBeginning - size);
    if (count == 0) break;
    size += count;
  }
  source.rewind();
  beginning.resize(size);
  // Unrecognised text is refused by the most common format, which names line and field.
  return recognised_trajectory(beginning).value_or(TrajectoryFormat::kTum);
}

void append_all(std::string& text, std::span<const double> numbers, char separator) {
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    if (i > 0) text += separator;
    append_number(text, numbers[i]);
  }
}

std::string tum_text(const Trajectory& trajectory) {
  std::string text = fmt::format("# {}\n", kTumRecord);
  for (const TimedPose& pose : trajectory.poses()) {
    const Eigen::Vector3d& t = pose.world_from_camera.translation();
    const Eigen::Quaterniond q = pose.world_from_camera.quaternion();
    append_all(text, std::array{pose.timestamp_s, t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w()},
               ' ');
    text += '\n';
  }
  return text;
}

std::string euroc_text(const Trajectory& trajectory) {
  std::string text =
      "#timestamp [ns],p_RS_R_x [m],p_RS_R_y [m],p_RS_R_z [m],q_RS_w [],q_RS_x [],q_RS_y [],"
      "q_RS_z []\n";
  std::optional<std::int64_t> before;
  for (const TimedPose& pose : trajectory.poses()) {
    constexpr double kMost = 9.2e9;  // seconds, of 64 bits
    if (!(std::abs(pose.timestamp_s) < kMost)) {
      throw Error(ErrorKind::kMisuse, "timestamp", fmt::format("{} s", pose.timestamp_s),
                  "seconds of which 64 bits hold the nanoseconds");
    }
    const double whole = std::floor(pose.timestamp_s);
    const std::int64_t nanoseconds =
        pose.timestamp_ns.value_or(static_cast<std::int64_t>(whole) * 1'000'000'000 +
                                   std::llround((pose.timestamp_s - whole) * kNanoseconds));
    if (before && nanoseconds <= *before) {
      throw Error(ErrorKind::kMisuse, "timestamp", fmt::format("{} s", pose.timestamp_s),
                  "times that are at least a nanosecond apart");
    }
    before = nanoseconds;
    const Eigen::Vector3d& t = pose.world_from_camera.translation();
    const Eigen::Quaterniond q = pose.world_from_camera.quaternion();
    text += fmt::format("{},", nanoseconds);
    append_all(text, std::array{t.x(), t.y(), t.z(), q.w(), q.x(), q.y(), q.z()}, ',');
    text += '\n';
  }
  return text;
}

std::string kitti_text(const Trajectory& trajectory) {
  std::string text;
  for (const TimedPose& pose : trajectory.poses()) {
    const Eigen::Matrix3d r = pose.world_from_camera.rotation();
    const Eigen::Vector3d& t = pose.world_from_camera.translation();
    append_all(text,
               std::array{r(0, 0), r(0, 1), r(0, 2), t(0), r(1, 0), r(1, 1), r(1, 2), t(1), r(2, 0),
                          r(2, 1), r(2, 2), t(2)},
               ' ');
    text += '\n';
  }
  return text;
}

}  // namespace

std::string_view to_string(TrajectoryFormat format) {
  for (const auto& [known, name] : kNames) {
    if (known == format) return name;
  }
  return "";
}

std::optional<TrajectoryFormat> trajectory_format(std::string_view name) {
  for (const auto& [format, known] : kNames) {
    if (known == name) return format;
  }
  return std::nullopt;
}

std::optional<TrajectoryFormat> recognised_trajectory(std::string_view beginning) {
  std::optional<Columns> named;
  bool has_header = false;
  std::optional<TrajectoryFormat> of_unknown_poses;
  while (!beginning.empty()) {
    const std::size_t end = beginning.find('\n');
    const std::string_view line = beginning.substr(0, end);
    beginning.remove_prefix(end == std::string_view::npos ? beginning.size() : end + 1);
    if (is_comment(line)) {
      if (const auto names = named_columns(line)) named = names;
      continue;
    }
    const bool commas = line.find(',') != std::string_view::npos;
    const auto words = words_of(line, commas);
    if (!has_header && is_header(words)) {
      named = named_columns(line);
      if (!named) return std::nullopt;
      has_header = true;
      continue;
    }
    const bool by_name = named && words.size() == named->most;
    if (!by_name && (commas ? words.size() < kFields : words.size() != kFields)) {
      if (commas || words.size() != 12) return of_unknown_poses;
      if (has_unknown(words)) {
        of_unknown_poses = TrajectoryFormat::kKitti;
        continue;
      }
      Eigen::Matrix3d rotation;
      for (std::size_t i = 0; i < 12; ++i) {
        const auto number = parse_number(words[i]);
        if (!number) return std::nullopt;
        const auto column = static_cast<int>(i % 4);
        if (column < 3) rotation(static_cast<int>(i / 4), column) = *number;
      }
      return is_rotation(rotation) ? std::optional(TrajectoryFormat::kKitti) : std::nullopt;
    }
    const Columns columns = by_name ? *named : unnamed_columns(commas);
    const bool is_euroc =
        commas && (by_name ? columns.has_real_part_first() : parse_unsigned(words[0]).has_value());
    const auto format = is_euroc ? TrajectoryFormat::kEuroc : TrajectoryFormat::kTum;
    Eigen::Vector4d quaternion;
    bool unknown = false;
    for (std::size_t i = 0; i < kFields; ++i) {
      const std::string_view word = words[columns.places[i]];
      const auto number = parse_number(word);
      if (!number && (i == kTime || !is_unknown(word))) return std::nullopt;
      unknown = unknown || !number;
      if (i >= kQx) quaternion(static_cast<int>(i - kQx)) = number.value_or(0.0);
    }
    if (unknown) {
      of_unknown_poses = format;
      continue;
    }
    return is_unit(Eigen::Quaterniond(quaternion)) ? std::optional(format) : std::nullopt;
  }
  return of_unknown_poses;
}

Trajectory read_trajectory(ByteSource& source, std::span<const double> times, const LogSink& log) {
  return format_of(source) == TrajectoryFormat::kKitti ? read_kitti(source, times, log)
                                                       : read_named(source, log);
}

Trajectory read_trajectory(const std::filesystem::path& path, const LogSink& log) {
  std::error_code ignored;
  if (std::filesystem::is_directory(path, ignored)) return read_pose_files(path, log);
  FileReader file(path);
  std::vector<double> times;
  const auto beside = path.parent_path() / "times.txt";
  if (format_of(file) == TrajectoryFormat::kKitti &&
      std::filesystem::is_regular_file(beside, ignored)) {
    times = read_times(beside, log);
  }
  const Trajectory read = read_trajectory(file, times, log);
  if (!path.filename().string().ends_with(".gt.freiburg")) return read;
  if (log) log(path.string() + ": poses of ICL-NUIM, whose y points up; turned to y down");
  return with_y_down(read);
}

void write_trajectory(const Trajectory& trajectory, TrajectoryFormat format, const ByteSink& sink) {
  switch (format) {
    case TrajectoryFormat::kEuroc:
      sink(euroc_text(trajectory));
      return;
    case TrajectoryFormat::kKitti:
      sink(kitti_text(trajectory));
      return;
    case TrajectoryFormat::kTum:
      break;
  }
  sink(tum_text(trajectory));
}

}  // namespace cairn
