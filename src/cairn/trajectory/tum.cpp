// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/trajectory/tum.hpp"

#include <array>
#include <cmath>
#include <string>
#include <string_view>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/core/number_text.hpp"
#include "cairn/core/text.hpp"
#include "cairn/geometry/limits.hpp"

namespace cairn {
namespace {

constexpr std::array<std::string_view, 8> kFields = {"timestamp", "tx", "ty", "tz",
                                                     "qx",        "qy", "qz", "qw"};

std::array<double, 8> numbers_of(std::string_view line, const std::string& place) {
  std::array<double, 8> numbers{};
  for (std::size_t i = 0; i < kFields.size(); ++i) {
    const auto where = [&] { return fmt::format("{}: field {} ({})", place, i + 1, kFields[i]); };
    line.remove_prefix(std::min(line.find_first_not_of(kBlanks), line.size()));
    if (line.empty()) {
      throw Error(ErrorKind::kInput, where(), "missing", "timestamp tx ty tz qx qy qz qw");
    }
    const std::string_view word = line.substr(0, line.find_first_of(kBlanks));
    const auto number = parse_number(word);
    if (!number) {
      throw Error(ErrorKind::kInput, where(), printable(word) + " is not a number",
                  "a finite decimal number");
    }
    const bool is_time = i == 0;
    const bool is_position = i >= 1 && i <= 3;
    if (is_time && std::abs(*number) > kLargestTimestamp) {
      throw Error(ErrorKind::kInput, where(), printable(word), "seconds, from -1e20 to 1e20");
    }
    if (is_position && std::abs(*number) > kLargestCoordinate) {
      throw Error(ErrorKind::kInput, where(), printable(word) + " is beyond the limit",
                  kExpectedCoordinates);
    }
    numbers[i] = *number;
    line.remove_prefix(word.size());
  }
  if (line.find_first_not_of(kBlanks) != std::string_view::npos) {
    throw Error(ErrorKind::kInput, place, "more than eight fields",
                "timestamp tx ty tz qx qy qz qw");
  }
  return numbers;
}

}  // namespace

Trajectory read_tum_trajectory(ByteSource& source, const LogSink& log) {
  std::vector<TimedPose> poses;
  LineReader lines(source, log);
  while (const auto line = lines.next()) {
    const std::size_t first = line->find_first_not_of(kBlanks);
    if (first == std::string_view::npos || (*line)[first] == '#') continue;
    const std::string place = fmt::format("{}:{}", source.name(), lines.line_number());
    const auto n = numbers_of(*line, place);
    const Eigen::Quaterniond rotation(n[7], n[4], n[5], n[6]);
    if (!(std::abs(rotation.norm() - 1.0) <= 1e-2)) {
      throw Error(
          ErrorKind::kInput, place,
          fmt::format("fields 5-8 (qx qy qz qw): quaternion of norm {:.6g}", rotation.norm()),
          "norm 1 within 1e-2");
    }
    if (!poses.empty() && n[0] <= poses.back().timestamp_s) {
      throw Error(ErrorKind::kInput, place + ": field 1 (timestamp)",
                  fmt::format("{:.6f} does not come after {:.6f}", n[0], poses.back().timestamp_s),
                  "ascending timestamps, each once");
    }
    poses.push_back({n[0], Rigid3(rotation, Eigen::Vector3d(n[1], n[2], n[3]))});
  }
  if (poses.empty()) {
    throw Error(ErrorKind::kInput, source.name(), "no poses",
                "lines of timestamp tx ty tz qx qy qz qw");
  }
  return Trajectory(std::move(poses));
}

void write_tum_trajectory(const Trajectory& trajectory, const ByteSink& sink) {
  std::string text = "# timestamp tx ty tz qx qy qz qw\n";
  for (const TimedPose& pose : trajectory.poses()) {
    const Eigen::Vector3d& t = pose.world_from_camera.translation();
    const Eigen::Quaterniond q = pose.world_from_camera.quaternion();
    append_number(text, pose.timestamp_s);
    for (const double number : {t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w()}) {
      text += ' ';
      append_number(text, number);
    }
    text += '\n';
  }
  sink(text);
}

}  // namespace cairn
