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

#include "cairn/core/error.hpp"
#include "cairn/map/io/map_file.hpp"
#include "cairn/map/operations.hpp"
#include "cairn/registration/icp.hpp"

#include "commands.hpp"
#include "support/alignments.hpp"
#include "support/arguments.hpp"
#include "support/documents.hpp"
#include "support/reports.hpp"
#include "support/table.hpp"

namespace cairn::cli {
namespace {

constexpr double kDefaultOverlapRadius = 0.05;  // metres

struct AlignArguments {
  CommonArguments common;
  std::string source;
  std::string target;
  std::string confidence = "none";
  PoseArguments initial;
  std::string truth;
  std::string output;
  std::string camera;
  IcpOptions options;
  bool stop_as_pcl = false;
  PointSetOptions point_options;
  std::string method;
  bool gravity = false;
  bool estimate_scale = false;
  bool anywhere = false;
  bool no_verdict = false;
  AlignOptions alignment;  // but for what `options` hold
  std::vector<const CLI::Option*> of_icp_alone;
  std::vector<const CLI::Option*> of_guesses;  // a search has none of these
  std::vector<const CLI::Option*> initials;

  void add_to(CLI::App& command);
  int run();

 private:
  bool is_robust() const;
  bool has_initial() const;
  void check_options() const;
  Json options_json(const std::vector<Strategy>& strategies) const;
  report::Report make_report(const LoadedMap& source_map, const LoadedMap& target_map,
                             const std::vector<Alignment>& alignments, LengthUnit unit,
                             const std::optional<Similarity3>& true_pose, const Json& json) const;
  void print(const LoadedMap& source_map, const LoadedMap& target_map,
             const std::vector<Alignment>& alignments, LengthUnit unit) const;
};

void AlignArguments::add_to(CLI::App& command) {
  add_text(command, "source", source, "Map to move: .map, .txt, .cairn, .ply or .pcd")->required();
  add_text(command, "target", target, "Map to align it to")->required();
  add_text(command, "--confidence", confidence,
           "Trust in landmarks: " + confidence_help() +
               ". Several, separated by commas, run side by side",
           "METRIC,...")
      ->capture_default_str();
  add_number(command, "-k,--neighbors", options.k,
             "With icp: nearest target landmarks among which the most trusted is matched");
  initial.add_to(command, "initial", "Displacement of the source map before alignment");
  add_text(command, "--truth", truth,
           "True target_from_source, 16 numbers or the JSON of an alignment: adds pose errors",
           "FILE");
  add_text(command, "-o,--output", output, "Write the source map, aligned to the target", "FILE");
  add_number(command, "--max-iterations", options.max_iterations, "Limit of the iterations");
  command.add_flag(
      "--stop-as-pcl", stop_as_pcl,
      "With icp: go on where matches repeat, until the mean squared distance settles or the limit "
      "is reached, as PCL does");
  command.add_flag(
      "--fast", options.coarse_to_fine,
      "With icp: align growing samples of the maps first: sooner done, and now and then at "
      "another optimum");
  add_number(command, "--min-observations", point_options.min_observations,
             "Leave out landmarks observed less often");
  add_number(command, "--max-distance", options.max_distance,
             "With icp: longest distance of a match, in the maps' unit (default: unlimited)");
  command.add_flag("--reciprocal", options.reciprocal,
                   "With icp: keep only matches that hold both ways");
  add_number(command, "--trim", options.trimmed_fraction,
             "With icp: share of the matches, the farthest apart, to leave out");
  command.add_flag("--weight-by-confidence", options.weight_by_source_confidence,
                   "With icp: weigh matches in the estimate by the source landmark's confidence");
  add_text(command, "--method", method,
           "robust (graduated kernel, landmark covariances; confidences are weights) or icp (the "
           "paper's) (default: robust, or icp where an option that only icp has is given)",
           "METHOD");
  command.add_flag("--one-to-one", alignment.one_to_one,
                   "With robust and --initial: match no target landmark twice");
  add_number(
      command, "--overlap-radius", options.overlap_radius,
      fmt::format("Distance within which landmarks overlap, in the maps' unit (default: {:g} "
                  "for maps in metres, else no overlap is computed)",
                  kDefaultOverlapRadius));
  add_text(command, "--camera", camera,
           fmt::format("Camera of all frames, for reprojection: {}", kCameraHelp), "CAMERA");
  command.add_flag("--trace", options.trace,
                   "Keep score and matches of each iteration in the JSON");
  common.add_report_to(command, "the maps in 3D, iteration by iteration, and charts");
  common.add_to(command);
  auto* const everywhere = command.add_flag(
      "--anywhere", anywhere,
      "Search for the pose everywhere: what is done anyway without --initial and --method icp");
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
                   "Only turn about the vertical, and tilt a little; a map that does "
                   "not know where down is has z upwards");
  command.add_flag("--scale", estimate_scale,
                   "The maps need not be of one scale; find the source's, from 1/20 to "
                   "20 times the target's");
  add_number(command, "--prior-odds", alignment.prior_odds,
             "Odds, before anything is looked at, that the maps show one place; 0.01 "
             "where one of a hundred pairs does");
  add_number(command, "--effort", alignment.effort,
             "Of the search: work in units of the default's, 1/16 to 64");
  add_number(command, "--time-limit", alignment.time_limit_s,
             "Limit of the search in seconds; the result then depends on the machine (default: no "
             "limit)");
  add_number(command, "--min-probability", alignment.min_probability,
             "Probability from which a pose is aligned, 0.5 to below 1");
  command.add_flag("--no-verdict", no_verdict,
                   "Do not judge: give the pose that the method came to, right or not");
  for (const char* const name : {"--initial", "--initial-matrix"}) {
    initials.push_back(command.get_option(name));
  }
  of_guesses = {command.get_option("--max-iterations"), command.get_option("--one-to-one")};
  command.footer(
      "Example: align two maps of one place of which nothing else is known\n"
      "  cairn align later.map earlier.map\n"
      "Example: refine a guess by the paper's ICP, by two strategies, and keep the result\n"
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
    throw Error(ErrorKind::kMisuse, "--one-to-one", "given with what only icp has",
                "--method robust");
  }
  for (const CLI::Option* const option : of_guesses) {
    if (is_robust() && !has_initial() && option->count() > 0) {
      throw Error(ErrorKind::kMisuse, option->get_name(), "given, but a search has no such thing",
                  "--initial, or --method icp");
    }
  }
  if (!is_robust() && estimate_scale) {
    throw Error(ErrorKind::kMisuse, "--scale", "given with icp", "--method robust");
  }
}

Json AlignArguments::options_json(const std::vector<Strategy>& strategies) const {
  Json names = Json::array();
  for (const Strategy& strategy : strategies) names.push_back(strategy.name);
  return {{"confidence", std::move(names)},
          {"method", is_robust() ? "robust" : "icp"},
          {"anywhere", is_robust() && !has_initial()},
          {"judge", !no_verdict},
          {"min_probability", no_verdict ? Json(nullptr) : Json(alignment.min_probability)},
          {"gravity", gravity},
          {"estimate_scale", estimate_scale},
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

report::Report AlignArguments::make_report(const LoadedMap& source_map, const LoadedMap& target_map,
                                           const std::vector<Alignment>& alignments,
                                           LengthUnit unit,
                                           const std::optional<Similarity3>& true_pose,
                                           const Json& json) const {
  ReportedPair pair;
  pair.source_name = file_name(source_map.path);
  pair.target_name = file_name(target_map.path);
  pair.source = &source_map.map;
  pair.target = &target_map.map;
  pair.unit = unit;
  pair.point_options = point_options;
  pair.initial = options.initial;
  pair.truth = true_pose;
  pair.alignments = alignments;
  report::Report report = begin_report(pair.source_name + " to " + pair.target_name, common);
  report.subtitle = subtitle_of(alignments, unit);
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

// The likeliest poses of a pair that has no trustworthy one, and what may help.
std::string not_trusted(const Alignment& alignment, LengthUnit unit) {
  constexpr std::size_t kShown = 3;
  std::string text;
  const auto& candidates = alignment.placement->candidates;
  for (std::size_t i = 0; i < std::min(kShown, candidates.size()); ++i) {
    text += fmt::format("  not trusted, {} %: {}\n", fixed(100.0 * candidates[i].probability, 2),
                        pose_text(candidates[i].target_from_source, unit, 3, 2));
  }
  const bool other =
      !candidates.empty() && candidates.front().probability > alignment.placement->probability;
  if (other) text += "  hint: without --initial and --method icp the likeliest pose is judged\n";
  if (!candidates.empty() && !candidates.front().support.agreement) {
    text += "  hint: maps with descriptors are told apart better\n";
  }
  if (!alignment.result.unobservable.empty()) {
    text += "  hint: maps that overlap in more than a plane or a line determine every direction\n";
  }
  text += "  hint: --min-probability lowers the bar\n";
  return text;
}

void AlignArguments::print(const LoadedMap& source_map, const LoadedMap& target_map,
                           const std::vector<Alignment>& alignments, LengthUnit unit) const {
  const Console console = common.console();
  for (const auto& [role, loaded] : {std::pair{"source", &source_map}, {"target", &target_map}}) {
    console.print(fmt::format("{}  {}: {} of {} landmarks\n", role, loaded->path,
                              loaded->description["kept_landmarks"].get<std::size_t>(),
                              loaded->map.landmark_count()));
  }
  console.print("\n" + alignment_table(alignments, options, unit));
  for (const Alignment& each : alignments) {
    const RegistrationResult& result = each.result;
    const std::string_view verdict = each.placement           ? to_string(each.placement->verdict)
                                     : each.result.has_pose() ? "not judged"
                                                              : "failed";
    console.print(fmt::format("\n{}: {}: {}\n", each.confidence, verdict, result.reason));
    const bool judged_wrong = each.placement && each.placement->verdict != Verdict::kAligned;
    if (judged_wrong) {
      console.print(not_trusted(each, unit));
      continue;
    }
    if (!has_answer(each)) continue;
    if (estimate_scale) {
      console.print(fmt::format("  scale of the source: {:.6g}\n", result.scale));
    }
    console.print(fmt::format("  target_from_source: {}\n",
                              pose_text(result.target_from_source, unit, 6, 4)));
    if (!result.unobservable.empty()) {
      console.print(
          fmt::format("  {} of the pose's {} directions are not determined by the matches\n",
                      result.unobservable.size(), estimate_scale ? 7 : 6));
    }
  }
  if (!output.empty() && has_answer(alignments.front())) {
    console.print(fmt::format("\nwrote {}\n", output));
  }
}

// Both in one unit, or neither known: a pose between maps of different scale means nothing.
LengthUnit common_unit(const LoadedMap& source, const LoadedMap& target) {
  const LengthUnit unit = source.map.info().length_unit;
  if (unit != target.map.info().length_unit) {
    throw Error(ErrorKind::kInput, source.path,
                "in " + to_string(unit) + " units, but " + target.path + " in " +
                    to_string(target.map.info().length_unit),
                "maps of one scale, or --scale");
  }
  return unit;
}

int AlignArguments::run() {
  // What the command line says is checked before any file is read.
  const std::vector<Strategy> strategies = parse_strategies(confidence);
  if (!output.empty()) {
    require_map_path(output, "--output");
    if (strategies.size() > 1) {
      throw Error(ErrorKind::kMisuse, "--output", "several strategies give several results",
                  "one --confidence");
    }
  }
  require_outputs(common);
  check_options();
  const auto given_camera =
      camera.empty() ? std::nullopt : std::optional(load_camera(camera).camera);
  options.initial = initial.pose();
  options.stop_at_repetition = !stop_as_pcl;
  std::optional<Similarity3> true_pose;
  if (!truth.empty()) {
    true_pose = estimate_scale ? read_similarity_file(truth) : read_pose_file(truth);
  }

  LoadedMap source_map = load_map(source, common);
  LoadedMap target_map = load_map(target, common);
  const LengthUnit unit =
      estimate_scale ? target_map.map.info().length_unit : common_unit(source_map, target_map);
  if (!options.overlap_radius && unit == LengthUnit::kMetres) {
    options.overlap_radius = kDefaultOverlapRadius;
  }
  for (LoadedMap* const loaded : {&source_map, &target_map}) {
    if (given_camera) loaded->map = with_camera(loaded->map, *given_camera);
    loaded->description["kept_landmarks"] =
        landmarks_observed(loaded->map, point_options.min_observations).size();
  }
  alignment.method = is_robust() ? AlignMethod::kRobust : AlignMethod::kIcp;
  if (has_initial()) alignment.prior = PosePrior{.target_from_source = options.initial};
  alignment.judge = !no_verdict;
  alignment.points = point_options;
  alignment.overlap_radius = options.overlap_radius;
  alignment.trace = options.trace || !common.report_path.empty();
  alignment.icp = options;
  alignment.seed = common.seed;
  if (estimate_scale) alignment.scale = ScaleRange();
  if (gravity) alignment.gravity = gravity_prior(source_map.map, target_map.map);
  const std::vector<Alignment> alignments =
      align_by_all(source_map.map, target_map.map, strategies, alignment, true_pose, common);

  if (!output.empty()) {
    if (has_answer(alignments.front())) {
      const RegistrationResult& result = alignments.front().result;
      LandmarkMap aligned = transformed(source_map.map, result.similarity());
      if (aligned.info().length_unit != unit) aligned = with_length_unit(aligned, unit);
      save_map(aligned, output, common);
    } else {
      common.console().remark(output + " is not written: there is no pose to move the source by");
    }
  }
  Json inputs = {{"source", source_map.description}, {"target", target_map.description}};
  if (true_pose) {
    inputs["truth"] = {{"path", truth},
                       {"target_from_source", to_json(true_pose->rigid())},
                       {"scale", true_pose->scale()}};
  }
  Json json = document("align", common, std::move(inputs), options_json(strategies));
  json["results"] = Json::array();
  for (const Alignment& one : alignments) {
    json["results"].push_back(to_json(one, options, unit));
  }
  write_document(json, common);
  print(source_map, target_map, alignments, unit);
  if (!common.report_path.empty()) {
    write_report(make_report(source_map, target_map, alignments, unit, true_pose, json), common);
  }
  const bool all_answered = std::all_of(alignments.begin(), alignments.end(), has_answer);
  return all_answered ? kDone : kNoTrustworthyAlignment;
}

}  // namespace

Run add_align(CLI::App& program) {
  auto arguments = std::make_shared<AlignArguments>();
  arguments->add_to(*program.add_subcommand(
      "align", "Align a source map to a target map: transform, score, strategies side by side"));
  return [arguments] { return arguments->run(); };
}

}  // namespace cairn::cli
