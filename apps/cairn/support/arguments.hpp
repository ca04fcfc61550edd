// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <CLI/CLI.hpp>

#include "cairn/confidence/metric.hpp"
#include "cairn/core/executor.hpp"
#include "cairn/geometry/rigid3.hpp"
#include "cairn/map/landmark_map.hpp"
#include "support/console.hpp"

namespace cairn::cli {

/// Exit codes of every verb.
enum ExitCode {
  kDone = 0,
  kInternalError = 1,
  kWrongUsage = 2,
  kBadInput = 3,
  kNoTrustworthyAlignment = 4,
};

/// What every verb takes.
struct CommonArguments {
  std::string json_path;  ///< empty: none; "-": stdout
  bool quiet = false;
  unsigned threads = 0;
  std::uint64_t seed = 0;

  void add_to(CLI::App& command);
  /// Answers for people go to stdout unless JSON goes there.
  Console console() const { return {quiet, json_path != "-"}; }
  Executor executor() const { return Executor(threads); }
};

/// "x y z roll pitch yaw": metres and degrees, R = Rz(yaw)·Ry(pitch)·Rx(roll).
/// @param option for the message
Rigid3 parse_pose(const std::string& text, std::string_view option);

/// 16 numbers, row-major, from a text file; or the first result of an `align --json` document.
Rigid3 read_pose_file(const std::string& path);

/// A pose given as an option of either kind.
struct PoseArguments {
  std::string text;
  std::string file;

  /// Adds --NAME and --NAME-matrix; `what` says what the pose is.
  void add_to(CLI::App& command, const std::string& name, const std::string& what);
  bool given() const { return !text.empty() || !file.empty(); }
  Rigid3 pose() const;

 private:
  std::string name_;
};

/// One way to align: without confidences, or with those of a metric.
struct Strategy {
  std::string name;  ///< "none", or the metric's
  std::optional<Metric> metric;
};

/// Strategies from "none,covariance"-like words, given once or several times; no two alike.
std::vector<Strategy> parse_strategies(const std::vector<std::string>& words);

/// Help text that lists the metrics.
std::string confidence_help();

/// "MODEL width height parameters": a camera for maps whose format has none.
Camera parse_camera(const std::string& text);

/// The numbers in `text`, separated by blanks or commas.
/// @throws Error (misuse) naming `option` if there are not `count` of them
std::vector<double> parse_numbers(std::string_view text, std::string_view option,
                                  std::optional<std::size_t> count = std::nullopt);

double degrees(double radians);
double radians(double degrees);

}  // namespace cairn::cli
