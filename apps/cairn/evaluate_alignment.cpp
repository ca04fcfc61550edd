// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <optional>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/core/file.hpp"
#include "cairn/evaluation/hand_eye.hpp"
#include "cairn/evaluation/pose_error.hpp"
#include "cairn/evaluation/trajectory_evaluation.hpp"
#include "cairn/formats/trajectory_file.hpp"
#include "cairn/geometry/covariance.hpp"
#include "cairn/geometry/decompositions.hpp"
#include "cairn/map/operations.hpp"
#include "cairn/registration/point_set.hpp"

#include "commands.hpp"
#include "support/arguments.hpp"
#include "support/console.hpp"
#include "support/documents.hpp"
#include "support/saved_results.hpp"

namespace cairn::cli {
namespace {

// Where a map lies in the world of its camera's true trajectory, and how well both trajectories fit there.
struct MapInWorld {
  Rigid3 world_from_map;
  std::size_t poses = 0;
  double rotation_rms_rad = 0.0;
  double translation_rms = 0.0;  // metres
};

struct TruePose {
  Similarity3 target_from_source;
  std::optional<MapInWorld> source = {};  // of a truth from trajectories
  std::optional<MapInWorld> target = {};
};

// One result compared with the truth; std::nullopt if unknown.
struct JudgedAlignment {
  const StrategyResult* result = nullptr;
  std::optional<PoseError> error = {};
  std::optional<bool> success = {};
  std::optional<double> normalised_squared_error = {};
  std::optional<bool> in_ellipsoid = {};  ///< of 95 % by the stated covariance
  bool fits_inverse = false;              ///< of the truth
};

// How the error compares to the stated covariance.
void judge_covariance(const Similarity3& truth, JudgedAlignment& judged) {
  const Alignment& alignment = judged.result->alignment;
  const RegistrationResult& result = alignment.registration;
  if (!alignment.estimate || !result.covariance) return;
  const Similarity3& pose = *alignment.estimate;
  const auto& with_scale = result.covariance_with_scale;
  // Six rows have no scale.
  if (!with_scale && pose.scale() != truth.scale()) return;
  const Eigen::VectorXd spectrum =
      with_scale ? Eigen::VectorXd(symmetric_eigenvalues<7>(*with_scale))
                 : Eigen::VectorXd(symmetric_eigenvalues<6>(*result.covariance));
  // As of a map aligned to itself, whose residuals are none.
  if (!(spectrum.minCoeff() > 1e-12 * spectrum.maxCoeff())) return;
  judged.normalised_squared_error =
      with_scale ? normalised_squared_error(pose, *with_scale, truth)
                 : normalised_squared_error(pose.rigid(), *result.covariance, truth.rigid());
  judged.in_ellipsoid =
      *judged.normalised_squared_error <=
      (with_scale ? kNormalisedSquaredErrorWithScale95 : kNormalisedSquaredError95);
}

std::string yes_or_no(const std::optional<bool>& value, const char* unknown) {
  if (!value) return unknown;
  return *value ? "yes" : "no";
}

double percent_of(const PoseError& error) {
  return 100.0 * std::expm1(error.log_scale);
}

detail::Csv rows_of(const std::vector<JudgedAlignment>& judged) {
  detail::Csv rows({"confidence", "status", "rotation_error_deg", "translation_error",
                    "length_unit", "success", "log_scale_error", "normalised_squared_error",
                    "in_ellipsoid"});
  for (const auto& [result, error, success, normalised, inside, inverted] : judged) {
    rows << result->confidence << std::string(status_of(result->alignment));
    rows << (error ? std::optional(degrees(error->rotation_rad)) : std::nullopt);
    rows << (error ? std::optional(error->translation) : std::nullopt);
    rows << to_string(result->length_unit);
    rows << yes_or_no(success, "");
    rows << (error ? std::optional(error->log_scale) : std::nullopt);
    rows << normalised << yes_or_no(inside, "");
    rows.end_row();
  }
  return rows;
}

Json json_of(const std::vector<JudgedAlignment>& judged) {
  Json results = Json::array();
  for (const auto& [result, error, success, normalised, inside, inverted] : judged) {
    Json entry = {{"confidence", result->confidence},
                  {"status", status_of(result->alignment)},
                  {"length_unit", to_string(result->length_unit)}};
    entry["error"] = error ? to_json(*error) : Json(nullptr);
    entry["success"] = to_json(success);
    entry["normalised_squared_error"] = to_json(normalised);
    entry["in_ellipsoid"] = to_json(inside);
    if (inverted) entry["fits_inverse_of_truth"] = true;
    results.push_back(std::move(entry));
  }
  return results;
}

std::string table_of(const std::vector<JudgedAlignment>& judged, bool with_scale,
                     bool with_ellipsoid) {
  std::vector<std::string> header = {"confidence", "status", "rotation error", "translation error",
                                     "success"};
  if (with_scale) header.emplace_back("scale error");
  if (with_ellipsoid) header.emplace_back("in ellipsoid");
  Table table(header);
  for (const auto& [result, error, success, normalised, inside, inverted] : judged) {
    const std::string unit = unit_symbol(result->length_unit);
    std::vector<std::string> row = {
        result->confidence, std::string(status_of(result->alignment)),
        error ? fixed(degrees(error->rotation_rad), 4) + " deg" : "-",
        error ? fmt::format("{} {}", fixed(error->translation, 5), unit) : "-",
        yes_or_no(success, "-")};
    if (with_scale) row.push_back(error ? fixed(percent_of(*error), 3) + " %" : "-");
    if (with_ellipsoid) {
      row.push_back(normalised ? fmt::format("{} ({:.3g})", yes_or_no(inside, "-"), *normalised)
                               : "-");
    }
    table.add_row(std::move(row));
  }
  return table.text();
}

struct EvaluateAlignmentArguments {
  CommonArguments common;
  std::string result;
  std::string truth;
  std::string source;
  std::string target;
  std::string camera;
  std::optional<double> min_probability;
  std::string source_trajectory;
  std::string source_truth;
  std::string target_trajectory;
  std::string target_truth;
  std::string truth_output;
  bool hand_eye = false;
  double max_rotation_deg = 5.0;
  double max_translation_m = 0.05;
  double max_scale_percent = 5.0;

