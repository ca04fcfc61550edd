// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <span>
#include <stop_token>
#include <utility>
#include <vector>

#include "cairn/registration/concepts.hpp"

namespace cairn {

/// Record of one iteration.
struct Iteration {
  Rigid3 target_from_source;           ///< after the iteration's step
  double mean_squared_distance = 0.0;  ///< of its matches, before the step
  std::vector<Match> matches;
};

struct IcpRun {
  Rigid3 target_from_source;
  int iterations = 0;  ///< number of steps
  StopReason stop_reason = StopReason::kTooFewMatches;
};

inline double mean_squared_distance(std::span<const Match> matches) {
  double sum = 0.0;
  for (const Match& match : matches) sum += match.squared_distance;
  return sum / static_cast<double>(matches.size());
}

/// Iterative closest point (Besl and McKay 1992) with exchangeable stages: match, estimate the motion, move
/// the source, repeat.
///
/// @param source   points in the source frame
/// @param initial  initial target_from_source
/// @param observe  called after each iteration; may be empty
template <CorrespondenceSearch Correspondence, TransformEstimation Estimator,
          ConvergenceTest Convergence>
IcpRun run_icp(std::span<const Eigen::Vector3d> source, const Rigid3& initial,
               const Correspondence& find_matches, const Estimator& estimate_step,
               const Convergence& converged, const std::stop_token& stop = {},
               const std::function<void(Iteration)>& observe = {}) {
  IcpRun run;
  run.target_from_source = initial;
  std::vector<Eigen::Vector3d> moved_source(source.size());
  const auto move_source = [&] {
    const Eigen::Matrix3d rotation = run.target_from_source.rotation();
    const Eigen::Vector3d& translation = run.target_from_source.translation();
    for (std::size_t i = 0; i < source.size(); ++i) {
      moved_source[i] = rotation * source[i] + translation;
    }
  };
  move_source();

  IterationState state;
  for (;;) {
    if (stop.stop_requested()) {
      run.stop_reason = StopReason::kCancelled;
      return run;
    }
    std::vector<Match> matches = find_matches(moved_source, run.target_from_source);
    if (matches.size() < kFewestMatches) {
      run.stop_reason = StopReason::kTooFewMatches;
      return run;
    }
    state.iteration = ++run.iterations;
    state.mean_squared_distance = mean_squared_distance(matches);
    state.step = estimate_step(moved_source, matches);
    run.target_from_source = state.step * run.target_from_source;
    state.target_from_source = run.target_from_source;
    move_source();
    if (observe) observe({run.target_from_source, state.mean_squared_distance, std::move(matches)});
    if (const auto reason = converged(state)) {
      run.stop_reason = *reason;
      return run;
    }
    state.previous_mean_squared_distance = state.mean_squared_distance;
  }
}

}  // namespace cairn
