// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <limits>
#include <optional>
#include <stop_token>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/core/executor.hpp"
#include "cairn/core/progress.hpp"
#include "cairn/registration/concepts.hpp"
#include "cairn/registration/convergence/match_history.hpp"
#include "cairn/registration/estimation/pose_covariance.hpp"
#include "cairn/registration/point_set.hpp"

namespace cairn {

/// How to align. The defaults are the paper's.
struct AlignOptions {
  Rigid3 initial = {};  ///< target_from_source to start from
  std::size_t k = 5;  ///< candidates a point among which the most confident is matched; at least 1
  int max_iterations = 150;  ///< at least 1; of a coarse_to_fine alignment, with each sample
  /// Stop below this change of the mean squared match distance.
  double mse_change_threshold = 1e-12;
  /// Stop as soon as matches come back, when all that would follow is known (see MatchHistory). Without
  /// it an alignment goes on, as PCL's does, until the change or the limit above ends it: in a limit
  /// cycle at whichever of its poses the limit falls upon.
  bool stop_at_repetition = true;
  /// Align growing samples of both first (see align_samples): faster, and it may end at
  /// another optimum than without.
  bool coarse_to_fine = false;
  double max_distance = std::numeric_limits<double>::infinity();  ///< of a match; positive
  bool reciprocal = false;        ///< keep only matches that hold both ways
  double trimmed_fraction = 0.0;  ///< share of the matches, the farthest, left out; in [0, 1)
  /// Weigh each match in the estimate by its source point's confidence (the paper does not).
  bool weight_by_source_confidence = false;
  /// Within which distance points count as overlapping; nothing: overlap is not computed.
  std::optional<double> overlap_radius = {};
  bool trace = false;  ///< keep score and matches of every iteration

  Executor executor = Executor();
  std::stop_token stop = {};
  Progress progress = {};

  /// @throws Error (misuse) naming the field, its value and what it may be
  void validate() const;
};

enum class AlignStatus {
  kAligned,    ///< the iteration ended by its own rules; says nothing of how right the pose is
  kFailed,     ///< no pose: too few points or matches
  kCancelled,  ///< the caller asked to stop; the pose is the last one reached
};

/// "aligned" and so on: the names in results.
std::string_view to_string(AlignStatus status);

/// What an iteration that ended for this reason has come to.
AlignStatus status_of(StopReason reason);

struct IterationRecord {
  Rigid3 target_from_source;           ///< after the iteration
  double scale = 1.0;                  ///< of the source, after the iteration; see AlignResult
  double mean_squared_distance = 0.0;  ///< of its matches, before its step
  std::size_t match_count = 0;
  std::optional<double> score;  ///< after the iteration; with AlignOptions::trace
  std::vector<Match> matches;   ///< with AlignOptions::trace
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

struct AlignResult {
  AlignStatus status = AlignStatus::kFailed;
  StopReason stop_reason = StopReason::kTooFewMatches;
  std::string reason;         ///< one sentence for people
  Rigid3 target_from_source;  ///< maps the source as passed in; the initial pose is part of it
  /// Of the source, which is scaled before it is moved: x_in_target = R·(scale·x_in_source) + t. 1 where
  /// it is not estimated. All that is said below is in the target's unit.
  double scale = 1.0;
  std::optional<double> initial_score;  ///< Eq. 5 at the initial pose; nothing of no points
  std::optional<double> score;          ///< Eq. 5 at the final pose
  int iterations = 0;                   ///< with all points
  int coarse_iterations = 0;  ///< before them, on samples; with AlignOptions::coarse_to_fine
  /// If matches came back, whether that ended the alignment or not; of a cycle that did, the pose is
  /// the best iteration's.
  std::optional<RepeatedMatches> repetition;
  std::vector<Match> matches;  ///< at the final pose
  std::vector<IterationRecord> history;
  std::optional<Matrix6d> covariance;             ///< see PoseUncertainty; nothing if unknown
  std::optional<Matrix7d> covariance_with_scale;  ///< the same, where a scale is estimated
  std::vector<OpenDirection> unobservable;
  std::optional<Overlap> overlap;
  double duration_s = 0.0;  ///< wall time of the whole call

  /// The pose with its scale.
  Similarity3 similarity() const { return {scale, target_from_source}; }
};

/// Aligns one set of points to another: the paper's ICP. Base if the target has no confidences,
/// weighted if it has.
///
/// An expected failure (an empty set, too few matches) is a status, not an exception. Same input, same
/// result, whatever the executor's number of threads.
///
/// @throws Error (misuse) for invalid options, confidences whose number differs from the points', or
///         positions or confidences that are not finite
AlignResult align(const PointSet& source, const PointSet& target, const AlignOptions& options = {});

/// Aligns two maps with the confidences of one metric.
/// @param metric nothing: base ICP
/// @throws Error also where a map lacks the metric's input
AlignResult align(const LandmarkMap& source, const LandmarkMap& target,
                  const std::optional<Metric>& metric, const AlignOptions& options = {},
                  const PointSetOptions& point_options = {});

}  // namespace cairn
