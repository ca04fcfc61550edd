// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "cairn/alignment/alignment.hpp"
#include "cairn/core/error.hpp"
#include "cairn/formats/foreign/all_formats.hpp"
#include "cairn/formats/map_file.hpp"
#include "cairn/map/operations.hpp"
#include "cairn/map/turning_columns.hpp"
#include "cairn/registration/icp.hpp"

#include "align_pairs.hpp"
#include "commands.hpp"
#include "support/alignments.hpp"
#include "support/arguments.hpp"
#include "support/documents.hpp"
#include "support/hints.hpp"
#include "support/reports.hpp"
#include "support/table.hpp"

namespace cairn::cli {
namespace {

constexpr double kDefaultOverlapRadius = 0.05;  // metres

struct AlignArguments {
  CommonArguments common;
  std::string source;
  std::string target;
  std::string pairs;
  std::string confidence = "none";
  PoseArguments initial;
  std::string truth;
  std::string output;
  std::string format;  // of an output to stdout
  std::string pose;
  std::string pose_format = "matrix";
  std::string camera;
  std::string source_sequence;
  std::string target_sequence;
  IcpOptions options;
  bool stop_as_pcl = false;
  PointSetOptions point_options;
  std::string method;
  bool gravity = false;
  bool estimate_scale = false;
  bool no_scale = false;
  bool with_scale = false;  // whether it is estimated for these maps
  bool anywhere = false;
  bool no_verdict = false;
  bool by_parts = false;
  bool no_parts = false;
  bool no_deformation = false;
  AlignOptions alignment;  // but for what `options` hold
  std::vector<const CLI::Option*> of_icp_alone;
  std::vector<const CLI::Option*> of_guesses;  // a search has none of these
  std::vector<const CLI::Option*> initials;

  void add_to(CLI::App& command);
  int run();

