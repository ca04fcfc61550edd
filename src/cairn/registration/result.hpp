// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/geometry/similarity3.hpp"
#include "cairn/registration/concepts.hpp"
#include "cairn/registration/convergence/match_history.hpp"
#include "cairn/registration/estimation/pose_covariance.hpp"

namespace cairn {

/// How an iteration ended: never how right its pose is, which a judgement alone says.
enum class RegistrationStatus {
  kConverged,  ///< it settled
  kStopped,    ///< a limit ended it, or its matches went round in a circle
  kFailed,     ///< no pose: too few points or matches
  kCancelled,  ///< the caller asked to stop; the pose is the last one reached
};

/// "converged" and so on: the names in results.
std::string_view to_string(RegistrationStatus status);

/// What an iteration that ended for this reason has come to.
RegistrationStatus status_of(StopReason reason);

struct IterationRecord {
  Rigid3 target_from_source;  ///< after the iteration
  double scale = 1.0;         ///< of the source, after the iteration; see RegistrationResult
  double mean_squared_distance = 0.0;  ///< of its matches, before its step
  std::size_t match_count = 0;
  std::optional<double> score;  ///< after the iteration; with `trace`
  std::vector<Match> matches;   ///< with `trace`
};

/// Shares of each set's points that have a point of the other within the radius.
struct Overlap {
  double source = 0.0;
  double target = 0.0;
};

/// Matches that came back, and the poses they lead to for ever.
struct RepeatedMatches {
  MatchCycle cycle;
  /// After this iteration of the cycle the mean squared match distance was least.
  int best_iteration = 0;
};

/// What an iterative method (icp(), refine()) came to.
struct RegistrationResult {
  RegistrationStatus status = RegistrationStatus::kFailed;
  StopReason stop_reason = StopReason::kTooFewMatches;
  std::string reason;         ///< one sentence for people
  Rigid3 target_from_source;  ///< maps the source as passed in; the initial pose is part of it
  /// Of the source, which is scaled before it is moved: x_in_target = R·(scale·x_in_source) + t. 1 where
  /// it is not estimated. All that is said below is in the target's unit.
  double scale = 1.0;
  std::optional<double> initial_score;  ///< Eq. 5 at the initial pose; absent if a set is empty
  std::optional<double> score;          ///< Eq. 5 at the final pose
  int iterations = 0;                   ///< with all points
  int coarse_iterations = 0;  ///< before them, on samples; with IcpOptions::coarse_to_fine
  /// If matches came back, whether that ended the alignment or not; of a cycle that did, the pose is
  /// the best iteration's.
  std::optional<RepeatedMatches> repetition;
  std::vector<Match> matches;  ///< at the final pose
  std::vector<IterationRecord> history;
  std::optional<Matrix6d> covariance;             ///< see PoseUncertainty; absent if unknown
  std::optional<Matrix7d> covariance_with_scale;  ///< the same, where a scale is estimated
  std::vector<OpenDirection> unobservable;
  std::optional<Overlap> overlap;
  double duration_s = 0.0;  ///< wall time of the whole call

  /// Whether there is a pose that the method came to by its own rules or limits.
  bool has_pose() const {
    return status == RegistrationStatus::kConverged || status == RegistrationStatus::kStopped;
  }

  /// The pose with its scale.
  Similarity3 similarity() const { return {scale, target_from_source}; }
};

}  // namespace cairn
