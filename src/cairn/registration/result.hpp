// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/geometry/similarity3.hpp"
#include "cairn/registration/estimation/point_to_point.hpp"
#include "cairn/registration/stages.hpp"

namespace cairn {

/// How an iterative method ended. A separate verdict states whether the pose is right.
enum class RegistrationStatus {
  kConverged,  ///< converged
  kStopped,    ///< ended by a limit or in a limit cycle
  kFailed,     ///< no pose: too few points or matches
  kCancelled,  ///< the caller asked to stop; the pose is the last one
};

/// "converged" etc.: the names in results.
std::string_view to_string(RegistrationStatus status);

/// The status for a stop reason.
RegistrationStatus status_of(StopReason reason);

struct IterationRecord {
  Rigid3 target_from_source;           ///< after the iteration
  double scale = 1.0;                  ///< see RegistrationResult::scale
  double mean_squared_distance = 0.0;  ///< over its matches, before the step
  std::size_t match_count = 0;
  std::optional<double> score;  ///< after the iteration; only with `trace`
  std::vector<Match> matches;   ///< with `trace`
};

/// Share of each set's points with a point of the other set within the overlap radius.
struct Overlap {
  double source = 0.0;
  double target = 0.0;
};

/// A cycle of iterations.
struct MatchCycle {
  int first = 0;   ///< iteration, from 1, whose matches were repeated
  int length = 0;  ///< number of iterations until the repetition; 1: a fixed point
};

/// Repeated matches, and the cycle of poses that follows from them.
struct RepeatedMatches {
  MatchCycle cycle;
  /// Iteration of the cycle after which the mean squared match distance was smallest.
  int best_iteration = 0;
};

/// Result of an iterative method (icp(), refine()).
struct RegistrationResult {
  RegistrationStatus status = RegistrationStatus::kFailed;
  StopReason stop_reason = StopReason::kTooFewMatches;
  std::string reason;         ///< one sentence for people
  Rigid3 target_from_source;  ///< for the source as passed in; includes the initial pose
  /// s in x_in_target = R·(s·x_in_source) + t; 1 if not estimated. All lengths below are in the target's
  /// unit.
  double scale = 1.0;
  std::optional<double>
      initial_score;            ///< Eq. 5 at the initial pose; std::nullopt if a set is empty
  std::optional<double> score;  ///< Eq. 5 at the final pose
  int iterations = 0;           ///< number with all points
  int coarse_iterations = 0;    ///< number on samples; with IcpOptions::coarse_to_fine
  /// Set if matches repeated, whether or not the repetition ended the alignment. If it did, the
  /// pose is the pose after the cycle's best iteration.
  std::optional<RepeatedMatches> repetition;
  std::vector<Match> matches;  ///< at the final pose
  std::vector<IterationRecord> history;
  std::optional<Matrix6d> covariance;             ///< see PoseUncertainty; std::nullopt if unknown
  std::optional<Matrix7d> covariance_with_scale;  ///< the same, if a scale is estimated
  std::vector<OpenDirection> unobservable;
  std::optional<Overlap> overlap;
  double duration_s = 0.0;  ///< wall time of the whole call

  /// Whether the method reached a pose by convergence or a limit.
  bool has_pose() const {
    return status == RegistrationStatus::kConverged || status == RegistrationStatus::kStopped;
  }

  /// The pose with its scale.
  Similarity3 similarity() const { return {scale, target_from_source}; }
};

}  // namespace cairn
