// SPDX-License-Identifier: BSD-3-Clause
#include "support/saved_results.hpp"

#include <array>
#include <limits>
#include <string_view>

#include <fmt/format.h>

#include "cairn/core/error.hpp"

#include "support/saved_alignments.hpp"

namespace cairn::cli {
namespace {

constexpr std::uint32_t kMostPoints = std::numeric_limits<std::uint32_t>::max();

std::string shown(const Json& value) {
  constexpr std::size_t kLongest = 40;
  std::string text = value.dump(-1, ' ', true, Json::error_handler_t::replace);
  if (text.size() > kLongest) text = text.substr(0, kLongest) + "...";
  return text;
}

// A value of a document and the way to it.
class Field {
 public:
  Field(const Json& value, std::string file, std::string path)
      : value_(&value), file_(std::move(file)), path_(std::move(path)) {}

  [[noreturn]] void refuse(std::string_view expected) const {
    throw Error(ErrorKind::kInput, file_, fmt::format("{} is {}", path_, shown(*value_)), expected);
  }

  // A member; null where it is absent.
  Field operator[](const char* name) const {
    static const Json absent;
    const bool present = value_->is_object() && value_->contains(name);
    return {present ? value_->at(name) : absent, file_, path_.empty() ? name : path_ + "." + name};
  }
  std::vector<Field> items() const {
    if (!value_->is_array()) refuse("a list");
    std::vector<Field> fields;
    for (std::size_t i = 0; i < value_->size(); ++i) {
      fields.push_back({(*value_)[i], file_, fmt::format("{}[{}]", path_, i)});
    }
    return fields;
  }

  bool is_null() const { return value_->is_null(); }
  const Json& json() const { return *value_; }
  double number() const {
    if (!value_->is_number()) refuse("a number");
    return value_->get<double>();
  }
  std::size_t whole(std::uint64_t most) const {
    if (!value_->is_number_unsigned() || value_->get<std::uint64_t>() > most) {
      refuse(fmt::format("a whole number of at most {}", most));
    }
    return value_->get<std::size_t>();
  }
  std::string text() const {
    if (!value_->is_string()) refuse("text");
    return value_->get<std::string>();
  }
  Rigid3 pose() const {
    const auto matrix = matrix_of_rows(nlohmann::json(*value_));
    if (!matrix) refuse("4 rows of 4 numbers");
    try {
      return Rigid3::from_matrix(*matrix);
    } catch (const Error& error) {
      throw Error(ErrorKind::kInput, fmt::format("{}: {}", file_, path_), error.what(), "");
    }
  }
  // 1 where none is given.
  double scale() const {
    if (is_null()) return 1.0;
    const double value = number();
    if (!(value > 0.0)) refuse("a positive number");
    return value;
  }
  std::optional<double> optional_number() const {
    return is_null() ? std::nullopt : std::optional(number());
  }
  std::optional<std::string> optional_text() const {
    return is_null() ? std::nullopt : std::optional(text());
  }
  std::optional<Rigid3> optional_pose() const {
    return is_null() ? std::nullopt : std::optional(pose());
  }

  // The one of `values` whose name this is.
  template <class Value, std::size_t Count>
  Value one_of(const std::array<Value, Count>& values) const {
    const std::string name = text();
    std::string names;
    for (const Value value : values) {
      if (to_string(value) == name) return value;
      names += fmt::format("{}{}", names.empty() ? "" : ", ", to_string(value));
    }
    refuse("one of " + names);
  }

