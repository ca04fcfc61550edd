// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/report/detail/run_builder.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string_view>
#include <utility>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/evaluation/pose_error.hpp"
#include "cairn/geometry/angles.hpp"

namespace cairn::report::detail {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr std::int32_t kNoMatch = -1;

bool is_nan(double value) {
  return std::isnan(value);
}

Scalar scalar(std::optional<double> value) {
  return value ? Scalar(*value) : Scalar();
}

std::uint32_t checked(std::uint32_t point, const Points& points, std::string_view role) {
  if (point >= points.size()) {
    throw Error(ErrorKind::kMisuse, fmt::format("match of a {} point", role),
                fmt::format("{}", point), fmt::format("one of {} points", points.size()));
  }
  return point;
}

// The match of each source point in one iteration.
std::vector<std::int32_t> match_list(const std::vector<Match>& matches, const Points& source,
                                     const Points& target) {
  std::vector<std::int32_t> list(source.size(), kNoMatch);
  for (const Match& match : matches) {
    list[checked(match.source, source, "source")] =
        static_cast<std::int32_t>(checked(match.target, target, "target"));
  }
  return list;
}

bool has_pose(const RegistrationResult& result) {
  return result.status != RegistrationStatus::kFailed;
}

// The iterations, and the estimate if no iteration ended there: the best pose of a cycle, the pose that
// the maps' parts agree on, or any pose if the result has no history.
std::vector<IterationRecord> with_estimate(const RegistrationResult& result) {
  std::vector<IterationRecord> history = result.history;
  const auto is_estimate = [&](const IterationRecord& record) {
    return Similarity3(record.scale, record.target_from_source).matrix() ==
           result.similarity().matrix();
  };
  if (!has_pose(result) || (!history.empty() && is_estimate(history.back()))) return history;
  const std::size_t best =
      result.repetition ? static_cast<std::size_t>(result.repetition->best_iteration) : 0;
  IterationRecord estimate;
  if (result.stop_reason == StopReason::kCycle && best < history.size()) {
    // The matches at a cycle's best pose are those at the start of the following iteration.
    estimate = history[best];
  } else {
    // A document holds the matches of iterations only.
    if (!history.empty()) estimate.matches = history.back().matches;
    estimate.mean_squared_distance = kNan;
  }
  estimate.target_from_source = result.target_from_source;
  estimate.scale = result.scale;
  estimate.score = result.score;
  history.push_back(std::move(estimate));
  return history;
}

void add_errors(AlignmentRun& run, const Similarity3& truth, const Points& positions) {
  for (const Similarity3& pose : run.target_from_source) {
    const PoseError error = pose_error(pose, truth, positions);
    run.rotation_error_deg.push_back(degrees(error.rotation_rad));
    run.translation_error.push_back(error.translation);
  }
}

std::string symbol(LengthUnit unit) {
  return unit == LengthUnit::kMetres ? "m" : "map units";
}

Line line_of(const std::string& name, const std::vector<double>& values) {
  Line line;
  line.name = name;
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (is_nan(values[i])) continue;
    line.x.push_back(static_cast<double>(i));
    line.y.push_back(values[i]);
  }
  return line;
}

Scalar summary_value(const AlignmentRun& run, std::string_view name) {
  for (const auto& [key, value] : run.summary) {
    if (key == name) return value;
  }
  return {};
}

}  // namespace

Matches delta_coded(std::span<const IterationRecord> history, const Points& source,
                    const Points& target) {
  Matches matches;
  if (history.empty()) return matches;
  matches.first = match_list(history.front().matches, source, target);
  std::vector<std::int32_t> current = matches.first;
  for (const IterationRecord& iteration : history.subspan(1)) {
    std::vector<std::int32_t> next = match_list(iteration.matches, source, target);
    std::uint32_t count = 0;
    for (std::uint32_t i = 0; i < next.size(); ++i) {
      if (next[i] == current[i]) continue;
      matches.changed.push_back(i);
      matches.targets.push_back(next[i]);
      ++count;
    }
    matches.change_counts.push_back(count);
    current = std::move(next);
  }
  return matches;
}