 private:
  int run_pairs();
  bool is_robust() const;
  bool has_initial() const;
  void check_options() const;
  void refuse_scale_in_tum() const;
  void check_outputs(std::size_t strategies);
  void write_pose_file(const Similarity3& target_from_source) const;
  Json options_json(const std::vector<Strategy>& strategies) const;
  ReportedPair reported_pair(const LoadedMap& source_map, const LoadedMap& target_map,
                             LengthUnit unit, const std::optional<Similarity3>& true_pose) const;
  report::Report make_report(const ReportedPair& pair, const Json& json) const;
  void print(const LoadedMap& source_map, const LoadedMap& target_map,
             const std::vector<StrategyResult>& results, LengthUnit unit) const;
};

void AlignArguments::add_to(CLI::App& command) {
  add_text(command, "source", source,
           "Map to move: " + all_formats().titles_text() + "; - for stdin");
  add_text(command, "target", target, "Map to align it to");
  auto* const list = add_text(
      command, "--pairs", pairs,
      "Align each pair in a CSV file (columns source and target) instead of two maps; - for stdin",
      "FILE|-");
  add_text(command, "--confidence", confidence,
           "Confidence metric of the landmarks: " + confidence_help() +
               ". Several, separated by commas, are compared",
           "METRIC,...")
      ->capture_default_str();
  add_number(command, "-k,--neighbors", options.k,
             "With icp: match a source landmark to the most confident of this many nearest target "
             "landmarks");
  initial.add_to(command, "initial", "Initial pose, target_from_source");
  add_text(
      command, "--truth", truth,
      "True target_from_source, 16 numbers or the JSON of an alignment; prints the pose errors",
      "FILE");
  add_text(command, "-o,--output", output,
           "Write the aligned source map, in the target's frame; - for stdout, with --format",
           "FILE|-");
  add_text(command, "--format", format, "Format of a map on stdout: " + stdout_formats_text(),
           "NAME");
  add_text(
      command, "--pose", pose,
      "Write target_from_source as 16 numbers, row-major, if the pose is aligned; - for stdout",
      "FILE|-");
  add_text(command, "--pose-format", pose_format,
           "Format of --pose: matrix, or tum (one line: 0 tx ty tz qx qy qz qw)", "NAME")
      ->capture_default_str();
  add_number(command, "--max-iterations", options.max_iterations, "Largest number of iterations");
  command.add_flag("--stop-as-pcl", stop_as_pcl,
                   "With icp: stop as PCL does, when the mean squared distance converges or at the "
                   "iteration limit, not when the matches repeat");
  command.add_flag("--fast", options.coarse_to_fine,
                   "With icp: align growing samples of the maps first; faster, but may converge to "
                   "another optimum");
  add_number(command, "--min-observations", point_options.min_observations,
             "Leave out landmarks with fewer observations");
  add_number(command, "--max-distance", options.max_distance,
             "With icp: largest distance of a match, in the maps' unit (default: unlimited)");
  command.add_flag("--reciprocal", options.reciprocal,
                   "With icp: keep only mutual nearest neighbours");
  add_number(command, "--trim", options.trimmed_fraction,
             "With icp: share of the matches to leave out, those with the largest distances");
  command.add_flag("--weight-by-confidence", options.weight_by_source_confidence,
                   "With icp: weight each match by the confidence of its source landmark");
  add_text(command, "--method", method,
           "robust (graduated kernel, landmark covariances; confidences are weights) or icp (the "
           "paper's) (default: robust; icp if an option is given that only icp has)",
           "METHOD");
  command.add_flag("--one-to-one", alignment.one_to_one,
                   "With robust and --initial: match each target landmark at most once");
  add_number(
      command, "--overlap-radius", options.overlap_radius,
      fmt::format("A landmark overlaps if the other map has one within this distance, in the maps' "
                  "unit (default: {:g} for maps in metres; else no overlap is computed)",
                  kDefaultOverlapRadius));
  add_text(command, "--camera", camera,
           fmt::format("Camera of all frames, for reprojection errors: {}", kCameraHelp), "CAMERA");
  command.add_flag("--trace", options.trace,
                   "Write pose, score and matches of each iteration to the JSON");
  common.add_report_to(command, "the verdict, the maps in 3D at each iteration, and charts");
  add_sequence_to(command, "--source-sequence", source_sequence, "the source map");
  add_sequence_to(command, "--target-sequence", target_sequence, "the target map");
  common.add_to(command);
  common.add_threads_to(command);
  common.add_seed_to(command);
  auto* const everywhere = command.add_flag(
      "--anywhere", anywhere,
      "Search without an initial pose; the default unless --initial or --method icp is given");
  for (const char* const other :
       {"--initial", "--initial-matrix", "--method", "--max-iterations", "--one-to-one"}) {
    everywhere->excludes(command.get_option(other));
  }
  for (const char* const name : {"--neighbors", "--stop-as-pcl", "--fast", "--max-distance",
                                 "--reciprocal", "--trim", "--weight-by-confidence"}) {
    of_icp_alone.push_back(command.get_option(name));
    everywhere->excludes(command.get_option(name));
  }
  command.add_flag("--gravity", gravity,
                   "Allow only rotations about the vertical and tilts of up to 10 degrees; z is up "
                   "in a map without a stored vertical");
  auto* const scale =
      command.add_flag("--scale", estimate_scale,
                       "Also estimate the scale of the source, from 1/20 to 20 times the target's; "
                       "the default if the unit of a map is free");
  command.add_flag("--no-scale", no_scale, "Estimate no scale, although the unit of a map is free")
      ->excludes(scale);
  add_number(command, "--prior-odds", alignment.prior_odds,
             "Odds that the maps show the same place, before any evidence; 0.01 if one pair in a "
             "hundred does");
  add_number(command, "--effort", alignment.effort,
             "Work of the search, as a multiple of the default's, 1/16 to 64");
  add_number(command, "--time-limit", alignment.time_limit_s,
             "Stop the search after this many seconds; the result then depends on the machine "
             "(default: no limit)");
  add_number(command, "--min-probability", alignment.min_probability,
             "Least probability of an aligned pose, at least 0.5 and below 1");
  auto* const parts = command.add_flag("--by-parts", by_parts,
                                       "Always align the parts of the maps separately too; prints "
                                       "each part's pose and how far a map bends");
  command
      .add_flag("--no-parts", no_parts,
                "Never align parts (default: if large maps with descriptors are not aligned as a "
                "whole, their parts are tried)")
      ->excludes(parts);
  command.add_flag(
      "--no-deformation", no_deformation,
      "With --scale: never align up to a smooth deformation (default: with descriptors, "
      "states it, and aligns maps that fit no other way)");
  command.add_flag("--no-verdict", no_verdict,
                   "Skip the verdict and print the method's pose, which may be wrong");
  for (const char* const name : {"--initial", "--initial-matrix"}) {
    initials.push_back(command.get_option(name));
  }
  of_guesses = {command.get_option("--max-iterations"), command.get_option("--one-to-one")};
  list->excludes(command.get_option("source"))->excludes(command.get_option("target"));
  for (const char* const of_one :
       {"--confidence", "--initial", "--initial-matrix", "--truth", "--output", "--format",
        "--pose", "--pose-format", "--camera", "--method", "--trace", "--report", "--no-verdict"}) {
    list->excludes(command.get_option(of_one));
  }
  for (const CLI::Option* const option : of_icp_alone) {
    list->excludes(command.get_option(option->get_name()));
  }
  command.footer(
      "Example: align two maps of one place without an initial pose\n"
      "  cairn align later.map earlier.map\n"
      "Example: read a map from a pipe, and write the pose for other programs\n"
      "  cairn convert later.map - --format binary | cairn align - earlier.map --pose pose.txt\n"
      "Example: align many pairs; each map is read once\n"
      "  cairn align --pairs pairs.csv --json results.json\n"
      "Example: refine an initial pose with the paper's ICP, with two metrics, and save the "
      "result\n"
      "  cairn align later.map earlier.map --method icp --confidence none,observations \\\n"
      "      --initial \"0.5 -0.5 0 0 0 30\" --json result.json");
}

bool any_given(const std::vector<const CLI::Option*>& options) {
  return std::any_of(options.begin(), options.end(),
                     [](const CLI::Option* option) { return option->count() > 0; });
}

bool AlignArguments::is_robust() const {
  if (anywhere || !method.empty()) return method != "icp";
  return !any_given(of_icp_alone);
}

bool AlignArguments::has_initial() const {
  return any_given(initials);
}

void AlignArguments::check_options() const {
  with_option_names({{"IcpOptions.k", "--neighbors"},
                     {"IcpOptions.max_iterations", "--max-iterations"},
                     {"IcpOptions.max_distance", "--max-distance"},
                     {"IcpOptions.trimmed_fraction", "--trim"},
                     {"IcpOptions.overlap_radius", "--overlap-radius"},
                     {"AlignOptions.min_probability", "--min-probability"},
                     {"PlaceOptions.effort", "--effort"},
                     {"PlaceOptions.prior_odds", "--prior-odds"},
                     {"PlaceOptions.time_limit_s", "--time-limit"}},
                    [&] {
                      options.validate();
                      alignment.validate();
                    });
  if (!method.empty() && method != "icp" && method != "robust") {
    throw Error(ErrorKind::kMisuse, "--method", printable(method) + " is no method",
                "icp or robust");
  }
  for (const CLI::Option* const option : of_icp_alone) {
    if (method == "robust" && option->count() > 0) {
      throw Error(ErrorKind::kMisuse, option->get_name(), "given with --method robust",
                  "--method icp");
    }
  }
  if (!is_robust() && alignment.one_to_one) {
    throw Error(ErrorKind::kMisuse, "--one-to-one", "given with an option that only icp has",
                "--method robust");
  }
  for (const CLI::Option* const option : of_guesses) {
    if (is_robust() && !has_initial() && option->count() > 0) {
      throw Error(ErrorKind::kMisuse, option->get_name(),
                  "given, but the search has no such option", "--initial, or --method icp");
    }
  }
  if (!is_robust() && estimate_scale) {
    throw Error(ErrorKind::kMisuse, "--scale", "given with icp", "--method robust");
  }
  if (!is_robust() && by_parts) {
    throw Error(ErrorKind::kMisuse, "--by-parts", "given with icp, which aligns whole maps only",
                "--method robust");
  }
}

Json AlignArguments::options_json(const std::vector<Strategy>& strategies) const {
  Json names = Json::array();
  for (const Strategy& strategy : strategies) names.push_back(strategy.name);
  return {{"confidence", std::move(names)},
          {"method", is_robust() ? "robust" : "icp"},
          {"anywhere", is_robust() && !has_initial()},
          {"judge", !no_verdict},
          {"parts", by_parts   ? "always"
                    : no_parts ? "never"
                               : "where_refused"},
          {"deformation", !no_deformation},
          {"min_probability", no_verdict ? Json(nullptr) : Json(alignment.min_probability)},
          {"gravity", gravity},
          {"estimate_scale", with_scale},
          {"scale_where_free", !no_scale},
          {"effort", alignment.effort},
          {"prior_odds", alignment.prior_odds},
          {"time_limit_s", to_json(alignment.time_limit_s)},
          {"one_to_one", alignment.one_to_one},
          {"k", options.k},
          {"initial", to_json(options.initial)},
          {"max_iterations", options.max_iterations},
          {"mse_change_threshold", options.mse_change_threshold},
          {"stop_at_repetition", options.stop_at_repetition},
          {"fast", options.coarse_to_fine},
          {"max_distance",
           std::isfinite(options.max_distance) ? Json(options.max_distance) : Json(nullptr)},
          {"min_observations", point_options.min_observations},
          {"reciprocal", options.reciprocal},
          {"trimmed_fraction", options.trimmed_fraction},
          {"weight_by_source_confidence", options.weight_by_source_confidence},
          {"overlap_radius", to_json(options.overlap_radius)},
          {"camera", text_or_null(camera)},
          {"trace", options.trace}};
}

// What is known before the maps are aligned.
ReportedPair AlignArguments::reported_pair(const LoadedMap& source_map, const LoadedMap& target_map,
                                           LengthUnit unit,
                                           const std::optional<Similarity3>& true_pose) const {
  ReportedPair pair;
  pair.source_name = file_name(source_map.path);
  pair.target_name = file_name(target_map.path);
  pair.source = &source_map.map;
  pair.target = &target_map.map;
  pair.source_images = images_of(source_map.map, source_sequence, common);
  pair.target_images = images_of(target_map.map, target_sequence, common);
  pair.unit = unit;
  pair.points = point_options;
  pair.initial = options.initial;
  pair.truth = true_pose;
  return pair;
}

report::Report AlignArguments::make_report(const ReportedPair& pair, const Json& json) const {
  report::Report report = begin_report(pair.source_name + " to " + pair.target_name, common);
  report.subtitle = subtitle_of(pair.results, pair.unit);
  set_provenance(report, json);
  add_pair(report, pair);
  return report;
}

// "x 0.100 y ..., roll ... deg", with so many digits.
std::string pose_text(const Rigid3& pose, LengthUnit unit, int digits, int angle_digits) {
  const Eigen::Vector3d& t = pose.translation();
  const Eigen::Vector3d angles = pose.roll_pitch_yaw();
  return fmt::format(
      "x {} y {} z {} {}, roll {} pitch {} yaw {} deg", fixed(t.x(), digits), fixed(t.y(), digits),
      fixed(t.z(), digits), unit_symbol(unit), fixed(degrees(angles.x()), angle_digits),
      fixed(degrees(angles.y()), angle_digits), fixed(degrees(angles.z()), angle_digits));
}

// A vector's numbers with blanks between.
template <class Vector>
std::string numbers_text(const Vector& vector, int digits) {
  std::string text;
  for (Eigen::Index i = 0; i < vector.size(); ++i) {
    text += (i > 0 ? " " : "") + fixed(vector[i], digits);
  }
  return text;
}

// Of the two quaternions of a rotation the one with qw >= 0.
Eigen::Quaterniond shown_quaternion(const Rigid3& pose) {
  const Eigen::Quaterniond q = pose.quaternion();
  return q.w() < 0.0 ? Eigen::Quaterniond(-q.coeffs()) : q;
}

// The trusted pose, or one that was not judged, in full.
std::string answer_text(const Alignment& alignment, LengthUnit unit, bool with_scale) {
  const Similarity3& pose = *alignment.estimate;
  std::string text = fmt::format("  target_from_source: {}\n", pose_text(pose.rigid(), unit, 6, 4));
  const Matrix4d matrix = pose.matrix();
  for (int row = 0; row < 4; ++row) {
    text += fmt::format("    {:>13.9f} {:>13.9f} {:>13.9f} {:>14.9f}\n", matrix(row, 0),
                        matrix(row, 1), matrix(row, 2), matrix(row, 3));
  }
  const Eigen::Quaterniond q = shown_quaternion(pose.rigid());
  text += fmt::format("  quaternion (qw qx qy qz): {}\n",
                      numbers_text(Eigen::Vector4d(q.w(), q.x(), q.y(), q.z()), 9));
  if (with_scale) text += fmt::format("  scale of the source: {:.6g}\n", pose.scale());
  if (const auto deviations = deviations_of(alignment)) {
    text += fmt::format(
        "  standard deviation at the source's centre: x y z {} {}, rotation about x y z {} deg",
        numbers_text(deviations->translation, 5), unit_symbol(unit),
        numbers_text(Eigen::Vector3d(deviations->rotation_rad * degrees(1.0)), 4));
    if (deviations->log_scale) {
      text += fmt::format(", scale {} %", fixed(100.0 * *deviations->log_scale, 3));
    }
    text += "\n";
  }
  return text;
}

// "moving along (0.00 1.00 0.00)": a motion that the matches leave open, in the target's frame.
std::string direction_text(const OpenDirection& open) {
  std::string text;
  const auto add = [&](const char* what, const Eigen::Vector3d& axis) {
    if (axis.norm() < 1e-6) return;
    text += fmt::format("{}{} ({})", text.empty() ? "" : " with ", what,
                        numbers_text(Eigen::Vector3d(axis.normalized()), 2));
  };
  // The rotation is a length shorter than the translation: what it amounts to at the landmarks counts.
  add("moving along", open.translation);
  add("turning about", open.rotation);
  if (std::abs(open.log_scale) > 1e-6) text += text.empty() ? "scaling" : " with scaling";
  return text;
}

std::string open_directions_text(const Alignment& alignment, bool with_scale) {
  const auto& open = alignment.registration.unobservable;
  if (open.empty()) return {};
  std::string text =
      fmt::format("  {} of the pose's {} directions are not determined by the matches:\n",
                  open.size(), with_scale ? 7 : 6);
  for (const OpenDirection& direction : open) text += "    " + direction_text(direction) + "\n";
  return text;
}

std::string candidates_text(const Alignment& alignment, LengthUnit unit, bool trusted) {
  constexpr std::size_t kShown = 3;
  const auto& candidates = alignment.candidates;
  std::string text;
  for (std::size_t i = trusted ? 1 : 0; i < std::min(kShown, candidates.size()); ++i) {
    text += fmt::format("  {}, {}: {}\n", trusted ? "other candidate" : "not trusted",
                        probability_text(candidates[i].probability),
                        pose_text(candidates[i].target_from_source, unit, 3, 2));
  }
  return text;
}

// A line for each part.
std::string parts_text(const PartsAlignment& parts, LengthUnit unit) {
  std::string text = fmt::format("  parts: {} of {} aligned separately; they {}\n", parts.aligned,
                                 parts.parts.size(),
                                 parts.consensus       ? "agree up to a bend"
                                 : parts.contradictory ? "contradict each other"
                                                       : "are too few to agree");
  for (const PartPose& part : parts.parts) {
    text += fmt::format("    {} keyframes {}-{}, {} landmarks: {} ({})", to_string(part.map),
                        part.first.value, part.last.value, part.landmarks, to_string(part.verdict),
                        probability_text(part.probability));
    if (part.target_from_source) {
      text += fmt::format("{} {}", part.agrees ? ":" : ", placed between the others:",
                          pose_text(part.target_from_source->rigid(), unit, 3, 2));
    } else if (part.found && part.verdict == Verdict::kAligned) {
      text += ": " + pose_text(part.found->rigid(), unit, 3, 2);
    }
    text += "\n";
  }
  return text;
}

void AlignArguments::print(const LoadedMap& source_map, const LoadedMap& target_map,
                           const std::vector<StrategyResult>& results, LengthUnit unit) const {
  const Console console = common.console();
  for (const auto& [role, loaded] : {std::pair{"source", &source_map}, {"target", &target_map}}) {
    console.print(fmt::format("{}  {}: {} of {} landmarks\n", role, loaded->path,
                              loaded->description["kept_landmarks"].get<std::size_t>(),
                              loaded->map.landmark_count()));
  }
  console.print("\n" + alignment_table(results, unit));
  for (const StrategyResult& each : results) {
    const Alignment& one = each.alignment;
    const std::string_view verdict = one.verdict                   ? to_string(*one.verdict)
                                     : one.registration.has_pose() ? "not judged"
                                                                   : "failed";
    console.print(fmt::format("\n{}: {}: {}\n", each.confidence, verdict, one.reason));
    const bool trusted = has_answer(one);
    if (trusted) console.print(answer_text(one, unit, with_scale));
    if (one.verdict != Verdict::kRejected) {
      console.print(open_directions_text(one, with_scale));
    }
    if (by_parts && one.parts) console.print(parts_text(*one.parts, unit));
    console.print(candidates_text(one, unit, trusted));
    if (!trusted) {
      console.print(hints(one, source_map.map, target_map.map,
                          {.points = point_options,
                           .min_probability = alignment.min_probability,
                           .by_icp = !is_robust(),
                           .has_initial = has_initial(),
                           .with_scale = with_scale,
                           .by_parts = by_parts}));
    }
  }
  if (!has_answer(results.front().alignment)) return;
  for (const std::string& path : {output, pose}) {
    if (!path.empty() && path != "-") console.print(fmt::format("\nwrote {}\n", path));
  }
}

std::string_view unit_text(LengthUnit unit) {
  return unit == LengthUnit::kMetres ? "in metres" : "of free scale";
}

// The unit of both maps, which must be the same: a rigid pose between different scales has no meaning.
LengthUnit common_unit(const LoadedMap& source, const LoadedMap& target) {
  const LengthUnit unit = source.map.info().length_unit;
  if (unit != target.map.info().length_unit) {
    throw Error(ErrorKind::kInput, source.path,
                fmt::format("is {}, but {} {}", unit_text(unit), target.path,
                            unit_text(target.map.info().length_unit)),
                "maps of one unit");
  }
  return unit;
}

void AlignArguments::refuse_scale_in_tum() const {
  if (pose_format != "tum" || !(estimate_scale || with_scale)) return;
  throw Error(ErrorKind::kMisuse, "--pose-format", "tum holds no scale, but one is estimated",
              "matrix, or --no-scale");
}

void AlignArguments::check_outputs(std::size_t strategies) {
  if (pose_format != "matrix" && pose_format != "tum") {
    throw Error(ErrorKind::kMisuse, "--pose-format", printable(pose_format), "matrix or tum");
  }
  if (!output.empty()) require_map_output(output, format, "--output");
  if (!pose.empty() && pose != "-") require_folder_of(pose);
  if (output.empty() && !format.empty()) {
    throw Error(ErrorKind::kMisuse, "--format", "given without --output -", "");
  }
  for (const auto& [option, path] : {std::pair{"--output", &output}, {"--pose", &pose}}) {
    if (!path->empty() && strategies > 1) {
      throw Error(ErrorKind::kMisuse, option, "several strategies give several results",
                  "one --confidence");
    }
  }
  refuse_scale_in_tum();
  require_one_stdout({{"--json", &common.json_path}, {"--output", &output}, {"--pose", &pose}});
  if (source == "-" && target == "-") {
    throw Error(ErrorKind::kMisuse, "target", "stdin is the source already", "a file");
  }
  common.stdout_is_taken = output == "-" || pose == "-";
  require_outputs(common);
}

void AlignArguments::write_pose_file(const Similarity3& target_from_source) const {
  std::string text = matrix_text(target_from_source);
  if (pose_format == "tum") {
    const Eigen::Quaterniond q = shown_quaternion(target_from_source.rigid());
    const Eigen::Vector3d& t = target_from_source.translation();
    text = fmt::format("0 {} {} {} {} {} {} {}\n", t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w());
  }
  write_text(text, pose);
}

int AlignArguments::run_pairs() {
  require_outputs(common);
  check_options();
  if (by_parts) alignment.parts = PartsUse::kAlways;
  if (no_parts) alignment.parts = PartsUse::kNever;
  alignment.deformation = !no_deformation;
  alignment.points = point_options;
  alignment.overlap_radius = options.overlap_radius;
  alignment.seed = common.seed;
  if (estimate_scale) alignment.scale = ScaleRange();
  with_scale = estimate_scale;
  alignment.scale_where_free = !no_scale;
  return align_pairs(pairs, alignment, gravity, options_json(parse_strategies("none")), common);
}

int AlignArguments::run() {
  if (!pairs.empty()) return run_pairs();
  for (const auto& [name, path] : {std::pair{"source", &source}, {"target", &target}}) {
    if (path->empty()) throw Error(ErrorKind::kMisuse, name, "not given", "two maps, or --pairs");
  }
  // What the command line says is checked before any file is read.
  const std::vector<Strategy> strategies = parse_strategies(confidence);
  check_outputs(strategies.size());
  check_options();
  const auto given_camera =
      camera.empty() ? std::nullopt : std::optional(load_camera(camera).camera);
  const Similarity3 guess = initial.guess(estimate_scale);
  options.initial = guess.rigid();
  options.stop_at_repetition = !stop_as_pcl;
  std::optional<Similarity3> true_pose;
  if (!truth.empty()) {
    true_pose = no_scale || !is_robust() ? read_pose_file(truth) : read_similarity_file(truth);
  }

  LoadedMap source_map = load_map(source, common);
  LoadedMap target_map = load_map(target, common);
  if (!output.empty()) require_no_splats(source_map.map, source);  // before the long work
  alignment.method = is_robust() ? AlignMethod::kRobust : AlignMethod::kIcp;
  if (estimate_scale) alignment.scale = ScaleRange();
  alignment.scale_where_free = !no_scale;
  with_scale =
      scale_range(alignment, source_map.map.info().length_unit, target_map.map.info().length_unit)
          .has_value();
  refuse_scale_in_tum();
  const LengthUnit unit =
      with_scale ? target_map.map.info().length_unit : common_unit(source_map, target_map);
  if (!options.overlap_radius && unit == LengthUnit::kMetres) {
    options.overlap_radius = kDefaultOverlapRadius;
  }
  for (LoadedMap* const loaded : {&source_map, &target_map}) {
    if (given_camera) loaded->map = with_camera(loaded->map, *given_camera);
    loaded->description["kept_landmarks"] =
        landmarks_observed(loaded->map, point_options.min_observations).size();
  }
  if (has_initial()) alignment.prior = PosePrior{.target_from_source = guess};
  alignment.judge = !no_verdict;
  if (by_parts) alignment.parts = PartsUse::kAlways;
  if (no_parts) alignment.parts = PartsUse::kNever;
  alignment.deformation = !no_deformation;
  alignment.points = point_options;
  alignment.overlap_radius = options.overlap_radius;
  alignment.trace = options.trace || !common.report_path.empty();
  alignment.icp = options;
  alignment.seed = common.seed;
  if (gravity) alignment.gravity = gravity_prior(source_map.map, target_map.map);
  ReportedPair shown = reported_pair(source_map, target_map, unit, true_pose);
  shown.results =
      align_by_all(source_map.map, target_map.map, strategies, alignment, true_pose, common);
  const std::vector<StrategyResult>& results = shown.results;

  const Alignment& first = results.front().alignment;
  if (has_answer(first)) {
    if (!output.empty()) {
      LandmarkMap aligned = transformed(source_map.map, *first.estimate);
      if (aligned.info().length_unit != unit) aligned = with_length_unit(aligned, unit);
      // The frame is the target's now, and so is what is known of its place on the Earth.
      if (const auto& georeference = target_map.map.info().georeference) {
        aligned = with_georeference(aligned, georeference);
      }
      save_map(aligned, output, common, {.format = format});
    }
    if (!pose.empty()) write_pose_file(*first.estimate);
  } else {
    for (const std::string& path : {output, pose}) {
      if (!path.empty()) common.console().remark(path + " is not written: the pose is not aligned");
    }
  }
  Json inputs = {{"source", source_map.description}, {"target", target_map.description}};
  if (true_pose) {
    inputs["truth"] = {{"path", truth},
                       {"target_from_source", to_json(true_pose->rigid())},
                       {"scale", true_pose->scale()}};
  }
  Json json =
      document("align", common, std::move(inputs), options_json(strategies), kAlignmentVersion);
  json["results"] = Json::array();
  for (const StrategyResult& one : results) {
    json["results"].push_back(
        to_json(one, options.trace ? HistoryDetail::kMatches : HistoryDetail::kNone));
  }
  write_document(json, common);
  print(source_map, target_map, results, unit);
  if (!common.report_path.empty()) write_report(make_report(shown, json), common);
  const bool all_answered = std::all_of(results.begin(), results.end(),
                                        [](const auto& one) { return has_answer(one.alignment); });
  return all_answered ? kDone : kNoTrustworthyAlignment;
}

}  // namespace

Run add_align(CLI::App& program) {
  auto arguments = std::make_shared<AlignArguments>();
  arguments->add_to(*program.add_subcommand(
      "align", "Find the pose of a source map in a target map, and judge it"));
  return [arguments] { return arguments->run(); };
}

}  // namespace cairn::cli
