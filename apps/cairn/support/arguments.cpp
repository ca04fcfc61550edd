// SPDX-License-Identifier: BSD-3-Clause
#include "support/arguments.hpp"

#include <algorithm>
#include <numbers>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <nlohmann/json.hpp>

#include "cairn/core/error.hpp"
#include "cairn/core/file.hpp"
#include "cairn/core/number_text.hpp"

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

[[noreturn]] void fail_pose_file(const std::string& path, std::string_view what) {
  throw Error(ErrorKind::kInput, path, what,
              "16 numbers of a rigid transform, row-major, or the JSON of an alignment");
}

Matrix4d matrix_of_json(const std::string& path, const std::string& text) {
  try {
    const auto document = nlohmann::json::parse(text);
    const auto& rows = document.at("results").at(0).at("target_from_source");
    Matrix4d matrix;
    for (int i = 0; i < 16; ++i) {
      matrix(i / 4, i % 4) =
          rows.at(static_cast<std::size_t>(i / 4)).at(static_cast<std::size_t>(i % 4)).get<double>();
    }
    return matrix;
  } catch (const nlohmann::json::exception& error) {
    fail_pose_file(path, fmt::format("no alignment in this JSON ({})", error.what()));
  }
}

Matrix4d matrix_of_text(const std::string& path, const std::string& text) {
  const auto words = words_of(text, " \t\r\n,");
  if (words.size() != 16) fail_pose_file(path, fmt::format("{} numbers", words.size()));
  Matrix4d matrix;
  for (std::size_t i = 0; i < 16; ++i) {
    const auto number = parse_number(words[i]);
    if (!number) {
      fail_pose_file(path, fmt::format("number {}: {} is no number", i + 1, printable(words[i])));
    }
    matrix(static_cast<int>(i / 4), static_cast<int>(i % 4)) = *number;
  }
  return matrix;
}

}  // namespace

void CommonArguments::add_to(CLI::App& command) {
  const std::string group = "Common";
  command.add_option("--json", json_path, "Write the result as JSON to FILE, or to stdout for -")
      ->type_name("FILE|-")
      ->group(group);
  command.add_flag("--quiet", quiet, "No remarks and no progress on stderr")->group(group);
  command.add_option("--threads", threads, "Threads to use at most; 0: one per core")
      ->capture_default_str()
      ->group(group);
  command.add_option("--seed", seed, "Seed of all random numbers")
      ->capture_default_str()
      ->group(group);
}

std::vector<double> parse_numbers(std::string_view text, std::string_view option,
                                  std::optional<std::size_t> count) {
  std::vector<double> numbers;
  for (const std::string_view word : words_of(text, " \t\r\n,")) {
    const auto number = parse_number(word);
    if (!number) {
      throw Error(ErrorKind::kMisuse, option, printable(word) + " is no number", "numbers");
    }
    numbers.push_back(*number);
  }
  if (count && numbers.size() != *count) {
    throw Error(ErrorKind::kMisuse, option, fmt::format("{} numbers", numbers.size()),
                fmt::format("{} in one quoted argument", *count));
  }
  return numbers;
}

double degrees(double radians) { return radians * 180.0 / std::numbers::pi; }
double radians(double degrees) { return degrees * std::numbers::pi / 180.0; }

Rigid3 parse_pose(const std::string& text, std::string_view option) {
  const std::vector<double> n = parse_numbers(text, option, 6);
  return Rigid3::from_roll_pitch_yaw({n[0], n[1], n[2]}, radians(n[3]), radians(n[4]),
                                     radians(n[5]));
}

Rigid3 read_pose_file(const std::string& path) {
  FileReader file(path);
  const std::string text = read_all(file);
  const std::size_t first = text.find_first_not_of(kBlanks);
  const bool is_json = first != std::string::npos && text[first] == '{';
  const Matrix4d matrix = is_json ? matrix_of_json(path, text) : matrix_of_text(path, text);
  try {
    return Rigid3::from_matrix(matrix);
  } catch (const Error& error) {
    fail_pose_file(path, error.what());
  }
}

void PoseArguments::add_to(CLI::App& command, const std::string& name, const std::string& what) {
  name_ = "--" + name;
  auto* const as_text =
      command
          .add_option(name_, text,
                      what + ": \"x y z roll pitch yaw\", metres and degrees, "
                             "R = Rz(yaw)*Ry(pitch)*Rx(roll)")
          ->type_name("POSE");
  command
      .add_option(name_ + "-matrix", file,
                  "The same from a file: 16 numbers, row-major, or the JSON of an alignment")
      ->type_name("FILE")
      ->excludes(as_text);
}

Rigid3 PoseArguments::pose() const {
  if (!file.empty()) return read_pose_file(file);
  if (!text.empty()) return parse_pose(text, name_);
  return {};
}

std::vector<Strategy> parse_strategies(const std::vector<std::string>& words) {
  std::vector<Strategy> strategies;
  for (const std::string& word : words) {
    for (const std::string_view name : words_of(word, ",")) {
      Strategy strategy{std::string(name), std::nullopt};
      if (name != "none" && name != "base") strategy.metric = metric_named(name);
      if (name == "base") strategy.name = "none";
      const bool repeated =
          std::any_of(strategies.begin(), strategies.end(),
                      [&](const Strategy& other) { return other.name == strategy.name; });
      if (!repeated) strategies.push_back(std::move(strategy));
    }
  }
  if (strategies.empty()) {
    throw Error(ErrorKind::kMisuse, "--confidence", "empty", "none or the name of a metric");
  }
  return strategies;
}

std::string confidence_help() {
  return fmt::format("none, {}, or a product such as covariance*observations",
                     fmt::join(metric_names(), ", "));
}

Camera parse_camera(const std::string& text) {
  const auto words = words_of(text, kBlanks);
  Camera camera;
  if (!words.empty()) {
    camera.model = std::string(words.front());
    const std::string rest = text.substr(static_cast<std::size_t>(
        words.front().data() + words.front().size() - text.data()));
    const std::vector<double> numbers = parse_numbers(rest, "--camera");
    constexpr double kLargest = 1e6;
    const auto is_size = [&](double n) { return n >= 1.0 && n <= kLargest && n == std::floor(n); };
    if (numbers.size() < 2 || !is_size(numbers[0]) || !is_size(numbers[1])) {
      throw Error(ErrorKind::kMisuse, "--camera", "no image size",
                  "\"MODEL width height parameters\"");
    }
    camera.width = static_cast<std::uint32_t>(numbers[0]);
    camera.height = static_cast<std::uint32_t>(numbers[1]);
    camera.parameters.assign(numbers.begin() + 2, numbers.end());
  }
  const std::string defect = camera_defect(camera);
  if (!defect.empty()) {
    throw Error(ErrorKind::kMisuse, "--camera", defect, "\"MODEL width height parameters\"");
  }
  return camera;
}

}  // namespace cairn::cli
