// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/experiments/run.hpp"

#include <algorithm>
#include <numbers>
#include <utility>

#include <fmt/format.h>

#include "cairn/alignment/align.hpp"
#include "cairn/core/detail/csv.hpp"
#include "cairn/core/error.hpp"
#include "cairn/core/number_text.hpp"
#include "cairn/geometry/angles.hpp"
#include "cairn/geometry/detail/centroid.hpp"

namespace cairn {
namespace {

RegistrationResult placed(const PairPoints& points, const Execution& execution) {
  Alignment result = place(points.source_cloud, points.target_cloud, {}, execution);
  const bool cancelled = result.registration.status == RegistrationStatus::kCancelled;
  if (!cancelled && result.verdict != Verdict::kAligned) {
    // The score of a pose that is not aligned has no meaning.
    result.registration.status = RegistrationStatus::kFailed;
    result.registration.score.reset();
    result.registration.initial_score.reset();
  }
  result.registration.duration_s = result.duration_s;
  return std::move(result.registration);
}

RegistrationResult found(const Trial& trial, const PairPoints& points, IcpOptions options,
                         const Execution& execution) {
  switch (trial.method) {
    case Method::kIcp:
      options.stop_at_repetition = false;
      break;
    case Method::kFast:
      options.coarse_to_fine = true;
      break;
    case Method::kRobust:
      return refine(points.source_cloud, points.target_cloud,
                    {.initial = options.initial, .max_iterations = options.max_iterations},
                    execution);
    case Method::kAnywhere:
      return placed(points, execution);
  }
  return icp(points.source, points.target, options, execution);
}

std::string label(const ResultTable::Column& column) {
  return column.unit.empty() ? column.name : fmt::format("{} ({})", column.name, column.unit);
}

// Without what would end a cell.
std::string escaped(std::string_view text, std::string_view special) {
  std::string result;
  for (const char c : text) {
    if (special.find(c) != std::string_view::npos) result += '\\';
    result += c == '\n' ? ' ' : c;
  }
  return result;
}

constexpr std::string_view kMarkdown = "|";
constexpr std::string_view kLatex = "&%$#_{}";

// "10^-3 m^2" with raised exponents; the only use of '^'.
std::string latex_unit(const std::string& unit) {
  std::string result;
  for (std::size_t i = 0; i < unit.size(); ++i) {
    if (unit[i] != '^') {
      result += escaped(unit.substr(i, 1), kLatex);
      continue;
    }
    const std::size_t end = std::min(unit.find(' ', i), unit.size());
    result += "$^{" + unit.substr(i + 1, end - i - 1) + "}$";
    i = end - 1;
  }
  return result;
}

std::string rounded_cell(const ResultTable::Cell& cell, int digits, std::string_view special) {
  if (const double* number = std::get_if<double>(&cell)) {
    return fmt::format("{:.{}g}", *number, digits);
  }
  if (const std::string* text = std::get_if<std::string>(&cell)) return escaped(*text, special);
  return "-";
}

}  // namespace

Strategy strategy_named(std::string_view name) {
  if (name == "base") return {"base", {}};
  return {std::string(name), metric_named(name)};
}

std::string_view to_string(Method method) {
  switch (method) {
    case Method::kIcp:
      return "icp";
    case Method::kFast:
      return "fast";
    case Method::kRobust:
      return "robust";
    case Method::kAnywhere:
      return "anywhere";
  }
  return "unknown";
}

bool uses_k(Method method) {
  return method == Method::kIcp || method == Method::kFast;
}

bool needs_clouds(Method method) {
  return method == Method::kRobust || method == Method::kAnywhere;
}

std::string approach_name(Method method, std::string_view strategy) {
  if (method == Method::kIcp) return std::string(strategy);
  if (strategy == "base") return std::string(to_string(method));
  return fmt::format("{} {}", to_string(method), strategy);
}

PairPoints pair_points(const MapPair& pair, const Strategy& strategy,
                       const PointSetOptions& options, bool with_clouds) {
  PairPoints points = {point_set(pair.source, strategy.metric, options),
                       point_set(pair.target, strategy.metric, options)};
  if (with_clouds) {
    points.source_cloud = landmark_cloud(pair.source, strategy.metric, options);
    points.target_cloud = landmark_cloud(pair.target, strategy.metric, options);
  }
  return points;
}

Rigid3 Displacement::pose() const {
  constexpr double kRadians = std::numbers::pi / 180.0;
  return Rigid3::from_roll_pitch_yaw({x_m, y_m, z_m}, roll_deg * kRadians, pitch_deg * kRadians,
                                     yaw_deg * kRadians);
}

std::string describe(const Displacement& displacement) {
  const std::array<std::pair<std::string_view, double>, 6> parts = {
      {{"x", displacement.x_m},
       {"y", displacement.y_m},
       {"z", displacement.z_m},
       {"roll", displacement.roll_deg},
       {"pitch", displacement.pitch_deg},
       {"yaw", displacement.yaw_deg}}};
  std::string text;
  for (const auto& [name, value] : parts) {
    if (value != 0.0) text += fmt::format("{}{} {:g}", text.empty() ? "" : " ", name, value);
  }
  return text.empty() ? "none" : text;
}

TrialResult run_trial(Trial trial, const PairPoints& points, const Rigid3& initial,
                      const std::optional<Rigid3>& truth, IcpOptions options,
                      const Execution& execution) {
  options.initial = initial;
  options.k = trial.k;
  const RegistrationResult result = found(trial, points, options, execution);
  if (result.status == RegistrationStatus::kCancelled) {
    throw Error(ErrorKind::kCancelled, "experiment", "cancelled", "");
  }
  TrialResult run;
  run.trial = std::move(trial);
  run.status = result.status;
  run.stop_reason = result.stop_reason;
  run.iterations = result.iterations;
  if (result.repetition) run.cycle_length = result.repetition->cycle.length;
  run.initial_score = result.initial_score;
  run.score = result.score;
  run.duration_s = result.duration_s;
  if (result.has_pose()) {
    run.target_from_source = result.target_from_source;
    if (truth) {
      run.error = pose_error(result.target_from_source, *truth, points.source.positions);
      run.fits_inverse = fits_inverse(result.target_from_source, *truth, points.source.positions);
    }
  }
  return run;
}

bool PoseTolerance::holds(const PoseError& error) const {
  return error.rotation_rad <= radians(rotation_deg) && error.translation <= translation_m;
}

std::optional<Agreement> find_agreement(std::span<const std::optional<Rigid3>> poses,
                                        std::span<const Eigen::Vector3d> source,
                                        const PoseTolerance& tolerance) {
  // Only the displacement of the centroid counts as translation error.
  const Eigen::Vector3d centre = centroid(source);

  std::optional<Agreement> best;
  std::size_t most = 0;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    if (!poses[i]) continue;
    Agreement agreement{i, std::vector<bool>(poses.size())};
    std::size_t count = 0;
    for (std::size_t j = 0; j < poses.size(); ++j) {
      agreement.agrees[j] =
          poses[j] && tolerance.holds(pose_error(*poses[j], *poses[i], {&centre, 1}));
      if (agreement.agrees[j]) ++count;
    }
    if (count <= most) continue;
    most = count;
    best = std::move(agreement);
  }
  return best;
}