 private:
  const Json* value_;
  std::string file_;
  std::string path_;
};

IterationRecord iteration_of(const Field& field) {
  IterationRecord record;
  record.target_from_source = field["target_from_source"].pose();
  record.scale = field["scale"].scale();
  record.mean_squared_distance = field["mean_squared_distance"].optional_number().value_or(
      std::numeric_limits<double>::quiet_NaN());
  record.score = field["score"].optional_number();
  const Field matches = field["matches"];
  if (matches.is_null()) return record;
  for (const Field& pair : matches.items()) {
    const std::vector<Field> ends = pair.items();
    if (ends.size() != 2) pair.refuse("two numbers, of a source and a target landmark");
    record.matches.push_back({static_cast<std::uint32_t>(ends[0].whole(kMostPoints)),
                              static_cast<std::uint32_t>(ends[1].whole(kMostPoints)), 0.0});
  }
  record.match_count = record.matches.size();
  return record;
}

Alignment alignment_of(const Field& field) {
  Alignment alignment;
  alignment.confidence = field["confidence"].text();
  alignment.method = field["method"].optional_text().value_or(alignment.method);
  alignment.k = field["k"].whole(std::numeric_limits<std::uint32_t>::max());
  RegistrationResult& result = alignment.result;
  result.stop_reason = field["stop_reason"].one_of(
      std::array{StopReason::kMseChange, StopReason::kNoMotion, StopReason::kFixedPoint,
                 StopReason::kCycle, StopReason::kIterationLimit, StopReason::kTimeLimit,
                 StopReason::kTooFewMatches, StopReason::kCancelled});
  if (const Field verdict = field["verdict"]; !verdict.is_null() && verdict.text() != "none") {
    PlacementResult& placement = alignment.placement.emplace();
    placement.verdict =
        verdict.one_of(std::array{Verdict::kAligned, Verdict::kAmbiguous, Verdict::kRejected});
    placement.probability = field["probability"].number();
    placement.radius = field["support_radius"].number();
    result.status = field["target_from_source"].is_null() ? RegistrationStatus::kFailed
                                                          : RegistrationStatus::kConverged;
  } else if (field["status"].text() == "aligned") {
    // Earlier documents say it of all that has a pose, which was never judged.
    result.status = status_of(result.stop_reason);
  } else {
    result.status = field["status"].one_of(
        std::array{RegistrationStatus::kConverged, RegistrationStatus::kStopped,
                   RegistrationStatus::kFailed, RegistrationStatus::kCancelled});
  }
  result.reason = field["reason"].text();
  result.target_from_source = field["target_from_source"].optional_pose().value_or(Rigid3());
  result.scale = field["scale"].scale();
  result.initial_score = field["initial_score"].optional_number();
  result.score = field["score"].optional_number();
  result.iterations = static_cast<int>(field["iterations"].whole(std::numeric_limits<int>::max()));
  if (const Field coarse = field["coarse_iterations"]; !coarse.is_null()) {
    result.coarse_iterations = static_cast<int>(coarse.whole(std::numeric_limits<int>::max()));
  }
  if (const Field repetition = field["repetition"]; !repetition.is_null()) {
    const auto count = [&](const char* name) {
      return static_cast<int>(repetition[name].whole(result.iterations));
    };
    result.repetition = {{count("first_iteration"), count("length")}, count("best_iteration")};
  }
  if (const Field overlap = field["overlap"]; !overlap.is_null()) {
    result.overlap = Overlap{overlap["source"].number(), overlap["target"].number()};
  }
  result.duration_s = field["duration_s"].optional_number().value_or(0.0);
  if (const Field error = field["error"]; !error.is_null()) {
    alignment.error =
        PoseError{radians(error["rotation_deg"].number()), error["translation"].number(),
                  error["log_scale"].optional_number().value_or(0.0)};
  }
  if (const Field history = field["history"]; !history.is_null()) {
    for (const Field& iteration : history.items()) {
      result.history.push_back(iteration_of(iteration));
    }
  }
  return alignment;
}

SavedMap map_of(const Field& input) {
  return {input["path"].optional_text(), input["hash"].optional_text()};
}

void check_version(const Field& root) {
  const Field version = root["schema"]["version"];
  if (version.whole(std::numeric_limits<std::uint32_t>::max()) != 1) version.refuse("1");
}

// Inputs by role, with what is said of each.
std::vector<std::pair<std::string, Json>> described(const Field& inputs) {
  std::vector<std::pair<std::string, Json>> list;
  if (!inputs.json().is_object()) return list;
  for (const auto& [role, description] : inputs.json().items())
    list.emplace_back(role, description);
  return list;
}

}  // namespace

SavedPaper saved_paper(const Json& document, const std::string& file) {
  const Field root(document, file, "");
  check_version(root);
  SavedPaper saved;
  const Field inputs = root["inputs"];
  saved.source = map_of(inputs["source"]);
  saved.target = map_of(inputs["target"]);
  saved.inputs = described(inputs);
  saved.truth = inputs["truth"]["target_from_source"].optional_pose();
  saved.success_score = root["success_score_m2"].number();
  const Field agreement = root["agreement"];
  saved.agreement.pose = agreement["pose"].whole(kMostPoints);
  for (const Field& agrees : agreement["agrees"].items()) {
    if (!agrees.json().is_boolean()) agrees.refuse("true or false");
    saved.agreement.agrees.push_back(agrees.json().get<bool>());
  }
  const Field options = root["options"];
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

SavedResult saved_result(const Json& document, const std::string& file) {
  const Field root(document, file, "");
  check_version(root);
  SavedResult saved;
  saved.file = file;
  const Field inputs = root["inputs"];
  saved.source = map_of(inputs["source"]);
  saved.target = map_of(inputs["target"]);
  saved.inputs = described(inputs);
  const Field options = root["options"];
  saved.options = options.json();
  if (const Field count = options["min_observations"]; !count.is_null()) {
    saved.min_observations = count.whole(std::numeric_limits<std::uint32_t>::max());
  }
  saved.camera = options["camera"].optional_text().value_or("");
  // The demo puts its start and truth beside the results.
  const Field initial = options["initial"].is_null() ? root["initial"] : options["initial"];
  saved.initial = initial.pose();
  const Field truth =
      root["truth"].is_null() ? inputs["truth"]["target_from_source"] : root["truth"];
  if (const auto pose = truth.optional_pose()) {
    saved.truth = Similarity3(inputs["truth"]["scale"].scale(), *pose);
  }
  const Field results = root["results"];
  for (const Field& result : results.items()) {
    saved.unit = result["length_unit"].text() == "free" ? LengthUnit::kFree : LengthUnit::kMetres;
    saved.alignments.push_back(alignment_of(result));
  }
  if (saved.alignments.empty()) results.refuse("at least one result");
  return saved;
}

}  // namespace cairn::cli
