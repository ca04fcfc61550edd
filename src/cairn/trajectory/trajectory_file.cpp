// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/trajectory/trajectory_file.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include <Eigen/LU>
#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/core/number_text.hpp"
#include "cairn/core/text.hpp"
#include "cairn/geometry/limits.hpp"
#include "cairn/trajectory/tum.hpp"

namespace cairn {
namespace {

constexpr std::array<std::pair<TrajectoryFormat, std::string_view>, 3> kNames = {
    {{TrajectoryFormat::kTum, "tum"},
     {TrajectoryFormat::kEuroc, "euroc"},
     {TrajectoryFormat::kKitti, "kitti"}}};

constexpr std::string_view kEurocRecord = "nanoseconds,px,py,pz,qw,qx,qy,qz";
constexpr std::string_view kKittiRecord = "the 12 numbers of [R | t], row by row";
constexpr double kNanoseconds = 1e9;

bool is_comment(std::string_view line) {
  const std::size_t first = line.find_first_not_of(kBlanks);
  return first == std::string_view::npos || line[first] == '#';
}

// Words separated by commas or by blanks.
std::vector<std::string_view> words_of(std::string_view line, bool commas) {
  std::vector<std::string_view> words;
  while (!line.empty()) {
    const std::size_t first = line.find_first_not_of(kBlanks);
    if (first == std::string_view::npos) break;
    line.remove_prefix(first);
    const std::size_t end = commas ? line.find(',') : line.find_first_of(kBlanks);
    std::string_view word = line.substr(0, end);
    if (const auto last = word.find_last_not_of(kBlanks); last != std::string_view::npos) {
      word = word.substr(0, last + 1);
    }
    words.push_back(word);
    line.remove_prefix(end == std::string_view::npos ? line.size() : end + (commas ? 1 : 0));
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

std::optional<std::vector<double>> numbers_in(const std::vector<std::string_view>& words,
                                              std::size_t count) {
  std::vector<double> numbers;
  for (std::size_t i = 0; i < count; ++i) {
    const auto number = parse_number(words[i]);
    if (!number) return std::nullopt;
    numbers.push_back(*number);
  }
  return numbers;
}

// A line of a known format, with errors that name the field.
class Record {
 public:
  Record(std::string_view line, bool commas, std::string place, std::string_view expected)
      : words_(words_of(line, commas)), place_(std::move(place)), expected_(expected) {}

  [[noreturn]] void refuse(const std::string& what) const {
    throw Error(ErrorKind::kInput, place_, what, expected_);
  }
  void require_fields(std::size_t least, std::size_t most) const {
    if (words_.size() >= least && words_.size() <= most) return;
    refuse(fmt::format("{} fields", words_.size()));
  }
  double number(std::size_t field) const {
    const auto value = parse_number(words_[field]);
    if (!value) {
      throw Error(ErrorKind::kInput, fmt::format("{}: field {}", place_, field + 1),
                  printable(words_[field]) + " is not a number", "a finite decimal number");
    }
    return *value;
  }
  double coordinate(std::size_t field) const {
    const double value = number(field);
    if (std::abs(value) <= kLargestCoordinate) return value;
    throw Error(ErrorKind::kInput, fmt::format("{}: field {}", place_, field + 1),
                printable(words_[field]) + " is beyond the limit", kExpectedCoordinates);
  }
  // Whole nanoseconds, which a double does not hold.
  double seconds(std::size_t field) const {
    const std::string_view word = words_[field];
    std::int64_t nanoseconds = 0;
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), nanoseconds);
    if (error != std::errc() || end != word.data() + word.size()) {
      throw Error(ErrorKind::kInput, fmt::format("{}: field {} (timestamp)", place_, field + 1),
                  printable(word), "whole nanoseconds");
    }
    constexpr std::int64_t kSecond = 1'000'000'000;
    const std::int64_t whole_seconds = nanoseconds / kSecond;
    return static_cast<double>(whole_seconds) +
           static_cast<double>(nanoseconds % kSecond) / kNanoseconds;
  }
  const std::string& place() const { return place_; }

 private:
  std::vector<std::string_view> words_;
  std::string place_;
  std::string_view expected_;
};

TimedPose euroc_pose(std::string_view line, std::string place) {
  const Record record(line, true, std::move(place), kEurocRecord);
  constexpr std::size_t kMostFields = 64;
  record.require_fields(8, kMostFields);
  const Eigen::Quaterniond rotation(record.number(4), record.number(5), record.number(6),
                                    record.number(7));
  if (!is_unit(rotation)) {
    throw Error(ErrorKind::kInput, record.place(),
                fmt::format("fields 5-8 (qw qx qy qz): quaternion of norm {:.6g}", rotation.norm()),
                "norm 1 within 1e-2");
  }
  const double time_s = record.seconds(0);
  return {time_s, Rigid3(rotation, Eigen::Vector3d(record.coordinate(1), record.coordinate(2),
                                                   record.coordinate(3)))};
}

Rigid3 kitti_pose(std::string_view line, std::string place) {
  const Record record(line, false, std::move(place), kKittiRecord);
  record.require_fields(12, 12);
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

Trajectory read_euroc(ByteSource& source, const LogSink& log) {
  std::vector<TimedPose> poses;
  LineReader lines(source, log);
  while (const auto line = lines.next()) {
    if (is_comment(*line)) continue;
    const std::string place = fmt::format("{}:{}", source.name(), lines.line_number());
    TimedPose pose = euroc_pose(*line, place);
    if (!poses.empty() && pose.timestamp_s <= poses.back().timestamp_s) {
      throw Error(ErrorKind::kInput, place + ": field 1 (timestamp)",
                  "does not come after the one before", "ascending timestamps, each once");
    }
    poses.push_back(std::move(pose));
  }
  return Trajectory(std::move(poses));
}

Trajectory read_kitti(ByteSource& source, std::span<const double> times, const LogSink& log) {
  std::vector<TimedPose> poses;
  LineReader lines(source, log);
  while (const auto line = lines.next()) {
    if (is_comment(*line)) continue;
    const std::string place = fmt::format("{}:{}", source.name(), lines.line_number());
    if (!times.empty() && poses.size() == times.size()) {
      throw Error(ErrorKind::kInput, place,
                  fmt::format("more poses than the {} times", times.size()), "as many");
    }
    const double time_s = times.empty() ? static_cast<double>(poses.size()) : times[poses.size()];
    poses.push_back({time_s, kitti_pose(*line, place)});
  }
  if (!times.empty() && poses.size() < times.size()) {
    throw Error(ErrorKind::kInput, source.name(),
                fmt::format("{} poses and {} times", poses.size(), times.size()), "as many");
  }
  return Trajectory(std::move(poses));
}

std::vector<double> read_times(const std::filesystem::path& path, const LogSink& log) {
  FileReader file(path);
  std::vector<double> times;
  LineReader lines(file, log);
  while (const auto line = lines.next()) {
    if (is_comment(*line)) continue;
    const Record record(*line, false, fmt::format("{}:{}", file.name(), lines.line_number()),
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
    const std::int64_t nanoseconds = static_cast<std::int64_t>(whole) * 1'000'000'000 +
                                     std::llround((pose.timestamp_s - whole) * kNanoseconds);
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
  while (!beginning.empty()) {
    const std::size_t end = beginning.find('\n');
    const std::string_view line = beginning.substr(0, end);
    beginning.remove_prefix(end == std::string_view::npos ? beginning.size() : end + 1);
    if (is_comment(line)) continue;
    const bool commas = line.find(',') != std::string_view::npos;
    const auto words = words_of(line, commas);
    if (commas && words.size() >= 8) {
      const auto n = numbers_in(words, 8);
      if (n && is_unit(Eigen::Quaterniond((*n)[4], (*n)[5], (*n)[6], (*n)[7]))) {
        return TrajectoryFormat::kEuroc;
      }
    } else if (!commas && words.size() == 8) {
      const auto n = numbers_in(words, 8);
      if (n && is_unit(Eigen::Quaterniond((*n)[7], (*n)[4], (*n)[5], (*n)[6]))) {
        return TrajectoryFormat::kTum;
      }
    } else if (!commas && words.size() == 12) {
      const auto n = numbers_in(words, 12);
      Eigen::Matrix3d rotation;
      if (n) {
        rotation << (*n)[0], (*n)[1], (*n)[2], (*n)[4], (*n)[5], (*n)[6], (*n)[8], (*n)[9],
            (*n)[10];
        if (is_rotation(rotation)) return TrajectoryFormat::kKitti;
      }
    }
    return std::nullopt;
  }
  return std::nullopt;
}

Trajectory read_trajectory(ByteSource& source, std::span<const double> times, const LogSink& log) {
  switch (format_of(source)) {
    case TrajectoryFormat::kEuroc:
      return read_euroc(source, log);
    case TrajectoryFormat::kKitti:
      return read_kitti(source, times, log);
    case TrajectoryFormat::kTum:
      break;
  }
  return read_tum_trajectory(source, log);
}

Trajectory read_trajectory(const std::filesystem::path& path, const LogSink& log) {
  FileReader file(path);
  std::vector<double> times;
  const auto beside = path.parent_path() / "times.txt";
  std::error_code ignored;
  if (format_of(file) == TrajectoryFormat::kKitti &&
      std::filesystem::is_regular_file(beside, ignored)) {
    times = read_times(beside, log);
  }
  return read_trajectory(file, times, log);
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
  write_tum_trajectory(trajectory, sink);
}

}  // namespace cairn