void ResultTable::round() {
  for (auto& row : rows) {
    for (Cell& cell : row) {
      double* const number = std::get_if<double>(&cell);
      if (number != nullptr)
        *number = parse_number(fmt::format("{:.15g}", *number)).value_or(*number);
    }
  }
}

std::string ResultTable::csv() const {
  detail::Csv csv;
  for (const Column& column : columns) csv << label(column);
  csv.end_row();
  for (const auto& row : rows) {
    for (const Cell& cell : row) {
      if (const double* number = std::get_if<double>(&cell)) {
        csv << *number;
      } else if (const std::string* text = std::get_if<std::string>(&cell)) {
        csv << *text;
      } else {
        csv << "";
      }
    }
    csv.end_row();
  }
  return csv.text();
}

std::string ResultTable::markdown() const {
  std::string text = "|";
  for (const Column& column : columns)
    text += fmt::format(" {} |", escaped(label(column), kMarkdown));
  text += "\n|" + fmt::format("{:-<3}|", "");
  for (std::size_t i = 1; i < columns.size(); ++i) text += "--:|";
  text += '\n';
  for (const auto& row : rows) {
    text += '|';
    for (std::size_t i = 0; i < row.size(); ++i) {
      text += fmt::format(" {} |", rounded_cell(row[i], columns[i].digits, kMarkdown));
    }
    text += '\n';
  }
  return text;
}

std::string ResultTable::latex() const {
  std::string names;
  std::string units;
  for (std::size_t i = 0; i < columns.size(); ++i) {
    const std::string_view before = i == 0 ? "" : " & ";
    names += fmt::format("{}{}", before, escaped(columns[i].name, kLatex));
    units += fmt::format("{}{}", before, latex_unit(columns[i].unit));
  }
  std::string text = fmt::format("\\begin{{tabular}}{{l{}}}\n\\toprule\n{} \\\\\n",
                                 std::string(columns.size() - 1, 'r'), names);
  const bool has_units = std::any_of(columns.begin(), columns.end(),
                                     [](const Column& column) { return !column.unit.empty(); });
  if (has_units) text += units + " \\\\\n";
  text += "\\midrule\n";
  for (const auto& row : rows) {
    for (std::size_t i = 0; i < row.size(); ++i) {
      text += (i == 0 ? "" : " & ") + rounded_cell(row[i], columns[i].digits, kLatex);
    }
    text += " \\\\\n";
  }
  return text + "\\bottomrule\n\\end{tabular}\n";
}

}  // namespace cairn