  void add_to(const Command& command) {
    command.add_text("result", result,
                     "JSON of 'cairn align --json'; not needed with --write-truth");
    const Option truth_file =
        command.add_text("--truth", truth,
                         "True target_from_source, 16 numbers or the JSON of an alignment", "FILE");
    command.add_text(
        "--source-trajectory", source_trajectory,
        "For a truth from trajectories: estimated trajectory of the source map's camera, in the "
        "map's frame, TUM format",
        "FILE");
    command.add_text("--source-truth", source_truth, "True trajectory of the same camera", "FILE");
    command.add_text("--target-trajectory", target_trajectory,
                     "Estimated trajectory of the target map's camera, in the map's frame", "FILE");
    command.add_text("--target-truth", target_truth,
                     "True trajectory of the same camera, in the world of --source-truth", "FILE");
    command.add_flag("--hand-eye", hand_eye,
                     "The true trajectories are those of a body that carries the camera, such as "
                     "markers of motion capture: also estimate the transform between them and the "
                     "clock offset, of each pair of trajectories");
    command.add_text("--write-truth", truth_output,
                     "Write the truth from trajectories, target_from_source, as --truth reads it",
                     "FILE");
    command.add_text("--source", source, "Source map (default: the path in the result)", "MAP");
    command.add_text("--target", target,
                     "Target map, for a verdict (default: the path in the result)", "MAP");
    add_number(command, "--min-probability", min_probability,
               "Without a truth: least probability of an aligned pose, at least 0.5 and below 1 "
               "(default: that of the result)");
    add_number(command, "--max-rotation-deg", max_rotation_deg,
               "Largest rotation error of a success, degrees");
    add_number(command, "--max-translation-m", max_translation_m,
               "Largest displacement of the source's centroid in a success, metres");
    add_number(command, "--max-scale-percent", max_scale_percent,
               "Largest error of the scale in a success, percent");
    common.add_csv_to(command, "result");
    common.add_to(command);
    common.add_threads_to(command);
    common.add_seed_to(command);
    for (const char* const name :
         {"--source-trajectory", "--source-truth", "--target-trajectory", "--target-truth"}) {
      command.option(name).excludes(truth_file);
    }
    for (const char* const name : {"--hand-eye", "--write-truth"}) {
      command.option(name).needs(command.option("--source-trajectory"));
    }
    command.footer(
        "Without a truth, judges each pose as it is, with the prior odds, probability, gravity,\n"
        "scale, effort, parts and deformation that the result was aligned with. The exit code is "
        "4\n"
        "unless all are aligned.\n"
        "\n"
        "Example: align with two metrics, then compare the poses with the true one\n"
        "  cairn align source.map target.map --confidence base,observations --json result.json\n"
        "  cairn evaluate alignment result.json --truth truth.txt --max-translation-m 0.02\n"
        "Example: judge the poses in a result\n"
        "  cairn evaluate alignment result.json\n"
        "Example: write the truth from both cameras' trajectories, for any --truth\n"
        "  cairn evaluate alignment --source-trajectory source.tum --source-truth source_truth.tum "
        "\\\n"
        "      --target-trajectory target.tum --target-truth target_truth.tum \\\n"
        "      --write-truth truth.txt");
  }

