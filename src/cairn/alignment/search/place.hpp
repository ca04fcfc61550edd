// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "cairn/alignment/evidence/verdict.hpp"
#include "cairn/alignment/landmark_cloud.hpp"
#include "cairn/alignment/prepared_cloud.hpp"
#include "cairn/core/execution.hpp"
#include "cairn/registration/icp.hpp"

namespace cairn {

/// The downward direction in both maps. The rotation about it and a small tilt remain free.
struct GravityPrior {
  Eigen::Vector3d source = -Eigen::Vector3d::UnitZ();  ///< downwards, in the source's frame
  Eigen::Vector3d target = -Eigen::Vector3d::UnitZ();  ///< the same in the target's
  double max_tilt_rad = 0.17;  ///< largest angle between the two after alignment; in (0, π]
};

/// Bounds of s in x_target = R·(s·x_source) + t. The search tries only scales within about three times of
/// what the maps' extents and spacings suggest; a map less than a tenth of the other's size is not found.
struct ScaleRange {
  double least = 1.0 / 20.0;
  double most = 20.0;
};

/// When rotations are searched. If many mutual descriptor matches agree on a pose, they decide.
enum class PoseSearch {
  kWhereNeeded,  ///< if descriptors do not decide
  kAlways,
  kNever,  ///< only descriptors propose poses: fast, and finds no pose without them
};

/// Options of place().
struct PlaceOptions {
  std::uint64_t seed = 0;
  /// Number of rotations tried, as a multiple of the default's; from 1/16 to 64.
  double effort = 1.0;
  PoseSearch search = PoseSearch::kWhereNeeded;
  /// Odds that the maps show the same place, before any evidence: 0.01 if one pair in a hundred does. From
  /// 1e-6 to 1e6.
  double prior_odds = 1.0;
  /// Least probability of an aligned pose; if only several poses together reach it, they are ambiguous. In
  /// [0.5, 1).
  double min_probability = 0.99;
  std::optional<GravityPrior> gravity = {};
  /// Also estimates the scale, e.g. of maps from a single camera; several times slower if descriptors do
  /// not decide. std::nullopt: both maps have one scale.
  std::optional<ScaleRange> scale = {};
  /// Wall time for the search, which then continues with what it has: half for the search for poses, the
  /// rest to refine and judge them. The result then depends on the machine and may differ between runs.
  /// Necessary work (trees, descriptors, overlap) is always done, so the call may take longer. Positive, at
  /// most 1e6; std::nullopt: no limit.
  std::optional<double> time_limit_s = {};
  bool use_covariances = true;  ///< in the final refinement; see RefineOptions
  /// A landmark of the result overlaps if the other map has one within this distance. std::nullopt: the
  /// placement's radius.
  std::optional<double> overlap_radius = {};
  bool trace = false;  ///< record score and matches of every iteration of the final refinement

  Execution execution = {};

  /// @throws Error (misuse) naming the field, its value and the constraint
  void validate() const;
};

/// Why the gravity or the range of scales of `options` does not allow a pose; std::nullopt if they do.
std::optional<std::string> forbidden(const Similarity3& target_from_source,
                                     const PlaceOptions& options);

struct PlacementResult {
  Verdict verdict = Verdict::kRejected;
  std::string reason;  ///< one sentence for people, the decision first
  /// The best pose, refined with all landmarks, with its covariance and overlap both ways; failed if there
  /// is none. Its status is that of the refinement; the verdict says whether the pose is right.
  RegistrationResult alignment;
  /// Likeliest first. In place(), the first is the refined pose, the second the runner-up.
  std::vector<PlacementCandidate> candidates;
  double probability = 0.0;  ///< that the pose is right
  /// Index of the candidate with this pose; std::nullopt for a judged pose that is near a better candidate.
  std::optional<std::size_t> own;
  double radius = 0.0;  ///< landmarks within this distance count as matched
  /// Free-space check of the landmarks around the matches, at the likeliest candidate.
  SightCounts around = {};
  /// The time limit ended the search or the last refinement early. A pose may be missing from the
  /// candidates, and the probability does not account for it.
  bool cut_short = false;
  bool time_limited = false;  ///< there was a time limit, whether or not it had an effect
  double duration_s = 0.0;    ///< wall time of the whole call
};

/// Aligns two maps without an initial pose and judges the pose.
///
/// Starts from thousands of evenly spread rotations, each with the translations that best overlay parts of
/// the source and the target. A tournament of robust refinements on samples of both maps leaves a few
/// distinct poses. With a free scale, this runs at scales a quarter apart around what the extents and
/// spacings suggest, and the refinements also estimate the scale. The poses are refined with all sampled
/// landmarks and ranked by probability, from the match distances and descriptors compared with chance
/// (Support) and the free-space check (SeenViews). The best pose is refined with all landmarks and their
/// covariances.
///
/// Lengths derive from the maps: extents, landmark spacings, covariances. An expected failure (too few
/// landmarks, no overlap) is a verdict. The same input and seed give the same result for any number of
/// threads, except with a time limit.
///
/// @throws Error (misuse) for invalid options or clouds
PlacementResult place(const LandmarkCloud& source, const LandmarkCloud& target,
                      const PlaceOptions& options = {});

/// Finds or judges any number of poses between two maps. Work that all of them share is done once, on first
/// use. Each pose is compared with the candidates of place().
class PreparedPair {
 public:
  /// @throws Error (misuse) for invalid options
  PreparedPair(const PreparedCloud& source, const PreparedCloud& target,
               const PlaceOptions& options = {});
  /// @throws Error (misuse) also for invalid clouds
  PreparedPair(const LandmarkCloud& source, const LandmarkCloud& target,
               const PlaceOptions& options = {});
  ~PreparedPair();
  PreparedPair(PreparedPair&&) noexcept;
  PreparedPair& operator=(PreparedPair&&) noexcept;

  /// Same as cairn::place().
  PlacementResult place();

  /// Judges a given pose without changing it. It is aligned only if gravity and scale range allow it, it is
  /// likelier than every other pose and no worse than the best pose near it.
  /// @throws Error (misuse) for a scale other than 1 without PlaceOptions::scale
  PlacementResult judge(const Similarity3& target_from_source);

  /// Refines a pose to the nearest optimum and judges that.
  /// @throws Error as judge()
  PlacementResult settle(const Similarity3& target_from_source);

 private:
  class Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace cairn
