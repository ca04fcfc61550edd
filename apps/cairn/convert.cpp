// SPDX-License-Identifier: BSD-3-Clause
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/core/number_text.hpp"
#include "cairn/map/io/map_file.hpp"
#include "cairn/map/operations.hpp"
#include "commands.hpp"
#include "support/arguments.hpp"
#include "support/documents.hpp"

namespace cairn::cli {
namespace {

struct ConvertArguments {
  CommonArguments common;
  std::string input;
  std::string output;
  std::string frames;
  std::size_t min_observations = 0;
  PoseArguments transform;
  std::vector<std::string> confidence;
  std::string camera;
  std::optional<int> format_version;
  bool ascii = false;

  void add_to(CLI::App& command);
  int run();
};

struct FrameRange {
  FrameId begin;
  FrameId end;
};

FrameRange parse_frames(const std::string& text) {
  const std::size_t colon = text.find(':');
  const auto begin = parse_unsigned(text.substr(0, colon));
  const auto end =
      colon == std::string::npos ? std::nullopt : parse_unsigned(text.substr(colon + 1));
  if (!begin || !end || *begin >= *end) {
    throw Error(ErrorKind::kMisuse, "--frames", printable(text),
                "A:B, two frame ids, of which frames from A to below B are kept");
  }
  return {FrameId{*begin}, FrameId{*end}};
}

void ConvertArguments::add_to(CLI::App& command) {
  command.add_option("input", input, "Map to read: .map, .ply or .pcd")->required();
  command
      .add_option("output", output, "Map to write; the extension names the format: .map, .ply, .pcd")
      ->required();
  command
      .add_option("--frames", frames,
                  "Cut a mini-map: keep frames with ids from A to below B, and only landmarks all of "
                  "whose observations lie in them")
      ->type_name("A:B");
  command
      .add_option("--min-observations", min_observations, "Leave out landmarks observed less often")
      ->capture_default_str();
  transform.add_to(command, "transform", "Move the map: new_from_old");
  command
      .add_option("--confidence", confidence,
                  "Add confidences as columns named confidence_METRIC: " + confidence_help())
      ->type_name("METRIC[,...]");
  command
      .add_option("--camera", camera, "The camera of all frames: \"MODEL width height parameters\"")
      ->type_name("CAMERA");
  command.add_option("--format-version", format_version,
                     "Version of the text format, 1 or 2; by default 1 where nothing is lost");
  command.add_flag("--ascii", ascii, "PLY and PCD as text instead of binary");
  common.add_to(command);
  command.footer(
      "Example: cut a long map into two mini-maps, and look at one in any PLY viewer\n"
      "  cairn convert desk.map first.map --frames 0:120\n"
      "  cairn convert desk.map second.map --frames 120:240\n"
      "  cairn convert first.map first.ply --confidence covariance,observations");
}

int ConvertArguments::run() {
  const auto range = frames.empty() ? std::nullopt : std::optional(parse_frames(frames));
  const auto given_camera = camera.empty() ? std::nullopt : std::optional(parse_camera(camera));
  const auto metrics =
      confidence.empty() ? std::vector<Strategy>{} : parse_strategies(confidence);
  const bool moves = transform.given();
  const Rigid3 new_from_old = transform.pose();
  if (!format_of_extension(output)) {
    throw Error(ErrorKind::kMisuse, output, "the extension names no map format",
                ".map, .txt, .ply or .pcd");
  }

  const LoadedMap loaded = load_map(input, common);
  LandmarkMap map = loaded.map;
  if (given_camera) map = with_camera(map, *given_camera);
  if (range) map = cut_frames(map, range->begin, range->end);
  if (min_observations > 0) map = with_landmarks(map, landmarks_observed(map, min_observations));
  if (moves) map = transformed(map, new_from_old);
  for (const Strategy& strategy : metrics) {
    if (!strategy.metric) continue;
    map = with_column(map, "confidence_" + strategy.name, strategy.metric->evaluate(map));
  }
  const Console console = common.console();
  MapWriteOptions options;
  options.native_version = format_version;
  options.ascii = ascii;
  options.progress = console.progress("writing " + output);
  write_map(map, output, options);
  console.print(fmt::format("{}: {} frames, {} landmarks\n", output, map.frame_count(),
                            map.landmark_count()));

  Json json = document("convert", common, {{"map", loaded.description}},
                       {{"frames", frames.empty() ? Json(nullptr) : Json(frames)},
                        {"min_observations", min_observations},
                        {"transform", moves ? to_json(new_from_old) : Json(nullptr)},
                        {"confidence", confidence}});
  json["output"] = {{"path", output},
                    {"frames", map.frame_count()},
                    {"landmarks", map.landmark_count()},
                    {"observations", map.has_observations() ? Json(map.observation_count())
                                                            : Json(nullptr)}};
  write_document(json, common);
  return kDone;
}

}  // namespace

Run add_convert(CLI::App& program) {
  auto arguments = std::make_shared<ConvertArguments>();
  arguments->add_to(*program.add_subcommand(
      "convert", "Convert a map to another format; cut, filter or move it on the way"));
  return [arguments] { return arguments->run(); };
}

}  // namespace cairn::cli