  int run() {
    for (const auto& [option, limit] : {std::pair{"--max-rotation-deg", max_rotation_deg},
                                        {"--max-translation-m", max_translation_m},
                                        {"--max-scale-percent", max_scale_percent}}) {
      refuse_if(limit < 0.0, option, fmt::format("{}", limit), "0 or more");
    }
    with_option_names({{"AlignOptions.min_probability", "--min-probability"}}, [&] {
      AlignOptions options;
      options.min_probability = min_probability.value_or(options.min_probability);
      options.validate();
    });
    has_trajectories();
    require_outputs(common);
    require_folder_of(truth_output);
    refuse_if(result.empty() && truth_output.empty(), "result", "not given",
              "the JSON of 'cairn align --json', or --write-truth");
    std::optional<SavedResult> saved;
    if (!result.empty()) saved = saved_result(read_file(result), result);
    const std::optional<TruePose> true_one = true_pose();
    if (!truth_output.empty()) write_pose(truth_output, true_one->target_from_source);
    if (!saved) return write_truth(*true_one);
    return true_one ? compare(*saved, *true_one) : give_verdicts(*saved);
  }

 private:
  // A path in a result is relative to where the alignment ran: here, or where the result lies.
  std::string map_path(const std::string& given, const std::string& option,
                       const SavedMap& saved) const {
    const std::string role = option.substr(2);
    if (!given.empty()) return given;
    reject_if(!saved.path, result, "does not name the " + role + " map", option + " MAP");
    const std::filesystem::path here = *saved.path;
    const std::filesystem::path beside = std::filesystem::path(result).parent_path() / here;
    for (const auto& path : {here, beside}) {
      std::error_code failure;  // the reader explains it
      if (std::filesystem::exists(path, failure) || failure) return path.string();
    }
    throw Error(ErrorKind::kInput, result, "its " + role + " map was not found: " + here.string(),
                option + " MAP");
  }

  LoadedMap load(const std::string& given, const std::string& option, const SavedMap& saved,
                 const SavedResult& whole) const {
    LoadedMap loaded = load_map(map_path(given, option, saved), common);
    std::error_code ignored;
    if (saved.hash && std::filesystem::is_regular_file(loaded.path, ignored) &&
        hash_file(loaded.path) != *saved.hash) {
      common.console().remark(loaded.path +
                              " is not the file that was aligned: its content differs");
    }
    if (!whole.camera.empty()) loaded.map = with_camera(loaded.map, parse_camera(whole.camera));
    return loaded;
  }

