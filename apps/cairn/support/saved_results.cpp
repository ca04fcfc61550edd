// SPDX-License-Identifier: BSD-3-Clause
#include "support/saved_results.hpp"

#include <limits>

#include <fmt/format.h>

#include "cairn/core/detail/json_field.hpp"
#include "cairn/core/error.hpp"

namespace cairn::cli {
namespace {

using detail::JsonField;

constexpr std::uint32_t kMostPoints = std::numeric_limits<std::uint32_t>::max();
constexpr std::uint64_t kMostSeed = std::numeric_limits<std::uint64_t>::max();

Rigid3 pose_of(const JsonField& field) {
  const auto rows = field.rows<4, 4>();
  Matrix4d matrix;
  for (int i = 0; i < 16; ++i) matrix(i / 4, i % 4) = rows[static_cast<std::size_t>(i)];
  try {
    return Rigid3::from_matrix(matrix);
  } catch (const Error& error) {
    throw Error(ErrorKind::kInput, fmt::format("{}: {}", field.file(), field.path()), error.what(),
                "");
  }
}

std::optional<Rigid3> optional_pose_of(const JsonField& field) {
  return field.is_null() ? std::nullopt : std::optional(pose_of(field));
}

double scale_of(const JsonField& field) {
  const double scale = field.optional_number().value_or(1.0);
  if (!(scale > 0.0)) field.refuse("a positive number");
  return scale;
}

SavedMap map_of(const JsonField& input) {
  return {input["path"].optional_text(), input["hash"].optional_text()};
}

void check_version(const JsonField& root, unsigned newest) {
  const JsonField version = root["schema"]["version"];
  const std::size_t given = version.whole(std::numeric_limits<std::uint32_t>::max());
  if (given < 1 || given > newest) {
    version.refuse(newest == 1 ? "1" : fmt::format("1 to {}", newest));
  }
}

// Options that the verdict depends on; each is the default if the document does not hold it.
AlignOptions judging_of(const JsonField& options) {
  AlignOptions judging;
  const auto read = [&](const char* name, double& value, auto valid, std::string_view expected) {
    const JsonField field = options[name];
    value = field.optional_number().value_or(value);
    if (!valid(value)) field.refuse(expected);
  };
  read(
      "min_probability", judging.min_probability, [](double p) { return p >= 0.5 && p < 1.0; },
      "at least 0.5 and below 1");
  read(
      "prior_odds", judging.prior_odds, [](double odds) { return odds >= 1e-6 && odds <= 1e6; },
      "from 1e-6 to 1e6");
  read(
      "effort", judging.effort,
      [](double effort) { return effort >= 1.0 / 16.0 && effort <= 64.0; }, "from 1/16 to 64");
  if (const JsonField field = options["parts"]; !field.is_null()) {
    const std::string parts = field.text();
    if (parts == "always") {
      judging.parts = PartsUse::kAlways;
    } else if (parts == "never") {
      judging.parts = PartsUse::kNever;
    } else if (parts != "where_refused") {
      field.refuse("always, never or where_refused");
    }
  }
  if (const JsonField field = options["deformation"]; !field.is_null()) {
    judging.deformation = field.truth();
  }
  return judging;
}

// Inputs by role, with what is said of each.
std::vector<std::pair<std::string, Json>> described(const JsonField& inputs) {
  std::vector<std::pair<std::string, Json>> list;
  if (!inputs.json().is_object()) return list;
  for (const auto& [role, description] : inputs.json().items())
    list.emplace_back(role, Json(description));
  return list;
}

}  // namespace

SavedPaper saved_paper(const std::string& text, const std::string& file) {
  const auto document = detail::Json::parse(text);
  const JsonField root(document, file, "");
  check_version(root, 1);
  SavedPaper saved;
  const JsonField inputs = root["inputs"];
  saved.source = map_of(inputs["source"]);
  saved.target = map_of(inputs["target"]);
  saved.inputs = described(inputs);
  saved.truth = optional_pose_of(inputs["truth"]["target_from_source"]);
  saved.success_score = root["success_score_m2"].number();
  const JsonField agreement = root["agreement"];
  saved.agreement.pose = agreement["pose"].whole(kMostPoints);
  for (const JsonField& agrees : agreement["agrees"].items()) {
    saved.agreement.agrees.push_back(agrees.truth());
  }
  const JsonField options = root["options"];
  saved.tolerance.rotation_deg = options["max_rotation_deg"].number();
  saved.tolerance.translation_m = options["max_translation_m"].number();
  saved.align.max_iterations =
      static_cast<int>(options["max_iterations"].whole(std::numeric_limits<int>::max()));
  if (const auto distance = options["max_distance"].optional_number()) {
    saved.align.max_distance = *distance;
  }
  saved.points.min_observations = options["min_observations"].whole(kMostPoints);
  return saved;
}

SavedResult saved_result(const std::string& text, const std::string& file) {
  SavedResult saved;
  saved.file = file;
  for (AlignmentRecord& record : read_alignments(text, file)) {
    saved.unit = record.length_unit;
    saved.results.push_back({std::move(record), std::nullopt});
  }
  const auto document = detail::Json::parse(text);
  const JsonField root(document, file, "");
  const JsonField inputs = root["inputs"];
  saved.source = map_of(inputs["source"]);
  saved.target = map_of(inputs["target"]);
  saved.inputs = described(inputs);
  const JsonField options = root["options"];
  saved.options = Json(options.json());
  if (const JsonField count = options["min_observations"]; !count.is_null()) {
    saved.min_observations = count.whole(std::numeric_limits<std::uint32_t>::max());
  }
  saved.with_scale = !options["estimate_scale"].is_null() && options["estimate_scale"].truth();
  saved.with_gravity = !options["gravity"].is_null() && options["gravity"].truth();
  saved.judging = judging_of(options);
  saved.seed = root["seed"].is_null() ? 0 : root["seed"].whole(kMostSeed);
  saved.camera = options["camera"].optional_text().value_or("");
  // The demo puts its start and truth beside the results.
  const JsonField initial = options["initial"].is_null() ? root["initial"] : options["initial"];
  saved.initial = optional_pose_of(initial).value_or(Rigid3());
  const JsonField truth =
      root["truth"].is_null() ? inputs["truth"]["target_from_source"] : root["truth"];
  if (const auto pose = optional_pose_of(truth)) {
    saved.truth = Similarity3(scale_of(inputs["truth"]["scale"]), *pose);
  }
  const std::vector<JsonField> results = root["results"].items();
  for (std::size_t i = 0; i < results.size(); ++i) {
    const JsonField error = results[i]["error"];
    if (error.is_null()) continue;
    saved.results[i].error =
        PoseError{radians(error["rotation_deg"].number()), error["translation"].number(),
                  error["log_scale"].optional_number().value_or(0.0)};
  }
  return saved;
}

}  // namespace cairn::cli
