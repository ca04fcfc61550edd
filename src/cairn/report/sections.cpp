// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/report/sections.hpp"

#include <algorithm>
#include <cctype>
#include <limits>
#include <utility>

#include <fmt/format.h>

#include "cairn/geometry/angles.hpp"
#include "cairn/report/detail/map_builder.hpp"
#include "cairn/report/detail/run_builder.hpp"

namespace cairn::report {
namespace {

// The terms of the probability. As there, without the evidence of a single object, which may occur twice.
std::vector<std::pair<std::string, double>> evidence_of(const Support& support) {
  std::vector<std::pair<std::string, double>> evidence = {
      {"Match distances", support.spread_evidence},
      {"Distances compared with other candidates", support.proximity.spread}};
  if (support.likeness)
    evidence.emplace_back("Descriptors of the matches", support.spread_likeness);
  if (support.contrast) evidence.emplace_back("Contrasts of the matches", support.contrast->spread);
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

constexpr double kPercent = 100.0;

// Ids are of lower-case letters, digits and '-'.
std::string id_of(std::string name) {
  std::replace(name.begin(), name.end(), '_', '-');
  return name;
}

Section chart_section(std::string id, std::string title, std::string text, Chart chart) {
  return {std::move(id), std::move(title), std::move(text), std::move(chart)};
}

std::string title_of(Experiment experiment) {
  switch (experiment) {
    case Experiment::kNeighbors:
      return "Number of candidates k";
    case Experiment::kYaw:
      return "Yaw";
    case Experiment::kXy:
      return "Displacement in the XY plane";
    case Experiment::kXyYaw:
      return "Displacement in the XY plane and yaw";
  }
  return "";
}

constexpr int kFirstFigure = 2;  // of yaw it is Figure 3, and so on

Section violins(Experiment experiment, bool published_ones, const PaperResults& results) {
  DistributionChart chart;
  chart.x_label = "Strategy";
  chart.y_label = "Score (m²)";
  chart.threshold =
      Threshold{published_ones ? kPublishedSuccessScore : results.success_score, "success below"};
  const auto published = published_experiments();
  double lowest = std::numeric_limits<double>::infinity();
  double highest = 0.0;
  for (std::size_t s = 0; s < kPaperStrategies.size(); ++s) {
    Distribution group{.name = std::string(kPaperStrategies[s])};
    for (std::size_t i = 0; i < published.size(); ++i) {
      if (published[i].experiment != experiment) continue;
      const std::optional<double> score = published_ones
                                              ? std::optional(published[i].outcomes[s].score)
                                              : run_of(results, i, s).score;
      if (!score) continue;
      group.values.push_back(*score);
      group.labels.push_back(describe(published[i].initial));
      lowest = std::min(lowest, *score);
      highest = std::max(highest, *score);
    }
    chart.groups.push_back(std::move(group));
  }
  // Scores over more than a decade need a logarithmic axis.
  if (lowest > 0.0 && highest > 10.0 * lowest) chart.y_scale = AxisScale::kLog;
  const int figure = kFirstFigure + static_cast<int>(experiment);
  return chart_section(
      fmt::format("figure{}{}", figure, published_ones ? "-published" : ""),
      title_of(experiment) + (published_ones ? ", as published" : ""),
      fmt::format("The paper's Figure {}{}. Solid: median; dashed: mean; points: single runs.",
                  figure,
                  published_ones ? ", on the paper's own pair of maps" : " on this pair of maps"),
      std::move(chart));
}

struct ScoredPose {
  std::string strategy;
  double translation = 0.0;
  double score = 0.0;
  std::string label;
};

// A logarithmic axis cannot show errors of zero.
constexpr double kLeastError = 1e-6;

Section score_against_error(const std::vector<ScoredPose>& poses, double tolerance_m,
                            std::optional<Threshold> score_threshold, std::string y_label) {
  ScatterChart chart;
  chart.x_label = "Translation error (m)";
  chart.y_label = std::move(y_label);
  chart.x_scale = AxisScale::kLog;
  chart.y_scale = AxisScale::kLog;
  chart.x_threshold = Threshold{tolerance_m, fmt::format("≤ {:g} m", tolerance_m)};
  chart.y_threshold = std::move(score_threshold);
  for (const ScoredPose& pose : poses) {
    auto series = std::find_if(chart.series.begin(), chart.series.end(),
                               [&](const auto& one) { return one.name == pose.strategy; });
    if (series == chart.series.end()) {
      chart.series.push_back({.name = pose.strategy});
      series = chart.series.end() - 1;
    }
    series->x.push_back(std::max(pose.translation, kLeastError));
    series->y.push_back(pose.score);
    series->labels.push_back(pose.label);
  }
  return chart_section("score-against-error", "Can the score judge the pose?",
                       "A point a run. Where the score can judge, points on the left lie below all "
                       "points on the right.",
                       std::move(chart));
}

void add_item(IntervalSeries& series, const std::string& name, const SuccessRate& rate) {
  const auto share = rate.share();
  if (!share) return;
  series.items.push_back({name, kPercent * *share, kPercent * rate.low, kPercent * rate.high});
}

Section success_chart(const StudySummary& summary) {
  IntervalsChart chart;
  chart.x_label = "Success by the true pose (%)";
  IntervalSeries all{.name = "all places"};
  for (const StrategySummary& strategy : summary.strategies) {
    add_item(all, strategy.name, strategy.success);
  }
  chart.series.push_back(std::move(all));
  return chart_section("success", "Success by strategy",
                       "Share of the starts that end at the true pose, with an interval for which "
                       "the pair of maps is the unit.",
                       std::move(chart));
}

Section places_chart(const StudySummary& summary) {
  IntervalsChart chart;
  chart.x_label = "Success by the true pose (%)";
  for (const StrategySummary& strategy : summary.strategies) {
    IntervalSeries series{.name = strategy.name};
    for (std::size_t group = 0; group < summary.groups.size(); ++group) {
      add_item(series, summary.groups[group], strategy.of_group[group]);
    }
    chart.series.push_back(std::move(series));
  }
  return chart_section(
      "success-by-place", "Success by kind of place",
      "With intervals for which the pair of maps is the unit, as starts of one pair are not "
      "independent; one pair alone leaves 0 to 100 %.",
      std::move(chart));
}

Section pairs_chart(const StudySummary& summary) {
  DistributionChart chart;
  chart.x_label = "Strategy";
  chart.y_label = "Success of a pair (%)";
  for (const StrategySummary& strategy : summary.strategies) {
    Distribution group{.name = strategy.name};
    for (std::size_t i = 0; i < strategy.pair_rates.size(); ++i) {
      group.values.push_back(kPercent * strategy.pair_rates[i]);
      group.labels.push_back(summary.pairs[summary.pairs_with_truth[i]]);
    }
    chart.groups.push_back(std::move(group));
  }
  return chart_section("success-by-pair", "Success by pair of maps",
                       "Share of a pair's starts that end at the true pose. Solid: median; dashed: "
                       "mean; points: single pairs.",
                       std::move(chart));
}

Section basins_chart(const StudySummary& summary) {
  HeatmapChart chart;
  chart.x_label = "Translation of the start (m)";
  chart.y_label = "Rotation of the start (deg)";
  chart.value_label = "Success (%)";
  chart.range = {{0.0, kPercent}};
  chart.x = summary.translation_edges_m;
  for (const double edge : summary.rotation_edges_rad) chart.y.push_back(degrees(edge));
  const std::size_t columns = chart.x.size() - 1;
  for (const StrategySummary& strategy : summary.strategies) {
    HeatmapPanel panel{.name = strategy.name};
    for (std::size_t i = 0; i < strategy.of_offset.size(); ++i) {
      if (i % columns == 0) {
        panel.values.emplace_back();
        panel.counts.emplace_back();
      }
      const SuccessCount& cell = strategy.of_offset[i];
      panel.values.back().push_back(
          kPercent * cell.share().value_or(std::numeric_limits<double>::quiet_NaN()));
      panel.counts.back().push_back(static_cast<double>(cell.trials));
    }
    chart.panels.push_back(std::move(panel));
  }
  return chart_section("basins", "Basins of convergence",
                       "Share of the starts that end at the true pose, by how far off they were.",
                       std::move(chart));
}

void add_tables(std::vector<Section>& sections, std::span<const ResultTable> tables) {
  for (const ResultTable& table : tables) sections.push_back(table_section(table));
}

}  // namespace

std::vector<AlignmentRun> runs_of(const ShownPair& pair) {
  const bool has_maps = pair.source != nullptr && pair.target != nullptr;
  detail::Points source;
  detail::Points target;
  if (has_maps) {
    source = point_set(*pair.source, std::nullopt, pair.points).positions;
    target = point_set(*pair.target, std::nullopt, pair.points).positions;
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

Section table_section(const ResultTable& source) {
  Table table;
  for (std::size_t i = 0; i < source.columns.size(); ++i) {
    const ResultTable::Column& column = source.columns[i];
    const bool is_text = std::any_of(source.rows.begin(), source.rows.end(), [&](const auto& row) {
      return std::holds_alternative<std::string>(row[i]);
    });
    table.columns.push_back({column.name,
                             column.unit.empty() ? std::nullopt : std::optional(column.unit),
                             is_text ? CellType::kText : CellType::kNumber,
                             {}});
  }
  for (const auto& row : source.rows) table.rows.emplace_back(row.begin(), row.end());
  const std::size_t end = std::min(source.title.find('.'), source.title.size());
  const std::string text = source.title.substr(std::min(end + 2, source.title.size()));
  return {id_of("table-" + source.name), source.title.substr(0, end),
          text.empty() ? std::nullopt : std::optional(text), std::move(table)};
}

std::vector<Section> paper_sections(const PaperResults& results, const PoseTolerance& tolerance) {
  const std::vector<ResultTable> tables = paper_tables(results, tolerance);
  std::vector<Section> sections = {table_section(tables.front())};
  for (const Experiment experiment : {Experiment::kYaw, Experiment::kXy, Experiment::kXyYaw}) {
    sections.push_back(violins(experiment, false, results));
    sections.push_back(violins(experiment, true, results));
  }
  std::vector<ScoredPose> poses;
  for (const TrialResult& run : results.runs) {
    if (!run.error || !run.score) continue;
    poses.push_back({approach_name(run.trial.method, run.trial.strategy), run.error->translation,
                     *run.score,
                     fmt::format("{} k={} {}", run.trial.experiment, run.trial.k,
                                 describe(run.trial.initial))});
  }
  if (!poses.empty()) {
    sections.push_back(score_against_error(poses, tolerance.translation_m,
                                           Threshold{results.success_score, "success below"},
                                           "Score (m²)"));
  }
  add_tables(sections, std::span(tables).subspan(1));
  return sections;
}

std::vector<Section> study_sections(const Study& study, const StudySummary& summary,
                                    std::span<const TrialResult> runs) {
  std::vector<Section> sections;
  if (!summary.pairs_with_truth.empty()) {
    sections.push_back(success_chart(summary));
    if (summary.groups.size() > 1) sections.push_back(places_chart(summary));
    if (summary.pairs.size() > 1) sections.push_back(pairs_chart(summary));
    sections.push_back(basins_chart(summary));
    std::vector<ScoredPose> poses;
    // More points show nothing new and enlarge the page.
    constexpr std::size_t kMostPoints = 6000;
    const std::size_t step = runs.size() / kMostPoints + 1;
    const std::size_t runs_per_pair = runs.size() / summary.pairs.size();
    // Strategies take turns: an odd step takes from all of them.
    for (std::size_t i = 0; i < runs.size(); i += step | 1U) {
      const TrialResult& run = runs[i];
      if (!run.error || !run.score) continue;
      poses.push_back({approach_name(run.trial.method, run.trial.strategy), run.error->translation,
                       *run.score / summary.lowest_scores[i / runs_per_pair],
                       fmt::format("{} {}", run.trial.pair, run.trial.number)});
    }
    if (!poses.empty()) {
      sections.push_back(score_against_error(poses, study.success.translation_m, std::nullopt,
                                             "Score, times the pair's lowest"));
    }
  }
  add_tables(sections, study_tables(study, summary));
  return sections;
}

}  // namespace cairn::report
