// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <optional>

#include "cairn/alignment/alignment.hpp"
#include "cairn/alignment/prepared_map.hpp"
#include "cairn/confidence/metric.hpp"
#include "cairn/core/execution.hpp"
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
  /// Also estimates the scale, e.g. of maps from a single camera; slower if neither descriptors nor quads decide.
  /// std::nullopt: both maps have one scale. Not with kIcp.
  std::optional<ScaleRange> scale = {};
  /// align(), kRobust, for maps: does so within the default range if the unit of one of them is free.
  bool scale_where_free = true;
  std::optional<GravityPrior> gravity = {};  ///< see gravity_prior()
  /// Least probability of an aligned pose; if only several poses together reach it, they are ambiguous. In [0.5, 1).
  double min_probability = 0.99;
  /// Odds that the maps show the same place, before any evidence: 0.01 if one pair in a hundred does. From 1e-6 to 1e6.
  double prior_odds = 1.0;
  bool one_to_one = false;  ///< kRobust, from a prior pose: match each target landmark at most once
  PartsUse parts = PartsUse::kWhereRefused;  ///< kRobust, for maps
  /// For maps with descriptors and a free scale: also align them up to a smooth deformation (DeformablePair), and
  /// state the deformation of aligned ones. No effect with a time limit.
  bool deformation = true;
  bool judge =
      true;  ///< false: no verdict, and no pose counts as aligned; the result has only the estimate
  PoseSearch search = PoseSearch::kWhereNeeded;
  /// Number of rotations tried, as a multiple of the default's; from 1/16 to 64.
  double effort = 1.0;
  /// Wall time for the search, which then continues with what it has: half for the search for poses, the
  /// rest to refine and judge them. The result then depends on the machine and may differ between runs.
  /// Necessary work (trees, descriptors, overlap) is always done, so the call may take longer. Positive, at
  /// most 1e6; std::nullopt: no limit.
  std::optional<double> time_limit_s = {};
  PointSetOptions points = {};  ///< landmarks of the maps that take part
  /// A landmark overlaps if the other map has one within this distance. std::nullopt: chosen from the maps.
  std::optional<double> overlap_radius = {};
  bool trace = false;  ///< record score and matches of every iteration
  /// For kIcp; max_iterations also limits a refinement from a prior pose. Initial pose, overlap radius
  /// and trace are those of AlignOptions.
  IcpOptions icp = {};

  static const OptionTable table;
  /// @throws Error (misuse) naming the field, its value and the constraint
  void validate() const;
};

/// Range of the scales that align() searches for maps of these units; std::nullopt if both maps have the same scale.
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
                const AlignOptions& options = {}, const Execution& execution = {});

/// Aligns prepared maps, of which each can be aligned with many others. Landmarks without a map are aligned as a whole
/// alone. PrepareOptions of each map replace
/// AlignOptions::confidence and points, which have no effect here.
/// @throws Error (misuse) for AlignMethod::kIcp
Alignment align(const PreparedMap& source, const PreparedMap& target,
                const AlignOptions& options = {}, const Execution& execution = {});

/// Judges a given pose without changing it, as align() judges its own. `method`, `prior` and `judge` have
/// no effect. For maps, their deformation can refuse a pose that fits, and with PartsUse::kAlways so can their
/// parts. Neither makes a pose aligned that is not aligned as a whole, as align() may do with a pose of its own.
/// @throws Error (misuse) for invalid options, or a scale other than 1 where scale_range() has none
Alignment judge_pose(const LandmarkMap& source, const LandmarkMap& target,
                     const Similarity3& target_from_source, const AlignOptions& options = {},
                     const Execution& execution = {});
Alignment judge_pose(const PreparedMap& source, const PreparedMap& target,
                     const Similarity3& target_from_source, const AlignOptions& options = {},
                     const Execution& execution = {});

/// Aligns two maps without an initial pose and judges the pose.
///
/// Descriptors and quads of neighbouring landmarks propose poses. Thousands of evenly spread rotations, each with the
/// translations that best overlay parts of the source and the target, propose more. A tournament of robust refinements on
/// samples of both maps leaves a few distinct poses. With a free scale, rotations are searched at the scales that the
/// quads suggest, and the refinements also estimate the scale. The poses are refined with all sampled
/// landmarks and ranked by probability, from the match distances and descriptors compared with chance
/// (Support) and the free-space check (SightCounts). The best pose is refined with all landmarks and their
/// covariances.
///
/// Lengths derive from the maps: extents, landmark spacings, covariances. An expected failure (too few
/// landmarks, no overlap) is a verdict. The same input and seed give the same result for any number of
/// threads, except with a time limit.
///
/// @throws Error (misuse) for invalid options or clouds
Alignment place(const LandmarkCloud& source, const LandmarkCloud& target,
                const AlignOptions& options = {}, const Execution& execution = {});

/// Finds or judges any number of poses between two maps as a whole, by the options' search, scale, gravity, limits and
/// bars; AlignOptions::method and prior have no effect. Work that all of them share is done once, on first
/// use. Each pose is compared with the candidates of place().
///
/// Evenly spread landmarks stand for a dense cloud (PreparedMap::even()). If that does not give an aligned pose, all
/// landmarks are used too, and the likelier result is returned.
class PreparedPair {
 public:
  /// @throws Error (misuse) for invalid options
  PreparedPair(const PreparedMap& source, const PreparedMap& target,
               const AlignOptions& options = {}, const Execution& execution = {});
  ~PreparedPair();
  PreparedPair(PreparedPair&&) noexcept;
  PreparedPair& operator=(PreparedPair&&) noexcept;

  /// Same as cairn::place().
  Alignment place();

  /// Judges a given pose without changing it. It is aligned only if gravity and scale range allow it, it is
  /// likelier than every other pose and no worse than the best pose near it.
  /// @throws Error (misuse) for a scale other than 1 without AlignOptions::scale
  Alignment judge(const Similarity3& target_from_source);

  /// Refines a pose to the nearest optimum and judges that.
  /// @throws Error as judge()
  Alignment settle(const Similarity3& target_from_source);

 private:
  class Work;
  template <class Judge>
  Alignment likeliest(const Judge& judge);

  std::unique_ptr<Work> even_;  // null unless a cloud is dense
  std::unique_ptr<Work> work_;  // null until all landmarks are needed
};

/// The vertical of both maps: each map's stored gravity direction, or its negative z axis if it has none.
GravityPrior gravity_prior(const LandmarkMap& source, const LandmarkMap& target);
GravityPrior gravity_prior(const PreparedMap& source, const PreparedMap& target);

}  // namespace cairn
