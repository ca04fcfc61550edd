// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>

#include "cairn/alignment/alignment.hpp"
#include "cairn/alignment/prepared_map.hpp"
#include "cairn/confidence/metric.hpp"
#include "cairn/core/option_table.hpp"
#include "cairn/map/landmark_map.hpp"
#include "cairn/registration/icp.hpp"

namespace cairn {

enum class AlignMethod {
  kRobust,  ///< search, or robust refinement from a prior pose: place(), refine()
  kIcp,     ///< the paper's ICP, from the prior pose or else the identity
};

/// Initial knowledge of a pose.
struct PosePrior {
  Similarity3 target_from_source = {};
  /// Covariance of the left perturbation (δt, δφ) in the target's frame. std::nullopt: the prior may be off
  /// by half the extent of the smaller map.
  std::optional<Matrix6d> covariance = {};
};

/// When parts of the maps are placed separately; see place_by_parts().
enum class PartsUse {
  kWhereRefused,  ///< if the whole maps are not aligned
  kAlways,        ///< for every pair, to get the bend and the parts' poses
  kNever,
};

/// Options of align().
struct AlignOptions {
  AlignMethod method = AlignMethod::kRobust;
  /// std::nullopt: search for the pose.
  std::optional<PosePrior> prior = {};
  /// For maps: metric of the landmarks' confidences. std::nullopt with kIcp: the paper's base ICP.
  std::optional<Metric> confidence = {};
  /// Also estimates the scale, within this range; see PlaceOptions. Not with kIcp.
  std::optional<ScaleRange> scale = {};
  /// kRobust, for maps: does so within the default range if the unit of one of them is free.
  bool scale_where_free = true;
  std::optional<GravityPrior> gravity = {};  ///< see gravity_prior()
  /// Least probability of an aligned pose; in [0.5, 1).
  double min_probability = 0.99;
  /// Odds that the maps show the same place, before any evidence; see PlaceOptions.
  double prior_odds = 1.0;
  bool one_to_one = false;  ///< kRobust, from a prior pose: match each target landmark at most once
  PartsUse parts = PartsUse::kWhereRefused;  ///< kRobust, for maps
  /// For maps with descriptors and a free scale: also align them up to a smooth deformation (DeformablePair), and
  /// state the deformation of aligned ones. No effect with a time limit.
  bool deformation = true;
  bool judge =
      true;  ///< false: no verdict, and no pose counts as aligned; the result has only the estimate
  /// Work of the search, as a multiple of the default's; from 1/16 to 64.
  double effort = 1.0;
  /// Time limit of the search in seconds; see PlaceOptions.
  std::optional<double> time_limit_s = {};
  PointSetOptions points = {};  ///< landmarks of the maps that take part
  /// A landmark overlaps if the other map has one within this distance. std::nullopt: chosen from the maps.
  std::optional<double> overlap_radius = {};
  std::uint64_t seed = 0;
  bool trace = false;  ///< record score and matches of every iteration
  /// For kIcp; max_iterations also limits a refinement from a prior pose. Initial pose, overlap radius,
  /// trace and execution are those of AlignOptions.
  IcpOptions icp = {};

  Execution execution = {};

  static const OptionTable table;
  /// @throws Error (misuse) naming the field, its value and the constraint
  void validate() const;
};

/// Range of the scales that align() searches for maps of these units; std::nullopt if both have one scale.
std::optional<ScaleRange> scale_range(const AlignOptions& options, LengthUnit source,
                                      LengthUnit target);

/// Aligns two maps by the landmarks that landmarks_to_align() selects, and judges the pose.
///
/// Compares the method's pose (from the search, a refinement or ICP) with the poses that the search finds:
/// see PreparedPair. The pose is aligned if its probability is at least `min_probability`, it has a
/// covariance, and the matches determine every direction. The same input and seed give the same result for
/// any number of threads.
///
/// @throws Error (misuse) for invalid options, or (input) if a map lacks the input of the confidence metric
Alignment align(const LandmarkMap& source, const LandmarkMap& target,
                const AlignOptions& options = {});

/// Aligns prepared maps, of which each can be aligned with many others. Landmarks without a map are aligned as a whole
/// alone. PrepareOptions of each map replace
/// AlignOptions::confidence and points, which have no effect here.
/// @throws Error (misuse) for AlignMethod::kIcp
Alignment align(const PreparedMap& source, const PreparedMap& target,
                const AlignOptions& options = {});

/// Judges a given pose without changing it, as align() judges its own. `method`, `prior` and `judge` have
/// no effect. For maps, their deformation can refuse a pose that fits, and with PartsUse::kAlways so can their
/// parts. Neither makes a pose aligned that is not aligned as a whole, as align() may do with a pose of its own.
/// @throws Error (misuse) for invalid options, or a scale other than 1 where scale_range() has none
Alignment judge_pose(const LandmarkMap& source, const LandmarkMap& target,
                     const Similarity3& target_from_source, const AlignOptions& options = {});
Alignment judge_pose(const PreparedMap& source, const PreparedMap& target,
                     const Similarity3& target_from_source, const AlignOptions& options = {});

/// The vertical of both maps: each map's stored gravity direction, or its negative z axis if it has none.
GravityPrior gravity_prior(const LandmarkMap& source, const LandmarkMap& target);
GravityPrior gravity_prior(const PreparedMap& source, const PreparedMap& target);

}  // namespace cairn
