// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Eigenvalues>
#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/core/file.hpp"
#include "cairn/evaluation/pose_error.hpp"
#include "cairn/geometry/covariance.hpp"
#include "cairn/registration/point_set.hpp"

#include "commands.hpp"
#include "support/arguments.hpp"
#include "support/documents.hpp"
#include "support/saved_alignments.hpp"
#include "support/table.hpp"

namespace cairn::cli {
namespace {

struct EvaluateAlignmentArguments {
  CommonArguments common;
  std::string result;
  std::string truth;
  std::string source;
  double max_rotation_deg = 5.0;
  double max_translation_m = 0.05;
  double max_scale_percent = 5.0;

  void add_to(CLI::App& command);
  int run();

 private:
  std::string source_path(const SavedAlignments& saved) const;
};

// One result beside the truth; what is not known stays nothing.
struct JudgedAlignment {
  SavedAlignment alignment;
  std::optional<PoseError> error = {};
  std::optional<bool> success = {};
  std::optional<double> normalised_squared_error = {};
  std::optional<bool> in_ellipsoid = {};  ///< of 95 % by the stated covariance
};

void EvaluateAlignmentArguments::add_to(CLI::App& command) {
  add_text(command, "result", result, "What 'cairn align --json' wrote")->required();
  add_text(command, "--truth", truth,
           "True target_from_source, 16 numbers or the JSON of an alignment", "FILE")
      ->required();
  add_text(command, "--source", source,
           "The source map; without it, it is looked for where the result says", "MAP");
  add_number(command, "--max-rotation-deg", max_rotation_deg,
             "Largest rotation error of a success, degrees");
  add_number(command, "--max-translation-m", max_translation_m,
             "Largest displacement of the source's centroid in a success, metres");
  add_number(command, "--max-scale-percent", max_scale_percent,
             "Largest error of the scale in a success, percent");
  common.add_csv_to(command, "result");
  common.add_to(command);
  command.footer(
      "Example: align by two strategies, then hold the poses against the true one\n"
      "  cairn align source.map target.map --confidence none,observations --json result.json\n"
      "  cairn evaluate alignment result.json --truth truth.txt --max-translation-m 0.02");
}

// A path in a result is relative to where the alignment ran: here, or where the result lies.
std::string EvaluateAlignmentArguments::source_path(const SavedAlignments& saved) const {
  if (!source.empty()) return source;
  if (!saved.source_path) {
    throw Error(ErrorKind::kInput, result, "does not name the source map", "--source MAP");
  }
  const std::filesystem::path here = *saved.source_path;
  const std::filesystem::path beside = std::filesystem::path(result).parent_path() / here;
  for (const auto& path : {here, beside}) {
    if (std::filesystem::exists(path)) return path.string();
  }
  throw Error(ErrorKind::kInput, result, "its source map is not to be found: " + here.string(),
              "--source MAP");
}

// How the error compares to the stated covariance.
void judge_covariance(const Similarity3& truth, JudgedAlignment& judged) {
  const auto& pose = judged.alignment.target_from_source;
  const auto& covariance = judged.alignment.covariance;
  if (!pose || !covariance) return;
  const bool with_scale = covariance->rows() == 7;
  // Six rows know nothing of a scale.
  if (!with_scale && pose->scale() != truth.scale()) return;
  // As of a map aligned to itself, whose residuals are none.
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> spectrum(*covariance,
                                                                Eigen::EigenvaluesOnly);
  if (!(spectrum.eigenvalues().minCoeff() > 1e-12 * spectrum.eigenvalues().maxCoeff())) return;
  judged.normalised_squared_error =
      with_scale ? normalised_squared_error(*pose, Matrix7d(*covariance), truth)
                 : normalised_squared_error(pose->rigid(), Matrix6d(*covariance), truth.rigid());
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

Csv rows_of(const std::vector<JudgedAlignment>& judged) {
  Csv rows({"confidence", "status", "rotation_error_deg", "translation_error", "length_unit",
            "success", "log_scale_error", "normalised_squared_error", "in_ellipsoid"});
  for (const auto& [alignment, error, success, normalised, inside] : judged) {
    rows << alignment.confidence << alignment.status;
    rows << (error ? std::optional(degrees(error->rotation_rad)) : std::nullopt);
    rows << (error ? std::optional(error->translation) : std::nullopt);
    rows << alignment.length_unit;
    rows << yes_or_no(success, "");
    rows << (error ? std::optional(error->log_scale) : std::nullopt);
    rows << normalised << yes_or_no(inside, "");
    rows.end_row();
  }
  return rows;
}

Json json_of(const std::vector<JudgedAlignment>& judged) {
  Json results = Json::array();
  for (const auto& [alignment, error, success, normalised, inside] : judged) {
    Json entry = {{"confidence", alignment.confidence},
                  {"status", alignment.status},
                  {"length_unit", alignment.length_unit}};
    entry["error"] = error ? to_json(*error) : Json(nullptr);
    entry["success"] = to_json(success);
    entry["normalised_squared_error"] = to_json(normalised);
    entry["in_ellipsoid"] = to_json(inside);
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
  for (const auto& [alignment, error, success, normalised, inside] : judged) {
    const char* const unit = alignment.length_unit == "metres" ? "m" : "units";
    std::vector<std::string> row = {
        alignment.confidence, alignment.status,
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

int EvaluateAlignmentArguments::run() {
  for (const auto& [option, limit] : {std::pair{"--max-rotation-deg", max_rotation_deg},
                                      {"--max-translation-m", max_translation_m},
                                      {"--max-scale-percent", max_scale_percent}}) {
    if (limit < 0.0) {
      throw Error(ErrorKind::kMisuse, option, fmt::format("{}", limit), "0 or more");
    }
  }
  require_outputs(common);
  const SavedAlignments saved = read_alignments(result);
  const Similarity3 true_pose = read_similarity_file(truth);
  const LoadedMap source_map = load_map(source_path(saved), common);
  const Console console = common.console();
  if (saved.source_hash && std::filesystem::is_regular_file(source_map.path) &&
      hash_file(source_map.path) != *saved.source_hash) {
    console.remark(source_map.path + " is not the file that was aligned: its content differs");
  }
  PointSetOptions point_options;
  if (saved.min_observations) point_options.min_observations = *saved.min_observations;
  const PointSet points = point_set(source_map.map, std::nullopt, point_options);
  if (points.positions.empty()) {
    throw Error(ErrorKind::kInput, source_map.path,
                fmt::format("has no landmarks with {} or more observations",
                            point_options.min_observations),
                "a map with landmarks, to measure translation at");
  }

  std::vector<JudgedAlignment> judged;
  std::optional<std::size_t> successes;  // of those in metres
  for (const SavedAlignment& alignment : saved.results) {
    JudgedAlignment entry{.alignment = alignment};
    judge_covariance(true_pose, entry);
    const bool metric = alignment.length_unit == "metres";
    if (alignment.target_from_source) {
      entry.error = pose_error(*alignment.target_from_source, true_pose, points.positions);
    }
    if (metric) {  // metres say nothing of a map of free scale
      entry.success = entry.error && degrees(entry.error->rotation_rad) <= max_rotation_deg &&
                      entry.error->translation <= max_translation_m &&
                      percent_of(*entry.error) <= max_scale_percent;
      successes = successes.value_or(0) + (*entry.success ? 1 : 0);
    }
    judged.push_back(std::move(entry));
  }

  Json inputs = {{"result", describe_file(result, common)},
                 {"source", source_map.description},
                 {"truth",
                  {{"path", truth},
                   {"target_from_source", to_json(true_pose.rigid())},
                   {"scale", true_pose.scale()}}}};
  Json json = document("evaluate_alignment", common, std::move(inputs),
                       {{"max_rotation_deg", max_rotation_deg},
                        {"max_translation_m", max_translation_m},
                        {"max_scale_percent", max_scale_percent},
                        {"min_observations", point_options.min_observations}});
  json["results"] = json_of(judged);
  json["successes"] = to_json(successes);
  write_document(json, common);
  write_rows(rows_of(judged), common);
  const bool with_scale =
      true_pose.scale() != 1.0 ||
      std::any_of(judged.begin(), judged.end(), [](const JudgedAlignment& entry) {
        const auto& pose = entry.alignment.target_from_source;
        return pose && pose->scale() != 1.0;
      });
  const bool with_ellipsoid = std::any_of(
      judged.begin(), judged.end(),
      [](const JudgedAlignment& entry) { return entry.normalised_squared_error.has_value(); });
  console.print(table_of(judged, with_scale, with_ellipsoid));
  console.print(
      fmt::format("\ntranslation error  displacement of the centroid of {} source landmarks\n",
                  points.positions.size()));
  if (successes) {
    console.print(fmt::format(
        "success            at most {:g} deg and {:g} m{}: {} of {}\n", max_rotation_deg,
        max_translation_m,
        with_scale ? fmt::format(", and {:g} % of the scale", max_scale_percent) : std::string(),
        *successes, judged.size()));
  } else {
    console.print("success            unknown: metres say nothing of maps of free scale\n");
  }
  if (with_ellipsoid)
    console.print(fmt::format(
        "in ellipsoid       whether the truth lies in the 95 % ellipsoid of the stated "
        "covariance\n                   (squared error under it: at most {:.1f}, with a "
        "scale {:.1f})\n",
        kNormalisedSquaredError95, kNormalisedSquaredErrorWithScale95));
  return kDone;
}

}  // namespace

Run add_evaluate_alignment(CLI::App& evaluate) {
  auto arguments = std::make_shared<EvaluateAlignmentArguments>();
  arguments->add_to(
      *evaluate.add_subcommand("alignment", "Pose errors of the results of an alignment"));
  return [arguments] { return arguments->run(); };
}

}  // namespace cairn::cli
