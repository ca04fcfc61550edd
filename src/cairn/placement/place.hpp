// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "cairn/core/execution.hpp"
#include "cairn/placement/landmark_cloud.hpp"
#include "cairn/placement/prepared_cloud.hpp"
#include "cairn/placement/verdict.hpp"
#include "cairn/registration/icp.hpp"

namespace cairn {

/// A known downward direction in both maps, which leaves open the turn about it and a small tilt.
struct GravityPrior {
  Eigen::Vector3d source = -Eigen::Vector3d::UnitZ();  ///< downwards, in the source's frame
  Eigen::Vector3d target = -Eigen::Vector3d::UnitZ();  ///< and in the target's
  double max_tilt_rad = 0.17;                          ///< most that the two may differ; in (0, π]
};

/// Numbers among which is the one that the source's lengths are multiplied by to be in the target's unit.
/// Looked for are those of them that are no more than about three times off what the maps' extents and
/// spacings suggest: of a map that is less than a tenth of the other, no scale is found.
struct ScaleRange {
  double least = 1.0 / 20.0;
  double most = 20.0;
};

/// When rotations are searched. Where many mutual matches of descriptors agree on a pose, that decides.
enum class PoseSearch {
  kWhereNeeded,  ///< where descriptors do not decide
  kAlways,
  kNever,  ///< descriptors alone propose poses: fast, and without them nothing is found
};

/// How to place a map from no initial pose.
struct PlaceOptions {
  std::uint64_t seed = 0;
  /// Work in units of the default's: how many rotations are tried; from 1/16 to 64.
  double effort = 1.0;
  PoseSearch search = PoseSearch::kWhereNeeded;
  /// How much likelier it is, before anything is looked at, that the maps show one place than that they do
  /// not: 0.01 where of a hundred pairs one does. From 1e-6 to 1e6.
  double prior_odds = 1.0;
  /// From which probability a pose is aligned, and poses between them are ambiguous; in [0.5, 1).
  double min_probability = 0.99;
  std::optional<GravityPrior> gravity = {};
  /// For maps that need not be of one scale, such as those of a single camera; takes some times longer
  /// where descriptors do not decide. Nothing: both maps are of one scale.
  std::optional<ScaleRange> scale = {};
  /// Wall time after which the search makes do with what it has: half of it for the search for poses,
  /// the rest to refine and judge them. What is found then depends on the machine, and so can be another
  /// from run to run. What has to be done whatever is found (trees, descriptors, overlap) is done, so the
  /// whole may take longer. Positive, at most 1e6; nothing: no limit.
  std::optional<double> time_limit_s = {};
  bool use_covariances = true;  ///< in the final refinement; see RefineOptions
  /// Within which distance the refined result's landmarks count as overlapping; nothing: the
  /// placement's own radius.
  std::optional<double> overlap_radius = {};
  bool trace = false;  ///< keep score and matches of every iteration of the final refinement

  Execution execution = {};

  /// @throws Error (misuse) naming the field, its value and what it may be
  void validate() const;
};

struct PlacementResult {
  Verdict verdict = Verdict::kRejected;
  std::string reason;  ///< one sentence for people, with its numbers
  /// The best pose, refined with all landmarks, with its covariance and overlap both ways; failed if
  /// there is none. Its status says nothing of how right the pose is: the verdict does.
  RegistrationResult alignment;
  /// Likeliest first. Of a placement the first is what was refined, the second the runner-up.
  std::vector<PlacementCandidate> candidates;
  double probability = 0.0;  ///< that the pose is right
  /// The candidate that the pose is; nothing for a judged pose that is near a better candidate.
  std::optional<std::size_t> own;
  double radius = 0.0;  ///< within which landmarks count as matched
  /// What lines of sight say of the landmarks around those that match, at the likeliest candidate.
  SightCounts around = {};
  /// The time limit cut the work short: a pose that the search would have found may be missing, and the
  /// probability does not know; or the last refinement did not come to its end.
  bool cut_short = false;
  bool time_limited = false;  ///< there was a limit, whether it cut anything short or not
  double duration_s = 0.0;    ///< wall time of the whole call
};

/// Aligns two maps from no initial pose, and says whether the pose can be trusted.
///
/// Search: from thousands of evenly spread rotations, each with the translations that put parts of the
/// source on parts of the target, a tournament of robust refinements on samples of both maps leaves a few
/// distinct poses. Where the scale is open, this is done at scales a quarter apart, about what the maps'
/// extents and spacings suggest, and the refinements that follow free the scale. The poses are refined
/// against all landmarks of the samples and ranked by how likely they are right: from how much closer
/// landmarks meet than by chance and how many of them look alike (Support), and from what the keyframes of
/// either map say of the other's landmarks (SeenViews). The best is refined once more with all
/// landmarks and their covariances.
///
/// Lengths come from the maps: their extents, the spacing of their landmarks, their covariances. An
/// expected failure (too few landmarks, nothing in common) is a verdict. Same input and seed, same
/// result, whatever the executor's number of threads; with a time limit, see there.
///
/// @throws Error (misuse) for invalid options or clouds
PlacementResult place(const LandmarkCloud& source, const LandmarkCloud& target,
                      const PlaceOptions& options = {});

/// A pair of maps between which any number of poses is found or judged; what all of them need is computed
/// once, when it is first needed. What a pose is held against are the poses that place() chooses among.
class PreparedPair {
 public:
  /// @throws Error (misuse) for invalid options
  PreparedPair(const PreparedCloud& source, const PreparedCloud& target,
               const PlaceOptions& options = {});
  /// @throws Error (misuse) for invalid clouds too
  PreparedPair(const LandmarkCloud& source, const LandmarkCloud& target,
               const PlaceOptions& options = {});
  ~PreparedPair();
  PreparedPair(PreparedPair&&) noexcept;
  PreparedPair& operator=(PreparedPair&&) noexcept;

  /// What cairn::place() gives.
  PlacementResult place();

  /// Judges a pose as it is, whatever found it. It is aligned only if it is likelier than every other
  /// pose, and if it is no worse than the best pose near it.
  /// @throws Error (misuse) for a scale other than 1, unless PlaceOptions::scale is given
  PlacementResult judge(const Similarity3& target_from_source);

  /// Moves a pose to the optimum near it and judges that.
  /// @throws Error as judge()
  PlacementResult settle(const Similarity3& target_from_source);

 private:
  class Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace cairn
