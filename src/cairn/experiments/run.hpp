// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/evaluation/pose_error.hpp"
#include "cairn/experiments/displacement.hpp"
#include "cairn/map/landmark_map.hpp"
#include "cairn/placement/landmark_cloud.hpp"
#include "cairn/registration/icp.hpp"

namespace cairn {

/// A way to choose matches: base ICP, or by a confidence.
struct Strategy {
  std::string name;              ///< "base", or the metric's
  std::optional<Metric> metric;  ///< nothing: base
};

/// @param name "base" or what metric_named knows
/// @throws Error (misuse) listing the names if there is none
Strategy strategy_named(std::string_view name);

/// Two maps to align again and again.
struct MapPair {
  std::string name;
  LandmarkMap source;
  LandmarkMap target;
  std::optional<Rigid3> truth;  ///< target_from_source, where it is known
};

/// How a trial finds its pose.
enum class Method {
  kIcp,       ///< the paper's, to the end as PCL would: its iterations compare with published ones
  kFast,      ///< the same on growing samples first, and ended where matches repeat
  kRobust,    ///< refine(), the confidences as weights
  kAnywhere,  ///< place(), which has no use for the start; a pose that it is not sure of is none
};

/// "icp" and so on: the names in studies and tables.
std::string_view to_string(Method method);

inline constexpr std::array kMethods = {Method::kIcp, Method::kFast, Method::kRobust,
                                        Method::kAnywhere};

/// What people call a strategy by a method: ICP's by its own name, "base" or "observations"; of another
/// method after that, "robust" or "robust observations".
std::string approach_name(Method method, std::string_view strategy);

/// Whether the number of candidates makes a difference to the method.
bool uses_k(Method method);
/// Whether the method is one of placement, which sees landmarks as clouds.
bool needs_clouds(Method method);

/// A pair's landmarks with the confidences of one strategy.
struct PairPoints {
  PointSet source;
  PointSet target;
  /// The same for the methods of placement; empty unless asked for.
  LandmarkCloud source_cloud = {};
  LandmarkCloud target_cloud = {};
};

/// @throws Error where a map lacks the strategy's input
PairPoints pair_points(const MapPair& pair, const Strategy& strategy,
                       const PointSetOptions& options = {}, bool with_clouds = false);

/// What is to be aligned, and how: the key of a row in tables.
struct Trial {
  std::string pair = {};
  std::string experiment = {};  ///< what it belongs to
  std::size_t number = 0;       ///< of its configuration, from 1; strategies share one
  Method method = Method::kIcp;
  std::string strategy = {};
  std::size_t k = 5;  ///< as configured; base ICP has no use for it
  Displacement initial = {};

  friend bool operator==(const Trial&, const Trial&) = default;
};

/// A trial and what came of it.
struct TrialResult {
  Trial trial;
  RegistrationStatus status = RegistrationStatus::kFailed;
  StopReason stop_reason = StopReason::kTooFewMatches;
  int iterations = 0;
  std::optional<int> cycle_length;           ///< of matches that came back; 1: a fixed point
  std::optional<double> initial_score;       ///< Eq. 5, m²
  std::optional<double> score;               ///< Eq. 5, m²
  std::optional<Rigid3> target_from_source;  ///< nothing of a failure
  std::optional<PoseError> error;            ///< where there is a pose and the truth is known
  double duration_s = 0.0;                   ///< the one thing that differs from time to time
};

/// Aligns by the trial's method. Of the options, `initial` and `k` are the trial's own; the methods of
/// placement take of the others what they have.
/// @param points with clouds if the method is one of placement
/// @param initial target_from_source to start from
/// @param seed    of what a method draws
/// @throws Error (cancelled) if options.stop asks for it
TrialResult run_trial(Trial trial, const PairPoints& points, const Rigid3& initial,
                      const std::optional<Rigid3>& truth, IcpOptions options,
                      std::uint64_t seed = 0);

/// How far a pose may be from the true one and still be a success.
struct PoseTolerance {
  double rotation_deg = 5.0;
  double translation_m = 0.05;

  bool holds(const PoseError& error) const;
};

/// The pose that most of the poses agree with, for pairs whose truth nobody knows. It is no proof:
/// strategies may agree on a wrong pose.
struct Agreement {
  std::size_t pose = 0;      ///< index of the pose with the most others within the tolerance; of
                             ///< equals the first
  std::vector<bool> agrees;  ///< one a pose: within the tolerance of that one
};

/// @param poses  nothing: no pose, which agrees with none
/// @param source landmarks in the source frame, at which translations are compared
/// @returns nothing if there is no pose
std::optional<Agreement> find_agreement(std::span<const std::optional<Rigid3>> poses,
                                        std::span<const Eigen::Vector3d> source,
                                        const PoseTolerance& tolerance = {});

}  // namespace cairn
