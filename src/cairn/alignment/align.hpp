// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <optional>
#include <string>

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
  /// Covariance of the left perturbation (δt, δφ) in the target's frame. std::nullopt: the error
  /// may reach half the extent of the smaller map.
  std::optional<Matrix6d> covariance = {};
};

/// When to place parts of the maps separately; see place_by_parts().
enum class PartsUse {
  kWhereRefused,  ///< if the whole maps are not aligned
  kAlways,        ///< for every pair, to estimate the bend and the parts' poses
  kNever,
};

/// Options of align().
struct AlignOptions {
  AlignMethod method = AlignMethod::kRobust;
  /// std::nullopt: search for the pose.
  std::optional<PosePrior> prior = {};
  /// For maps: metric of the landmarks' confidences. std::nullopt with kIcp: the paper's base ICP.
  std::optional<Metric> confidence = {};
  /// Range of the scale to estimate, e.g. for maps from a single camera. Slower if neither
  /// descriptors nor quads determine the pose. std::nullopt: both maps have one scale. Not
  /// available with kIcp.
  std::optional<ScaleRange> scale = {};
  /// kRobust, for maps: align() estimates the scale within the default range if one map's unit is
  /// free.
  bool scale_where_free = true;
  std::optional<GravityPrior> gravity = {};  ///< see gravity_prior()
  /// Least probability of an aligned pose; in [0.5, 1). If only several poses together reach this
  /// value, they are ambiguous.
  double min_probability = 0.99;
  /// Prior odds that the maps show the same place, e.g. 0.01 if one pair in a hundred does; from
  /// 1e-6 to 1e6.
  double prior_odds = 1.0;
  bool one_to_one = false;  ///< kRobust, from a prior pose: match each target landmark at most once
  PartsUse parts = PartsUse::kWhereRefused;  ///< kRobust, for maps
  /// For maps with descriptors and a free scale: also aligns them up to a smooth deformation
  /// (DeformablePair), and reports the deformation of aligned maps. No effect with a time limit.
  bool deformation = true;
  bool judge =
      true;  ///< false: no verdict and no aligned pose; the result contains only the estimate
  PoseSearch search = PoseSearch::kWhereNeeded;
  /// Number of rotations searched, as a multiple of the default; from 1/16 to 64.
  double effort = 1.0;
  /// Limit of the wall time: half for the search for poses, the rest for refinement and verdict of
  /// the poses found so far. The result then depends on the machine and may differ between runs.
  /// Necessary work (trees, descriptors, overlap) is always completed, so the call may exceed the
  /// limit. Positive, at most 1e6; std::nullopt: no limit.
  std::optional<double> time_limit_s = {};
  PointSetOptions points = {};  ///< selects the landmarks to align
  /// A landmark overlaps if the other map has a landmark within this distance. std::nullopt: chosen
  /// from the maps.
  std::optional<double> overlap_radius = {};
  bool trace = false;  ///< record score and matches of every iteration
  /// Options of kIcp. max_iterations also limits a refinement from a prior pose. AlignOptions
  /// overrides the initial pose, overlap radius and trace.
  IcpOptions icp = {};

  static const OptionTable table;
  /// @throws Error (misuse) naming the field, its value and the constraint
  void validate() const;
};

/// Range of the scales that align() searches for maps of these units; std::nullopt if both maps
/// have the same scale.
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

/// Aligns prepared maps; each can be aligned with many others. Maps prepared from a LandmarkCloud
/// are aligned only as a whole. The PrepareOptions of each map replace AlignOptions::confidence and
/// AlignOptions::points.
/// @throws Error (misuse) for AlignMethod::kIcp
Alignment align(const PreparedMap& source, const PreparedMap& target,
                const AlignOptions& options = {}, const Execution& execution = {});

/// Judges a given pose without changing it, by the criteria of align(). `method`, `prior` and
/// `judge` have no effect. For maps, a large deformation can prevent the verdict "aligned"; with
/// PartsUse::kAlways, contradicting parts can too. Unlike align(), does not accept a pose by
/// deformation or parts if the maps as a whole are not aligned.
/// @throws Error (misuse) for invalid options, or for a scale other than 1 if scale_range() is
///        std::nullopt
Alignment judge_pose(const LandmarkMap& source, const LandmarkMap& target,
                     const Similarity3& target_from_source, const AlignOptions& options = {},
                     const Execution& execution = {});
Alignment judge_pose(const PreparedMap& source, const PreparedMap& target,
                     const Similarity3& target_from_source, const AlignOptions& options = {},
                     const Execution& execution = {});

/// Aligns two maps without an initial pose and judges the pose.
///
/// Descriptors and quads propose poses. A quad is a landmark and three of its nearest neighbours.
/// Further candidates are thousands of evenly spread rotations, each with the translations that
/// best overlay parts of the source and the target. A tournament of robust refinements on samples
/// of both maps leaves a few distinct poses. With a free scale, rotations are searched at the
/// scales that the quads suggest, and the refinements also estimate the scale. The poses are
/// refined with all sampled landmarks and ranked by probability. The probability combines match
/// distances and descriptors, both compared with chance (Support), and the free-space check
/// (SightCounts). The best pose is refined with all landmarks and their covariances.
///
/// All lengths derive from the maps' extents, landmark spacings and covariances. An expected
/// failure (too few landmarks, no overlap) is reported as a verdict. The same input and seed give
/// the same result for any number of threads, except with a time limit.
///
/// @throws Error (misuse) for invalid options or clouds
Alignment place(const LandmarkCloud& source, const LandmarkCloud& target,
                const AlignOptions& options = {}, const Execution& execution = {});

/// Finds or judges any number of poses between two maps as a whole, with the search, scale,
/// gravity, limits and thresholds of the options. AlignOptions::method and prior have no effect.
/// Work that all poses share is done once, on first use. Each pose is compared with the candidates
/// of place().
///
/// Evenly spread landmarks represent a dense cloud (PreparedMap::even()). If they give no aligned
/// pose, all landmarks are used too, and the likelier result is returned.
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

  /// Judges a given pose without changing it. The pose is aligned only if gravity and scale range
  /// allow it, if no other pose is as likely, and if the best pose near it is no better.
  /// @throws Error (misuse) for a scale other than 1 without AlignOptions::scale
  Alignment judge(const Similarity3& target_from_source);

  /// Refines a pose to the nearest optimum and judges the optimum.
  /// @throws Error as judge()
  Alignment settle(const Similarity3& target_from_source);

 private:
  class Work;
  template <class Judge>
  Alignment likeliest(const Judge& judge);

  std::unique_ptr<Work> even_;  // null unless a cloud is dense
  std::unique_ptr<Work> work_;  // null until all landmarks are needed
};

/// The vertical of both maps: the stored gravity direction, or else the map's negative z axis.
GravityPrior gravity_prior(const LandmarkMap& source, const LandmarkMap& target);
GravityPrior gravity_prior(const PreparedMap& source, const PreparedMap& target);

/// Checks that a map and its model are in one frame, e.g. a splat map and the SfM model that it was
/// trained on: at least half of the model's landmarks have a landmark of the map within 2 % of the
/// model's radius.
/// @param name of the map
/// @throws Error (input) naming the map
void require_one_frame(const LandmarkMap& map, const LandmarkMap& model, const std::string& name);

}  // namespace cairn
