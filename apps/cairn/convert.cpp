// SPDX-License-Identifier: BSD-3-Clause
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/core/number_text.hpp"
#include "cairn/interchange/formats.hpp"
#include "cairn/map/io/content_uuid.hpp"
#include "cairn/map/io/format_registry.hpp"
#include "cairn/map/operations.hpp"

#ifdef CAIRN_HAS_ADJUSTMENT
#include "cairn/adjustment/estimate_covariances.hpp"
#endif

#include "commands.hpp"
#include "support/arguments.hpp"
#include "support/documents.hpp"
#include "support/interrupt.hpp"

namespace cairn::cli {
namespace {

struct ConvertArguments {
  CommonArguments common;
  std::string input;
  std::string output;
  std::string frames;
  std::size_t min_observations = 0;
  PoseArguments transform;
  std::string confidence;
  std::string camera;
  std::string format;
  std::optional<int> format_version;
  bool ascii = false;
  bool double_precision = false;
  bool estimate_covariances = false;
  std::optional<double> pixel_noise;

  void add_to(CLI::App& command);
  int run();

 private:
  const MapFormat& output_format() const;
  LandmarkMap with_estimated_covariances(const LandmarkMap& map, Json& json) const;
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
  add_text(command, "input", input, "Map to read: " + all_formats().titles_text() + "; - for stdin")
      ->required();
  add_text(command, "output", output,
           "Map to write; its ending names the format: " + all_formats().endings_text() +
               "; - for stdout, which takes --format")
      ->required();
  add_text(command, "--format", format,
           "Format to write, whatever the output's ending: " + all_formats().written_names_text(),
           "FORMAT");
  add_text(
      command, "--frames", frames,
      "Cut a mini-map: keep frames with ids from A to below B, and only landmarks all of whose "
      "observations lie in them",
      "A:B");
  add_number(command, "--min-observations", min_observations,
             "Leave out landmarks observed less often, after cutting");
  transform.add_to(command, "transform", "Move the map, new_from_old");
  add_text(command, "--confidence", confidence,
           "Add confidences as columns named confidence_METRIC: " + confidence_help(),
           "METRIC,...");
  add_text(command, "--camera", camera, fmt::format("Camera of all frames: {}", kCameraHelp),
           "CAMERA");
#ifdef CAIRN_HAS_ADJUSTMENT
  auto* const estimate = command.add_flag(
      "--estimate-covariances", estimate_covariances,
      "Covariances of landmarks from their observations, with the first frame held where it is "
      "(and, where no depths give the scale, the distance of the farthest frame); in place of "
      "those that the map has");
  add_number(command, "--pixel-noise", pixel_noise,
             "For that: standard deviation of an observed pixel (default: as the residuals tell)")
      ->needs(estimate);
#endif
  add_number(command, "--format-version", format_version,
             "Version of the text format, 1 or 2 (default: 1 where nothing is lost)");
  command.add_flag("--ascii", ascii, "PLY and PCD as text instead of binary");
  command.add_flag("--double", double_precision,
                   "PCD: positions in double precision, which PCL's point types do not take");
  common.add_to(command);
  command.footer(
      "Example: cut a long map into two mini-maps, and look at one in any PLY viewer\n"
      "  cairn convert desk.map first.map --frames 0:120\n"
      "  cairn convert desk.map second.map --frames 120:240\n"
      "  cairn convert first.map first.ply --confidence covariance,observations");
}

const MapFormat& ConvertArguments::output_format() const {
  const bool to_stdout = output == "-";
  if (to_stdout) {
    require_map_output(output, format, "output");
  } else if (format.empty()) {
    require_map_path(output, "output");
  }
  const MapFormat* const written =
      format.empty() ? all_formats().format_of_ending(output) : all_formats().find(format);
  if (written == nullptr || !written->is_written()) {
    throw Error(ErrorKind::kMisuse, "--format", printable(format),
                all_formats().written_names_text());
  }
  if (!to_stdout) require_place_of(output, *written);
  if (format_version && written->name != "text") {
    throw Error(ErrorKind::kMisuse, "--format-version", output + " is not in the text format",
                "an output that ends in .map or .txt");
  }
  if (format_version && *format_version != 1 && *format_version != 2) {
    throw Error(ErrorKind::kMisuse, "--format-version", std::to_string(*format_version), "1 or 2");
  }
  if (ascii && written->name != "ply" && written->name != "pcd") {
    throw Error(ErrorKind::kMisuse, "--ascii", output + " is neither PLY nor PCD",
                "an output that ends in .ply or .pcd");
  }
  return *written;
}

#ifdef CAIRN_HAS_ADJUSTMENT
LandmarkMap ConvertArguments::with_estimated_covariances(const LandmarkMap& map, Json& json) const {
  CovarianceOptions how;
  how.execution = {common.executor(), interrupt_requests(), {}};
  if (pixel_noise) {
    how.noise = estimated_noise(map);
    how.noise->pixel_px = *pixel_noise;
  }
  EstimatedCovariances estimated;
  with_option_names({{"MeasurementNoise.pixel_px", "--pixel-noise"}},
                    [&] { estimated = cairn::estimate_covariances(map, how); });
  const MeasurementNoise& noise = estimated.noise;
  const bool has_depths =
      map.info().length_unit == LengthUnit::kMetres && !map.observations().depths.empty();
  json = {{"known", estimated.known},
          {"pixel_noise_px", noise.pixel_px},
          {"depth_noise", has_depths ? Json({{"floor_m", noise.depth_floor},
                                             {"quadratic_per_m", noise.depth_quadratic}})
                                     : Json(nullptr)}};
  common.console().print(
      fmt::format("covariances of {} of {} landmarks, by pixel noise of {:.3g} px{}\n",
                  estimated.known, map.landmark_count(), noise.pixel_px,
                  has_depths ? fmt::format(" and depth noise of {:.2g} + {:.2g} z^2 m",
                                           noise.depth_floor, noise.depth_quadratic)
                             : std::string()));
  return estimated.map;
}
#endif

int ConvertArguments::run() {
  const MapFormat& written = output_format();
  require_one_stdout({{"--json", &common.json_path}, {"output", &output}});
  common.stdout_is_taken = output == "-";
  require_folder_of(common.json_path);
  const auto range = frames.empty() ? std::nullopt : std::optional(parse_frames(frames));
  const auto given_camera =
      camera.empty() ? std::nullopt : std::optional(load_camera(camera).camera);
  const auto strategies =
      confidence.empty() ? std::vector<Strategy>{} : parse_strategies(confidence);
  const auto new_from_old = transform.given() ? std::optional(transform.pose()) : std::nullopt;

  const LoadedMap loaded = load_map(input, common);
  LandmarkMap map = loaded.map;
  if (given_camera) map = with_camera(map, *given_camera);
  if (range && !map.has_observations()) {
    throw Error(ErrorKind::kInput, input, "does not know its observations",
                "a map that does, for --frames");
  }
  if (range) {
    with_option_names({{"frames", "--frames"}},
                      [&] { map = cut_frames(map, range->begin, range->end); });
  }
  if (min_observations > 0) map = with_landmarks(map, landmarks_observed(map, min_observations));
  if (new_from_old) map = transformed(map, *new_from_old);
  Json covariances = nullptr;
#ifdef CAIRN_HAS_ADJUSTMENT
  if (estimate_covariances) map = with_estimated_covariances(map, covariances);
#endif
  Json metrics = Json::array();
  for (const Strategy& strategy : strategies) {
    if (!strategy.metric) continue;
    map = with_column(map, "confidence_" + strategy.name, strategy.metric->evaluate(map));
    metrics.push_back(strategy.name);
  }
  // A map made from another has a name of its own, if that one had.
  if (loaded.map.info().uuid && !map.info().uuid) map = with_content_uuid(std::move(map));
  MapWriteOptions options;
  options.format = written.name;
  options.native_version = format_version;
  options.ascii = ascii;
  options.double_precision = double_precision;
  save_map(map, output, common, options);

  const bool has_frames = written.holds_frames;
  Json json = document("convert", common, {{"map", loaded.description}},
                       {{"frames", text_or_null(frames)},
                        {"min_observations", min_observations},
                        {"transform", new_from_old ? to_json(*new_from_old) : Json(nullptr)},
                        {"confidence", std::move(metrics)},
                        {"camera", text_or_null(camera)},
                        {"format", text_or_null(format)},
                        {"format_version", to_json(format_version)},
                        {"ascii", ascii},
                        {"double_precision", double_precision},
                        {"estimate_covariances", estimate_covariances},
                        {"pixel_noise", to_json(pixel_noise)}});
  json["covariances"] = std::move(covariances);
  json["output"] = {
      {"path", output},
      {"frames", has_frames ? Json(map.frame_count()) : Json(nullptr)},
      {"landmarks", map.landmark_count()},
      {"observations",
       has_frames && map.has_observations() ? Json(map.observation_count()) : Json(nullptr)}};
  write_document(json, common);
  const std::string frame_text =
      has_frames ? fmt::format("{} frames, ", map.frame_count()) : std::string();
  common.console().print(
      fmt::format("{}: {}{} landmarks\n", output, frame_text, map.landmark_count()));
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