  bool has_trajectories() const {
    const std::array<const std::string*, 4> all = {&source_trajectory, &source_truth,
                                                   &target_trajectory, &target_truth};
    const auto given =
        std::count_if(all.begin(), all.end(), [](const auto* path) { return !path->empty(); });
    refuse_if(given != 0 && given != 4, "--source-trajectory",
              "not all four trajectories are given",
              "--source-trajectory, --source-truth, --target-trajectory and --target-truth");
    return given == 4;
  }

  // By orientations and positions: where a path is short or straight, positions leave a turn open.
  MapInWorld map_in_world(const std::string& estimate_path, const std::string& truth_path) const {
    const LogSink log = common.console().log();
    const Trajectory estimate = read_trajectory(estimate_path, log);
    Trajectory truth_of_camera = read_trajectory(truth_path, log);
    if (hand_eye) {
      const HandEyeResult found = estimate_hand_eye(estimate, truth_of_camera);
      reject_if(!found.hand_eye, estimate_path, found.reason, "");
      truth_of_camera = corrected_truth(truth_of_camera, *found.hand_eye);
    }
    TrajectoryEvaluationOptions options;
    options.alignment = TrajectoryAlignment::kPoses;
    const TrajectoryEvaluation evaluation = evaluate_trajectory(estimate, truth_of_camera, options);
    reject_if(!evaluation.absolute, estimate_path,
              "cannot be aligned with " + truth_path + ": " + evaluation.reason,
              "trajectories with common times");
    const AbsoluteError& absolute = *evaluation.absolute;
    return {absolute.truth_from_estimate.rigid(), evaluation.pairs.size(),
            absolute.rotation_rad.rmse, absolute.translation.rmse};
  }

  // std::nullopt if none was given.
  std::optional<TruePose> true_pose() const {
    if (!truth.empty()) return TruePose{read_similarity_file(truth)};
    if (!has_trajectories()) return std::nullopt;
    const MapInWorld in_source = map_in_world(source_trajectory, source_truth);
    const MapInWorld in_target = map_in_world(target_trajectory, target_truth);
    return TruePose{Similarity3(in_target.world_from_map.inverse() * in_source.world_from_map),
                    in_source, in_target};
  }

  Json truth_json(const TruePose& true_one) const {
    Json json = {{"path", text_or_null(truth)},
                 {"target_from_source", to_json(true_one.target_from_source.rigid())},
                 {"scale", true_one.target_from_source.scale()}};
    if (true_one.source) {
      json["source_trajectory"] = trajectory_json(source_trajectory, *true_one.source);
      json["source_truth"] = describe_file(source_truth, common);
      json["target_trajectory"] = trajectory_json(target_trajectory, *true_one.target);
      json["target_truth"] = describe_file(target_truth, common);
    }
    return json;
  }

  Json trajectory_json(const std::string& path, const MapInWorld& map) const {
    Json json = describe_file(path, common);
    json["poses"] = map.poses;
    json["rotation_rms_deg"] = degrees(map.rotation_rms_rad);
    json["translation_rms_m"] = map.translation_rms;
    return json;
  }

  // How well the trajectories determine the truth.
  void print_truth(const TruePose& true_one) const {
    const Console console = common.console();
    for (const auto& [role, map] :
         {std::pair{"source", &true_one.source}, {"target", &true_one.target}}) {
      if (!*map) continue;
      console.print("{} trajectory  {} poses, {} deg and {} m (rms) from the true one{}\n", role,
                    (*map)->poses, fixed(degrees((*map)->rotation_rms_rad), 2),
                    fixed((*map)->translation_rms, 4), hand_eye ? ", hand-eye corrected" : "");
    }
    if (!truth_output.empty()) console.print("wrote {}\n", truth_output);
  }

