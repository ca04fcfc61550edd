// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <utility>

#include <fmt/format.h>

#include "cairn/experiments/study.hpp"
#include "cairn/geometry/angles.hpp"

namespace cairn {
namespace {

using Cell = ResultTable::Cell;
using Row = std::vector<Cell>;

constexpr double kPercent = 100.0;

Cell scaled(const std::optional<double>& value, double factor) {
  return value ? Cell(factor * *value) : Cell();
}

// The share with its interval.
void add(Row& row, const SuccessRate& rate) {
  row.push_back(scaled(rate.share(), kPercent));
  row.push_back(rate.trials > 0 ? Cell(kPercent * rate.low) : Cell());
  row.push_back(rate.trials > 0 ? Cell(kPercent * rate.high) : Cell());
}

double share_of(std::size_t part, std::size_t whole) {
  return kPercent * static_cast<double>(part) / static_cast<double>(whole);
}

ResultTable strategies(const StudySummary& summary) {
  ResultTable table{
      "strategies",
      "Success by strategy. By the true pose with an interval for which the pair of maps is the "
      "unit, success by the score, iterations, and the median errors of successes.",
      {{"strategy"},
       {"runs"},
       {"success", "%", 3},
       {"low", "%", 3},
       {"high", "%", 3},
       {"by score", "%", 3},
       {"median iterations"},
       {"at the limit", "%", 3},
       {"median rotation error", "deg", 3},
       {"median translation error", "mm", 3}},
      {}};
  for (const StrategySummary& strategy : summary.strategies) {
    Row row = {strategy.name, static_cast<double>(strategy.runs)};
    add(row, strategy.success);
    row.emplace_back(share_of(strategy.score_successes, strategy.runs));
    row.emplace_back(strategy.median_iterations);
    row.emplace_back(share_of(strategy.at_limit, strategy.runs));
    row.push_back(scaled(strategy.median_rotation_rad, degrees(1.0)));
    row.push_back(scaled(strategy.median_translation, 1e3));
    table.rows.push_back(std::move(row));
  }
  return table;
}

ResultTable places(const StudySummary& summary) {
  ResultTable table{
      "places", "Success by kind of place. By the true pose.", {{"place"}, {"runs"}}, {}};
  for (const StrategySummary& strategy : summary.strategies) {
    table.columns.push_back({strategy.name, "%", 3});
  }
  for (std::size_t group = 0; group < summary.groups.size(); ++group) {
    Row row = {summary.groups[group],
               static_cast<double>(summary.strategies.front().of_group[group].trials)};
    for (const StrategySummary& strategy : summary.strategies) {
      row.push_back(scaled(strategy.of_group[group].share(), kPercent));
    }
    table.rows.push_back(std::move(row));
  }
  return table;
}

ResultTable pair_rates(const Study& study, const StudySummary& summary) {
  ResultTable table{"pairs",
                    fmt::format("Success by pair of maps. Of {} starts each.", study.initial_count),
                    {{"pair"}},
                    {}};
  for (const StrategySummary& strategy : summary.strategies) {
    table.columns.push_back({strategy.name, "%", 3});
  }
  for (std::size_t i = 0; i < summary.pairs_with_truth.size(); ++i) {
    Row row = {summary.pairs[summary.pairs_with_truth[i]]};
    for (const StrategySummary& strategy : summary.strategies) {
      row.emplace_back(kPercent * strategy.pair_rates[i]);
    }
    table.rows.push_back(std::move(row));
  }
  return table;
}

ResultTable judgement(const ScoreJudgement& score) {
  ResultTable table{"score",
                    "The score as a judge of the pose. AUC: the probability that of a right and a "
                    "wrong pose the right one has the lower score; 0.5 is a coin.",
                    {{"what"}, {"value", "", 3}, {"low", "", 3}, {"high", "", 3}},
                    {}};
  table.rows.push_back({"median AUC within a pair", score.median_auc, Cell(), Cell()});
  table.rows.push_back({"lowest AUC within a pair", score.lowest_auc, Cell(), Cell()});
  for (const auto& [name, rate] :
       {std::pair{"wrong poses that pass by the score, %", &score.passed_wrong},
        {"right poses that fail by the score, %", &score.refused_right},
        {"pairs whose lowest score is of a wrong pose, %", &score.lowest_is_wrong}}) {
    if (rate->trials == 0) continue;
    Row row = {std::string(name)};
    add(row, *rate);
    table.rows.push_back(std::move(row));
  }
  return table;
}

std::string rate_text(const StrategySummary& strategy) {
  return fmt::format("{} {:.1f} % ({:.1f} to {:.1f})", strategy.name,
                     kPercent * strategy.success.share().value_or(0.0),
                     kPercent * strategy.success.low, kPercent * strategy.success.high);
}

// Which strategies succeed most and least often.
std::string range_text(const Study& study, const StudySummary& summary) {
  const auto [least, most] =
      std::minmax_element(summary.strategies.begin(), summary.strategies.end(),
                          [](const StrategySummary& a, const StrategySummary& b) {
                            return a.success.successes < b.success.successes;
                          });
  if (summary.strategies.size() == 1) {
    return fmt::format("Success: {}, {:g} % interval.", rate_text(*most),
                       kPercent * study.confidence_level);
  }
  return fmt::format("Success, highest: {}; lowest: {}; {:g} % intervals over pairs.",
                     rate_text(*most), rate_text(*least), kPercent * study.confidence_level);
}

std::string score_text(const ScoreJudgement& score) {
  return fmt::format(
      "The score as a judge: within a pair a right pose has a lower score than a wrong one with "
      "probability {:.2f} (median of {} pairs, lowest {:.2f}); in {} of {} pairs the lowest "
      "score of all belongs to a wrong pose.",
      score.median_auc, score.pairs, score.lowest_auc, score.lowest_is_wrong.successes,
      score.lowest_is_wrong.trials);
}

std::string scope_text(const Study& study, const StudySummary& summary) {
  return fmt::format(
      "{} of maps ({} with a known truth), {} starts each; a success is within {:g} "
      "degrees and {:g} m of the true pose.",
      summary.pairs.size() == 1 ? "1 pair" : fmt::format("{} pairs", summary.pairs.size()),
      summary.pairs_with_truth.size(), study.initial_count, study.success.rotation_deg,
      study.success.translation_m);
}

}  // namespace

std::vector<ResultTable> study_tables(const Study& study, const StudySummary& summary) {
  std::vector<ResultTable> tables = {strategies(summary)};
  if (!summary.pairs_with_truth.empty()) {
    tables.push_back(places(summary));
    tables.push_back(pair_rates(study, summary));
    tables.push_back(judgement(summary.judgement));
  }
  for (ResultTable& table : tables) table.round();
  return tables;
}

std::vector<std::string> study_findings(const Study& study, const StudySummary& summary) {
  std::vector<std::string> findings;
  if (summary.pairs_with_truth.empty()) {
    findings.emplace_back(
        "Without a truth only the score can tell success from failure, and it may well be wrong.");
  } else {
    findings.push_back(range_text(study, summary));
    if (summary.judgement.pairs > 0) findings.push_back(score_text(summary.judgement));
  }
  findings.push_back(scope_text(study, summary));
  return findings;
}

}  // namespace cairn
