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
  return side_by_side(results, rotation ? "rotation_errors" : "translation_errors",
                      rotation ? "Rotation errors. Angle between the pose found and the true one."
                               : "Translation errors. Displacement of the source's centroid from "
                                 "where the true pose puts it.",
                      rotation ? "deg" : "m", 4, all, nullptr, [&](const TrialResult& run) -> Cell {
                        if (!run.error) return {};
                        return rotation ? degrees(run.error->rotation_rad) : run.error->translation;
                      });
}

// Which runs succeed by each measure, in the order of the results.
struct Passed {
  std::vector<bool> published;
  std::vector<bool> by_score;
  std::vector<bool> by_agreement;
  std::vector<bool> by_truth;
};

Passed passed_of(const PaperResults& results, const PoseTolerance& tolerance) {
  Passed passed;
  const auto published = published_experiments();
  for (std::size_t i = 0; i < results.runs.size(); ++i) {
    const TrialResult& run = results.runs[i];
    const auto& outcomes = published[i / kPaperStrategies.size()].outcomes;
    passed.published.push_back(outcomes[i % kPaperStrategies.size()].score <
                               kPublishedSuccessScore);
    passed.by_score.push_back(results.score_success(run));
    passed.by_agreement.push_back(results.agreement && results.agreement->agrees[i]);
    passed.by_truth.push_back(run.error && tolerance.holds(*run.error));
  }
  return passed;
}

// Whether the runs of an experiment by one strategy succeed.
std::vector<bool> passes_of(Experiment experiment, std::size_t strategy,
                            const std::vector<bool>& passes) {
  std::vector<bool> own;
  const auto published = published_experiments();
  for (std::size_t i = 0; i < published.size(); ++i) {
    if (published[i].experiment != experiment) continue;
    own.push_back(passes[i * kPaperStrategies.size() + strategy]);
  }
  return own;
}

std::string count_text(const std::vector<bool>& passes) {
  return fmt::format("{} of {}", std::count(passes.begin(), passes.end(), true), passes.size());
}

ResultTable successes(const PaperResults& results, const PoseTolerance& tolerance) {
  ResultTable table{
      "successes",
      fmt::format(
          "Successes. The published runs succeed by their score; those of these maps by their "
          "score, by agreement with the pose that most runs agree on, and by the true pose "
          "where it is known. They start from {}.",
          start_text(results)),
      {{"experiment"}, {"strategy"}, {"published by score"}, {"by score"}, {"by agreement"}},
      {}};
  const Passed passed = passed_of(results, tolerance);
  std::vector<const std::vector<bool>*> measures = {&passed.published, &passed.by_score,
                                                    &passed.by_agreement};
  if (results.has_truth) {
    table.columns.push_back({"by true pose"});
    measures.push_back(&passed.by_truth);
  }
  for (const Experiment experiment : kExperiments) {
    for (std::size_t s = 0; s < kPaperStrategies.size(); ++s) {
      std::vector<Cell> row = {std::string(experiment_name(experiment)),
                               std::string(kPaperStrategies[s])};
      for (const auto* measure : measures) {
        row.emplace_back(count_text(passes_of(experiment, s, *measure)));
      }
      table.rows.push_back(std::move(row));
    }
  }
  return table;
}

// "base 4 of 8 (up to 30 degrees), covariance 8 of 8, ...", with a limit if all runs up to it succeed and none after.
std::string reach_text(Experiment experiment, const std::vector<bool>& passes) {
  std::vector<PublishedExperiment> own;
  for (const PublishedExperiment& one : published_experiments()) {
    if (one.experiment == experiment) own.push_back(one);
  }
  std::vector<std::string> texts;
  for (std::size_t s = 0; s < kPaperStrategies.size(); ++s) {
    const std::vector<bool> succeeds = passes_of(experiment, s, passes);
    std::string text = fmt::format("{} {}", kPaperStrategies[s], count_text(succeeds));
    const auto reach = std::find(succeeds.begin(), succeeds.end(), false) - succeeds.begin();
    const bool has_limit = reach > 0 && reach < std::ssize(succeeds) &&
                           std::count(succeeds.begin() + reach, succeeds.end(), true) == 0;
    if (has_limit && experiment == Experiment::kNeighbors) {
      text += fmt::format(" (up to k = {})", own[reach - 1].k);
    } else if (has_limit && experiment == Experiment::kYaw) {
      text += fmt::format(" (up to {} degrees)", own[reach - 1].initial.yaw_deg);
    }
    texts.push_back(std::move(text));
  }
  return fmt::format("{}", fmt::join(texts, ", "));
}

