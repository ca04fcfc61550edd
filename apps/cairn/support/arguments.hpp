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

/// Options of names in the library.
struct OptionNames {
  OptionNames(std::string name, std::string option)
      : options{{std::move(name), std::move(option)}} {}
  /// The fields of a table, e.g. "IcpOptions.k".
  OptionNames(const OptionTable& table);

  std::vector<std::pair<std::string, std::string>> options;
};

/// The library names its own parameters and fields; people know the options. Calls `call`; of an
/// Error about one of the library's names the message names its option instead.
void with_option_names(const std::vector<OptionNames>& names, const std::function<void()>& call);

/// Number from a word of the command line; `option` is for the message.
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

/// What every verb takes.
struct CommonArguments {
  std::string json_path;    ///< empty: none; "-": stdout
  std::string csv_path;     ///< the same; only of verbs that add_csv_to
  std::string report_path;  ///< empty: none; only of verbs that add_report_to
  bool quiet = false;
  bool stdout_is_taken = false;  ///< by a map or a pose: set by the verb that writes it
  unsigned threads = 0;
  std::uint64_t seed = 0;

  void add_to(const Command& command);
  /// Adds --threads; of verbs whose work several threads share.
  void add_threads_to(const Command& command);
  /// Adds --seed; of verbs whose work draws random numbers.
  void add_seed_to(const Command& command);
  /// Adds --csv; `row` says what each row is, e.g. "landmark".
  void add_csv_to(const Command& command, const std::string& row);
  /// Adds --report; `what` says what the page shows.
  void add_report_to(const Command& command, const std::string& what);
  /// Answers for people go to stdout unless a file goes there.
  Console console() const {
    if (json_path == "-" || csv_path == "-") return {quiet, Console::Answer::kNowhere};
    return {quiet, stdout_is_taken ? Console::Answer::kToStderr : Console::Answer::kToStdout};
  }
  Executor executor() const { return Executor(threads); }
  /// With the seed, until an interrupt, and with a progress bar of this name; empty: none.
  Execution execution(const std::string& work = {}) const;
};

/// "x y z roll pitch yaw": metres and degrees, R = Rz(yaw)·Ry(pitch)·Rx(roll).
/// @param option for the message
Rigid3 parse_pose(const std::string& text, std::string_view option);

/// 16 numbers, row-major, from a text file; the first result of an `align --json` document; "FILE#MAP": where a
/// merge or an atlas placed that map, by the JSON of `merge`, `atlas merge` or `atlas show`; or the
/// dataparser_transforms.json of nerfstudio.
/// @throws Error (input) naming the file and what is wrong with it
Rigid3 read_pose_file(const std::string& path);
/// The same with a scale: of the matrix, whose upper left part is s·R, or the result's.
Similarity3 read_similarity_file(const std::string& path);

/// A pose given as an option of either kind.
struct PoseArguments {
  std::string text;
  std::string file;

  /// Adds --NAME and --NAME-matrix; `what` says what the pose is.
  void add_to(const Command& command, const std::string& name, const std::string& what);
  bool given() const { return !text.empty() || !file.empty(); }
  /// @throws Error for the JSON of an alignment that was rejected, or whose pose has a scale
  Rigid3 pose() const;
  /// The same of a pose that is only where to start from: a rejected alignment's will do.
  Similarity3 guess(bool with_scale) const;

 private:
  std::string name_;
};

/// Strategies from text such as "base,covariance"; no two alike.
std::vector<Strategy> parse_strategies(const std::string& text);

/// Help text that lists the metrics.
std::string confidence_help();

/// What `--camera` takes, for help and messages.
inline constexpr const char* kCameraHelp =
    "fr1, fr2 or fr3 of the TUM benchmark, a camera file, or \"MODEL width height parameters\"";

/// The camera that `--camera` names: any of kCameraHelp.
/// @param names of other words that the verb takes, for its suggestion
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
