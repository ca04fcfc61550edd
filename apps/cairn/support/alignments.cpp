// SPDX-License-Identifier: BSD-3-Clause
#include "support/alignments.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "cairn/core/error.hpp"

#include "support/interrupt.hpp"
#include "support/table.hpp"

namespace cairn::cli {
namespace {

std::string number(std::optional<double> value, int digits) {
  return value ? fmt::format("{:.{}g}", *value, digits) : "-";
}

std::string percent(double share) {
  return fmt::format("{:.0f} %", 100.0 * share);
}

Json json_of(const std::vector<OpenDirection>& directions) {
  Json list = Json::array();
  for (const OpenDirection& direction : directions) {
    list.push_back({{"translation", to_json(direction.translation)},
                    {"rotation", to_json(direction.rotation)},
                    {"log_scale", direction.log_scale}});
  }
  return list;
}

Json json_of(const std::vector<IterationRecord>& history, bool trace) {
  Json list = Json::array();
  for (const IterationRecord& iteration : history) {
    Json entry = {{"target_from_source", to_json(iteration.target_from_source)},
                  {"scale", iteration.scale},
                  {"mean_squared_distance", iteration.mean_squared_distance}};
    if (trace) {
      entry["score"] = to_json(iteration.score);
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

Json json_of(const std::vector<PlacementCandidate>& candidates) {
  Json list = Json::array();
  for (const PlacementCandidate& candidate : candidates) {
    list.push_back(
        {{"target_from_source", to_json(candidate.target_from_source)},
         {"scale", candidate.scale},
         {"support", candidate.support.share},
         {"matches", candidate.support.within[0]},
         {"close_matches", candidate.support.within[1]},
         {"matches_by_radius", candidate.support.within},
         {"descriptor_agreement", agreement_json(candidate.support)},
         {"proximity", proximity_json(candidate.support.proximity)},
         {"evidence", candidate.support.evidence},
         {"spread_evidence", candidate.support.spread_evidence},
         {"likeness", likeness_json(candidate.support)},
         {"contradicted", candidate.contradicted ? Json(*candidate.contradicted) : Json(nullptr)},
         {"probability", candidate.probability}});
  }
  return list;
}

// A placement has a radius of its own, where none is asked for.
Json overlap_radius_of(const Alignment& alignment, const IcpOptions& options) {
  if (options.overlap_radius) return *options.overlap_radius;
  return alignment.placement ? Json(alignment.placement->radius) : Json(nullptr);
}

// With the scale's row and column where that is estimated.
Json covariance_json(const RegistrationResult& result) {
  if (result.covariance_with_scale) return to_json(*result.covariance_with_scale);
  return result.covariance ? to_json(*result.covariance) : Json(nullptr);
}

// What the verdict rests on, for the table and the document.
PlacementResult placement_of(const cairn::Alignment& alignment) {
  PlacementResult placement;
  placement.verdict = *alignment.verdict;
  placement.reason = alignment.reason;
  placement.candidates = alignment.candidates;
  placement.probability = alignment.probability.value_or(0.0);
  placement.radius = alignment.radius;
  placement.cut_short = alignment.cut_short;
  placement.time_limited = !alignment.deterministic;
  return placement;
}

}  // namespace

std::string_view status_of(const Alignment& alignment) {
  return alignment.placement ? to_string(alignment.placement->verdict)
                             : to_string(alignment.result.status);
}

bool has_answer(const Alignment& alignment) {
  return alignment.placement ? alignment.placement->verdict == Verdict::kAligned
                             : alignment.result.has_pose();
}

AlignOptions by_icp_alone(const IcpOptions& options, const PointSetOptions& points) {
  AlignOptions alone;
  alone.method = AlignMethod::kIcp;
  alone.judge = false;
  alone.icp = options;
  alone.prior = PosePrior{.target_from_source = options.initial};
  alone.overlap_radius = options.overlap_radius;
  alone.trace = options.trace;
  alone.points = points;
  return alone;
}

std::vector<Alignment> align_by_all(const LandmarkMap& source, const LandmarkMap& target,
                                    const std::vector<Strategy>& strategies, AlignOptions options,
                                    const std::optional<Similarity3>& truth,
                                    const CommonArguments& common) {
  const bool by_icp = options.method == AlignMethod::kIcp;
  options.execution.executor = common.executor();
  options.execution.stop = interrupt_requests();
  std::vector<Alignment> alignments;
  for (const Strategy& strategy : strategies) {
    options.execution.progress = common.console().progress("aligning, confidence " + strategy.name);
    options.confidence = strategy.metric;
    cairn::Alignment found = align(source, target, options);
    Alignment alignment;
    alignment.confidence = strategy.name;
    alignment.method = by_icp ? "icp" : "robust";
    if (by_icp && strategy.metric) alignment.k = options.icp.k;
    alignment.result = std::move(found.registration);
    if (alignment.result.status == RegistrationStatus::kCancelled) {
      throw Error(ErrorKind::kCancelled, "align", "cancelled", "");
    }
    if (found.verdict) alignment.placement = placement_of(found);
    alignment.result.reason = found.reason;
    alignment.result.duration_s = found.duration_s;
    if (truth && has_answer(alignment)) {
      alignment.error = pose_error(alignment.result.similarity(), *truth,
                                   point_set(source, std::nullopt, options.points).positions);
    }
    alignments.push_back(std::move(alignment));
  }
  return alignments;
}

std::string alignment_table(const std::vector<Alignment>& alignments, const IcpOptions& options,
                            LengthUnit unit) {
  const bool with_error = std::any_of(alignments.begin(), alignments.end(),
                                      [](const Alignment& a) { return a.error.has_value(); });
  const bool with_scale =
      std::any_of(alignments.begin(), alignments.end(),
                  [](const Alignment& alignment) { return alignment.result.scale != 1.0; });
  const std::string symbol = unit_symbol(unit);
  std::vector<std::string> header = {"confidence",   "k",          "status", "iterations",
                                     "score before", "score after"};
  if (options.overlap_radius) header.emplace_back("overlap");
  if (with_error) header.emplace_back("pose error");
  header.emplace_back("time");
  Table table(header);
  for (const Alignment& alignment : alignments) {
    const RegistrationResult& result = alignment.result;
    std::vector<std::string> row = {alignment.confidence,
                                    std::to_string(alignment.k),
                                    std::string(status_of(alignment)),
                                    std::to_string(result.iterations),
                                    number(result.initial_score, 4),
                                    number(result.score, 4)};
    if (options.overlap_radius) {
      const auto& overlap = result.overlap;
      row.push_back(overlap ? percent(overlap->source) + " / " + percent(overlap->target) : "-");
    }
    if (with_error) {
      const auto& error = alignment.error;
      std::string text = "-";
      if (error) {
        text = fmt::format("{:.3f} deg {:.4f} {}", degrees(error->rotation_rad), error->translation,
                           symbol);
        if (with_scale) text += fmt::format(" {:.2f} %", 100.0 * std::expm1(error->log_scale));
      }
      row.push_back(std::move(text));
    }
    row.push_back(fmt::format("{:.0f} ms", 1e3 * result.duration_s));
    table.add_row(std::move(row));
  }
  std::string text = table.text();
  text += fmt::format("\nscore    mean squared distance to the nearest target landmark, {}^2\n",
                      symbol);
  if (options.overlap_radius) {
    text += fmt::format(
        "overlap  share of source / target landmarks with a counterpart within {:g} {}\n",
        *options.overlap_radius, symbol);
  }
  return text;
}

Json to_json(const Alignment& alignment, const IcpOptions& options, LengthUnit unit) {
  const RegistrationResult& result = alignment.result;
  const auto& placement = alignment.placement;
  // The best pose of a rejected pair is wrong more often than not; the candidates list it.
  const bool is_rejected = placement && placement->verdict == Verdict::kRejected;
  const bool has_pose = result.status != RegistrationStatus::kFailed && !is_rejected;
  Json json = {
      {"status", status_of(alignment)},
      {"verdict", placement ? to_string(placement->verdict) : "none"},
      {"reason", result.reason},
      {"target_from_source", has_pose ? to_json(result.target_from_source) : Json(nullptr)},
      // The best pose found, right or not.
      {"estimate", result.status == RegistrationStatus::kFailed
                       ? Json(nullptr)
                       : to_json(result.target_from_source)},
      {"scale", has_pose ? Json(result.scale) : Json(nullptr)},
      {"method", alignment.method},
      {"confidence", alignment.confidence},
      {"k", alignment.k},
      {"length_unit", to_string(unit)},
      {"score", to_json(result.score)},
      {"initial_score", to_json(result.initial_score)},
      {"iterations", result.iterations},
      {"coarse_iterations", result.coarse_iterations},
      {"stop_reason", to_string(result.stop_reason)},
      {"repetition", result.repetition ? Json{{"first_iteration", result.repetition->cycle.first},
                                              {"length", result.repetition->cycle.length},
                                              {"best_iteration", result.repetition->best_iteration}}
                                       : Json(nullptr)},
      {"matches", result.matches.size()},
      {"overlap", result.overlap ? Json{{"source", result.overlap->source},
                                        {"target", result.overlap->target},
                                        {"radius", overlap_radius_of(alignment, options)}}
                                 : Json(nullptr)},
      {"probability", placement ? Json(placement->probability) : Json(nullptr)},
      {"covariance", has_pose ? covariance_json(result) : Json(nullptr)},
      {"unobservable", has_pose ? json_of(result.unobservable) : Json(nullptr)},
      {"candidates", placement ? json_of(placement->candidates) : Json(nullptr)},
      // A limit in seconds leaves it to the machine what is found.
      {"deterministic", !(placement && placement->time_limited)},
      {"cut_short", placement ? Json(placement->cut_short) : Json(nullptr)},
      {"support_radius", placement ? Json(placement->radius) : Json(nullptr)},
      {"duration_s", result.duration_s},
  };
  json["error"] = alignment.error ? to_json(*alignment.error) : Json(nullptr);
  json["history"] = json_of(result.history, options.trace);
  return json;
}

}  // namespace cairn::cli