// Whether the score tells the runs that end at a pose from the others.
std::string disagreement_text(const Passed& passed, const std::vector<bool>& at_pose,
                              std::string_view pose) {
  std::size_t wrong = 0;
  std::size_t missed = 0;
  for (std::size_t i = 0; i < at_pose.size(); ++i) {
    if (passed.by_score[i] && !at_pose[i]) ++wrong;
    if (!passed.by_score[i] && at_pose[i]) ++missed;
  }
  if (wrong + missed == 0) {
    return fmt::format("Score and pose agree in all {} runs.", at_pose.size());
  }
  return fmt::format(
      "Score and pose disagree in {} of {} runs: {} pass by the score and do not end at {}, {} end "
      "there and fail by the score.",
      wrong + missed, at_pose.size(), wrong, pose, missed);
}

std::string lowest_score_text(const PaperResults& results) {
  const TrialResult* lowest = nullptr;
  for (const TrialResult& run : results.runs) {
    if (run.score && run.error && (lowest == nullptr || *run.score < *lowest->score)) lowest = &run;
  }
  if (lowest == nullptr) return "No run found a pose.";
  return fmt::format(
      "The run with the lowest score ({}, {:.4g} m^2) is {:.2g} degrees and {:.2g} m off.",
      lowest->trial.strategy, *lowest->score, degrees(lowest->error->rotation_rad),
      lowest->error->translation);
}

}  // namespace

std::vector<ResultTable> paper_tables(const PaperResults& results, const PoseTolerance& tolerance) {
  std::vector<ResultTable> tables;
  tables.push_back(successes(results, tolerance));
  tables.push_back(scores(results, Experiment::kNeighbors, "table1_k",
                          "Score by the number of candidates k (Table 1)."));
  tables.push_back(scores(results, Experiment::kYaw, "yaw", "Score by yaw (Figure 3)."));
  tables.push_back(
      scores(results, Experiment::kXy, "xy", "Score by displacement in the XY plane (Figure 4)."));
  tables.push_back(
      scores(results, Experiment::kXyYaw, "xy_yaw", "Score by displacement and yaw (Figure 5)."));
  tables.push_back(side_by_side(
      results, "iterations", "Iterations. At most 150 in what is published.", "", 4, all,
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

std::vector<std::string> paper_findings(const PaperResults& results,
                                        const PoseTolerance& tolerance) {
  const Passed passed = passed_of(results, tolerance);
  const std::vector<bool>& at_pose = results.has_truth ? passed.by_truth : passed.by_agreement;
  const std::string pose =
      results.has_truth ? "the true pose" : "the pose that most runs agree on, which may be wrong";
  std::vector<std::string> findings = {
      fmt::format("{} runs end at {}.", count_text(at_pose), pose)};
  for (const Experiment experiment : kExperiments) {
    findings.push_back(fmt::format("By {}, at that pose: {}; published, by the score: {}.",
                                   experiment_name(experiment), reach_text(experiment, at_pose),
                                   reach_text(experiment, passed.published)));
  }
  findings.push_back(disagreement_text(passed, at_pose, pose));
  if (results.has_truth) findings.push_back(lowest_score_text(results));
  return findings;
}

ResultTable paper_durations(const PaperResults& results) {
  return side_by_side(
      results, "durations",
      "Durations. Wall time of each run; the published ones are of unoptimised code that scored "
      "each iteration.",
      "s", 3, all, [](const PublishedOutcome& outcome) { return Cell(outcome.duration_s); },
      [](const TrialResult& run) { return Cell(run.duration_s); });
}

ResultTable search_table(const PaperResults& results) {
  ResultTable table{
      "xy_search",
      "Failure by quadrant. Displacement |x| = |y| up to which every strategy succeeded by "
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
