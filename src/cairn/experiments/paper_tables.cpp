// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <functional>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "cairn/experiments/paper.hpp"
#include "cairn/geometry/angles.hpp"

namespace cairn {
namespace {

using Cell = ResultTable::Cell;

Cell cell(const std::optional<double>& value) {
  return value ? Cell(*value) : Cell();
}

void add_strategies(ResultTable& table, std::string_view prefix, const std::string& unit,
                    int digits) {
  for (const std::string_view strategy : kPaperStrategies) {
    table.columns.push_back({fmt::format("{}{}", prefix, strategy), unit, digits});
  }
}

// A row for each configuration that `chosen` takes, with what was published and what came now.
ResultTable side_by_side(const PaperResults& results, std::string name, std::string title,
                         const std::string& unit, int digits,
                         const std::function<bool(const PublishedExperiment&)>& chosen,
                         const std::function<Cell(const PublishedOutcome&)>& published_cell,
                         const std::function<Cell(const TrialResult&)>& cell_of) {
  ResultTable table{std::move(name), std::move(title), {{"experiment"}, {"k"}, {"initial"}}, {}};
  if (published_cell) add_strategies(table, "published ", unit, digits);
  add_strategies(table, "", unit, digits);
  const auto published = published_experiments();
  for (std::size_t i = 0; i < published.size(); ++i) {
    if (!chosen(published[i])) continue;
    std::vector<Cell> row = {std::string(experiment_name(published[i].experiment)),
                             static_cast<double>(published[i].k), describe(published[i].initial)};
    if (published_cell) {
      for (const PublishedOutcome& outcome : published[i].outcomes) {
        row.push_back(published_cell(outcome));
      }
    }
    for (std::size_t s = 0; s < kPaperStrategies.size(); ++s) {
      row.push_back(cell_of(run_of(results, i, s)));
    }
    table.rows.push_back(std::move(row));
  }
  return table;
}

bool all(const PublishedExperiment&) {
  return true;
}

ResultTable scores(const PaperResults& results, Experiment experiment, std::string name,
                   std::string title) {
  constexpr double kMilli = 1e3;
  return side_by_side(
      results, std::move(name), std::move(title), "10^-3 m^2", 6,
      [&](const PublishedExperiment& published) { return published.experiment == experiment; },
      [](const PublishedOutcome& outcome) { return Cell(kMilli * outcome.score); },
      [](const TrialResult& run) { return run.score ? Cell(kMilli * *run.score) : Cell(); });
}

ResultTable pose_errors(const PaperResults& results, bool rotation) {
  return side_by_side(
      results, rotation ? "rotation_errors" : "translation_errors",
      rotation ? "Angle between the pose found and the true one."
               : "Displacement of the source's centroid from where the true pose puts it.",
      rotation ? "deg" : "m", 4, all, nullptr, [&](const TrialResult& run) -> Cell {
        if (!run.error) return {};
        return rotation ? degrees(run.error->rotation_rad) : run.error->translation;
      });
}

// How many of an experiment's runs by one strategy pass a test.
std::string count(Experiment experiment, std::size_t strategy,
                  const std::function<bool(std::size_t run)>& passes) {
  const auto published = published_experiments();
  std::size_t passed = 0;
  std::size_t total = 0;
  for (std::size_t i = 0; i < published.size(); ++i) {
    if (published[i].experiment != experiment) continue;
    ++total;
    if (passes(i * kPaperStrategies.size() + strategy)) ++passed;
  }
  return fmt::format("{} of {}", passed, total);
}

ResultTable successes(const PaperResults& results, const PoseTolerance& tolerance) {
  ResultTable table{
      "successes",
      fmt::format(
          "Runs that succeeded: published ones by their score; those of these maps by their "
          "score, by agreement with the pose that most runs agree on, and by the true pose "
          "where it is known. They start from {}.",
          start_text(results)),
      {{"experiment"}, {"strategy"}, {"published by score"}, {"by score"}, {"by agreement"}},
      {}};
  if (results.has_truth) table.columns.push_back({"by true pose"});
  const auto published = published_experiments();
  for (const Experiment experiment : kExperiments) {
    for (std::size_t s = 0; s < kPaperStrategies.size(); ++s) {
      std::vector<Cell> row = {
          std::string(experiment_name(experiment)), std::string(kPaperStrategies[s]),
          count(experiment, s,
                [&](std::size_t i) {
                  return published[i / kPaperStrategies.size()].outcomes[s].score <
                         kPublishedSuccessScore;
                }),
          count(experiment, s,
                [&](std::size_t i) { return results.score_success(results.runs[i]); }),
          count(experiment, s,
                [&](std::size_t i) { return results.agreement && results.agreement->agrees[i]; })};
      if (results.has_truth) {
        row.emplace_back(count(experiment, s, [&](std::size_t i) {
          return results.runs[i].error && tolerance.holds(*results.runs[i].error);
        }));
      }
      table.rows.push_back(std::move(row));
    }
  }
  return table;
}

}  // namespace

std::vector<ResultTable> paper_tables(const PaperResults& results, const PoseTolerance& tolerance) {
  std::vector<ResultTable> tables;
  tables.push_back(successes(results, tolerance));
  tables.push_back(scores(results, Experiment::kNeighbors, "table1_k",
                          "The paper's Table 1: score by the number of candidates k."));
  tables.push_back(
      scores(results, Experiment::kYaw, "yaw", "Score by yaw, as in the paper's Figure 3."));
  tables.push_back(scores(results, Experiment::kXy, "xy",
                          "Score by displacement in the XY plane, as in the paper's Figure 4."));
  tables.push_back(scores(results, Experiment::kXyYaw, "xy_yaw",
                          "Score by displacement and yaw, as in the paper's Figure 5."));
  tables.push_back(side_by_side(
      results, "iterations", "Iterations, at most 150 in what is published.", "", 4, all,
      [](const PublishedOutcome& outcome) { return Cell(double(outcome.iterations)); },
      [](const TrialResult& run) { return Cell(double(run.iterations)); }));
  if (results.has_truth) {
    tables.push_back(pose_errors(results, true));
    tables.push_back(pose_errors(results, false));
  }
  if (!results.searches.empty()) tables.push_back(search_table(results));
  for (ResultTable& table : tables) table.round();
  return tables;
}

ResultTable paper_durations(const PaperResults& results) {
  return side_by_side(
      results, "durations",
      "Wall time of each run. The published ones are of unoptimised code that scored each "
      "iteration.",
      "s", 3, all, [](const PublishedOutcome& outcome) { return Cell(outcome.duration_s); },
      [](const TrialResult& run) { return Cell(run.duration_s); });
}

ResultTable search_table(const PaperResults& results) {
  ResultTable table{
      "xy_search",
      "Displacement |x| = |y| of each quadrant up to which every strategy succeeded by "
      "its score, and at which the first failed.",
      {{"quadrant"}, {"all succeed", "m"}, {"first failure", "m"}, {"failed there"}},
      {}};
  for (const QuadrantSearch& search : results.searches) {
    table.rows.push_back(
        {fmt::format("({}, {})", search.sign_x > 0 ? '+' : '-', search.sign_y > 0 ? '+' : '-'),
         cell(search.last_success_m), cell(search.first_failure_m),
         fmt::format("{}", fmt::join(search.failed, ", "))});
  }
  return table;
}

std::string_view start_text(const PaperResults& results) {
  return results.has_truth ? "the true pose, displaced" : "the maps as they lie, displaced";
}

}  // namespace cairn
