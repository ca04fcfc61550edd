// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/alignment/document.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <type_traits>
#include <utility>

#include "cairn/core/detail/json_field.hpp"
#include "cairn/core/detail/json_text.hpp"
#include "cairn/geometry/angles.hpp"
#include "cairn/geometry/decompositions.hpp"

namespace cairn {
namespace {

using detail::Json;
using detail::JsonField;

constexpr const char* kMetres = "metres";
constexpr const char* kFree = "free";

constexpr std::uint64_t kMostIndices = std::numeric_limits<std::uint32_t>::max();

// Largest relative difference between two statements of one pose.
constexpr double kSamePose = 1e-9;

// All values of an enumeration that is written by name.
template <class Value>
constexpr std::array kAll = {Value()};
template <>
constexpr std::array kAll<AlignMethod> = {AlignMethod::kRobust, AlignMethod::kIcp};
template <>
constexpr std::array kAll<MapRole> = {MapRole::kSource, MapRole::kTarget};
template <>
constexpr std::array kAll<Verdict> = {Verdict::kAligned, Verdict::kAmbiguous, Verdict::kRejected};
template <>
constexpr std::array kAll<StopReason> = {StopReason::kMseChange,      StopReason::kNoMotion,
                                         StopReason::kFixedPoint,     StopReason::kCycle,
                                         StopReason::kIterationLimit, StopReason::kTimeLimit,
                                         StopReason::kTooFewMatches,  StopReason::kCancelled};

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

// ---- The values of fields

template <class Value>
Json json_of(const Value& value) {
  if constexpr (std::is_same_v<Value, LengthUnit>) {
    return value == LengthUnit::kMetres ? kMetres : kFree;
  } else if constexpr (std::is_enum_v<Value>) {
    return to_string(value);
  } else if constexpr (std::is_same_v<Value, FrameId>) {
    return value.value;
  } else if constexpr (std::is_same_v<Value, Eigen::Vector3d>) {
    return {value.x(), value.y(), value.z()};
  } else {
    return value;
  }
}

Json json_of(const std::vector<Match>& matches) {
  Json list = Json::array();
  for (const Match& match : matches) list.push_back({match.source, match.target});
  return list;
}

template <class Value>
Json json_of(const std::optional<Value>& value) {
  return value ? json_of(*value) : Json(nullptr);
}

void read(const JsonField& field, LengthUnit& unit) {
  const std::string name = field.text();
  if (name != kMetres && name != kFree) field.refuse("metres or free");
  unit = name == kMetres ? LengthUnit::kMetres : LengthUnit::kFree;
}

void read(const JsonField& field, Eigen::Vector3d& vector) {
  const auto n = field.numbers<3>();
  vector = {n[0], n[1], n[2]};
}

template <class Value>
void read(const JsonField& field, Value& value) {
  if constexpr (std::is_enum_v<Value>) {
    value = field.one_of(kAll<Value>);
  } else if constexpr (std::is_same_v<Value, double>) {
    value = field.number();
  } else if constexpr (std::is_same_v<Value, bool>) {
    value = field.truth();
  } else if constexpr (std::is_same_v<Value, std::string>) {
    value = field.text();
  } else if constexpr (std::is_same_v<Value, FrameId>) {
    value.value = field.whole(std::numeric_limits<std::uint64_t>::max());
  } else if constexpr (std::is_same_v<Value, int>) {
    value = static_cast<int>(field.whole(std::numeric_limits<int>::max()));
  } else {
    value = field.whole(kMostIndices);
  }
}

void read(const JsonField& field, std::array<std::size_t, Support::kRadii>& counts) {
  const std::vector<JsonField> items = field.items();
  if (items.size() != counts.size()) field.refuse(fmt::format("{} whole numbers", counts.size()));
  for (std::size_t i = 0; i < counts.size(); ++i) read(items[i], counts[i]);
}

void read(const JsonField& field, std::vector<Match>& matches) {
  for (const JsonField& pair : field.items()) {
    const std::vector<JsonField> ends = pair.items();
    if (ends.size() != 2) pair.refuse("two numbers, of a source and a target landmark");
    matches.push_back({static_cast<std::uint32_t>(ends[0].whole(kMostIndices)),
                       static_cast<std::uint32_t>(ends[1].whole(kMostIndices)), 0.0});
  }
}

template <class Value>
void read(const JsonField& field, std::optional<Value>& value) {
  read(field, value.emplace());
}

template <class Work>
auto in_file(const JsonField& field, const Work& work) {
  try {
    return work();
  } catch (const Error& error) {
    throw Error(ErrorKind::kInput, fmt::format("{}: {}", field.file(), field.path()), error.what(),
                "");
  }
}

// A positive number; 1 if there is none.
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

// The angle that converts back to exactly these degrees, if radians() or a neighbouring double
// does.
double angle_of_degrees(double deg) {
  const double nearest = radians(deg);
  for (const double angle :
       {nearest, std::nextafter(nearest, -INFINITY), std::nextafter(nearest, INFINITY)}) {
    if (degrees(angle) == deg) return angle;
  }
  return nearest;
}

// ---- Fields, which are listed once, in functions of a Writer or a Reader and an object

class Writer {
 public:
  static constexpr bool kReads = false;

