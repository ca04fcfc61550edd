// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <concepts>
#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "cairn/core/execution.hpp"
#include "cairn/core/option_table.hpp"
#include "cairn/experiments/run.hpp"
#include "cairn/formats/camera_file.hpp"
#include "cairn/geometry/angles.hpp"
#include "cairn/geometry/rigid3.hpp"
#include "cairn/map/landmark_map.hpp"

#include "support/command_line.hpp"
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

/// Names in the library, each with its option of the command line.
struct OptionNames {
  OptionNames(std::string name, std::string option)
      : options{{std::move(name), std::move(option)}} {}
  /// The fields of a table, e.g. "IcpOptions.k".
  OptionNames(const OptionTable& table);

  std::vector<std::pair<std::string, std::string>> options;
};

/// Calls `call`. If it throws an Error about one of the library's names, the message names the option instead,
/// because users know only the options.
void with_option_names(const std::vector<OptionNames>& names, const std::function<void()>& call);

/// Number from a word of the command line.
/// @param option option's name for the message
/// @throws Error (misuse)
double parse_real(const std::string& word, const std::string& option);
std::uint64_t parse_whole(const std::string& word, const std::string& option,
                          std::uint64_t largest);

template <class Number>
Number parse_as(const std::string& word, const std::string& option) {
  if constexpr (std::integral<Number>) {
    constexpr auto kLargest = static_cast<std::uint64_t>(std::numeric_limits<Number>::max());
    return static_cast<Number>(parse_whole(word, option, kLargest));
  } else {
    return parse_real(word, option);
  }
}

/// "2/8": the second of eight parts, from 1.
/// @throws Error (misuse)
std::pair<std::uint64_t, std::uint64_t> parse_part(std::string_view word, std::string_view option,
                                                   std::string_view expected);

/// Adds an option that takes a number: a finite decimal, or a whole number that fits.
template <class Number>
Option add_number(const Command& command, const std::string& name, std::optional<Number>& number,
                  const std::string& what) {
  return command.add_value(name, what, std::integral<Number> ? "N" : "X",
                           [&number, option = long_name(name)](const std::string& word) {
                             number = parse_as<Number>(word, option);
                           });
}

/// The same; the help shows the number's value before parsing as the default.
template <class Number>
Option add_number(const Command& command, const std::string& name, Number& number,
                  const std::string& what) {
  const Option added =
      command.add_value(name, what, std::integral<Number> ? "N" : "X",
                        [&number, option = long_name(name)](const std::string& word) {
                          number = parse_as<Number>(word, option);
                        });
  if (std::integral<Number> || std::isfinite(number)) added.shows(fmt::format("{}", number));
  return added;
}

/// Adds the flags of an options struct, which must live as long as the program; in the table's order.
std::vector<Option> add_options(const Command& command, const OptionTable& table, void* options);

/// Arguments that every verb takes.
struct CommonArguments {
  std::string json_path;    ///< empty: none; "-": stdout
  std::string csv_path;     ///< the same; only for verbs that call add_csv_to()
  std::string report_path;  ///< empty: none; only for verbs that call add_report_to()
  bool quiet = false;
  bool stdout_is_taken = false;  ///< whether a map or a pose goes to stdout; set by the verb
  unsigned threads = 0;
  std::uint64_t seed = 0;

  void add_to(const Command& command);
  /// Adds --threads, for verbs whose work several threads share.
  void add_threads_to(const Command& command);
  /// Adds --seed, for verbs whose work draws random numbers.
  void add_seed_to(const Command& command);
  /// Adds --csv; `row` states what each row is, e.g. "landmark".
  void add_csv_to(const Command& command, const std::string& row);
  /// Adds --report; `what` states what the page shows.
  void add_report_to(const Command& command, const std::string& what);
  /// Answers for people go to stdout, unless a file goes to stdout.
  Console console() const {
    if (json_path == "-" || csv_path == "-") return {quiet, Console::Answer::kNowhere};
    return {quiet, stdout_is_taken ? Console::Answer::kToStderr : Console::Answer::kToStdout};
  }
  Executor executor() const { return Executor(threads); }
  /// The Execution with the seed, a stop on interrupt, and a progress bar of this name; empty: no bar.
  Execution execution(const std::string& work = {}) const;
};

/// "x y z roll pitch yaw": metres and degrees, R = Rz(yaw)·Ry(pitch)·Rx(roll).
/// @param option option's name for the message
Rigid3 parse_pose(const std::string& text, std::string_view option);

/// Reads a pose from one of these files: a text file with 16 numbers, row-major; an `align --json` document, of
/// which the first result counts; "FILE#MAP", the pose of that map in the JSON of `merge`, `atlas merge` or
/// `atlas show`; or the dataparser_transforms.json of nerfstudio.
/// @throws Error (input) naming the file and what is wrong with it
Rigid3 read_pose_file(const std::string& path);
/// The same with a scale: that of the matrix, whose upper left part is s·R, or that of the result.
Similarity3 read_similarity_file(const std::string& path);

/// A pose that is given by one of two options, as text or as a file.
struct PoseArguments {
  std::string text;
  std::string file;

  /// Adds --NAME and --NAME-matrix; `what` states what the pose is.
  void add_to(const Command& command, const std::string& name, const std::string& what);
  bool given() const { return !text.empty() || !file.empty(); }
  /// @throws Error for the JSON of an alignment that was rejected, or whose pose has a scale
  Rigid3 pose() const;
  /// The same for an initial pose, which may be that of a rejected alignment.
  Similarity3 guess(bool with_scale) const;

 private:
  std::string name_;
};

/// Strategies from text such as "base,covariance"; all different.
std::vector<Strategy> parse_strategies(const std::string& text);

/// Help text that lists the metrics.
std::string confidence_help();

/// Values of `--camera`, for help and messages.
inline constexpr const char* kCameraHelp =
    "fr1, fr2 or fr3 of the TUM benchmark, a camera file, or \"MODEL width height parameters\"";

/// The camera that `--camera` names: any of kCameraHelp.
/// @param names other words that the verb accepts, for the suggestion in the message
CameraFile load_camera(const std::string& text, std::vector<std::string> names = {});
/// The same, or a stereo pair: one file, or two as LEFT,RIGHT.
CameraFile load_calibration(const std::string& text, std::vector<std::string> names = {});

/// "MODEL width height parameters": a camera for maps whose format has none.
Camera parse_camera(const std::string& text);

/// The numbers in `text`, separated by blanks or commas.
/// @throws Error (misuse) naming `option`
std::vector<double> parse_numbers(std::string_view text, std::string_view option,
                                  std::string_view expected);

}  // namespace cairn::cli
