// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cctype>
#include <utility>

#include <fmt/format.h>

#include "cairn/geometry/angles.hpp"
#include "cairn/report/detail/map_builder.hpp"
#include "cairn/report/detail/run_builder.hpp"
#include "cairn/report/sections.hpp"

namespace cairn::report {
namespace {

// The terms of the probability. As there, without the evidence of a single object, which may occur twice.
std::vector<std::pair<std::string, double>> evidence_of(const Support& support) {
  std::vector<std::pair<std::string, double>> evidence = {
      {"Match distances", support.spread_evidence},
      {"Distances compared with other candidates", support.proximity.spread}};
  if (support.likeness)
    evidence.emplace_back("Descriptors of the matches", support.spread_likeness);
  if (support.agreement) {
    evidence.emplace_back("Matches that agree", support.agreement->evidence());
  }
  return evidence;
}

// Verdict, pose with its uncertainty, candidates.
AlignmentAnswer answer_of(const Alignment& alignment, const std::string& name) {
  AlignmentAnswer answer{.name = name,
                         .status = std::string(status_of(alignment)),
                         .judged = alignment.verdict.has_value(),
                         .probability = alignment.probability,
                         .reason = alignment.reason,
                         .target_from_source = alignment.estimate};
  if (alignment.radius > 0.0) answer.radius = alignment.radius;
  answer.deviations = deviations_of(alignment);
  for (const OpenDirection& open : alignment.registration.unobservable) {
    answer.open.push_back({open.translation, open.rotation, open.log_scale});
  }
  for (const PlacementCandidate& candidate : alignment.candidates) {
    answer.candidates.push_back({.target_from_source = candidate.similarity(),
                                 .probability = candidate.probability,
                                 .matches = candidate.support.matches(),
                                 .share = candidate.support.share,
                                 .contradicted = candidate.contradicted,
                                 .evidence = evidence_of(candidate.support)});
  }
  return answer;
}

// Whether a line of the chart leaves one value: a flat one shows nothing that the table does not.
bool changes(const LinesChart& chart) {
  constexpr double kFlat = 0.01;  // of the largest value
  return std::any_of(chart.series.begin(), chart.series.end(), [&](const Line& line) {
    const auto [low, high] = std::minmax_element(line.y.begin(), line.y.end());
    return low != line.y.end() && *high - *low > kFlat * *high;
  });
}

}  // namespace

std::vector<AlignmentRun> runs_of(const ShownPair& pair) {
  const bool has_maps = pair.source != nullptr && pair.target != nullptr;
  detail::ShownPoints source;
  detail::ShownPoints target;
  if (has_maps) {
    source = detail::ShownPoints::only_aligned(*pair.source, pair.points);
    target = detail::ShownPoints::only_aligned(*pair.target, pair.points);
  }
  std::vector<AlignmentRun> runs;
  for (const ShownAlignment& shown : pair.alignments) {
    const detail::RunOptions options{.name = shown.name,
                                     .initial = pair.initial,
                                     .k = shown.k,
                                     .truth = has_maps ? pair.truth : std::nullopt};
    if (has_maps) {
      runs.push_back(detail::make_run(*shown.alignment, source, target, options));
    } else {
      Alignment alignment = *shown.alignment;
      for (IterationRecord& iteration : alignment.registration.history) iteration.matches.clear();
      runs.push_back(detail::make_run(alignment, source, target, options));
    }
  }
  return runs;
}

void add_pair(Report& report, const ShownPair& pair, std::vector<AlignmentRun> runs,
              const std::string& prefix) {
  Table table = detail::run_table(runs, pair.unit);
  if (!pair.marks_best) table.best.assign(table.columns.size(), Best::kNone);
  const std::vector<std::pair<Section, LinesChart>> charts = {
      {{.id = "convergence", .title = "Convergence"}, detail::convergence_chart(runs, pair.unit)},
      {{.id = "translation-error", .title = "Translation error"},
       detail::error_chart(runs, pair.unit, true)},
      {{.id = "rotation-error", .title = "Rotation error"},
       detail::error_chart(runs, pair.unit, false)}};
  const bool has_maps = pair.source != nullptr && pair.target != nullptr;
  const std::string names = pair.source_name + " to " + pair.target_name;
  if (pair.answer && !pair.alignments.empty()) {
    Answer answer{.length_unit = pair.unit,
                  .scene = has_maps ? std::optional(prefix + "scene") : std::nullopt};
    for (const ShownAlignment& shown : pair.alignments) {
      answer.alignments.push_back(answer_of(*shown.alignment, shown.name));
    }
    report.sections.push_back({.id = prefix + "answer",
                               .title = prefix.empty() ? "Answer" : names,
                               .text = std::nullopt,
                               .content = std::move(answer)});
  }
  const bool several = runs.size() > 1;
  if (has_maps) {
    const auto add_shown = [&](const char* role, const LandmarkMap& map, const std::string& name,
                               const std::vector<FrameImage>& images) {
      report.maps.push_back(
          detail::make_map(map, {.id = prefix + role,
                                 .name = name,
                                 .landmarks = landmarks_to_align(map, pair.points),
                                 .images = images}));
    };
    add_shown("source", *pair.source, pair.source_name, pair.source_images);
    add_shown("target", *pair.target, pair.target_name, pair.target_images);
    report.sections.push_back(
        {.id = prefix + "scene",
         .title = prefix.empty() ? "Alignment" : names + (pair.answer ? ", in 3D" : ""),
         .text = pair.story,
         .content = Scene{.source = prefix + "source",
                          .target = prefix + "target",
                          .truth = pair.truth,
                          .up = detail::up_of(*pair.target),
                          .runs = std::move(runs)}});
  }
  report.sections.push_back(
      {.id = prefix + "strategies",
       .title = several ? "Strategies" : "Numbers",
       .text = "The score is the mean squared distance of the source landmarks to the nearest "
               "target landmark. A lower one is a closer fit, not always a better pose.",
       .content = std::move(table)});
  for (const auto& [section, chart] : charts) {
    if (!changes(chart)) continue;
    report.sections.push_back({.id = prefix + section.id,
                               .title = section.title,
                               .text = std::nullopt,
                               .content = Chart(chart)});
  }
}

void add_map(Report& report, const LandmarkMap& map, const std::string& name,
             const std::string& prefix, std::vector<FrameImage> images) {
  report.maps.push_back(detail::make_map(map, {.id = prefix + "map",
                                               .name = name,
                                               .landmarks = std::nullopt,
                                               .images = std::move(images)}));
  report.sections.push_back({.id = prefix + "scene",
                             .title = prefix.empty() ? "Map" : name,
                             .text = std::nullopt,
                             .content = Scene{.source = std::nullopt,
                                              .target = prefix + "map",
                                              .truth = std::nullopt,
                                              .up = detail::up_of(map),
                                              .runs = {}}});
}

std::string verdict_sentence(std::span<const ShownAlignment> alignments) {
  std::string text;
  for (const ShownAlignment& shown : alignments) {
    if (!text.empty()) text += ", ";
    text += fmt::format("{} {}", shown.name, status_of(*shown.alignment));
  }
  if (alignments.size() == 1) {
    const Alignment& alignment = *alignments.front().alignment;
    text = fmt::format("{}: {}", status_of(alignment), alignment.reason);
    text.front() = static_cast<char>(std::toupper(static_cast<unsigned char>(text.front())));
  }
  return text + ".";
}

std::string strategy_name(AlignMethod method, const std::string& confidence) {
  if (method == AlignMethod::kIcp) return confidence;
  return confidence == "base" ? "robust" : "robust " + confidence;
}

}  // namespace cairn::report
