// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/report/experiment_sections.hpp"

#include <algorithm>
#include <utility>

#include <fmt/format.h>

#include "cairn/experiments/paper_tables.hpp"
#include "cairn/experiments/statistics/density.hpp"
#include "cairn/experiments/study_tables.hpp"
#include "cairn/geometry/angles.hpp"

namespace cairn::report {
namespace {

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

Section success_chart(const StudyAnalysis& analysis) {
  IntervalsChart chart;
  chart.x_label = "Success by the true pose (%)";
  IntervalSeries all{.name = "all places"};
  for (const StrategySummary& strategy : analysis.strategies) {
    const Interval interval = strategy.interval.value_or(strategy.success.interval);
    all.items.push_back({strategy.name, kPercent * strategy.success.estimate.value_or(0.0),
                         kPercent * interval.low, kPercent * interval.high});
  }
  chart.series.push_back(std::move(all));
  return chart_section("success", "Success by strategy",
                       "Share of the starts that end at the true pose, with an interval from "
                       "resampling the pairs of maps.",
                       std::move(chart));
}

Section places_chart(const StudyAnalysis& analysis) {
  IntervalsChart chart;
  chart.x_label = "Success by the true pose (%)";
  for (const StrategySummary& strategy : analysis.strategies) {
    IntervalSeries series{.name = strategy.name};
    for (std::size_t group = 0; group < analysis.groups.size(); ++group) {
      const Proportion& rate = strategy.group_success[group];
      if (!rate.estimate) continue;
      series.items.push_back({analysis.groups[group], kPercent * *rate.estimate,
                              kPercent * rate.interval.low, kPercent * rate.interval.high});
    }
    chart.series.push_back(std::move(series));
  }
  return chart_section(
      "success-by-place", "Success by kind of place",
      "With intervals for which the pair of maps is the unit, as starts of one pair are not "
      "independent; one pair alone leaves 0 to 100 %.",
      std::move(chart));
}

Section differences_chart(const StudyAnalysis& analysis) {
  IntervalsChart chart;
  chart.x_label = "Difference of success (points)";
  IntervalSeries series{.name = "difference"};
  for (const StrategyComparison& comparison : analysis.comparisons) {
    const BootstrapResult& difference = comparison.difference.difference;
    const auto& interval = difference.bca ? difference.bca : difference.percentile;
    const double value = -kPercent * difference.estimate;
    series.items.push_back({fmt::format("{} - {}", analysis.strategies[comparison.second].name,
                                        analysis.strategies[comparison.first].name),
                            value, interval ? -kPercent * interval->high : value,
                            interval ? -kPercent * interval->low : value});
  }
  chart.series.push_back(std::move(series));
  return chart_section("differences", "Differences between strategies",
                       "Intervals from resampling the pairs of maps; one that holds 0 shows no "
                       "difference.",
                       std::move(chart));
}

Section basins_chart(const StudyAnalysis& analysis) {
  HeatmapChart chart;
  chart.x_label = "Translation of the start (m)";
  chart.y_label = "Rotation of the start (deg)";
  chart.value_label = "Success (%)";
  chart.range = {{0.0, kPercent}};
  const SuccessTable& first = analysis.strategies.front().basin;
  chart.x = first.translation_edges;
  for (const double edge : first.rotation_edges) chart.y.push_back(degrees(edge));
  for (const StrategySummary& strategy : analysis.strategies) {
    HeatmapPanel panel{.name = strategy.name};
    for (std::size_t i = 0; i < strategy.basin.rows(); ++i) {
      std::vector<double> values;
      std::vector<double> counts;
      for (std::size_t j = 0; j < strategy.basin.columns(); ++j) {
        const Proportion& cell = strategy.basin.at(i, j);
        values.push_back(cell.estimate ? kPercent * *cell.estimate
                                       : std::numeric_limits<double>::quiet_NaN());
        counts.push_back(static_cast<double>(cell.count.trials));
      }
      panel.values.push_back(std::move(values));
      panel.counts.push_back(std::move(counts));
    }
    chart.panels.push_back(std::move(panel));
  }
  return chart_section("basins", "Basins of convergence",
                       "Share of the starts that end at the true pose, by how far off they were.",
                       std::move(chart));
}

void add_tables(std::vector<Section>& sections, const std::vector<ResultTable>& tables) {
  for (const ResultTable& table : tables) sections.push_back(table_section(table));
}

}  // namespace

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
  std::string title = source.name;
  std::replace(title.begin(), title.end(), '_', ' ');
  return {id_of("table-" + source.name), "Table: " + title, source.title, std::move(table)};
}

std::vector<Section> paper_sections(const PaperResults& results, const PoseTolerance& tolerance) {
  std::vector<Section> sections;
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
  add_tables(sections, paper_tables(results, tolerance));
  return sections;
}

std::vector<Section> study_sections(const Study& study, const StudyAnalysis& analysis,
                                    std::span<const TrialResult> runs) {
  std::vector<Section> sections;
  if (!analysis.pairs_with_truth.empty()) {
    sections.push_back(success_chart(analysis));
    if (analysis.groups.size() > 1) sections.push_back(places_chart(analysis));
    if (!analysis.comparisons.empty()) sections.push_back(differences_chart(analysis));
    sections.push_back(basins_chart(analysis));
    std::vector<ScoredPose> poses;
    // More points show nothing new and enlarge the page.
    constexpr std::size_t kMostPoints = 6000;
    const std::size_t step = runs.size() / kMostPoints + 1;
    const std::size_t runs_per_pair = runs.size() / analysis.pairs.size();
    // Strategies take turns: an odd step takes from all of them.
    for (std::size_t i = 0; i < runs.size(); i += step | 1U) {
      const TrialResult& run = runs[i];
      if (!run.error || !run.score) continue;
      poses.push_back({approach_name(run.trial.method, run.trial.strategy), run.error->translation,
                       *run.score / analysis.lowest_scores[i / runs_per_pair],
                       fmt::format("{} {}", run.trial.pair, run.trial.number)});
    }
    if (!poses.empty()) {
      sections.push_back(score_against_error(poses, study.success.translation_m, std::nullopt,
                                             "Score, times the pair's lowest"));
    }
  }
  std::vector<ResultTable> tables = study_tables(study, analysis);
  std::erase_if(tables,
                [](const ResultTable& table) { return table.name == "basins"; });  // charted
  add_tables(sections, tables);
  return sections;
}

DensityFunction violin_density() {
  return [](std::span<const double> values) {
    std::vector<DensityPoint> points;
    const auto density = kernel_density(values, {.points = 128, .reach = 0.0});
    if (!density) return points;
    for (std::size_t i = 0; i < density->positions.size(); ++i) {
      points.push_back({density->positions[i], density->densities[i]});
    }
    return points;
  };
}

}  // namespace cairn::report
