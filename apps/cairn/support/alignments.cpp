// SPDX-License-Identifier: BSD-3-Clause
#include "support/alignments.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "cairn/alignment/alignment.hpp"
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

}  // namespace

std::string swapped_truth_text(std::string_view what) {
  return fmt::format(
      "the inverse of the truth fits {}: the truth seems to be source_from_target, of swapped maps",
      what);
}

bool has_answer(const Alignment& alignment) {
  return alignment.verdict ? alignment.verdict == Verdict::kAligned
                           : alignment.registration.has_pose();
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

std::vector<StrategyResult> align_by_all(const LandmarkMap& source, const LandmarkMap& target,
                                         const std::vector<Strategy>& strategies,
                                         AlignOptions options,
                                         const std::optional<Similarity3>& truth,
                                         const CommonArguments& common) {
  options.execution.executor = common.executor();
  options.execution.stop = interrupt_requests();
  std::vector<StrategyResult> results;
  for (const Strategy& strategy : strategies) {
    options.execution.progress = common.console().progress("aligning, confidence " + strategy.name);
    options.confidence = strategy.metric;
    StrategyResult result;
    result.alignment = align(source, target, options);
    const Alignment& alignment = result.alignment;
    if (alignment.registration.status == RegistrationStatus::kCancelled) {
      throw Error(ErrorKind::kCancelled, "align", "cancelled", "");
    }
    result.method = options.method;
    result.confidence = strategy.name;
    if (options.method == AlignMethod::kIcp && strategy.metric) result.k = options.icp.k;
    result.length_unit = target.info().length_unit;
    result.matches = alignment.registration.matches.size();
    // The search has a radius of its own, where none is asked for.
    result.overlap_radius = options.overlap_radius;
    if (!result.overlap_radius && alignment.radius > 0.0) result.overlap_radius = alignment.radius;
    if (truth && alignment.estimate) {
      const PointSet points = point_set(source, std::nullopt, options.points);
      result.error = pose_error(*alignment.estimate, *truth, points.positions);
      result.fits_inverse = fits_inverse(*alignment.estimate, *truth, points.positions);
      if (result.fits_inverse) common.console().remark(swapped_truth_text("the pose"));
    }
    results.push_back(std::move(result));
  }
  return results;
}

std::string alignment_table(const std::vector<StrategyResult>& results, LengthUnit unit) {
  const auto any = [&](const auto& holds) {
    return std::any_of(results.begin(), results.end(), holds);
  };
  const bool with_error = any([](const StrategyResult& one) { return one.error.has_value(); });
  const bool with_scale =
      any([](const StrategyResult& one) { return one.alignment.registration.scale != 1.0; });
  const bool with_overlap =
      any([](const StrategyResult& one) { return one.alignment.registration.overlap.has_value(); });
  const auto radius = std::find_if(results.begin(), results.end(),
                                   [](const auto& one) { return one.overlap_radius.has_value(); });
  const bool with_probability =
      any([](const StrategyResult& one) { return one.alignment.probability.has_value(); });
  const std::string symbol = unit_symbol(unit);
  std::vector<std::string> header = {"confidence", "k", "status"};
  if (with_probability) header.emplace_back("probability");
  for (const char* const name : {"iterations", "score before", "score after"}) {
    header.emplace_back(name);
  }
  if (with_overlap) header.emplace_back("overlap");
  if (with_error) header.emplace_back("pose error");
  header.emplace_back("time");
  Table table(header);
  for (const StrategyResult& one : results) {
    const RegistrationResult& registration = one.alignment.registration;
    std::vector<std::string> row = {one.confidence, std::to_string(one.k),
                                    std::string(status_of(one.alignment))};
    if (with_probability) {
      const auto& probability = one.alignment.probability;
      row.push_back(probability ? probability_text(*probability) : "-");
    }
    row.push_back(std::to_string(registration.iterations));
    row.push_back(number(registration.initial_score, 4));
    row.push_back(number(registration.score, 4));
    if (with_overlap) {
      const auto& overlap = registration.overlap;
      row.push_back(overlap ? percent(overlap->source) + " / " + percent(overlap->target) : "-");
    }
    if (with_error) {
      const auto& error = one.error;
      std::string text = "-";
      if (error) {
        text = fmt::format("{:.3f} deg {:.4f} {}", degrees(error->rotation_rad), error->translation,
                           symbol);
        if (with_scale) text += fmt::format(" {:.2f} %", 100.0 * std::expm1(error->log_scale));
      }
      row.push_back(std::move(text));
    }
    row.push_back(fmt::format("{:.0f} ms", 1e3 * one.alignment.duration_s));
    table.add_row(std::move(row));
  }
  std::string text = table.text();
  text += fmt::format("\nscore    mean squared distance to the nearest target landmark, {}^2\n",
                      symbol);
  if (with_overlap) {
    text += "overlap  share of source / target landmarks with a counterpart";
    if (radius != results.end()) {
      text += fmt::format(" within {:.3g} {}", *radius->overlap_radius, symbol);
    }
    text += "\n";
  }
  if (any([](const StrategyResult& one) { return one.fits_inverse; })) {
    text += fmt::format("truth    {}\n", swapped_truth_text("the pose"));
  }
  return text;
}

Json to_json(const StrategyResult& result, HistoryDetail history) {
  Json json = Json::parse(cairn::to_json(result, history));
  json["error"] = result.error ? to_json(*result.error) : Json(nullptr);
  if (result.fits_inverse) json["fits_inverse_of_truth"] = true;
  return json;
}

}  // namespace cairn::cli