  // The verdict on each pose as it is, from the maps alone.
  int give_verdicts(const SavedResult& saved) const {
    const LoadedMap source_map = load(source, "--source", saved.source, saved);
    const LoadedMap target_map = load(target, "--target", saved.target, saved);
    AlignOptions options = saved.judging;
    options.scale_where_free = false;  // what the result was aligned with counts
    if (min_probability) options.min_probability = *min_probability;
    if (saved.with_gravity) options.gravity = gravity_prior(source_map.map, target_map.map);
    options.points.min_observations = saved.min_observations;
    std::vector<StrategyResult> results;
    for (const StrategyResult& one : saved.results) {
      StrategyResult judged = one;
      const auto& pose = one.alignment.estimate;
      judged.alignment = Alignment();
      judged.alignment.reason = "there is no pose to judge";
      if (pose) {
        options.scale.reset();
        if (saved.with_scale || pose->scale() != 1.0) options.scale = ScaleRange();
        judged.alignment =
            judge_pose(source_map.map, target_map.map, *pose, options, common.execution());
        judged.overlap_radius = judged.alignment.radius;
        judged.matches = judged.alignment.registration.matches.size();
      }
      if (judged.alignment.registration.status == RegistrationStatus::kCancelled) {
        throw Error(ErrorKind::kCancelled, "evaluate alignment", "cancelled", "");
      }
      results.push_back(std::move(judged));
    }
    Json json = document("evaluate_alignment", common,
                         {{"result", describe_file(result, common)},
                          {"source", source_map.description},
                          {"target", target_map.description},
                          {"truth", nullptr}},
                         {{"min_probability", options.min_probability},
                          {"prior_odds", options.prior_odds},
                          {"gravity", saved.with_gravity},
                          {"effort", options.effort},
                          {"parts", options.parts == PartsUse::kAlways  ? "always"
                                    : options.parts == PartsUse::kNever ? "never"
                                                                        : "where_refused"},
                          {"deformation", options.deformation},
                          {"min_observations", saved.min_observations}});
    json["results"] = Json::array();
    detail::Csv rows({"confidence", "status", "probability"});
    const Console console = common.console();
    for (const StrategyResult& one : results) {
      json["results"].push_back(to_json(one, HistoryDetail::kNone));
      rows << one.confidence << std::string(status_of(one.alignment)) << one.alignment.probability;
      rows.end_row();
      console.print("{}: {}: {}\n", one.confidence, status_of(one.alignment), one.alignment.reason);
    }
    write_document(json, common);
    write_rows(rows, common);
    const bool all_aligned = std::all_of(results.begin(), results.end(), [](const auto& one) {
      return one.alignment.verdict == Verdict::kAligned;
    });
    return all_aligned ? kDone : kNoTrustworthyAlignment;
  }

  JudgedAlignment judge(const StrategyResult& one, const Similarity3& true_pose,
                        const std::vector<Eigen::Vector3d>& positions) const {
    JudgedAlignment entry{.result = &one};
    judge_covariance(true_pose, entry);
    const auto& pose = one.alignment.estimate;
    if (pose) {
      entry.error = pose_error(*pose, true_pose, positions);
      entry.fits_inverse = fits_inverse(*pose, true_pose, positions);
    }
    // An untrusted pose does not count as a success. Maps of free scale have no lengths in metres.
    if (one.length_unit == LengthUnit::kMetres) {
      entry.success = entry.error && has_answer(one.alignment) &&
                      degrees(entry.error->rotation_rad) <= max_rotation_deg &&
                      entry.error->translation <= max_translation_m &&
                      percent_of(*entry.error) <= max_scale_percent;
    }
    return entry;
  }

