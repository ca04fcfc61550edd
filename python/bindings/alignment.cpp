// SPDX-License-Identifier: BSD-3-Clause
#include "bindings/alignment.hpp"

#include <cmath>

#include <fmt/format.h>

#include "cairn/alignment/alignment.hpp"
#include "cairn/core/file.hpp"
#include "cairn/core/version_number.hpp"
#include "cairn/geometry/angles.hpp"

#include "bindings/maps.hpp"
#include "bindings/properties.hpp"

namespace cairn::python {
namespace {

// Keywords of align() and judge().
struct AlignKeywords {
  AlignOptions options;
  std::optional<Similarity3> initial;
  std::optional<Matrix6d> initial_covariance;
  bool gravity = false;
};

void set_scale(AlignKeywords& call, py::handle value) {
  if (value.is_none() || value.is(py::bool_(false))) {
    call.options.scale.reset();
    call.options.scale_where_free = value.is_none();
  } else if (value.is(py::bool_(true))) {
    call.options.scale = ScaleRange();
  } else {
    const auto range = real_array(value, "scale", {2});
    call.options.scale = ScaleRange{range.at(0), range.at(1)};
  }
}

void set_confidence(std::optional<Metric>& metric, py::handle value) {
  metric.reset();
  if (value.is_none()) return;
  std::string name;
  from_python(value, "confidence", name);
  metric = metric_named(name);
}

// The keywords that judge() shares.
void add_verdict_keywords(Keywords<AlignKeywords>& keywords) {
  keywords
      .add("confidence", py::none(),
           [](AlignKeywords& call, py::handle value) {
             set_confidence(call.options.confidence, value);
           })
      .add("scale", py::none(), set_scale)
      .add("gravity", [](auto& c) -> auto& { return c.gravity; })
      .add_table(AlignOptions::table, [](auto& c) -> auto& { return c.options; },
                 {"one_to_one", "scale_where_free", "deformation", "judge", "trace"})
      .add_seed()
      .add("trace", [](auto& c) -> auto& { return c.options.trace; });
}

Keywords<AlignKeywords> align_keywords() {
  Keywords<AlignKeywords> keywords("align");
  keywords
      .add(
          "method", [](auto& c) -> auto& { return c.options.method; },
          Words<AlignMethod>{{"robust", AlignMethod::kRobust}, {"icp", AlignMethod::kIcp}})
      .add("initial", py::none(),
           [](AlignKeywords& call, py::handle value) {
             if (!value.is_none()) call.initial = similarity_of(value, "initial");
           })
      .add("initial_covariance", py::none(),
           [](AlignKeywords& call, py::handle value) {
             if (value.is_none()) return;
             call.initial_covariance = matrix_of<6>(value, "initial_covariance");
           })
      .add("one_to_one", [](auto& c) -> auto& { return c.options.one_to_one; })
      .add("judge", [](auto& c) -> auto& { return c.options.judge; });
  add_verdict_keywords(keywords);
  keywords.add_table(IcpOptions::table, [](auto& c) -> auto& { return c.options.icp; },
                     {"overlap_radius", "trace"});
  return keywords;
}

Keywords<AlignKeywords> judge_keywords() {
  Keywords<AlignKeywords> keywords("judge");
  add_verdict_keywords(keywords);
  return keywords;
}

AlignOptions complete(const AlignKeywords& call, const LandmarkMap& source,
                      const LandmarkMap& target) {
  AlignOptions options = call.options;
  if (call.initial) {
    options.prior = PosePrior{*call.initial, call.initial_covariance};
  } else if (call.initial_covariance) {
    throw Error(ErrorKind::kMisuse, "initial_covariance", "given without initial",
                "initial beside it");
  }
  if (call.gravity) options.gravity = gravity_prior(source, target);
  refuse_if(!options.scale && source.info().length_unit != target.info().length_unit, "source",
            fmt::format("lengths in {} units, but of the target in {}",
                        to_string(source.info().length_unit), to_string(target.info().length_unit)),
            "maps of one scale, or scale=True");
  options.validate();
  return options;
}

std::string options_json(const py::kwargs& given) {
  py::dict options;
  for (const auto& [name, value] : given) {
    const auto text = name.cast<std::string>();
    if (text != "threads" && text != "progress") options[name] = value;
  }
  const py::object plain = py::module_::import("cairn._json").attr("text");
  return plain(options).cast<std::string>();
}

SharedAlignment record(Alignment alignment, const AlignOptions& options, const LandmarkMap& target,
                       const CallOptions& call, const py::kwargs& given) {
  auto result = std::make_shared<AlignmentResult>();
  AlignmentRecord& record = result->record;
  record.method = options.method;
  if (options.confidence) record.confidence = options.confidence->name;
  if (options.method == AlignMethod::kIcp && options.confidence) record.k = options.icp.k;
  record.length_unit = target.info().length_unit;
  record.overlap_radius = options.overlap_radius;
  if (!record.overlap_radius && alignment.radius > 0.0) record.overlap_radius = alignment.radius;
  record.matches = alignment.registration.matches.size();
  record.alignment = std::move(alignment);
  result->seed = call.seed;
  result->options_json = options_json(given);
  result->initial = options.prior ? options.prior->target_from_source.rigid() : Rigid3();
  result->points = options.points;
  return result;
}

// pybind11's own message would list the signature, but not say what to do about a path.
SharedMap map_of(const py::object& given, const char* name) {
  if (py::isinstance<LandmarkMap>(given)) return given.cast<SharedMap>();
  const auto type = py::str(py::type::handle_of(given).attr("__name__")).cast<std::string>();
  throw py::type_error(
      fmt::format("{}: {}; expected a LandmarkMap, which cairn.read_map(path) reads", name, type));
}

SharedAlignment align_maps(const py::object& source_map, const py::object& target_map,
                           const py::kwargs& given) {
  const SharedMap source = map_of(source_map, "source");
  const SharedMap target = map_of(target_map, "target");
  CallOptions call;
  const AlignOptions options = complete(align_keywords().read(given, &call), *source, *target);
  Alignment alignment;
  run("aligning", call,
      [&](const Execution& execution) { alignment = align(*source, *target, options, execution); });
  return record(std::move(alignment), options, *target, call, given);
}

SharedAlignment judge_maps(const py::object& source_map, const py::object& target_map,
                           const py::object& target_from_source, const py::kwargs& given) {
  const SharedMap source = map_of(source_map, "source");
  const SharedMap target = map_of(target_map, "target");
  CallOptions call;
  const AlignOptions options = complete(judge_keywords().read(given, &call), *source, *target);
  const Similarity3 pose = similarity_of(target_from_source, "target_from_source");
  Alignment alignment;
  run("judging", call, [&](const Execution& execution) {
    alignment = judge_pose(*source, *target, pose, options, execution);
  });
  return record(std::move(alignment), options, *target, call, given);
}

struct IcpKeywords {
  IcpOptions options;
  PointSetOptions points;
  std::optional<Metric> confidence;
  std::vector<double> source_confidences;
  std::vector<double> target_confidences;
};

Keywords<IcpKeywords> icp_keywords() {
  Keywords<IcpKeywords> keywords("icp");
  const auto numbers = [](std::vector<double> IcpKeywords::*member, const char* name) {
    return [member, name](IcpKeywords& call, py::handle value) {
      if (value.is_none()) return;
      const auto array = real_array(value, name, {-1});
      (call.*member).assign(array.data(), array.data() + array.size());
    };
  };
  keywords
      .add("initial", py::none(),
           [](IcpKeywords& call, py::handle value) {
             if (!value.is_none()) call.options.initial = rigid_of(value, "initial");
           })
      .add("confidence", py::none(),
           [](IcpKeywords& call, py::handle value) { set_confidence(call.confidence, value); })
      .add("source_confidences", py::none(),
           numbers(&IcpKeywords::source_confidences, "source_confidences"))
      .add("target_confidences", py::none(),
           numbers(&IcpKeywords::target_confidences, "target_confidences"))
      .add("min_observations", [](auto& c) -> auto& { return c.points.min_observations; })
      .add_table(IcpOptions::table, [](auto& c) -> auto& { return c.options; });
  return keywords;
}

PointSet points_of(py::handle given, const char* name, const IcpKeywords& call,
                   const std::vector<double>& confidences) {
  if (!py::isinstance<LandmarkMap>(given)) {
    refuse_if(call.confidence.has_value(), "confidence",
              std::string(name) + " is an array of positions",
              "source_confidences and target_confidences");
    return {positions_of(given, name), confidences};
  }
  refuse_if(!confidences.empty(), std::string(name) + "_confidences",
            std::string(name) + " is a LandmarkMap", "confidence, the name of a metric");
  const auto map = given.cast<SharedMap>();
  return unlocked([&] { return point_set(*map, call.confidence, call.points); });
}

RegistrationResult icp_of(const py::object& source, const py::object& target,
                          const py::kwargs& given) {
  CallOptions call;
  const IcpKeywords keywords = icp_keywords().read(given, &call);
  const PointSet from = points_of(source, "source", keywords, keywords.source_confidences);
  const PointSet to = points_of(target, "target", keywords, keywords.target_confidences);
  RegistrationResult result;
  run("icp", call,
      [&](const Execution& execution) { result = icp(from, to, keywords.options, execution); });
  return result;
}

py::array matches_of(const std::vector<Match>& matches) {
  return row_array(matches, [](const Match& match) {
    return std::array{match.source, match.target};
  });
}

py::array distances_of(const std::vector<Match>& matches) {
  std::vector<double> distances;
  for (const Match& match : matches) distances.push_back(std::sqrt(match.squared_distance));
  return copied(distances);
}

py::array directions_of(const std::vector<OpenDirection>& open) {
  return row_array(open, [](const OpenDirection& one) {
    const Eigen::Vector3d& t = one.translation;
    const Eigen::Vector3d& r = one.rotation;
    return std::array{t.x(), t.y(), t.z(), r.x(), r.y(), r.z(), one.log_scale};
  });
}

py::tuple shares_of(const Overlap& overlap) {
  return py::make_tuple(overlap.source, overlap.target);
}

// Arrays with one row per iteration.
py::dict history_of(const RegistrationResult& result) {
  std::vector<double> poses;
  std::vector<double> distances;
  std::vector<double> scores;
  std::vector<std::uint64_t> matches;
  for (const IterationRecord& iteration : result.history) {
    const Matrix4d matrix = Similarity3(iteration.scale, iteration.target_from_source).matrix();
    for (int i = 0; i < 4; ++i) {
      for (int j = 0; j < 4; ++j) poses.push_back(matrix(i, j));
    }
    distances.push_back(iteration.mean_squared_distance);
    scores.push_back(iteration.score.value_or(std::nan("")));
    matches.push_back(iteration.match_count);
  }
  py::dict history;
  history["target_from_source"] = copied(poses, {static_cast<py::ssize_t>(distances.size()), 4, 4});
  history["mean_squared_distance"] = copied(distances);
  history["score"] = copied(scores);
  history["matches"] = copied(matches);
  return history;
}

std::string repr(const AlignmentResult& self) {
  const Alignment& alignment = self.alignment();
  return fmt::format("<Alignment: {}: {}>", status_of(alignment), alignment.reason);
}

std::string html(const AlignmentResult& self) {
  const Alignment& alignment = self.alignment();
  const py::object escape = py::module_::import("html").attr("escape");
  const auto escaped = [&](const std::string& text) {
    return escape(py::str(py::bytes(text).attr("decode")("utf-8", "replace"))).cast<std::string>();
  };
  std::string rows;
  const auto add = [&](const char* name, const std::string& value) {
    rows += fmt::format(
        R"(<tr><th style="text-align:left">{}</th><td style="text-align:left">{}</td></tr>)", name,
        value);
  };
  add("verdict", fmt::format("<b>{}</b>", status_of(alignment)));
  if (alignment.probability) add("probability", probability_text(*alignment.probability));
  add("reason", escaped(alignment.reason));
  const std::string unit = std::string(" ") + unit_symbol(self.record.length_unit);
  if (const auto& pose = alignment.estimate) {
    const Eigen::Vector3d& t = pose->translation();
    const Eigen::Vector3d angles =
        pose->rigid().roll_pitch_yaw() * (180.0 / 3.14159265358979323846);
    add(alignment.target_from_source ? "target_from_source" : "estimate, not trusted",
        fmt::format("x {:.4f} y {:.4f} z {:.4f}{}, roll {:.3f}° pitch {:.3f}° yaw {:.3f}°", t.x(),
                    t.y(), t.z(), unit, angles.x(), angles.y(), angles.z()));
    if (pose->scale() != 1.0) add("scale", fmt::format("{:.6g}", pose->scale()));
  }
  if (const auto& overlap = alignment.registration.overlap) {
    add("overlap", fmt::format("{:.0f} % of the source, {:.0f} % of the target",
                               100.0 * overlap->source, 100.0 * overlap->target));
  }
  return "<table>" + rows + "</table>";
}

std::string document(const AlignmentResult& self, HistoryDetail history) {
  return fmt::format(
      "{{\"schema\": {{\"name\": \"cairn.align\", \"version\": {}}}, \"cairn_version\": \"{}\",\n"
      "\"inputs\": {{}}, \"options\": {}, \"seed\": {},\n\"results\": [{}]}}\n",
      kAlignmentVersion, kVersion, self.options_json, self.seed, to_json(self.record, history));
}

std::vector<SharedAlignment> parsed(std::string_view text, const std::string& name) {
  std::vector<SharedAlignment> results;
  for (AlignmentRecord& record : read_alignments(text, name)) {
    auto result = std::make_shared<AlignmentResult>();
    result->record = std::move(record);
    results.push_back(std::move(result));
  }
  return results;
}

py::tuple packed(const AlignmentResult& self) {
  const Alignment& alignment = self.alignment();
  return py::make_tuple(document(self, HistoryDetail::kMatches), self.options_json, self.seed,
                        seen(self.initial), self.points.min_observations,
                        matches_of(alignment.registration.matches),
                        distances_of(alignment.registration.matches));
}

SharedAlignment unpacked(const py::tuple& state) {
  SharedAlignment result = parsed(state[0].cast<std::string>(), "pickled Alignment").front();
  result->options_json = state[1].cast<std::string>();
  result->seed = state[2].cast<std::uint64_t>();
  result->initial = rigid_of(state[3], "initial");
  result->points.min_observations = state[4].cast<std::size_t>();
  const auto matches = state[5].cast<py::array_t<std::uint32_t>>();
  const auto distances = state[6].cast<py::array_t<double>>();
  for (py::ssize_t i = 0; i < matches.shape(0); ++i) {
    const double distance = distances.at(i);
    result->record.alignment.registration.matches.push_back(
        {matches.at(i, 0), matches.at(i, 1), distance * distance});
  }
  return result;
}

void bind_registration(py::module_& module) {
  using Result = RegistrationResult;
  Exposed<Result>(
      module, "Registration",
      "Result of an iterative registration. It does not state whether the pose is right;\n"
      "a verdict does.")
      .get("status", "'converged', 'stopped', 'failed' or 'cancelled'.", &Result::status)
      .get("stop_reason", "", &Result::stop_reason)
      .def_readonly("reason", &Result::reason, "One sentence for people.")
      .get("target_from_source", "4x4, including the scale.", &Result::similarity)
      .def_readonly("scale", &Result::scale)
      .def_readonly("initial_score", &Result::initial_score,
                    "The paper's Eq. 5 at the initial pose.")
      .def_readonly("score", &Result::score, "The paper's Eq. 5 at the final pose.")
      .def_readonly("iterations", &Result::iterations)
      .get("matches", "(m, 2): indices of points in source and target, at the final pose.",
           &Result::matches, &matches_of)
      .get("match_distances", "(m,), at the final pose.", &Result::matches, &distances_of)
      .get("history",
           "Arrays with one entry per iteration: target_from_source, mean_squared_distance,\n"
           "score (NaN without trace=True), matches.",
           &history_of)
      .get("covariance",
           "(6, 6), of the left perturbation (dt, dphi) in the target frame; None if unknown.",
           &Result::covariance)
      .get("covariance_with_scale",
           "(7, 7), of (dt, dphi, dlog s); None if the scale was not estimated.",
           &Result::covariance_with_scale)
      .get("unobservable",
           "(m, 7): motions that the matches do not determine: translation, rotation, log scale.",
           &Result::unobservable, &directions_of)
      .get("overlap",
           "Shares of the source's and the target's landmarks that overlap; None if unknown.",
           &Result::overlap, &shares_of)
      .def_readonly("duration_s", &Result::duration_s)
      .def("__repr__", [](const Result& self) {
        return fmt::format("<Registration: {} after {} iterations: {}>", to_string(self.status),
                           self.iterations, self.reason);
      });
}

void bind_candidate(py::module_& module) {
  using Candidate = PlacementCandidate;
  Exposed<Candidate>(module, "Candidate", "A candidate pose from the search.")
      .get("target_from_source", "4x4, including the scale.", &Candidate::similarity)
      .def_readonly("scale", &Candidate::scale)
      .def_readonly("probability", &Candidate::probability, "Probability that this pose is right.")
      .get("matches", "", &Candidate::support, &Support::matches)
      .def_readonly("contradicted", &Candidate::contradicted,
                    "Share of the keyframes' lines of sight that contradict it; None if unknown.")
      .def("__repr__", [](const Candidate& self) {
        return fmt::format("<Candidate: {}, {} matches>", probability_text(self.probability),
                           self.support.matches());
      });
}

void bind_deformation(py::module_& module) {
  Exposed<MapDeformation>(module, "MapDeformation",
                          "Smooth deformation of two maps of free scale against each other.")
      .def_readonly("matches", &MapDeformation::matches,
                    "Number of descriptor matches that agree with it.")
      .get("rotation_deg", "Largest rotation between the local poses of two landmarks.",
           &MapDeformation::rotation_rad, &degrees)
      .def_readonly("scale_ratio", &MapDeformation::scale_ratio,
                    "Largest ratio of their local scales.")
      .def_readonly(
          "displacement", &MapDeformation::displacement,
          "Root mean square distance of the matches under the single pose, in the target's "
          "unit.")
      .def("__repr__", [](const MapDeformation& self) {
        return fmt::format("MapDeformation(rotation_deg={:.2f}, scale_ratio={:.3f}, matches={})",
                           degrees(self.rotation_rad), self.scale_ratio, self.matches);
      });
}

void bind_result(py::module_& module) {
  using Result = AlignmentResult;
  Exposed<Result, SharedAlignment> result(module, "Alignment", "Result of aligning two maps.");
  result
      .get("verdict", "'aligned', 'ambiguous' or 'rejected'; None if it was not judged.",
           &Result::alignment, &Alignment::verdict)
      .get("status", "The verdict; if not judged, 'converged', 'stopped', 'failed' or 'cancelled'.",
           &Result::alignment, [](const Alignment& one) { return status_of(one); })
      .get("probability", "Probability that the estimate is right; None if it was not judged.",
           &Result::alignment, &Alignment::probability)
      .get("reason", "One sentence for people.", &Result::alignment, &Alignment::reason)
      .get("target_from_source",
           "4x4, including the scale: x_in_target = target_from_source @ x_in_source.\n"
           "None unless the verdict is 'aligned'.",
           &Result::alignment, &Alignment::target_from_source)
      .get("estimate", "4x4: the best pose found, whatever the verdict; None if none was found.",
           &Result::alignment, &Alignment::estimate)
      .get("scale", "Scale of the estimate; None without one.", &Result::alignment,
           &Alignment::estimate, &Similarity3::scale)
      .get("covariance",
           "(6, 6), of the left perturbation (dt, dphi) in the target frame; None if unknown.",
           &Result::alignment, &Alignment::registration, &RegistrationResult::covariance)
      .get("covariance_with_scale",
           "(7, 7), of (dt, dphi, dlog s); None if the scale was not estimated.",
           &Result::alignment, &Alignment::registration, &RegistrationResult::covariance_with_scale)
      .get("candidates",
           "All poses that were compared, likeliest first; empty if it was not judged.",
           &Result::alignment, &Alignment::candidates)
      .get("registration", "Score, iterations and matches of the estimate.", &Result::alignment,
           &Alignment::registration)
      .get("deformation",
           "How the maps are deformed against each other, if they clearly are (with scale=True); "
           "None "
           "otherwise.",
           &Result::alignment, &Alignment::deformation)
      .get("overlap",
           "Shares of the source's and the target's landmarks that overlap; None if unknown.",
           &Result::alignment, &Alignment::registration, &RegistrationResult::overlap, &shares_of)
      .get("unobservable",
           "(m, 7): motions that the matches do not determine: translation, rotation, log scale.",
           &Result::alignment, &Alignment::registration, &RegistrationResult::unobservable,
           &directions_of)
      .get("deterministic", "False with a time limit.", &Result::alignment,
           &Alignment::deterministic)
      .get("duration_s", "", &Result::alignment, &Alignment::duration_s)
      .def(
          "to_json",
          [](const Result& self, bool history) {
            return document(self, history ? HistoryDetail::kMatches : HistoryDetail::kNone);
          },
          py::kw_only(), py::arg("history") = false,
          "to_json($self, *, history=False)\n--\n\n"
          "The result as a cairn.align document, which read_alignments() and the cairn tool read.")
      .def("__repr__", &repr)
      .def("_repr_html_", &html)
      .def("__copy__", [](const SharedAlignment& self) { return self; })
      .def(
          "__deepcopy__", [](const SharedAlignment& self, const py::dict&) { return self; },
          py::arg("memo"));
  make_picklable(
      module, result, "restored_alignment",
      [](const py::object& self) { return packed(self.cast<const Result&>()); }, &unpacked);
}

}  // namespace

void bind_alignment(py::module_& module) {
  bind_registration(module);
  bind_candidate(module);
  bind_deformation(module);
  bind_result(module);
  module.def(
      "align", &align_maps, py::arg("source"), py::arg("target"),
      kept(align_keywords().signature("source, target") +
           "Aligns two maps and judges whether the pose can be trusted.\n\n"
           "Without `initial`, searches all poses. With `initial` (4x4, target_from_source), "
           "refines\n"
           "it robustly, or with the paper's ICP if method='icp'. Judges the pose in each case. "
           "The\n"
           "same input and seed give the same result for any number of threads.\n\n"
           "method         'robust' or 'icp'\n"
           "confidence     metric of the landmarks: 'covariance', 'observations', 'distance', ...\n"
           "scale          True or (least, most): estimate the scale too\n"
           "gravity        only rotate about the vertical, with a small tilt\n"
           "prior_odds     odds that the maps show the same place, before any evidence\n"
           "effort         work of the search, relative to the default; 1/16 to 64\n"
           "threads        largest number; 0: one per core\n"
           "progress       True for a progress bar (tqdm), or a callable that takes a share in "
           "[0, 1]\n"
           "k, max_distance and the following keywords are options of ICP."));
  module.def("judge", &judge_maps, py::arg("source"), py::arg("target"),
             py::arg("target_from_source"),
             kept(judge_keywords().signature("source, target, target_from_source") +
                  "Judges a given pose without changing it, as align() judges its own."));
  module.def(
      "icp", &icp_of, py::arg("source"), py::arg("target"),
      kept(
          icp_keywords().signature("source, target") +
          "Aligns two maps, or two arrays of positions (n, 3), with the paper's ICP. Does not "
          "judge.\n\n"
          "Runs weighted ICP if the target has confidences: for maps, of the metric `confidence`;\n"
          "for arrays, `target_confidences`, one per point. Otherwise runs base ICP."));
  module.def("metrics", &metric_names, "metrics()\n--\n\nNames of the confidence metrics.");
  module.def(
      "read_alignments",
      [](const std::filesystem::path& path) { return parsed(read_file(path), path.string()); },
      py::arg("path"),
      "read_alignments(path)\n--\n\nReads the results from a document of `cairn align --json` or "
      "to_json().");
}

}  // namespace cairn::python