AlignmentRun make_run(const RegistrationResult& result, const Points& source, const Points& target,
                      const RunOptions& options) {
  AlignmentRun run;
  run.name = options.name;
  // In the target's unit from the first iteration, because a start without a pose has no scale.
  const double initial_scale = result.history.empty() ? 1.0 : result.history.front().scale;
  run.target_from_source = {Similarity3(initial_scale, options.initial)};
  run.mean_squared_distance = {kNan};
  run.scores = {result.initial_score.value_or(kNan)};
  const std::vector<IterationRecord> history = with_estimate(result);
  bool traced = !history.empty();
  for (const IterationRecord& iteration : history) {
    run.target_from_source.emplace_back(iteration.scale, iteration.target_from_source);
    run.mean_squared_distance.push_back(iteration.mean_squared_distance);
    run.scores.push_back(iteration.score.value_or(kNan));
    traced = traced && !iteration.matches.empty();
  }
  if (!history.empty()) run.scores.back() = result.score.value_or(run.scores.back());
  if (std::all_of(run.scores.begin(), run.scores.end(), is_nan)) run.scores.clear();
  if (options.truth) add_errors(run, *options.truth, source);
  if (traced) run.matches = delta_coded(history, source, target);

  const std::string status =
      options.status.empty() ? std::string(to_string(result.status)) : options.status;
  const bool counts = has_pose(result) && !options.rejected;
  const bool has_error = counts && !run.rotation_error_deg.empty();
  const bool has_scale = counts && result.scale != 1.0;  // maps of one scale have none
  const auto& overlap = result.overlap;
  run.summary = {
      {"status", status},
      {"reason", result.reason},
      {"stop_reason", std::string(to_string(result.stop_reason))},
      {"k", static_cast<double>(options.k)},
      {"iterations", static_cast<double>(result.iterations)},
      {"scale", has_scale ? Scalar(result.scale) : Scalar()},
      {"initial_score", scalar(result.initial_score)},
      {"score", scalar(result.score)},
      {"rotation_error_deg", has_error ? Scalar(run.rotation_error_deg.back()) : Scalar()},
      {"translation_error_m", has_error ? Scalar(run.translation_error.back()) : Scalar()},
      {"overlap_source", overlap ? Scalar(overlap->source) : Scalar()},
      {"overlap_target", overlap ? Scalar(overlap->target) : Scalar()},
      {"duration_s", result.duration_s},
  };
  return run;
}

AlignmentRun make_run(const Alignment& alignment, const Points& source, const Points& target,
                      RunOptions options) {
  RegistrationResult registration = alignment.registration;
  registration.reason = alignment.reason;
  registration.duration_s = alignment.duration_s;
  options.rejected = alignment.verdict == Verdict::kRejected;
  options.status = status_of(alignment);
  return make_run(registration, source, target, options);
}

LinesChart convergence_chart(std::span<const AlignmentRun> runs, LengthUnit unit) {
  // All values of one kind, because scores and match distances are not comparable.
  const bool scored = std::all_of(runs.begin(), runs.end(), [](const AlignmentRun& run) {
    return !run.scores.empty() && std::none_of(run.scores.begin(), run.scores.end(), is_nan);
  });
  LinesChart chart;
  chart.x_label = "Iteration";
  chart.y_label = fmt::format("{} ({}²)", scored ? "Score" : "Mean squared distance of the matches",
                              symbol(unit));
  chart.y_scale = AxisScale::kLog;
  for (const AlignmentRun& run : runs) {
    Line line = line_of(run.name, scored ? run.scores : run.mean_squared_distance);
    // A logarithmic axis cannot show maps that fit exactly.
    if (std::any_of(line.y.begin(), line.y.end(), [](double y) { return y <= 0.0; })) {
      chart.y_scale = AxisScale::kLinear;
    }
    if (!line.x.empty()) chart.series.push_back(std::move(line));
  }
  return chart;
}

LinesChart error_chart(std::span<const AlignmentRun> runs, LengthUnit unit, bool translation) {
  LinesChart chart;
  chart.x_label = "Iteration";
  chart.y_label = translation ? fmt::format("Translation error ({})", symbol(unit))
                              : "Rotation error (degrees)";
  for (const AlignmentRun& run : runs) {
    const auto& values = translation ? run.translation_error : run.rotation_error_deg;
    if (!values.empty()) chart.series.push_back(line_of(run.name, values));
  }
  return chart;
}

Table run_table(std::span<const AlignmentRun> runs, LengthUnit unit) {
  struct Entry {
    std::string_view key;
    TableColumn column;
    Best best;
  };
  const std::string length = symbol(unit);
  const std::string area = length + "²";
  constexpr auto kNumber = CellType::kNumber;
  const std::vector<Entry> entries = {
      {"k", {"k", std::nullopt, kNumber, 0}, Best::kNone},
      {"status", {"Status", std::nullopt, CellType::kText, std::nullopt}, Best::kNone},
      {"iterations", {"Iterations", std::nullopt, kNumber, 0}, Best::kNone},
      {"initial_score", {"Score before", area, kNumber, 6}, Best::kNone},
      {"score", {"Score after", area, kNumber, 6}, Best::kLow},
      {"rotation_error_deg", {"Rotation error", "deg", kNumber, 4}, Best::kLow},
      {"translation_error_m", {"Translation error", length, kNumber, 5}, Best::kLow},
      {"overlap_source", {"Overlap of source", std::nullopt, kNumber, 3}, Best::kHigh},
      {"overlap_target", {"Overlap of target", std::nullopt, kNumber, 3}, Best::kHigh},
      {"duration_s", {"Time", "s", kNumber, 3}, Best::kNone},
  };
  Table table;
  table.columns = {{"Strategy", std::nullopt, CellType::kText, std::nullopt}};
  table.best = {Best::kNone};
  table.rows.resize(runs.size());
  for (std::size_t i = 0; i < runs.size(); ++i) table.rows[i] = {runs[i].name};
  for (const Entry& entry : entries) {
    const auto known = [&](const AlignmentRun& run) {
      return !std::holds_alternative<std::monostate>(summary_value(run, entry.key));
    };
    if (std::none_of(runs.begin(), runs.end(), known)) continue;
    table.columns.push_back(entry.column);
    table.best.push_back(entry.best);
    for (std::size_t i = 0; i < runs.size(); ++i) {
      table.rows[i].push_back(summary_value(runs[i], entry.key));
    }
  }
  return table;
}

}  // namespace cairn::report::detail