  int compare(const SavedResult& saved, const TruePose& true_one) const {
    const Similarity3& true_pose = true_one.target_from_source;
    const LoadedMap source_map = load(source, "--source", saved.source, saved);
    PointSetOptions point_options;
    point_options.min_observations = saved.min_observations;
    const PointSet points = point_set(source_map.map, std::nullopt, point_options);
    reject_if(points.positions.empty(), source_map.path,
              fmt::format("has no landmarks with {} or more observations",
                          point_options.min_observations),
              "a map with landmarks, to measure translation at");

    std::vector<JudgedAlignment> judged;
    std::optional<std::size_t> successes;  // of those in metres
    for (const StrategyResult& one : saved.results) {
      judged.push_back(judge(one, true_pose, points.positions));
      const auto& success = judged.back().success;
      if (success) successes = successes.value_or(0) + (*success ? 1 : 0);
    }

    Json inputs = {{"result", describe_file(result, common)},
                   {"source", source_map.description},
                   {"truth", truth_json(true_one)}};
    Json json = document("evaluate_alignment", common, std::move(inputs),
                         {{"max_rotation_deg", max_rotation_deg},
                          {"max_translation_m", max_translation_m},
                          {"max_scale_percent", max_scale_percent},
                          {"hand_eye", hand_eye},
                          {"min_observations", point_options.min_observations}});
    json["results"] = json_of(judged);
    json["successes"] = to_json(successes);
    write_document(json, common);
    write_rows(rows_of(judged), common);
    print(judged, successes, true_one, points.positions.size());
    return kDone;
  }

  void print(const std::vector<JudgedAlignment>& judged, std::optional<std::size_t> successes,
             const TruePose& true_one, std::size_t landmarks) const {
    const Console console = common.console();
    const bool with_scale =
        true_one.target_from_source.scale() != 1.0 ||
        std::any_of(judged.begin(), judged.end(), [](const JudgedAlignment& entry) {
          const auto& pose = entry.result->alignment.estimate;
          return pose && pose->scale() != 1.0;
        });
    const bool with_ellipsoid = std::any_of(
        judged.begin(), judged.end(),
        [](const JudgedAlignment& entry) { return entry.normalised_squared_error.has_value(); });
    print_truth(true_one);
    if (true_one.source) console.print("\n");
    console.print(table_of(judged, with_scale, with_ellipsoid));
    console.print("\ntranslation error  displacement of the centroid of {} source landmarks\n",
                  landmarks);
    if (successes) {
      console.print(
          "success            at most {:g} deg and {:g} m{}: {} of {}\n", max_rotation_deg,
          max_translation_m,
          with_scale ? fmt::format(", and {:g} % of the scale", max_scale_percent) : std::string(),
          *successes, judged.size());
    } else {
      console.print(
          "success            unknown: the limits are in metres, the maps of free scale\n");
    }
    if (with_ellipsoid)
      console.print(
          "in ellipsoid       whether the truth lies in the 95 % ellipsoid of the stated "
          "covariance\n                   (squared error under it: at most {:.1f}, with a "
          "scale {:.1f})\n",
          kNormalisedSquaredError95, kNormalisedSquaredErrorWithScale95);
    if (std::any_of(judged.begin(), judged.end(),
                    [](const JudgedAlignment& entry) { return entry.fits_inverse; })) {
      console.print("truth              {}\n", swapped_truth_text("the pose"));
      console.remark(swapped_truth_text("the pose"));
    }
  }

  // The truth alone.
  int write_truth(const TruePose& true_one) const {
    Json json = document("evaluate_alignment", common, {{"truth", truth_json(true_one)}},
                         {{"hand_eye", hand_eye}});
    json["results"] = Json::array();
    write_document(json, common);
    write_rows(rows_of({}), common);
    print_truth(true_one);
    return kDone;
  }
};

}  // namespace

void add_evaluate_alignment(const Command& evaluate) {
  add_verb<EvaluateAlignmentArguments>(
      evaluate, "alignment", "Compute the pose errors of alignments, or judge their poses");
}

}  // namespace cairn::cli
