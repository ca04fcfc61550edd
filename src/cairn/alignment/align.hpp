// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/alignment/map_bend.hpp"
#include "cairn/confidence/metric.hpp"
#include "cairn/map/landmark_map.hpp"
#include "cairn/placement/place.hpp"
#include "cairn/placement/prepared_map.hpp"
#include "cairn/registration/icp.hpp"

namespace cairn {

enum class AlignMethod {
  kRobust,  ///< search, or from a prior pose a robust refinement: place.hpp, refine.hpp
  kIcp,     ///< the paper's ICP, from the prior pose or else the identity
};

/// What is known of a pose before the maps are looked at.
struct PosePrior {
  Similarity3 target_from_source = {};
  /// Left perturbation in the target's frame, (δt, δφ): how far off it may be. Nothing: anything within
  /// half the extent of the smaller map.
  std::optional<Matrix6d> covariance = {};
};

/// When maps are placed by parts; see map_bend.hpp.
enum class PartsUse {
  kWhereRefused,  ///< where no pose of the whole maps is aligned
  kAlways,        ///< to tell the bend and the parts' poses of every pair
  kNever,
};

/// How two maps are aligned.
struct AlignOptions {
  AlignMethod method = AlignMethod::kRobust;
  /// Nothing: every pose is possible, and is searched for.
  std::optional<PosePrior> prior = {};
  /// Of maps: how far each landmark is trusted; with kIcp nothing is the paper's base ICP.
  std::optional<Metric> confidence = {};
  /// For maps that need not be of one scale; see PlaceOptions. Not with kIcp.
  std::optional<ScaleRange> scale = {};
  std::optional<GravityPrior> gravity = {};  ///< see gravity_prior()
  /// Probability from which a pose is aligned; in [0.5, 1).
  double min_probability = 0.99;
  /// Odds, before anything is looked at, that the maps show one place; see PlaceOptions.
  double prior_odds = 1.0;
  bool one_to_one = false;  ///< kRobust, from a prior pose: match no target landmark twice
  PartsUse parts = PartsUse::kWhereRefused;  ///< kRobust, of maps
  bool judge = true;  ///< without it no pose is aligned: the result has an estimate and no verdict
  /// Work of the search in units of the default's; from 1/16 to 64.
  double effort = 1.0;
  /// Limit of the search in seconds; see PlaceOptions.
  std::optional<double> time_limit_s = {};
  PointSetOptions points = {};  ///< which landmarks of maps take part
  /// Within which distance landmarks count as overlapping; nothing: one that the maps suggest.
  std::optional<double> overlap_radius = {};
  std::uint64_t seed = 0;
  bool trace = false;  ///< keep score and matches of every iteration
  /// For kIcp; its limit of iterations is also that of a refinement from a prior pose. Initial pose,
  /// overlap radius, trace and execution are taken from here above and below.
  IcpOptions icp = {};

  Execution execution = {};

  /// @throws Error (misuse) naming the field, its value and what it may be
  void validate() const;
};

/// What is known of the pose between two maps.
struct Alignment {
  /// Nothing: not judged, for that was not asked for, the method failed, or the caller stopped the work.
  std::optional<Verdict> verdict;
  std::optional<double> probability;  ///< of the estimate; nothing if it was not judged
  std::string reason;                 ///< one sentence for people
  /// Only if the verdict is aligned. x_in_target = target_from_source * x_in_source.
  std::optional<Similarity3> target_from_source;
  /// The best pose that the method found, trusted or not; nothing if it found none.
  std::optional<Similarity3> estimate;
  /// All poses that were held against each other, likeliest first; empty if not judged.
  std::vector<PlacementCandidate> candidates;
  /// How the estimate was come to: score, iterations, history, matches; and its covariance, open
  /// directions and overlap.
  RegistrationResult registration;
  double radius = 0.0;  ///< within which landmarks count as matched; 0 if not judged
  /// The poses of the maps' parts, and whether they agree; std::nullopt if the parts were not placed.
  std::optional<PartsAlignment> parts;
  bool cut_short = false;     ///< by the time limit; see PlacementResult
  bool deterministic = true;  ///< false with a time limit
  double duration_s = 0.0;    ///< wall time of the whole call
};

/// The verdict's word, or, where there is none, "converged", "stopped", "failed" or "cancelled".
std::string_view status_of(const Alignment& alignment);

/// Aligns two clouds of landmarks and says whether the pose can be trusted.
///
/// Whatever finds the pose (the search, a refinement from a prior pose, ICP), it is held against the
/// poses that the search finds: PreparedPair. It is aligned if it is right with the probability asked for,
/// has a covariance, and is determined in every direction.
/// Same input and seed, same result, whatever the executor's number of threads.
///
/// @throws Error (misuse) for invalid options or clouds
Alignment align(const LandmarkCloud& source, const LandmarkCloud& target,
                const AlignOptions& options = {});

/// Aligns two maps, by their landmarks that take part (landmarks_to_align()).
/// @throws Error also (input) where a map lacks the input of the confidence metric
Alignment align(const LandmarkMap& source, const LandmarkMap& target,
                const AlignOptions& options = {});

/// Aligns two maps of which either is aligned with many. AlignOptions::confidence and points stand in the
/// PrepareOptions of each; here they have no effect.
/// @throws Error (misuse) for AlignMethod::kIcp, which takes maps
Alignment align(const PreparedMap& source, const PreparedMap& target,
                const AlignOptions& options = {});

/// Judges a pose as it is, whatever found it, as align() judges its own. Of the options, `method`,
/// `prior` and `judge` have no effect.
/// @throws Error (misuse) for invalid options, or a scale other than 1 without AlignOptions::scale
Alignment judge_pose(const LandmarkCloud& source, const LandmarkCloud& target,
                     const Similarity3& target_from_source, const AlignOptions& options = {});
Alignment judge_pose(const LandmarkMap& source, const LandmarkMap& target,
                     const Similarity3& target_from_source, const AlignOptions& options = {});
Alignment judge_pose(const PreparedMap& source, const PreparedMap& target,
                     const Similarity3& target_from_source, const AlignOptions& options = {});

/// That both maps know where down is: each as it says, or else its negative z axis.
GravityPrior gravity_prior(const LandmarkMap& source, const LandmarkMap& target);
GravityPrior gravity_prior(const PreparedMap& source, const PreparedMap& target);

}  // namespace cairn
