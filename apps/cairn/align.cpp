// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/map/io/map_file.hpp"
#include "cairn/map/operations.hpp"
#include "cairn/registration/align.hpp"
#include "commands.hpp"
#include "support/alignments.hpp"
#include "support/arguments.hpp"
#include "support/documents.hpp"

namespace cairn::cli {
namespace {

constexpr double kDefaultOverlapRadius = 0.05;  // metres

struct AlignArguments {
  CommonArguments common;
  std::string source;
  std::string target;
  std::vector<std::string> confidence = {"none"};
  PoseArguments initial;
  std::string truth;
  std::string output;
  std::string camera;
  std::optional<double> overlap_radius;
  AlignOptions options;
  PointSetOptions point_options;

  void add_to(CLI::App& command);
  int run();

 private:
  Json options_json() const;
  void write_output(const LandmarkMap& source, const Alignment& alignment) const;
};

void AlignArguments::add_to(CLI::App& command) {
  command.add_option("source", source, "Map to move: .map, .ply or .pcd")->required();
  command.add_option("target", target, "Map to align it to")->required();
  command
      .add_option("--confidence", confidence,
                  "Trust in landmarks: " + confidence_help() +
                      ". Several, separated by commas, run side by side")
      ->type_name("METRIC[,...]")
      ->capture_default_str();
  command.add_option("-k,--neighbors", options.k,
                     "Nearest target landmarks among which the most trusted is matched")
      ->capture_default_str();
  initial.add_to(command, "initial", "Displacement of the source map before alignment");
  command
      .add_option("--truth", truth,
                  "True target_from_source, 16 numbers or the JSON of an alignment: adds pose errors")
      ->type_name("FILE");
  command.add_option("--max-iterations", options.max_iterations, "Limit of the iterations")
      ->capture_default_str();
  command
      .add_option("--min-observations", point_options.min_observations,
                  "Leave out landmarks observed less often")
      ->capture_default_str();
  command.add_option("--max-distance", options.max_distance,
                     "Longest distance of a match, in the maps' unit; unlimited by default");
  command.add_flag("--reciprocal", options.reciprocal, "Keep only matches that hold both ways");
  command
      .add_option("--trim", options.trimmed_fraction,
                  "Share of the matches, the farthest apart, to leave out")
      ->capture_default_str();
  command.add_flag("--weight-by-confidence", options.weight_by_source_confidence,
                   "Weigh matches in the estimate by the source landmark's confidence");
  command.add_option(
      "--overlap-radius", overlap_radius,
      fmt::format("Distance within which landmarks overlap; {} m by default for maps in metres",
                  kDefaultOverlapRadius));
  command
      .add_option("--camera", camera,
                  "Camera of maps that name none, for reprojection: \"MODEL width height parameters\"")
      ->type_name("CAMERA");
  command.add_option("-o,--output", output, "Write the source map, aligned to the target")
      ->type_name("FILE");
  command.add_flag("--trace", options.trace, "Keep score and matches of each iteration in the JSON");
  common.add_to(command);
  command.footer(
      "Example: align two maps from a guess, by two strategies, and keep the result\n"
      "  cairn align later.map earlier.map --confidence none,observations \\\n"
      "      --initial \"0.5 -0.5 0 0 0 30\" --json result.json");
}

Json AlignArguments::options_json() const {
  return {{"confidence", confidence},
          {"k", options.k},
          {"initial", to_json(options.initial)},
          {"max_iterations", options.max_iterations},
          {"mse_change_threshold", options.mse_change_threshold},
          {"max_distance",
           std::isfinite(options.max_distance) ? Json(options.max_distance) : Json(nullptr)},
          {"min_observations", point_options.min_observations},
          {"reciprocal", options.reciprocal},
          {"trimmed_fraction", options.trimmed_fraction},
          {"weight_by_source_confidence", options.weight_by_source_confidence},
          {"overlap_radius", to_json(options.overlap_radius)},
          {"trace", options.trace}};
}

void AlignArguments::write_output(const LandmarkMap& source_map, const Alignment& alignment) const {
  if (output.empty()) return;
  if (alignment.result.status != AlignStatus::kAligned) {
    common.console().remark(output + " is not written: there is no pose to move the source by");
    return;
  }
  write_map(transformed(source_map, alignment.result.target_from_source), output);
}

// Both in one unit, or neither known: a pose between maps of different scale means nothing.
LengthUnit common_unit(const LoadedMap& source, const LoadedMap& target) {
  const LengthUnit unit = source.map.info().length_unit;
  if (unit != target.map.info().length_unit) {
    throw Error(ErrorKind::kInput, source.path,
                "in " + to_string(unit) + " units, but " + target.path + " in " +
                    to_string(target.map.info().length_unit),
                "maps of one scale");
  }
  return unit;
}

int AlignArguments::run() {
  // What the command line says is checked before any file is read.
  const std::vector<Strategy> strategies = parse_strategies(confidence);
  if (!output.empty() && strategies.size() > 1) {
    throw Error(ErrorKind::kMisuse, "--output", "several strategies give several results",
                "one --confidence");
  }
  if (!output.empty() && !format_of_extension(output)) {
    throw Error(ErrorKind::kMisuse, "--output", output + " names no map format",
                "a name that ends in .map, .txt, .ply or .pcd");
  }
  const auto given_camera = camera.empty() ? std::nullopt : std::optional(parse_camera(camera));
  options.initial = initial.pose();
  options.executor = common.executor();
  options.overlap_radius = overlap_radius;
  options.validate();
  const auto true_pose = truth.empty() ? std::nullopt : std::optional(read_pose_file(truth));

  LoadedMap source_map = load_map(source, common);
  LoadedMap target_map = load_map(target, common);
  const LengthUnit unit = common_unit(source_map, target_map);
  if (!overlap_radius && unit == LengthUnit::kMetres) options.overlap_radius = kDefaultOverlapRadius;
  for (LoadedMap* const loaded : {&source_map, &target_map}) {
    if (given_camera) loaded->map = with_camera(loaded->map, *given_camera);
    const auto kept = landmarks_observed(loaded->map, point_options.min_observations);
    loaded->description["kept_landmarks"] = kept.size();
  }
  const Console console = common.console();
  options.progress = console.progress("aligning");
  const std::vector<Alignment> alignments = align_by_all(
      source_map.map, target_map.map, strategies, options, point_options, true_pose);

  console.print(fmt::format("source {}: {} of {} landmarks\ntarget {}: {} of {} landmarks\n\n",
                            source, source_map.description["kept_landmarks"].get<std::size_t>(),
                            source_map.map.landmark_count(), target,
                            target_map.description["kept_landmarks"].get<std::size_t>(),
                            target_map.map.landmark_count()));
  console.print(alignment_table(alignments, unit_symbol(unit)));
  for (const Alignment& alignment : alignments) {
    console.print(fmt::format("\n{}: {}\n", alignment.confidence, alignment.result.reason));
    if (alignment.result.status != AlignStatus::kAligned) continue;
    const Rigid3& pose = alignment.result.target_from_source;
    const Eigen::Vector3d angles = pose.roll_pitch_yaw();
    console.print(fmt::format(
        "  target_from_source: x {:.6f} y {:.6f} z {:.6f} {}, roll {:.4f} pitch {:.4f} yaw {:.4f} deg\n",
        pose.translation().x(), pose.translation().y(), pose.translation().z(), unit_symbol(unit),
        degrees(angles.x()), degrees(angles.y()), degrees(angles.z())));
    if (!alignment.result.unobservable.empty()) {
      console.print(fmt::format("  {} directions of the pose are not determined by the matches\n",
                                alignment.result.unobservable.size()));
    }
  }

  Json inputs = {{"source", source_map.description}, {"target", target_map.description}};
  if (true_pose) inputs["truth"] = {{"path", truth}, {"target_from_source", to_json(*true_pose)}};
  Json json = document("align", common, std::move(inputs), options_json());
  json["results"] = Json::array();
  for (const Alignment& alignment : alignments) {
    json["results"].push_back(to_json(alignment, options, unit));
  }
  write_output(source_map.map, alignments.front());
  write_document(json, common);
  const bool all_aligned =
      std::all_of(alignments.begin(), alignments.end(), [](const Alignment& alignment) {
        return alignment.result.status == AlignStatus::kAligned;
      });
  return all_aligned ? kDone : kNoTrustworthyAlignment;
}

}  // namespace

Run add_align(CLI::App& program) {
  auto arguments = std::make_shared<AlignArguments>();
  arguments->add_to(*program.add_subcommand(
      "align", "Align a source map to a target map: transform, score, comparison of strategies"));
  return [arguments] { return arguments->run(); };
}

}  // namespace cairn::cli