  // A field that has to be there.
  template <class Value>
  void field(const char* name, const Value& value) {
    json_[name] = json_of(value);
  }
  // A field that may be null or absent.
  template <class Value>
  void maybe(const char* name, const Value& value) {
    field(name, value);
  }
  // A field that follows from others.
  template <class Make>
  void derived(const char* name, const Make& make) {
    field(name, make());
  }
  void degrees(const char* name, double radians) { field(name, cairn::degrees(radians)); }
  // The matrix is for people and other programs; quaternion and scale restore the pose exactly.
  void pose(const char* name, const Similarity3& pose, const std::string& prefix = "") {
    const Eigen::Quaterniond q = pose.rigid().quaternion();
    json_[name] = rows_of(pose.matrix());
    json_[prefix + "quaternion"] = {q.w(), q.x(), q.y(), q.z()};
    json_[prefix + "scale"] = pose.scale();
  }
  void pose(const char* name, const Rigid3& rigid, double scale) {
    pose(name, Similarity3(scale, rigid));
  }
  void pose(const char* name, const std::optional<Similarity3>& value, const std::string& prefix) {
    if (value) pose(name, *value, prefix);
  }
  template <class Value, class Fields>
  void object(const char* name, const Value& value, const Fields& fields) {
    json_[name] = object_of(value, fields);
  }
  template <class Value, class Fields>
  void object(const char* name, const std::optional<Value>& value, const Fields& fields) {
    json_[name] = value ? object_of(*value, fields) : Json(nullptr);
  }
  template <class Value, class Fields>
  void list(const char* name, const std::vector<Value>& values, const Fields& fields) {
    Json list = Json::array();
    for (const Value& value : values) list.push_back(object_of(value, fields));
    json_[name] = std::move(list);
  }

  Json take() { return std::move(json_); }

 private:
  template <class Value, class Fields>
  static Json object_of(const Value& value, const Fields& fields) {
    Writer inner;
    fields(inner, value);
    return inner.take();
  }

  Json json_ = Json::object();
};

class Reader {
 public:
  static constexpr bool kReads = true;

  Reader(const JsonField& from, unsigned version) : from_(from), version_(version) {}

  bool holds(const char* name) const { return !from_[name].is_null(); }

  template <class Value>
  void field(const char* name, Value& value) const {
    read(from_[name], value);
  }
  // Without the field, the value stays.
  template <class Value>
  void maybe(const char* name, Value& value) const {
    if (holds(name)) field(name, value);
  }
  template <class Make>
  void derived(const char* /*name*/, const Make& /*make*/) const {}
  void degrees(const char* name, double& radians) const {
    radians = angle_of_degrees(from_[name].number());
  }
  void pose(const char* name, Rigid3& rigid, double& scale) const {
    const Similarity3 pose = pose_of(from_, name, version_);
    rigid = pose.rigid();
    scale = pose.scale();
  }
  void pose(const char* name, std::optional<Similarity3>& value, const std::string& prefix) const {
    if (holds(name)) value = pose_of(from_, name, version_, prefix);
  }
  template <class Value, class Fields>
  void object(const char* name, Value& value, const Fields& fields) const {
    if (holds(name)) read_object(from_[name], value, fields);
  }
  template <class Value, class Fields>
  void object(const char* name, std::optional<Value>& value, const Fields& fields) const {
    if (holds(name)) read_object(from_[name], value.emplace(), fields);
  }
  template <class Value, class Fields>
  void list(const char* name, std::vector<Value>& values, const Fields& fields) const {
    if (!holds(name)) return;
    for (const JsonField& item : from_[name].items()) {
      read_object(item, values.emplace_back(), fields);
    }
  }

 private:
  template <class Value, class Fields>
  void read_object(const JsonField& from, Value& value, const Fields& fields) const {
    Reader inner(from, version_);
    fields(inner, value);
  }

