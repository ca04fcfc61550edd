// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/report/pair_sections.hpp"

#include <cctype>
#include <utility>

#include <fmt/format.h>

#include "cairn/report/map_builder.hpp"

namespace cairn::report {

AlignmentRun make_run(const Alignment& alignment, const ShownPoints& source,
                      const ShownPoints& target, RunOptions options) {
  RegistrationResult registration = alignment.registration;
  registration.reason = alignment.reason;
  registration.duration_s = alignment.duration_s;
  if (alignment.verdict == Verdict::kRejected) registration.status = RegistrationStatus::kFailed;
  options.status = status_of(alignment);
  return make_run(registration, source, target, options);
}

std::vector<AlignmentRun> runs_of(const ShownPair& pair) {
  const bool has_maps = pair.source != nullptr && pair.target != nullptr;
  ShownPoints source;
  ShownPoints target;
  if (has_maps) {
    source = ShownPoints::only_aligned(*pair.source, pair.points);
    target = ShownPoints::only_aligned(*pair.target, pair.points);
  }
  std::vector<AlignmentRun> runs;
  for (const ShownAlignment& shown : pair.alignments) {
    const RunOptions options{.name = shown.name,
                             .initial = pair.initial,
                             .k = shown.k,
                             .truth = has_maps ? pair.truth : std::nullopt};
    if (has_maps) {
      runs.push_back(make_run(*shown.alignment, source, target, options));
    } else {
      Alignment alignment = *shown.alignment;
      for (IterationRecord& iteration : alignment.registration.history) iteration.matches.clear();
      runs.push_back(make_run(alignment, source, target, options));
    }
  }
  return runs;
}

void add_pair(Report& report, const ShownPair& pair, std::vector<AlignmentRun> runs,
              const std::string& prefix) {
  Table table = run_table(runs, pair.unit);
  const std::vector<std::pair<Section, LinesChart>> charts = {
      {{.id = "convergence", .title = "Convergence"}, convergence_chart(runs, pair.unit)},
      {{.id = "translation-error", .title = "Translation error"},
       error_chart(runs, pair.unit, true)},
      {{.id = "rotation-error", .title = "Rotation error"}, error_chart(runs, pair.unit, false)}};
  if (pair.source != nullptr && pair.target != nullptr) {
    const auto add_shown = [&](const char* role, const LandmarkMap& map, const std::string& name) {
      report.maps.push_back(make_map(
          map,
          {.id = prefix + role, .name = name, .landmarks = landmarks_to_align(map, pair.points)}));
    };
    add_shown("source", *pair.source, pair.source_name);
    add_shown("target", *pair.target, pair.target_name);
    report.sections.push_back(
        {.id = prefix + "scene",
         .title = prefix.empty() ? "Alignment" : pair.source_name + " to " + pair.target_name,
         .text = pair.story,
         .content = Scene{.source = prefix + "source",
                          .target = prefix + "target",
                          .truth = pair.truth,
                          .up = up_of(*pair.target),
                          .runs = std::move(runs)}});
  }
  report.sections.push_back(
      {.id = prefix + "strategies",
       .title = "Strategies",
       .text = "The score is the mean squared distance of the source landmarks to the nearest "
               "target landmark. A lower one is a closer fit, not always a better pose.",
       .content = std::move(table)});
  for (const auto& [section, chart] : charts) {
    if (chart.series.empty()) continue;
    report.sections.push_back({.id = prefix + section.id,
                               .title = section.title,
                               .text = std::nullopt,
                               .content = Chart(chart)});
  }
}

void add_map(Report& report, const LandmarkMap& map, const std::string& name,
             const std::string& prefix) {
  report.maps.push_back(
      make_map(map, {.id = prefix + "map", .name = name, .landmarks = std::nullopt}));
  report.sections.push_back({.id = prefix + "scene",
                             .title = prefix.empty() ? "Map" : name,
                             .text = std::nullopt,
                             .content = Scene{.source = std::nullopt,
                                              .target = prefix + "map",
                                              .truth = std::nullopt,
                                              .up = up_of(map),
                                              .runs = {}}});
}

std::string verdict_sentence(const Alignment& alignment) {
  std::string word(status_of(alignment));
  word.front() = static_cast<char>(std::toupper(static_cast<unsigned char>(word.front())));
  return fmt::format("{}: {}.", word, alignment.reason);
}

}  // namespace cairn::report
