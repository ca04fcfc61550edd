// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/experiments/run.hpp"

#include <array>
#include <numbers>
#include <utility>

#include <fmt/format.h>

#include "cairn/alignment/align.hpp"
#include "cairn/core/error.hpp"
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

}  // namespace cairn
