// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/alignment/document.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <utility>

#include "cairn/core/detail/json_field.hpp"
#include "cairn/core/detail/json_text.hpp"
#include "cairn/geometry/angles.hpp"
#include "cairn/geometry/decompositions.hpp"

namespace cairn {
namespace {

using detail::Json;
using detail::JsonField;

constexpr std::uint64_t kMostIndices = std::numeric_limits<std::uint32_t>::max();
constexpr std::uint64_t kMostIterations = std::numeric_limits<int>::max();

constexpr const char* kMetres = "metres";
constexpr const char* kFree = "free";

template <class Value>
Json or_null(const std::optional<Value>& value) {
  return value ? Json(*value) : Json(nullptr);
}

template <class Matrix>
Json rows_of(const Matrix& matrix) {
  Json rows = Json::array();
  for (Eigen::Index i = 0; i < matrix.rows(); ++i) {
    Json row = Json::array();
    for (Eigen::Index j = 0; j < matrix.cols(); ++j) row.push_back(matrix(i, j));
    rows.push_back(std::move(row));
  }
  return rows;
}

Json list_of(const Eigen::Vector3d& vector) {
  return {vector.x(), vector.y(), vector.z()};
}

// The matrix is for people and other programs; quaternion and scale restore the pose exactly.
void put_pose(Json& json, const char* name, const Similarity3& pose,
              const std::string& prefix = "") {
  const Eigen::Quaterniond q = pose.rigid().quaternion();
  json[name] = rows_of(pose.matrix());
  json[prefix + "quaternion"] = {q.w(), q.x(), q.y(), q.z()};
  json[prefix + "scale"] = pose.scale();
}

Json open_directions_json(const std::vector<OpenDirection>& directions) {
  Json list = Json::array();
  for (const OpenDirection& direction : directions) {
    list.push_back({{"translation", list_of(direction.translation)},
                    {"rotation", list_of(direction.rotation)},
                    {"log_scale", direction.log_scale}});
  }
  return list;
}

Json history_json(const std::vector<IterationRecord>& history, bool with_matches) {
  Json list = Json::array();
  for (const IterationRecord& iteration : history) {
    Json entry;
    put_pose(entry, "target_from_source", {iteration.scale, iteration.target_from_source});
    entry["mean_squared_distance"] = iteration.mean_squared_distance;
    entry["match_count"] = iteration.match_count;
    if (with_matches) {
      entry["score"] = or_null(iteration.score);
      Json matches = Json::array();
      for (const Match& match : iteration.matches) matches.push_back({match.source, match.target});
      entry["matches"] = std::move(matches);
    }
    list.push_back(std::move(entry));
  }
  return list;
}

Json likeness_json(const Support& support) {
  if (!support.likeness) return nullptr;
  return {{"compared", support.likeness->compared},
          {"alike", support.likeness->alike},
          {"evidence", support.likeness->evidence()},
          {"spread_evidence", support.spread_likeness}};
}

Json agreement_json(const Support& support) {
  if (!support.agreement) return nullptr;
  return {{"matches", support.agreement->matches},
          {"agreeing", support.agreement->agreeing},
          {"spread", support.agreement->spread},
          {"expected", support.agreement->expected},
          {"evidence", support.agreement->evidence()}};
}

Json proximity_json(const ProximityEvidence& proximity) {
  return {{"evidence", proximity.all},
          {"spread_evidence", proximity.spread},
          {"share", proximity.share},
          {"deviation", proximity.deviation}};
}

Json candidates_json(const std::vector<PlacementCandidate>& candidates) {
  Json list = Json::array();
  for (const PlacementCandidate& candidate : candidates) {
    const Support& support = candidate.support;
    Json entry;
    put_pose(entry, "target_from_source", candidate.similarity());
    entry["probability"] = candidate.probability;
    entry["support"] = support.share;
    entry["matches"] = support.within[0];
    entry["close_matches"] = support.within[1];
    entry["matches_by_radius"] = support.within;
    entry["descriptor_agreement"] = agreement_json(support);
    entry["proximity"] = proximity_json(support.proximity);
    entry["evidence"] = support.evidence;
    entry["spread_evidence"] = support.spread_evidence;
    entry["likeness"] = likeness_json(support);
    entry["contradicted"] = or_null(candidate.contradicted);
    list.push_back(std::move(entry));
  }
  return list;
}

// Includes the scale's row and column if the scale is estimated.
Json covariance_json(const RegistrationResult& result) {
  if (result.covariance_with_scale) return rows_of(*result.covariance_with_scale);
  return result.covariance ? rows_of(*result.covariance) : Json(nullptr);
}

Json overlap_json(const AlignmentRecord& record) {
  const auto& overlap = record.alignment.registration.overlap;
  if (!overlap) return nullptr;
  return {{"source", overlap->source},
          {"target", overlap->target},
          {"radius", or_null(record.overlap_radius)}};
}

// Results of the parts.
Json parts_json(const std::optional<PartsAlignment>& parts) {
  if (!parts) return nullptr;
  Json list = Json::array();
  for (const PartPose& part : parts->parts) {
    Json entry = {{"map", to_string(part.map)},
                  {"first_keyframe", part.first.value},
                  {"middle_keyframe", part.middle.value},
                  {"last_keyframe", part.last.value},
                  {"landmarks", part.landmarks},
                  {"verdict", to_string(part.verdict)},
                  {"probability", part.probability},
                  {"agrees", part.agrees},
                  {"found", nullptr},
                  {"target_from_source", nullptr}};
    if (part.found) put_pose(entry, "found", *part.found, "found_");
    if (part.target_from_source) put_pose(entry, "target_from_source", *part.target_from_source);
    list.push_back(std::move(entry));
  }
  Json bend = nullptr;
  if (parts->bend) {
    bend = {{"map", to_string(parts->bend->map)},
            {"rotation_deg", degrees(parts->bend->rotation_rad)},
            {"first_keyframe", parts->bend->first.value},
            {"last_keyframe", parts->bend->last.value},
            {"displacement", parts->bend->displacement}};
  }
  return {{"aligned", parts->aligned},
          {"consensus", parts->consensus},
          {"contradictory", parts->contradictory},
          {"confirmed", or_null(parts->confirmed)},
          {"probability", parts->consensus ? Json(parts->probability) : Json(nullptr)},
          {"bend", std::move(bend)},
          {"poses", std::move(list)}};
}

Json deformation_json(const std::optional<MapDeformation>& deformation) {
  if (!deformation) return nullptr;
  return {{"matches", deformation->matches},
          {"rotation_deg", degrees(deformation->rotation_rad)},
          {"scale_ratio", deformation->scale_ratio},
          {"displacement", deformation->displacement}};
}

Json repetition_json(const std::optional<RepeatedMatches>& repetition) {
  if (!repetition) return nullptr;
  return {{"first_iteration", repetition->cycle.first},
          {"length", repetition->cycle.length},
          {"best_iteration", repetition->best_iteration}};
}

// ---- Reading

template <class Work>
auto in_file(const JsonField& field, const Work& work) {
  try {
    return work();
  } catch (const Error& error) {
    throw Error(ErrorKind::kInput, fmt::format("{}: {}", field.file(), field.path()), error.what(),
                "");
  }
}

// Largest relative difference between two statements of one pose.
constexpr double kSamePose = 1e-9;

// A positive number; 1 if there is none.
Json deviations_json(const Alignment& alignment) {
  const auto deviations = deviations_of(alignment);
  if (!deviations) return nullptr;
  return {{"translation", list_of(deviations->translation)},
          {"rotation_deg", list_of(deviations->rotation_rad * degrees(1.0))},
          {"log_scale", or_null(deviations->log_scale)}};
}

double scale_of(const JsonField& field) {
  if (field.is_null()) return 1.0;
  const double scale = field.number();
  if (!(scale > 0.0)) field.refuse("a positive number");
  return scale;
}

// The pose of the member `name`, by version: in version 1 the matrix is rigid, and the scale stands
// beside it alone.
Similarity3 pose_of(const JsonField& parent, const char* name, unsigned version,
                    const std::string& prefix = "") {
  const JsonField field = parent[name];
  const auto rows = field.rows<4, 4>();
  Matrix4d matrix;
  for (int i = 0; i < 16; ++i) matrix(i / 4, i % 4) = rows[static_cast<std::size_t>(i)];
  const double scale = scale_of(parent[(prefix + "scale").c_str()]);
  if (version == 1) {
    return in_file(field, [&] { return Similarity3(scale, Rigid3::from_matrix(matrix)); });
  }
  Similarity3 rough = in_file(field, [&] { return Similarity3::from_matrix(matrix); });
  const JsonField quaternion = parent[(prefix + "quaternion").c_str()];
  if (quaternion.is_null()) return rough;
  const auto q = quaternion.numbers<4>();
  Similarity3 exact(scale, Rigid3(Eigen::Quaterniond(q[0], q[1], q[2], q[3]), rough.translation()));
  const double difference = (exact.matrix() - matrix).topLeftCorner<3, 3>().norm();
  if (!(difference <= kSamePose * scale)) field.refuse("the pose of its quaternion and scale");
  return exact;
}

template <int kSize>
std::optional<Eigen::Matrix<double, kSize, kSize, Eigen::DontAlign>> covariance_of(
    const JsonField& field) {
  const Json& list = field.json();
  const bool square = list.is_array() && list.size() == kSize &&
                      std::all_of(list.begin(), list.end(), [](const Json& row) {
                        return row.is_array() && row.size() == kSize;
                      });
  if (!square) return std::nullopt;
  const auto rows = field.rows<kSize, kSize>();
  Eigen::Matrix<double, kSize, kSize, Eigen::DontAlign> matrix;
  for (int i = 0; i < kSize * kSize; ++i) {
    matrix(i / kSize, i % kSize) = rows[static_cast<std::size_t>(i)];
  }
  constexpr double kRounding = 1e-9;
  const bool symmetric = (matrix - matrix.transpose()).norm() <= kRounding * matrix.norm();
  const auto refuse = [&] { field.refuse("a positive semidefinite 6x6 or 7x7 matrix"); };
  if (!symmetric) refuse();
  const auto values = symmetric_eigenvalues<kSize>(matrix);
  if (!(values.minCoeff() >= -kRounding * values.maxCoeff())) refuse();
  return matrix;
}

void read_covariance(const JsonField& field, RegistrationResult& result) {
  if (field.is_null()) return;
  if (auto covariance = covariance_of<6>(field)) {
    result.covariance = *covariance;
  } else if (auto with_scale = covariance_of<7>(field)) {
    result.covariance_with_scale = *with_scale;
    result.covariance = Matrix6d(with_scale->template topLeftCorner<6, 6>());
  } else {
    field.refuse("a positive semidefinite 6x6 or 7x7 matrix");
  }
}

Eigen::Vector3d vector_of(const JsonField& field) {
  const auto n = field.numbers<3>();
  return {n[0], n[1], n[2]};
}

std::vector<OpenDirection> open_directions_of(const JsonField& field) {
  std::vector<OpenDirection> directions;
  if (field.is_null()) return directions;
  for (const JsonField& entry : field.items()) {
    directions.push_back({vector_of(entry["translation"]), vector_of(entry["rotation"]),
                          entry["log_scale"].optional_number().value_or(0.0)});
  }
  return directions;
}

IterationRecord iteration_of(const JsonField& field, unsigned version) {
  IterationRecord record;
  const Similarity3 pose = pose_of(field, "target_from_source", version);
  record.target_from_source = pose.rigid();
  record.scale = pose.scale();
  record.mean_squared_distance = field["mean_squared_distance"].optional_number().value_or(
      std::numeric_limits<double>::quiet_NaN());
  record.score = field["score"].optional_number();
  if (const JsonField matches = field["matches"]; !matches.is_null()) {
    for (const JsonField& pair : matches.items()) {
      const std::vector<JsonField> ends = pair.items();
      if (ends.size() != 2) pair.refuse("two numbers, of a source and a target landmark");
      record.matches.push_back({static_cast<std::uint32_t>(ends[0].whole(kMostIndices)),
                                static_cast<std::uint32_t>(ends[1].whole(kMostIndices)), 0.0});
    }
  }
  const JsonField count = field["match_count"];
  record.match_count = count.is_null() ? record.matches.size() : count.whole(kMostIndices);
  return record;
}

PlacementCandidate candidate_of(const JsonField& field, unsigned version) {
  PlacementCandidate candidate;
  const Similarity3 pose = pose_of(field, "target_from_source", version);
  candidate.target_from_source = pose.rigid();
  candidate.scale = pose.scale();
  candidate.probability = field["probability"].number();
  candidate.contradicted = field["contradicted"].optional_number();
  Support& support = candidate.support;
  support.share = field["support"].number();
  if (const JsonField within = field["matches_by_radius"]; !within.is_null()) {
    const std::vector<JsonField> counts = within.items();
    if (counts.size() != Support::kRadii) {
      within.refuse(fmt::format("{} whole numbers", Support::kRadii));
    }
    for (std::size_t i = 0; i < Support::kRadii; ++i) {
      support.within[i] = counts[i].whole(kMostIndices);
    }
  } else {
    support.within[0] = field["matches"].whole(kMostIndices);
    support.within[1] = field["close_matches"].whole(kMostIndices);
  }
  support.evidence = field["evidence"].optional_number().value_or(0.0);
  support.spread_evidence = field["spread_evidence"].optional_number().value_or(0.0);
  if (const JsonField likeness = field["likeness"]; !likeness.is_null()) {
    support.likeness =
        Likeness{likeness["compared"].whole(kMostIndices), likeness["alike"].whole(kMostIndices)};
    support.spread_likeness = likeness["spread_evidence"].optional_number().value_or(0.0);
  }
  if (const JsonField agreement = field["descriptor_agreement"]; !agreement.is_null()) {
    support.agreement = DescriptorAgreement{
        agreement["matches"].whole(kMostIndices), agreement["agreeing"].whole(kMostIndices),
        agreement["spread"].whole(kMostIndices), agreement["expected"].number()};
  }
  if (const JsonField proximity = field["proximity"]; !proximity.is_null()) {
    support.proximity = {proximity["evidence"].number(), proximity["spread_evidence"].number(),
                         proximity["share"].number(), proximity["deviation"].number()};
  }
  return candidate;
}

MapRole role_of(const JsonField& field) {
  return field.one_of(std::array{MapRole::kSource, MapRole::kTarget});
}

// The angle that is written as these degrees again, if there is one beside radians().
double angle_of_degrees(double deg) {
  const double nearest = radians(deg);
  for (const double angle :
       {nearest, std::nextafter(nearest, -INFINITY), std::nextafter(nearest, INFINITY)}) {
    if (degrees(angle) == deg) return angle;
  }
  return nearest;
}

std::optional<PartsAlignment> parts_of(const JsonField& field) {
  if (field.is_null()) return std::nullopt;
  const auto keyframe = [](const JsonField& value) {
    return FrameId{value.whole(std::numeric_limits<std::uint64_t>::max())};
  };
  PartsAlignment parts;
  parts.aligned = field["aligned"].whole(kMostIndices);
  parts.consensus = field["consensus"].truth();
  parts.contradictory = field["contradictory"].truth();
  if (!field["confirmed"].is_null()) parts.confirmed = field["confirmed"].truth();
  parts.probability = field["probability"].optional_number().value_or(0.0);
  if (const JsonField bend = field["bend"]; !bend.is_null()) {
    parts.bend = MapBend{.map = role_of(bend["map"]),
                         .rotation_rad = angle_of_degrees(bend["rotation_deg"].number()),
                         .first = keyframe(bend["first_keyframe"]),
                         .last = keyframe(bend["last_keyframe"]),
                         .displacement = bend["displacement"].number()};
  }
  for (const JsonField& pose : field["poses"].items()) {
    PartPose& part = parts.parts.emplace_back();
    part.map = role_of(pose["map"]);
    part.first = keyframe(pose["first_keyframe"]);
    part.middle = keyframe(pose["middle_keyframe"]);
    part.last = keyframe(pose["last_keyframe"]);
    part.landmarks = pose["landmarks"].whole(kMostIndices);
    part.verdict = pose["verdict"].one_of(
        std::array{Verdict::kAligned, Verdict::kAmbiguous, Verdict::kRejected});
    part.probability = pose["probability"].number();
    part.agrees = pose["agrees"].truth();
    if (!pose["found"].is_null()) part.found = pose_of(pose, "found", kAlignmentVersion, "found_");
    if (!pose["target_from_source"].is_null()) {
      part.target_from_source = pose_of(pose, "target_from_source", kAlignmentVersion);
    }
  }
  return parts;
}

std::optional<MapDeformation> deformation_of(const JsonField& field) {
  if (field.is_null()) return std::nullopt;
  return MapDeformation{.matches = field["matches"].whole(kMostIndices),
                        .rotation_rad = angle_of_degrees(field["rotation_deg"].number()),
                        .scale_ratio = field["scale_ratio"].number(),
                        .displacement = field["displacement"].number()};
}

void read_counts(const JsonField& field, RegistrationResult& result) {
  const auto count = [](const JsonField& value, std::uint64_t most) {
    return value.is_null() ? 0 : static_cast<int>(value.whole(most));
  };
  result.iterations = count(field["iterations"], kMostIterations);
  result.coarse_iterations = count(field["coarse_iterations"], kMostIterations);
  if (const JsonField repetition = field["repetition"]; !repetition.is_null()) {
    const auto most = static_cast<std::uint64_t>(result.iterations);
    result.repetition = {
        {count(repetition["first_iteration"], most), count(repetition["length"], most)},
        count(repetition["best_iteration"], most)};
  }
  result.initial_score = field["initial_score"].optional_number();
  result.score = field["score"].optional_number();
  if (const JsonField overlap = field["overlap"]; !overlap.is_null()) {
    result.overlap = Overlap{overlap["source"].number(), overlap["target"].number()};
  }
}

// How the method ended. A judged document states it only by the stop reason.
RegistrationStatus registration_status(const JsonField& field, const Alignment& alignment) {
  if (alignment.verdict) {
    return alignment.estimate ? status_of(alignment.registration.stop_reason)
                              : RegistrationStatus::kFailed;
  }
  // Documents of version 1 may call every pose "aligned", although none was judged.
  if (field["status"].is_null() || field["status"].json() == "aligned") {
    return status_of(alignment.registration.stop_reason);
  }
  return field["status"].one_of(
      std::array{RegistrationStatus::kConverged, RegistrationStatus::kStopped,
                 RegistrationStatus::kFailed, RegistrationStatus::kCancelled});
}

void read_poses(const JsonField& field, unsigned version, Alignment& alignment) {
  const bool moved = !field["target_from_source"].is_null();
  const bool estimated = !field["estimate"].is_null();
  if (!field.json().contains("target_from_source")) {
    field.refuse("an object with target_from_source");
  }
  if (estimated) alignment.estimate = pose_of(field, "estimate", version);
  if (moved) {
    const Similarity3 pose = pose_of(field, "target_from_source", version);
    // The same pose, of which version 1 has both matrices and only the first is kept.
    if (!alignment.estimate) alignment.estimate = pose;
    if (!alignment.estimate->matrix().isApprox(pose.matrix(), kSamePose)) {
      field["target_from_source"].refuse("the pose of the estimate");
    }
    if (alignment.verdict == Verdict::kAligned) alignment.target_from_source = alignment.estimate;
  }
  if (alignment.verdict == Verdict::kAligned && !alignment.target_from_source) {
    field["target_from_source"].refuse("the pose of an aligned pair");
  }
  RegistrationResult& result = alignment.registration;
  if (!alignment.estimate) return;
  result.target_from_source = alignment.estimate->rigid();
  result.scale = alignment.estimate->scale();
}

AlignmentRecord record_of(const JsonField& field, unsigned version) {
  if (!field.json().is_object()) field.refuse("an object");
  AlignmentRecord record;
  record.confidence = field["confidence"].optional_text().value_or(record.confidence);
  if (!field["method"].is_null()) {
    record.method = field["method"].one_of(std::array{AlignMethod::kRobust, AlignMethod::kIcp});
  } else {
    record.method = AlignMethod::kIcp;  // the only one when documents did not name it
  }
  if (!field["k"].is_null()) record.k = field["k"].whole(kMostIndices);
  if (const JsonField unit = field["length_unit"]; !unit.is_null()) {
    if (unit.text() != kMetres && unit.text() != kFree) unit.refuse("metres or free");
    record.length_unit = unit.text() == kMetres ? LengthUnit::kMetres : LengthUnit::kFree;
  }
  record.overlap_radius = field["overlap"]["radius"].optional_number();
  if (!field["matches"].is_null()) record.matches = field["matches"].whole(kMostIndices);

  Alignment& alignment = record.alignment;
  RegistrationResult& result = alignment.registration;
  if (const JsonField verdict = field["verdict"];
      !verdict.is_null() && verdict.json() != "none") {  // version 1's word for null
    alignment.verdict =
        verdict.one_of(std::array{Verdict::kAligned, Verdict::kAmbiguous, Verdict::kRejected});
    alignment.probability = field["probability"].number();
    alignment.radius = field["support_radius"].number();
    if (!field["cut_short"].is_null()) alignment.cut_short = field["cut_short"].truth();
  }
  if (!field["stop_reason"].is_null()) {
    result.stop_reason = field["stop_reason"].one_of(
        std::array{StopReason::kMseChange, StopReason::kNoMotion, StopReason::kFixedPoint,
                   StopReason::kCycle, StopReason::kIterationLimit, StopReason::kTimeLimit,
                   StopReason::kTooFewMatches, StopReason::kCancelled});
  } else {
    result.stop_reason = StopReason::kMseChange;
  }
  read_poses(field, version, alignment);
  result.status = registration_status(field, alignment);
  alignment.reason = field["reason"].optional_text().value_or("");
  result.reason = alignment.reason;
  read_counts(field, result);
  read_covariance(field["covariance"], result);
  result.unobservable = open_directions_of(field["unobservable"]);
  if (const JsonField candidates = field["candidates"]; !candidates.is_null()) {
    for (const JsonField& candidate : candidates.items()) {
      alignment.candidates.push_back(candidate_of(candidate, version));
    }
  }
  if (!field["centre"].is_null()) alignment.centre = vector_of(field["centre"]);
  alignment.other_scale = field["other_scale"].optional_number();
  alignment.parts = parts_of(field["parts"]);
  alignment.deformation = deformation_of(field["deformation"]);
  if (const JsonField history = field["history"]; !history.is_null()) {
    for (const JsonField& iteration : history.items()) {
      result.history.push_back(iteration_of(iteration, version));
    }
  }
  if (!field["deterministic"].is_null()) alignment.deterministic = field["deterministic"].truth();
  alignment.duration_s = field["duration_s"].optional_number().value_or(0.0);
  result.duration_s = alignment.duration_s;
  return record;
}

}  // namespace

std::string_view to_string(AlignMethod method) {
  return method == AlignMethod::kIcp ? "icp" : "robust";
}

std::string to_json(const AlignmentRecord& record, HistoryDetail history) {
  const Alignment& alignment = record.alignment;
  const RegistrationResult& result = alignment.registration;
  const bool judged = alignment.verdict.has_value();
  Json json = {{"status", status_of(alignment)},
               {"verdict", judged ? Json(to_string(*alignment.verdict)) : Json(nullptr)},
               {"probability", or_null(alignment.probability)},
               {"reason", alignment.reason},
               {"target_from_source", alignment.target_from_source
                                          ? rows_of(alignment.target_from_source->matrix())
                                          : Json(nullptr)}};
  if (alignment.estimate) {
    put_pose(json, "estimate", *alignment.estimate);
  } else {
    json["estimate"] = json["quaternion"] = json["scale"] = nullptr;
  }
  json["covariance"] = covariance_json(result);
  json["unobservable"] = open_directions_json(result.unobservable);
  json["centre"] = alignment.centre ? list_of(*alignment.centre) : Json(nullptr);
  json["deviations"] = deviations_json(alignment);
  json["other_scale"] = or_null(alignment.other_scale);
  json["method"] = to_string(record.method);
  json["confidence"] = record.confidence;
  json["k"] = record.k;
  json["length_unit"] = record.length_unit == LengthUnit::kMetres ? kMetres : kFree;
  json["score"] = or_null(result.score);
  json["initial_score"] = or_null(result.initial_score);
  json["iterations"] = result.iterations;
  json["coarse_iterations"] = result.coarse_iterations;
  json["stop_reason"] = to_string(result.stop_reason);
  json["repetition"] = repetition_json(result.repetition);
  json["matches"] = record.matches;
  json["overlap"] = overlap_json(record);
  json["candidates"] = candidates_json(alignment.candidates);
  json["parts"] = parts_json(alignment.parts);
  json["deformation"] = deformation_json(alignment.deformation);
  // With a limit in seconds, the result depends on the machine's speed.
  json["deterministic"] = alignment.deterministic;
  json["cut_short"] = judged ? Json(alignment.cut_short) : Json(nullptr);
  json["support_radius"] = judged ? Json(alignment.radius) : Json(nullptr);
  json["duration_s"] = alignment.duration_s;
  if (history != HistoryDetail::kNone) {
    json["history"] = history_json(result.history, history == HistoryDetail::kMatches);
  }
  return json.dump(2, ' ', false, Json::error_handler_t::replace);
}

std::vector<AlignmentRecord> read_alignments(std::string_view document, const std::string& name) {
  constexpr std::string_view kExpected = "what 'cairn align --json' writes";
  const std::optional<Json> parsed = detail::parse_json<Json>(document, name);
  if (!parsed) throw Error(ErrorKind::kInput, name, "is no JSON", kExpected);
  const JsonField root(*parsed, name, "");
  unsigned version = kAlignmentVersion;
  if (const JsonField given = root["schema"]["version"]; !given.is_null()) {
    version = static_cast<unsigned>(given.whole(std::numeric_limits<std::uint32_t>::max()));
    if (version < 1 || version > kAlignmentVersion) {
      given.refuse(fmt::format("at most {}", kAlignmentVersion));
    }
  }
  const JsonField results = root["results"];
  if (results.is_null()) {
    throw Error(ErrorKind::kInput, name, "holds no results of an alignment", kExpected);
  }
  std::vector<AlignmentRecord> records;
  for (const JsonField& result : results.items()) records.push_back(record_of(result, version));
  if (records.empty()) results.refuse("at least one result");
  return records;
}

}  // namespace cairn
