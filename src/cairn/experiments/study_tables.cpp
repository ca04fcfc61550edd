// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/experiments/study_tables.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "cairn/geometry/angles.hpp"

namespace cairn {
namespace {

using Cell = ResultTable::Cell;
using Row = std::vector<Cell>;

Cell scaled(const std::optional<double>& value, double factor = 1.0) {
  return value ? Cell(factor * *value) : Cell();
}

void add(Row& row, const std::optional<Interval>& interval, double factor = 1.0) {
  row.push_back(interval ? Cell(factor * interval->low) : Cell());
  row.push_back(interval ? Cell(factor * interval->high) : Cell());
}

constexpr double kPercent = 100.0;

ResultTable strategies(const StudyAnalysis& analysis) {
  ResultTable table{
      "strategies",
      "Success by the true pose with an interval from resampling pairs of maps, success by "
      "the score, iterations, and what is left of the error where a run succeeds.",
      {{"strategy"},
       {"runs"},
       {"success", "%", 3},
       {"low", "%", 3},
       {"high", "%", 3},
       {"by score", "%", 3},
       {"median iterations"},
       {"at the limit", "%", 3},
       {"median rotation error", "deg", 3},
       {"median translation error", "mm", 3},
       {"90 % succeed up to", "deg", 3},
       {"90 % succeed up to", "m", 3}},
      {}};
  for (const StrategySummary& strategy : analysis.strategies) {
    Row row = {strategy.name, static_cast<double>(strategy.score_success.count.trials),
               scaled(strategy.success.estimate, kPercent)};
    add(row, strategy.interval, kPercent);
    row.push_back(scaled(strategy.score_success.estimate, kPercent));
    row.emplace_back(strategy.median_iterations);
    row.push_back(scaled(strategy.at_limit.estimate, kPercent));
    row.push_back(scaled(strategy.median_rotation_rad, degrees(1.0)));
    row.push_back(scaled(strategy.median_translation, 1e3));
    row.push_back(scaled(strategy.rotation_radius_rad, degrees(1.0)));
    row.push_back(scaled(strategy.translation_radius));
    table.rows.push_back(std::move(row));
  }
  return table;
}

ResultTable places(const StudyAnalysis& analysis) {
  ResultTable table{
      "places", "Success by the true pose, by kind of place.", {{"place"}, {"runs"}}, {}};
  for (const StrategySummary& strategy : analysis.strategies) {
    table.columns.push_back({strategy.name, "%", 3});
  }
  for (std::size_t group = 0; group < analysis.groups.size(); ++group) {
    Row row = {analysis.groups[group],
               static_cast<double>(analysis.strategies.front().group_success[group].count.trials)};
    for (const StrategySummary& strategy : analysis.strategies) {
      row.push_back(scaled(strategy.group_success[group].estimate, kPercent));
    }
    table.rows.push_back(std::move(row));
  }
  return table;
}

ResultTable comparisons(const StudyAnalysis& analysis) {
  ResultTable table{"comparisons",
                    "Difference of the success rates of two strategies with an interval from "
                    "resampling pairs of maps; "
                    "Wilcoxon's test of the pairs' success rates, adjusted by Holm for all "
                    "comparisons; and, taking each "
                    "start as independent though those of one pair are not, who succeeds where the "
                    "other fails, and "
                    "McNemar's test.",
                    {{"first"},
                     {"second"},
                     {"difference", "%", 3},
                     {"low", "%", 3},
                     {"high", "%", 3},
                     {"Cohen's h", "", 2},
                     {"rank-biserial", "", 2},
                     {"p by pairs", "", 2},
                     {"p adjusted", "", 2},
                     {"only first"},
                     {"only second"},
                     {"McNemar p", "", 2},
                     {"TOST p", "", 2}},
                    {}};
  for (const StrategyComparison& comparison : analysis.comparisons) {
    Row row = {analysis.strategies[comparison.first].name,
               analysis.strategies[comparison.second].name,
               kPercent * comparison.difference.difference.estimate};
    const BootstrapResult& difference = comparison.difference.difference;
    add(row, difference.bca ? difference.bca : difference.percentile, kPercent);
    row.emplace_back(comparison.cohens_h);
    row.push_back(scaled(comparison.by_pair.rank_biserial));
    row.emplace_back(comparison.by_pair.p_value);
    row.emplace_back(comparison.by_pair_adjusted);
    row.emplace_back(static_cast<double>(comparison.counts.first_only));
    row.emplace_back(static_cast<double>(comparison.counts.second_only));
    row.emplace_back(comparison.mcnemar_mid_p);
    row.push_back(comparison.equivalence ? Cell(comparison.equivalence->p_value) : Cell());
    table.rows.push_back(std::move(row));
  }
  return table;
}

ResultTable basins(const StudyAnalysis& analysis) {
  ResultTable table{
      "basins",
      "Success by how far the start was off, from the lower to the upper of the bounds, with "
      "intervals for which the pair of maps is the unit.",
      {{"strategy"},
       {"rotation from", "deg"},
       {"to", "deg"},
       {"translation from", "m"},
       {"to", "m"},
       {"runs"},
       {"success", "%", 3},
       {"low", "%", 3},
       {"high", "%", 3}},
      {}};
  for (const StrategySummary& strategy : analysis.strategies) {
    const SuccessTable& basin = strategy.basin;
    for (std::size_t i = 0; i < basin.rows(); ++i) {
      for (std::size_t j = 0; j < basin.columns(); ++j) {
        const Proportion& cell = basin.at(i, j);
        if (cell.count.trials == 0) continue;
        Row row = {strategy.name,
                   degrees(basin.rotation_edges[i]),
                   degrees(basin.rotation_edges[i + 1]),
                   basin.translation_edges[j],
                   basin.translation_edges[j + 1],
                   static_cast<double>(cell.count.trials),
                   kPercent * *cell.estimate};
        add(row, cell.interval, kPercent);
        table.rows.push_back(std::move(row));
      }
    }
  }
  return table;
}

ResultTable pair_rates(const Study& study, const StudyAnalysis& analysis) {
  ResultTable table{"pairs",
                    fmt::format("Success of {} starts of each pair.", study.initial_count),
                    {{"pair"}},
                    {}};
  for (const StrategySummary& strategy : analysis.strategies) {
    table.columns.push_back({strategy.name, "%", 3});
  }
  for (std::size_t i = 0; i < analysis.pairs_with_truth.size(); ++i) {
    Row row = {analysis.pairs[analysis.pairs_with_truth[i]]};
    for (const StrategySummary& strategy : analysis.strategies) {
      row.emplace_back(kPercent * strategy.pair_rates[i]);
    }
    table.rows.push_back(std::move(row));
  }
  return table;
}

ResultTable judgement(const ScoreJudgement& score) {
  ResultTable table{
      "score",
      "Whether the score can judge the pose. AUC: the probability that of a right and a "
      "wrong pose the right one has the lower score; 0.5 is a coin.",
      {{"what"}, {"value", "", 3}, {"low", "", 3}, {"high", "", 3}},
      {}};
  table.rows.push_back({"median AUC within a pair", score.median_auc, Cell(), Cell()});
  table.rows.push_back({"lowest AUC within a pair", score.lowest_auc, Cell(), Cell()});
  if (score.pooled) {
    // Its intervals would take the runs for independent.
    table.rows.push_back({"AUC of all runs, scores relative to the pair's lowest",
                          score.pooled->auc, Cell(), Cell()});
    table.rows.push_back({"best threshold, times the pair's lowest score",
                          score.pooled->best.threshold, Cell(), Cell()});
  }
  for (const auto& [name, rate] :
       {std::pair{"wrong poses that pass by the score, %", &score.passed_wrong},
        {"right poses that fail by the score, %", &score.refused_right},
        {"pairs whose lowest score is of a wrong pose, %", &score.lowest_is_wrong}}) {
    if (!rate->estimate) continue;
    Row row = {std::string(name), kPercent * *rate->estimate};
    add(row, rate->interval, kPercent);
    table.rows.push_back(std::move(row));
  }
  return table;
}

std::string p_text(double p) {
  return p < 0.001 ? std::string("p < 0.001") : fmt::format("p = {:.3f}", p);
}

// With a sign, but for 0.
std::string points_text(double difference) {
  const std::string text = fmt::format("{:+.1f}", kPercent * difference);
  return text == "-0.0" || text == "+0.0" ? "0.0" : text;
}

std::string interval_text(const BootstrapResult& result) {
  const auto& interval = result.bca ? result.bca : result.percentile;
  if (!interval) return "no interval";
  return fmt::format("{} to {}", points_text(interval->low), points_text(interval->high));
}

std::string answer(const Study& study, const StudyAnalysis& analysis,
                   const StrategyComparison& comparison) {
  const std::string& base = analysis.strategies[comparison.first].name;
  const std::string& other = analysis.strategies[comparison.second].name;
  // The comparison is first less second; people ask what the other adds to base.
  const double gain = -comparison.difference.difference.estimate;
  BootstrapResult turned = comparison.difference.difference;
  const auto turn = [](std::optional<Interval>& interval) {
    if (interval) interval = Interval{-interval->high, -interval->low};
  };
  turn(turned.bca);
  turn(turned.percentile);
  std::string text = fmt::format(
      "{} against {}: {:.1f} % of the starts succeed instead of {:.1f} %, {} points "
      "({:g} % interval over pairs {}; Wilcoxon by pairs, Holm: {})",
      other, base, kPercent * comparison.difference.second_rate,
      kPercent * comparison.difference.first_rate, points_text(gain),
      kPercent * study.confidence_level, interval_text(turned),
      p_text(comparison.by_pair_adjusted));
  if (comparison.equivalence) {
    text +=
        fmt::format("; {} within {:g} points (TOST {})",
                    comparison.equivalence->equivalent ? "equivalent" : "not shown equivalent",
                    kPercent * study.equivalence_margin, p_text(comparison.equivalence->p_value));
  }
  return text + ".";
}

constexpr const char* kNoTruth =
    "Without a truth only the score can tell success from failure, and it may well be wrong.";

std::string scope_text(const Study& study, const StudyAnalysis& analysis) {
  return fmt::format(
      "{} of maps ({} with a known truth), {} starts each; a success is within {:g} "
      "degrees and {:g} m of the true pose.",
      analysis.pairs.size() == 1 ? "1 pair" : fmt::format("{} pairs", analysis.pairs.size()),
      analysis.pairs_with_truth.size(), study.initial_count, study.success.rotation_deg,
      study.success.translation_m);
}

std::string score_text(const ScoreJudgement& score) {
  return fmt::format(
      "The score as a judge: within a pair a right pose has a lower score than a wrong one with "
      "probability {:.2f} (median of {} pairs, lowest {:.2f}); in {} of {} pairs the lowest "
      "score of "
      "all belongs to a wrong pose.",
      score.median_auc, score.pairs, score.lowest_auc, score.lowest_is_wrong.count.successes,
      score.lowest_is_wrong.count.trials);
}

std::string rate_text(const StrategySummary& strategy) {
  const Interval interval = strategy.interval.value_or(strategy.success.interval);
  return fmt::format("{} {:.1f} % ({:.1f} to {:.1f})", strategy.name,
                     kPercent * strategy.success.estimate.value_or(0.0), kPercent * interval.low,
                     kPercent * interval.high);
}

// Which strategies succeed most and least often.
std::string range_text(const Study& study, const StudyAnalysis& analysis) {
  const auto less = [](const StrategySummary& a, const StrategySummary& b) {
    return a.success.estimate.value_or(0.0) < b.success.estimate.value_or(0.0);
  };
  const auto [least, most] =
      std::minmax_element(analysis.strategies.begin(), analysis.strategies.end(), less);
  if (analysis.strategies.size() == 1) {
    return fmt::format("Success: {}, {:g} % interval.", rate_text(*most),
                       kPercent * study.confidence_level);
  }
  return fmt::format("Success, highest: {}; lowest: {}; {:g} % intervals over pairs.",
                     rate_text(*most), rate_text(*least), kPercent * study.confidence_level);
}

// Which comparisons show a difference, the largest first.
std::string difference_text(const Study& study, const StudyAnalysis& analysis) {
  constexpr std::size_t kNamed = 5;
  const double level = 1.0 - study.confidence_level;
  std::vector<const StrategyComparison*> different;
  double lowest = 1.0;
  std::size_t equivalent = 0;
  for (const StrategyComparison& comparison : analysis.comparisons) {
    lowest = std::min(lowest, comparison.by_pair_adjusted);
    if (comparison.by_pair_adjusted < level) different.push_back(&comparison);
    if (comparison.equivalence && comparison.equivalence->equivalent) ++equivalent;
  }
  const auto difference = [](const StrategyComparison& comparison) {
    return comparison.difference.difference.estimate;
  };
  std::sort(different.begin(), different.end(), [&](const auto* a, const auto* b) {
    return std::abs(difference(*a)) > std::abs(difference(*b));
  });
  const std::size_t count = analysis.comparisons.size();
  const char* const test = "Wilcoxon's test by pairs, Holm's correction";
  std::string text =
      different.empty()
          ? fmt::format("No difference between strategies is significant ({} {}; {}: lowest {}).",
                        count, count == 1 ? "comparison" : "comparisons", test, p_text(lowest))
          : fmt::format("{} of {} differences between strategies {} significant ({}, p < {:g}): ",
                        different.size(), count, different.size() == 1 ? "is" : "are", test, level);
  for (std::size_t i = 0; i < std::min(kNamed, different.size()); ++i) {
    const bool first_is_better = difference(*different[i]) > 0.0;
    const std::string& first = analysis.strategies[different[i]->first].name;
    const std::string& second = analysis.strategies[different[i]->second].name;
    text += fmt::format("{}{} over {} {:+.1f} points", i > 0 ? "; " : "",
                        first_is_better ? first : second, first_is_better ? second : first,
                        kPercent * std::abs(difference(*different[i])));
  }
  if (different.size() > kNamed) text += fmt::format("; and {} more", different.size() - kNamed);
  if (!different.empty()) text += ".";
  if (equivalent > 0) {
    text += fmt::format(" {} of {} are shown equivalent within {:g} points.", equivalent, count,
                        kPercent * study.equivalence_margin);
  }
  return text;
}

}  // namespace

std::vector<ResultTable> study_tables(const Study& study, const StudyAnalysis& analysis) {
  std::vector<ResultTable> tables = {strategies(analysis)};
  if (analysis.pairs_with_truth.empty()) {
    tables.front().round();
    return tables;
  }
  tables.push_back(places(analysis));
  if (!analysis.comparisons.empty()) tables.push_back(comparisons(analysis));
  tables.push_back(basins(analysis));
  tables.push_back(pair_rates(study, analysis));
  tables.push_back(judgement(analysis.judgement));
  for (ResultTable& table : tables) table.round();
  return tables;
}

std::vector<std::string> study_answers(const Study& study, const StudyAnalysis& analysis) {
  std::vector<std::string> answers;
  answers.push_back(scope_text(study, analysis));
  if (analysis.pairs_with_truth.empty()) {
    answers.emplace_back(kNoTruth);
    return answers;
  }
  if (analysis.friedman) {
    answers.push_back(fmt::format(
        "Do strategies differ at all? Friedman's test over the pairs' success rates: chi-squared "
        "{:.1f}, {}.",
        analysis.friedman->statistic, p_text(analysis.friedman->p_value)));
  }
  for (const StrategyComparison& comparison : analysis.comparisons) {
    answers.push_back(answer(study, analysis, comparison));
  }
  if (analysis.judgement.pairs > 0) answers.push_back(score_text(analysis.judgement));
  return answers;
}

std::vector<std::string> study_findings(const Study& study, const StudyAnalysis& analysis) {
  std::vector<std::string> findings;
  if (analysis.pairs_with_truth.empty()) {
    findings.emplace_back(kNoTruth);
  } else {
    findings.push_back(range_text(study, analysis));
    if (!analysis.comparisons.empty()) findings.push_back(difference_text(study, analysis));
    if (analysis.judgement.pairs > 0) findings.push_back(score_text(analysis.judgement));
  }
  findings.push_back(scope_text(study, analysis));
  return findings;
}

}  // namespace cairn