  JsonField from_;
  unsigned version_;
};

constexpr auto kOpenDirectionFields = [](auto& io, auto& direction) {
  io.field("translation", direction.translation);
  io.field("rotation", direction.rotation);
  io.maybe("log_scale", direction.log_scale);
};

constexpr auto kCandidateFields = [](auto& io, auto& candidate) {
  auto& support = candidate.support;
  io.pose("target_from_source", candidate.target_from_source, candidate.scale);
  io.field("probability", candidate.probability);
  io.field("support", support.share);
  io.maybe("matches", support.within[0]);
  io.maybe("close_matches", support.within[1]);
  io.maybe("matches_by_radius", support.within);
  io.object("descriptor_agreement", support.agreement, [](auto& inner, auto& agreement) {
    inner.field("matches", agreement.matches);
    inner.field("agreeing", agreement.agreeing);
    inner.field("spread", agreement.spread);
    inner.field("expected", agreement.expected);
    inner.maybe("identities", agreement.identities);
    inner.maybe("identical", agreement.identical);
    inner.derived("evidence", [&] { return agreement.evidence(); });
  });
  io.object("proximity", support.proximity, [](auto& inner, auto& proximity) {
    inner.field("evidence", proximity.all);
    inner.field("spread_evidence", proximity.spread);
    inner.field("share", proximity.share);
    inner.field("deviation", proximity.deviation);
  });
  io.maybe("evidence", support.evidence);
  io.maybe("spread_evidence", support.spread_evidence);
  io.object("likeness", support.likeness, [&](auto& inner, auto& likeness) {
    inner.field("compared", likeness.compared);
    inner.field("alike", likeness.alike);
    inner.derived("evidence", [&] { return likeness.evidence(); });
    inner.maybe("spread_evidence", support.spread_likeness);
  });
  io.object("contrast", support.contrast, [](auto& inner, auto& contrast) {
    inner.field("compared", contrast.compared);
    inner.field("correlation", contrast.correlation);
    inner.field("spread_evidence", contrast.spread);
  });
  io.maybe("contradicted", candidate.contradicted);
};

constexpr auto kPartFields = [](auto& io, auto& part) {
  io.field("map", part.map);
  io.field("first_keyframe", part.first);
  io.field("middle_keyframe", part.middle);
  io.field("last_keyframe", part.last);
  io.field("landmarks", part.landmarks);
  io.field("verdict", part.verdict);
  io.field("probability", part.probability);
  io.field("agrees", part.agrees);
  for (const char* const pose : {"found", "target_from_source"}) {
    io.derived(pose, [] { return nullptr; });  // the order of fields
  }
  io.pose("found", part.found, "found_");
  io.pose("target_from_source", part.target_from_source, "");
};

constexpr auto kPartsFields = [](auto& io, auto& parts) {
  io.field("aligned", parts.aligned);
  io.field("consensus", parts.consensus);
  io.field("contradictory", parts.contradictory);
  io.maybe("confirmed", parts.confirmed);
  if (io.kReads || parts.consensus) {
    io.maybe("probability", parts.probability);
  } else {
    io.derived("probability", [] { return nullptr; });
  }
  io.object("bend", parts.bend, [](auto& inner, auto& bend) {
    inner.field("map", bend.map);
    inner.degrees("rotation_deg", bend.rotation_rad);
    inner.field("first_keyframe", bend.first);
    inner.field("last_keyframe", bend.last);
    inner.field("displacement", bend.displacement);
  });
  io.list("poses", parts.parts, kPartFields);
};

constexpr auto kDeformationFields = [](auto& io, auto& deformation) {
  io.field("matches", deformation.matches);
  io.degrees("rotation_deg", deformation.rotation_rad);
  io.field("scale_ratio", deformation.scale_ratio);
  io.field("displacement", deformation.displacement);
};

constexpr auto kIterationFields = [](auto& io, auto& iteration) {
  io.pose("target_from_source", iteration.target_from_source, iteration.scale);
  io.maybe("mean_squared_distance", iteration.mean_squared_distance);
  io.maybe("match_count", iteration.match_count);
};

constexpr auto kTracedIterationFields = [](auto& io, auto& iteration) {
  kIterationFields(io, iteration);
  io.maybe("score", iteration.score);
  io.maybe("matches", iteration.matches);
};

constexpr auto kRepetitionFields = [](auto& io, auto& repetition) {
  io.maybe("first_iteration", repetition.cycle.first);
  io.maybe("length", repetition.cycle.length);
  io.maybe("best_iteration", repetition.best_iteration);
};

Json deviations_json(const Alignment& alignment) {
  const auto deviations = deviations_of(alignment);
  if (!deviations) return nullptr;
  return {{"translation", json_of(deviations->translation)},
          {"rotation_deg", json_of(Eigen::Vector3d(deviations->rotation_rad * degrees(1.0)))},
          {"log_scale", json_of(deviations->log_scale)}};
}

// All fields except verdict, status, poses, covariance and history.
constexpr auto kRecordFields = [](auto& io, auto& record) {
  auto& alignment = record.alignment;
  auto& result = alignment.registration;
  io.list("unobservable", result.unobservable, kOpenDirectionFields);
  io.maybe("centre", alignment.centre);
  io.derived("deviations", [&] { return deviations_json(alignment); });
  io.maybe("other_scale", alignment.other_scale);
  io.maybe("common_images", alignment.common_images);
  io.maybe("one_map", alignment.one_map);
  io.maybe("method", record.method);
  io.maybe("confidence", record.confidence);
  io.maybe("k", record.k);
  io.maybe("length_unit", record.length_unit);
  io.maybe("score", result.score);
  io.maybe("initial_score", result.initial_score);
  io.maybe("iterations", result.iterations);
  io.maybe("coarse_iterations", result.coarse_iterations);
  io.maybe("stop_reason", result.stop_reason);
  io.object("repetition", result.repetition, kRepetitionFields);
  io.maybe("matches", record.matches);
  io.object("overlap", result.overlap, [&](auto& inner, auto& overlap) {
    inner.field("source", overlap.source);
    inner.field("target", overlap.target);
    inner.maybe("radius", record.overlap_radius);
  });
  io.list("candidates", alignment.candidates, kCandidateFields);
  io.object("parts", alignment.parts, kPartsFields);
  io.object("deformation", alignment.deformation, kDeformationFields);
  // With a limit in seconds, the result depends on the machine's speed.
  io.maybe("deterministic", alignment.deterministic);
  if (alignment.verdict) {
    io.maybe("cut_short", alignment.cut_short);
    io.field("support_radius", alignment.radius);
  } else {
    io.derived("cut_short", [] { return nullptr; });
    io.derived("support_radius", [] { return nullptr; });
  }
  io.maybe("duration_s", alignment.duration_s);
};

// Includes the scale's row and column if the scale is estimated.
Json covariance_json(const RegistrationResult& result) {
  if (result.covariance_with_scale) return rows_of(*result.covariance_with_scale);
  return result.covariance ? rows_of(*result.covariance) : Json(nullptr);
}

// ---- What documents of version 1 lack or say otherwise

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

void read_history(const JsonField& field, unsigned version, RegistrationResult& result) {
  if (field.is_null()) return;
  for (const JsonField& item : field.items()) {
    IterationRecord& iteration = result.history.emplace_back();
    iteration.mean_squared_distance = std::numeric_limits<double>::quiet_NaN();
    const Reader io(item, version);
    kTracedIterationFields(io, iteration);
    if (!io.holds("match_count")) iteration.match_count = iteration.matches.size();
  }
}

AlignmentRecord record_of(const JsonField& field, unsigned version) {
  if (!field.json().is_object()) field.refuse("an object");
  AlignmentRecord record;
  record.method = AlignMethod::kIcp;  // the only one when documents did not name it
  Alignment& alignment = record.alignment;
  RegistrationResult& result = alignment.registration;
  result.stop_reason = StopReason::kMseChange;
  const Reader io(field, version);
  // "none" is version 1's word for null.
  if (io.holds("verdict") && field["verdict"].json() != "none") {
    io.field("verdict", alignment.verdict);
    io.field("probability", alignment.probability);
  }
  kRecordFields(io, record);
  if (record.confidence == "none") record.confidence = "base";  // its name before 0.2
  read_poses(field, version, alignment);
  result.status = registration_status(field, alignment);
  io.maybe("reason", alignment.reason);
  result.reason = alignment.reason;
  read_covariance(field["covariance"], result);
  read_history(field["history"], version, result);
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
  Writer io;
  io.field("status", status_of(alignment));
  io.field("verdict", alignment.verdict);
  io.field("probability", alignment.probability);
  io.field("reason", alignment.reason);
  for (const char* const name : {"target_from_source", "estimate", "quaternion", "scale"}) {
    io.field(name, nullptr);
  }
  if (alignment.target_from_source) {
    io.field("target_from_source", rows_of(alignment.target_from_source->matrix()));
  }
  io.pose("estimate", alignment.estimate, "");
  io.field("covariance", covariance_json(result));
  kRecordFields(io, record);
  if (history == HistoryDetail::kPoses) io.list("history", result.history, kIterationFields);
  if (history == HistoryDetail::kMatches) {
    io.list("history", result.history, kTracedIterationFields);
  }
  return io.take().dump(2, ' ', false, Json::error_handler_t::replace);
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
  reject_if(results.is_null(), name, "holds no results of an alignment", kExpected);
  std::vector<AlignmentRecord> records;
  for (const JsonField& result : results.items()) records.push_back(record_of(result, version));
  if (records.empty()) results.refuse("at least one result");
  return records;
}

}  // namespace cairn
