// SPDX-License-Identifier: BSD-3-Clause
#include "support/arguments.hpp"

#include <algorithm>
#include <filesystem>
#include <system_error>

#include <fmt/ranges.h>
#include <nlohmann/json.hpp>

#include "cairn/alignment/document.hpp"
#include "cairn/core/detail/json_field.hpp"
#include "cairn/core/detail/json_text.hpp"
#include "cairn/core/error.hpp"
#include "cairn/core/file.hpp"
#include "cairn/core/number_text.hpp"
#include "cairn/core/text.hpp"
#include "cairn/geometry/limits.hpp"

#include "support/interrupt.hpp"

namespace cairn::cli {
namespace {

std::vector<std::string_view> words_of(std::string_view text, std::string_view separators) {
  std::vector<std::string_view> words;
  for (std::size_t begin = text.find_first_not_of(separators); begin != std::string_view::npos;) {
    const std::size_t end = std::min(text.find_first_of(separators, begin), text.size());
    words.push_back(text.substr(begin, end - begin));
    begin = text.find_first_not_of(separators, end);
  }
  return words;
}

constexpr std::string_view kBlanks = " \t\r\n";
constexpr std::string_view kSeparators = " \t\r\n,";

constexpr std::string_view kPoseFile =
    "16 numbers of a rigid transform, row-major, the JSON of an alignment, or FILE#MAP of a merge";

[[noreturn]] void fail_pose_file(const std::string& path, std::string_view what) {
  throw Error(ErrorKind::kInput, path, what, kPoseFile);
}

enum class PoseUse {
  kAnswer,  ///< of a pose that was judged, the verdict must be aligned
  kGuess,   ///< that is to be refined and judged anew: any pose will do
};

// Of the first result.
Similarity3 pose_of_json(const std::string& path, const std::string& text, PoseUse use) {
  const Alignment first = std::move(read_alignments(text, path).front().alignment);
  if ((!first.verdict || use == PoseUse::kGuess) && first.estimate) return *first.estimate;
  if (!first.target_from_source) {
    fail_pose_file(path, fmt::format("the first result has no pose: it is {}", status_of(first)));
  }
  return *first.target_from_source;
}

// The path of a map without what people write in one way or another: a "./" before it, a "/" behind it.
std::string plain_path(const std::string& path) {
  std::string plain = std::filesystem::path(path).lexically_normal().string();
  if (plain.ends_with('/')) plain.pop_back();
  return plain;
}

// Where a merge or an atlas placed one of its maps, which is named as there, or by its path.
Matrix4d pose_of_placed(const std::string& path, const nlohmann::ordered_json& document,
                        const std::string& map) {
  const detail::JsonField root(document, path, "");
  const std::vector<detail::JsonField> maps = root["maps"].items();
  const detail::JsonField inputs = root["inputs"]["maps"];
  std::vector<std::string> names;
  for (std::size_t i = 0; i < maps.size(); ++i) {
    names.push_back(maps[i]["name"].text());
    const bool has_path = inputs.json().is_array() && i < inputs.json().size();
    const auto given = has_path ? inputs.items()[i]["path"].optional_text() : std::nullopt;
    const bool is_meant = names.back() == map || (given && plain_path(*given) == plain_path(map));
    if (!is_meant) continue;
    const detail::JsonField pose =
        maps[i]["world_from_map"].is_null() ? maps[i]["frame_from_map"] : maps[i]["world_from_map"];
    if (pose.is_null()) {
      fail_pose_file(path, fmt::format("the map {} is not placed", printable(map)));
    }
    const auto numbers = pose.rows<4, 4>();
    return Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(numbers.data());
  }
  constexpr std::size_t kShown = 8;
  const bool cut = names.size() > kShown;
  names.resize(std::min(names.size(), kShown));
  throw Error(
      ErrorKind::kInput, path,
      map.empty() ? fmt::format("places {} maps", maps.size())
                  : fmt::format("places no map {}", printable(map)),
      fmt::format("{}#MAP with one of {}{}", path, fmt::join(names, ", "), cut ? ", ..." : ""));
}

// nerfstudio's dataparser_transforms.json: from the model that it was given into the frame in which it trains.
Matrix4d pose_of_training(const std::string& path, const nlohmann::ordered_json& document) {
  const detail::JsonField root(document, path, "");
  const auto rows = root["transform"].rows<3, 4>();
  Matrix4d matrix = Matrix4d::Identity();
  matrix.topRows<3>() = root["scale"].number() *
                        Eigen::Map<const Eigen::Matrix<double, 3, 4, Eigen::RowMajor>>(rows.data());
  return matrix;
}

Matrix4d matrix_of_text(const std::string& path, const std::string& text) {
  const auto words = words_of(text, kSeparators);
  Matrix4d matrix;
  for (std::size_t i = 0; i < words.size() && i < 16; ++i) {
    const auto number = parse_number(words[i]);
    if (!number) {
      fail_pose_file(path, fmt::format("word {}: {} is no number", i + 1, printable(words[i])));
    }
    matrix(static_cast<int>(i / 4), static_cast<int>(i % 4)) = *number;
  }
  if (words.size() != 16) fail_pose_file(path, fmt::format("{} numbers", words.size()));
  return matrix;
}

template <class Transform>
Transform read_transform(const std::string& path, PoseUse use = PoseUse::kAnswer) {
  // Of "merge.json#one/sparse/0" the part behind the file.
  std::error_code ignored;
  std::string file = path;
  std::string map;
  for (std::size_t hash = path.find('#');
       hash != std::string::npos && !std::filesystem::exists(file, ignored);
       hash = path.find('#', hash + 1)) {
    if (!std::filesystem::exists(path.substr(0, hash), ignored)) continue;
    file = path.substr(0, hash);
    map = path.substr(hash + 1);
  }
  const std::string content = read_file(file);
  const std::string text(without_byte_order_mark(content));
  const std::size_t first = text.find_first_not_of(kBlanks);
  const bool is_json = first != std::string::npos && text[first] == '{';
  const auto document = is_json ? detail::parse_json<nlohmann::ordered_json>(text, file)
                                : std::optional<nlohmann::ordered_json>();
  const bool places_maps = document && document->contains("maps");
  if (!map.empty() && !places_maps) fail_pose_file(path, "names a map, but the file places none");
  const bool is_of_training =
      document && document->contains("transform") && document->contains("scale");
  const Matrix4d matrix = places_maps      ? pose_of_placed(file, *document, map)
                          : is_of_training ? pose_of_training(file, *document)
                          : is_json        ? pose_of_json(file, text, use).matrix()
                                           : matrix_of_text(file, text);
  try {
    return Transform::from_matrix(matrix);
  } catch (const Error& error) {
    throw Error(ErrorKind::kInput, path, error.what(), "");
  }
}

}  // namespace

OptionNames::OptionNames(const OptionTable& table) {
  for (const OptionField& field : table.fields) {
    if (field.flag.empty()) continue;
    const std::string name = long_name(std::string(field.flag));
    options.emplace_back(fmt::format("{}.{}", table.options, field.name),
                         name.substr(name.front() == '!' ? 1 : 0));
  }
}

void with_option_names(const std::vector<OptionNames>& names, const std::function<void()>& call) {
  try {
    call();
  } catch (const Error& error) {
    const std::string_view message = error.what();
    for (const OptionNames& some : names) {
      for (const auto& [name, option] : some.options) {
        const std::string start = name + ": ";
        if (message.starts_with(start)) {
          throw Error(error.kind(), option, message.substr(start.size()), "");
        }
      }
    }
    throw;
  }
}

Execution CommonArguments::execution(const std::string& work) const {
  return {executor(), interrupt_requests(), work.empty() ? Progress() : console().progress(work),
          seed};
}

std::vector<Option> add_options(const Command& command, const OptionTable& table, void* options) {
  std::vector<Option> added;
  for (const OptionField& field : table.fields) {
    if (field.flag.empty()) continue;
    const auto add = [&](auto* value) {
      const std::string name(field.flag);
      const std::string help(field.help);
      if constexpr (std::is_same_v<decltype(value), bool*>) {
        return command.add_flag(name, *value, help);
      } else {
        return add_number(command, name, *value, help);
      }
    };
    added.push_back(std::visit(add, field.value(options)));
  }
  return added;
}

double parse_real(const std::string& word, const std::string& option) {
  const auto number = parse_number(word);
  refuse_if(!number, option, printable(word), "a finite decimal number");
  return *number;
}

std::uint64_t parse_whole(const std::string& word, const std::string& option,
                          std::uint64_t largest) {
  const auto number = parse_unsigned(word);
  refuse_if(!number, option, printable(word), "a whole number, 0 or more");
  refuse_if(*number > largest, option, word, fmt::format("at most {}", largest));
  return *number;
}

std::pair<std::uint64_t, std::uint64_t> parse_part(std::string_view word, std::string_view option,
                                                   std::string_view expected) {
  const std::size_t slash = std::min(word.find('/'), word.size());
  const auto index = parse_unsigned(word.substr(0, slash));
  const auto count = parse_unsigned(word.substr(std::min(slash + 1, word.size())));
  refuse_if(!index || !count || *index < 1 || *index > *count, option, printable(word), expected);
  return {*index, *count};
}

void CommonArguments::add_to(const Command& command) {
  command
      .add_text("--json", json_path, "Write the result as JSON to FILE, or to stdout for -",
                "FILE|-")
      .under(kCommonOptions);
  command.add_flag("--quiet", quiet, "Print no remarks and no progress on stderr")
      .under(kCommonOptions);
}

void CommonArguments::add_threads_to(const Command& command) {
  add_number(command, "--threads", threads,
             "Largest number of threads; 0: one per core. The results do not depend on it")
      .under(kCommonOptions);
}

void CommonArguments::add_seed_to(const Command& command) {
  add_number(command, "--seed", seed, "Seed of the random numbers").under(kCommonOptions);
}

void CommonArguments::add_csv_to(const Command& command, const std::string& row) {
  command.add_text("--csv", csv_path,
                   "Write a CSV table with a row for each " + row + " to FILE, or to stdout for -",
                   "FILE|-");
}

void CommonArguments::add_report_to(const Command& command, const std::string& what) {
  command.add_text("--report", report_path, "Write an HTML page that works offline: " + what,
                   "FILE");
}

std::vector<double> parse_numbers(std::string_view text, std::string_view option,
                                  std::string_view expected) {
  std::vector<double> numbers;
  for (const std::string_view word : words_of(text, kSeparators)) {
    const auto number = parse_number(word);
    refuse_if(!number, option, printable(word) + " is no number", expected);
    numbers.push_back(*number);
  }
  return numbers;
}

Rigid3 parse_pose(const std::string& text, std::string_view option) {
  constexpr std::string_view kExpected = "6, in one quoted argument: \"x y z roll pitch yaw\"";
  const std::vector<double> n = parse_numbers(text, option, kExpected);
  refuse_if(n.size() != 6, option, fmt::format("{} numbers", n.size()), kExpected);
  const std::string_view defect = coordinate_defect({n[0], n[1], n[2]});
  refuse_if(!defect.empty(), option, fmt::format("the translation {}", defect),
            kExpectedCoordinates);
  return Rigid3::from_roll_pitch_yaw({n[0], n[1], n[2]}, radians(n[3]), radians(n[4]),
                                     radians(n[5]));
}

Similarity3 read_similarity_file(const std::string& path) {
  return read_transform<Similarity3>(path);
}

Rigid3 read_pose_file(const std::string& path) {
  return read_transform<Rigid3>(path);
}

void PoseArguments::add_to(const Command& command, const std::string& name,
                           const std::string& what) {
  name_ = "--" + name;
  const Option as_text =
      command.add_text(name_, text,
                       what +
                           ": \"x y z roll pitch yaw\", lengths in the map's unit, "
                           "angles in degrees, R = Rz(yaw)*Ry(pitch)*Rx(roll)",
                       "POSE");
  command
      .add_text(
          name_ + "-matrix", file,
          "Read that pose from a file: 16 numbers, row-major, or the JSON of an alignment (its "
          "first result)",
          "FILE")
      .excludes(as_text);
}

Similarity3 PoseArguments::guess(bool with_scale) const {
  if (file.empty()) return pose();
  if (with_scale) return read_transform<Similarity3>(file, PoseUse::kGuess);
  return read_transform<Rigid3>(file, PoseUse::kGuess);
}

Rigid3 PoseArguments::pose() const {
  if (!file.empty()) return read_pose_file(file);
  if (!text.empty()) return parse_pose(text, name_);
  return {};
}

std::vector<Strategy> parse_strategies(const std::string& text) {
  const auto refuse = [](std::string_view name) {
    throw Error(ErrorKind::kMisuse, "--confidence", printable(name) + " names no metric",
                confidence_help() + did_you_mean(std::string(name), metric_names()));
  };
  std::vector<Strategy> strategies;
  for (const std::string_view name : words_of(text, kSeparators)) {
    Strategy strategy;
    try {
      strategy = strategy_named(name == "none" ? "base" : name);  // its name before 0.2
    } catch (const Error&) {
      refuse(name);
    }
    const auto same = [&](const Strategy& other) { return other.name == strategy.name; };
    if (std::none_of(strategies.begin(), strategies.end(), same)) {
      strategies.push_back(std::move(strategy));
    }
  }
  if (strategies.empty()) refuse(text);
  return strategies;
}

std::string confidence_help() {
  return fmt::format("base, {}, or a product such as covariance*observations",
                     fmt::join(metric_names(), ", "));
}

CameraFile load_camera(const std::string& text, std::vector<std::string> names) {
  CameraFile file = load_calibration(text, std::move(names));
  reject_if(file.rig.has_value(), text, "holds a stereo pair", "one camera");
  return file;
}

CameraFile load_calibration(const std::string& text, std::vector<std::string> names) {
  if (text == "fr1" || text == "fr2" || text == "fr3") {
    return {tum_camera(text), std::nullopt, tum_readout_s(text)};
  }
  if (text.find_first_of(kBlanks) != std::string::npos) return {parse_camera(text), std::nullopt};
  std::error_code failure;  // the reader explains it
  const bool is_missing = !std::filesystem::exists(text, failure) && !failure;
  if (const std::size_t comma = text.find(','); is_missing && comma != std::string::npos) {
    refuse_if(parse_number(std::string_view(text).substr(0, comma)).has_value(), "--camera",
              printable(text) + " is a list of numbers, without model and image size",
              "for example \"PINHOLE 640 480 517 516 318 255\"");
    FileReader left(text.substr(0, comma));
    FileReader right(text.substr(comma + 1));
    const StereoRig rig = read_stereo_files(left, right);
    return {rig.left, std::nullopt, std::nullopt, rig};
  }
  if (is_missing) {
    names.insert(names.end(), {"fr1", "fr2", "fr3"});
    throw Error(ErrorKind::kMisuse, "--camera", printable(text) + " is no camera and no file",
                std::string(kCameraHelp) + did_you_mean(text, names));
  }
  FileReader file(text);
  return read_calibration_file(file);
}

Camera parse_camera(const std::string& text) {
  constexpr std::string_view kExpected = "\"MODEL width height parameters\"";
  const auto words = words_of(text, kBlanks);
  Camera camera;
  if (!words.empty()) {
    camera.model = std::string(words.front());
    const std::string rest = text.substr(
        static_cast<std::size_t>(words.front().data() + words.front().size() - text.data()));
    const std::vector<double> numbers = parse_numbers(rest, "--camera", kExpected);
    constexpr double kLargest = 1e6;
    const auto is_size = [&](double n) { return n >= 1.0 && n <= kLargest && n == std::floor(n); };
    refuse_if(numbers.size() < 2 || !is_size(numbers[0]) || !is_size(numbers[1]), "--camera",
              "no image size", kExpected);
    camera.width = static_cast<std::uint32_t>(numbers[0]);
    camera.height = static_cast<std::uint32_t>(numbers[1]);
    camera.parameters.assign(numbers.begin() + 2, numbers.end());
  }
  const std::string defect = camera_defect(camera);
  refuse_if(!defect.empty(), "--camera", defect, kExpected);
  return camera;
}

}  // namespace cairn::cli
