// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/core/ids.hpp"
#include "cairn/geometry/similarity3.hpp"
#include "cairn/pose_graph/pose_graph.hpp"
#include "cairn/registration/result.hpp"

namespace cairn {

/// Descriptor similarity of the landmarks that a pose matches.
struct Likeness {
  /// Two landmarks are similar if their descriptor distance beats the distances of one of them to this many
  /// others.
  static constexpr std::size_t kOthers = 63;
  /// Share of similar pairs among unrelated landmarks.
  static constexpr double kChance = 1.0 / (kOthers + 1);

  std::size_t compared = 0;  ///< pairs of landmarks with descriptors
  std::size_t alike = 0;     ///< similar pairs

  Likeness& operator+=(const Likeness& other);
  Likeness operator-(const Likeness& other) const;

  /// Log-likelihood ratio, for the likeliest share of pairs that are the same landmark, versus chance. At
  /// least 0.
  double evidence() const;
};

/// How many matches agree with a pose: mutual descriptor matches, and landmarks that keypoints of common images show
/// to be the same. The matches are found without the pose.
struct DescriptorAgreement {
  std::size_t matches = 0;
  std::size_t agreeing = 0;  ///< matches whose landmarks the pose brings within the radius
  /// Agreeing matches outside their largest cluster: excludes a single object that stands in two places.
  std::size_t spread = 0;
  /// Number of agreeing matches expected by chance, with random partners, on this pair and pose.
  double expected = 0.0;
  /// Of `matches` and of `agreeing`: those of landmarks that one keypoint shows, of an image that both maps contain.
  std::size_t identities = 0;
  std::size_t identical = 0;

  /// Whether such keypoints show that the pose is right: at least four, and most of all of them.
  bool is_proven() const { return identical >= 4 && 2 * identical > identities; }

  /// Log-likelihood ratio of `spread` against a Poisson count of mean `expected`, at least 0.
  double evidence() const;
};

/// Log-likelihood ratio of the distances at one pose: some pairs are the same landmark, with Gaussian
/// errors, versus all pairs being as far apart as at the other poses.
struct ProximityEvidence {
  static constexpr double kWidest = 0.14;  ///< largest standard deviation considered, in spacings

  double all = 0.0;     ///< for the likeliest share and error of common landmarks; at least 0
  double spread = 0.0;  ///< without the sixteenth of the source that contributes most
  double share = 0.0;   ///< likeliest share of the pairs
  /// Likeliest standard deviation of the errors along an axis, in spacings.
  double deviation = 0.0;
};

/// What two maps have in common at a pose.
struct Support {
  /// Mutual nearest neighbours within r, r/2, r/4, ... of the radius r, in the sample.
  static constexpr std::size_t kRadii = 6;
  std::array<std::size_t, kRadii> within = {};
  /// Of `within`: the widest radius, a quarter of r, at which most matches are no chance.
  static constexpr std::size_t kFine = 2;
  /// One-to-one matches of all landmarks, as a share of the smaller map, estimated from the sample; at most 1.
  /// Mapping many landmarks onto one does not increase it.
  double share = 0.0;
  /// Log-likelihood ratio of the match distances, of all mutual nearest neighbours at any distance: some
  /// are the same landmarks, versus independent points on a surface. At least 0.
  double evidence = 0.0;
  /// The same without the sixteenth of the source that contributes most: excludes a single object that
  /// stands in both places.
  double spread_evidence = 0.0;
  /// Log-likelihood ratio of the match distances, versus those at the other candidates.
  ProximityEvidence proximity = {};
  /// Agreement of matches with the pose; std::nullopt if the maps have neither descriptors of one kind nor common
  /// images.
  std::optional<DescriptorAgreement> agreement = {};
  /// Descriptor similarity of the matches; std::nullopt if the maps have no descriptors of one kind.
  std::optional<Likeness> likeness = {};
  /// The likeness evidence without the sixteenth of the source that contributes most.
  double spread_likeness = 0.0;

  std::size_t matches() const { return within[0]; }
};

/// Free-space check: counts of landmarks relative to what the other map's keyframes saw along the same
/// lines of sight. The space in front of a seen landmark is free.
struct SightCounts {
  std::size_t agree = 0;     ///< landmarks at the depth of what the camera saw
  std::size_t in_front = 0;  ///< landmarks in front of it, in free space: a contradiction
  std::size_t behind = 0;    ///< landmarks behind it, hidden from the camera

  std::size_t total() const { return agree + in_front + behind; }
  SightCounts& operator+=(const SightCounts& other);
};

/// What surrounds the matches of a pose: the landmarks outside a ball that covers nearly all of them. An object that stands
/// in two places matches as well as a place does; its surroundings reveal the difference.
struct Surroundings {
  /// Numbers of landmarks around the ball, in both maps, grouped by the majority of the other map's lines of sight.
  /// Lines of sight into the ball are not compared.
  SightCounts landmarks = {};
  double extent = 0.0;  ///< radius of the ball, in matching radii; 0 without matches
  double share =
      0.0;  ///< of the landmarks of a map that are outside the ball; the smaller of both maps'
};

/// A candidate pose, distinct from the others.
struct PlacementCandidate {
  Rigid3 target_from_source;
  double scale = 1.0;  ///< s in x_target = R·(s·x_source) + t
  Support support = {};
  /// Share of compared lines of sight, of both maps' keyframes, on which the other map has a landmark in
  /// front of what the keyframe saw. std::nullopt if too few lines were compared. See SightCounts.
  std::optional<double> contradicted = {};
  /// Probability that this pose is right. 1 minus the sum over all candidates is that none is.
  double probability = 0.0;

  /// The pose with its scale.
  Similarity3 similarity() const { return {scale, target_from_source}; }
};

/// Which of the two maps of an alignment.
enum class MapRole { kSource, kTarget };

/// "source" or "target": the names in results.
std::string_view to_string(MapRole role);

/// Part of one map, placed in the whole other map.
struct PartPose {
  MapRole map = MapRole::kSource;
  FrameId first;  ///< keyframes of the part
  FrameId middle;
  FrameId last;
  std::size_t landmarks = 0;
  Verdict verdict = Verdict::kRejected;  ///< on the part alone
  double probability = 0.0;              ///< of `found`
  /// The pose of the part alone, whatever its verdict. x_in_target = target_from_source * x_in_source.
  std::optional<Similarity3> found;
  /// `found` is aligned separately, or agrees with neighbouring parts that are.
  bool agrees = false;
  /// Pose of the part under the consensus: `found` if it agrees, else interpolated between the neighbouring
  /// parts. std::nullopt without a consensus of parts (see place_by_parts()).
  std::optional<Similarity3> target_from_source;
};

/// Deviation of a map from a rigid one, as the other map shows it.
struct MapBend {
  MapRole map = MapRole::kSource;
  /// Largest rotation between the poses of two parts, after smoothing; radians.
  double rotation_rad = 0.0;
  FrameId first;  ///< the bend lies between these keyframes
  FrameId last;
  /// Largest root mean square distance of a part's landmarks from their places under the single pose, in
  /// the target's unit.
  double displacement = 0.0;
};

/// Smooth deformation of two maps of free scale against each other. It does not show which of them is deformed.
struct MapDeformation {
  std::size_t matches = 0;    ///< descriptor matches that agree with it
  double rotation_rad = 0.0;  ///< largest rotation between the local poses of two landmarks
  double scale_ratio = 1.0;   ///< largest ratio of their scales
  /// Root mean square distance of the matches under the single pose, in the target's unit.
  double displacement = 0.0;
};

/// Result of place_by_parts().
struct PartsAlignment {
  std::vector<PartPose> parts;  ///< parts of the source first, in the order of their keyframes
  std::size_t aligned = 0;      ///< number of parts that are aligned separately
  /// At least two parts of one map are aligned separately, with landmarks of two parts of the other, and
  /// agree up to a bend; no aligned part contradicts them.
  bool consensus = false;
  bool contradictory = false;  ///< parts that are aligned separately contradict each other
  /// Whether the straightened map is aligned as a whole; std::nullopt if not tested.
  std::optional<bool> confirmed = {};
  std::optional<MapBend> bend;  ///< with a consensus
  /// With a consensus: the pose that fits all landmarks of the bent map best, each at the place that its
  /// part's pose gives. The covariance includes the deviations of the parts' poses from it.
  std::optional<Similarity3> target_from_source;
  std::optional<Matrix6d> covariance;
  std::optional<Matrix7d> covariance_with_scale = {};  ///< the same, if a scale is estimated
  double probability = 0.0;                            ///< the largest of the parts that agree
};

/// Standard deviations of a pose along and about the target's axes.
struct PoseDeviations {
  Eigen::Vector3d translation =
      Eigen::Vector3d::Zero();  ///< of a point of the source; the target's unit
  Eigen::Vector3d rotation_rad = Eigen::Vector3d::Zero();
  std::optional<double> log_scale = {};  ///< if a scale was estimated
};

/// Result of an alignment.
struct Alignment {
  /// std::nullopt if not judged: `judge` is false, the method failed, or the caller stopped the work.
  std::optional<Verdict> verdict;
  std::optional<double> probability;  ///< of the estimate; std::nullopt if not judged
  std::string reason;                 ///< one sentence for people, the decision first
  /// Only if the verdict is aligned. x_in_target = target_from_source * x_in_source.
  std::optional<Similarity3> target_from_source;
  /// The best pose, whatever the verdict; std::nullopt if the method found none.
  std::optional<Similarity3> estimate;
  /// All poses compared, likeliest first; empty if not judged. After place(), the first is the refined pose, the second
  /// the runner-up.
  std::vector<PlacementCandidate> candidates;
  /// Index of the candidate with the estimate; std::nullopt for a judged pose that is near a better candidate.
  std::optional<std::size_t> own;
  /// At the likeliest candidate.
  Surroundings around;
  /// Score, iterations, history and matches of the estimate; its covariance, open directions and overlap.
  RegistrationResult registration;
  /// Centre of the source's landmarks, in its frame; std::nullopt if read from a document that does not state it.
  std::optional<Eigen::Vector3d> centre;
  double radius = 0.0;  ///< landmarks within this distance count as matched; 0 if unknown
  /// Poses of the maps' parts, and whether they agree; std::nullopt if no parts were placed.
  std::optional<PartsAlignment> parts;
  /// How the maps are deformed against each other, if they clearly are; covariances then include the deviations of
  /// the landmarks' local poses from the single one. std::nullopt if not tested.
  std::optional<MapDeformation> deformation;
  /// For maps that are not aligned at one scale, but whose descriptors agree on a pose with this scale of the source: one
  /// of their units is probably wrong.
  std::optional<double> other_scale;
  std::size_t common_images = 0;  ///< images that both maps contain: see common_images()
  bool one_map = false;           ///< one map is a copy of the other: that they align shows nothing
  /// The time limit ended the search or the last refinement early. A pose may be missing from the candidates, and the
  /// probability does not account for it.
  bool cut_short = false;
  bool deterministic = true;  ///< false with a time limit
  double duration_s = 0.0;    ///< wall time of the whole call
};

/// Standard deviations of the estimate at `centre`, or else at the source's origin, where they are larger the farther
/// that is from the landmarks. std::nullopt without a covariance.
std::optional<PoseDeviations> deviations_of(const Alignment& alignment);

/// Name of the verdict; if there is none, "converged", "stopped", "failed" or "cancelled".
std::string_view status_of(const Alignment& alignment);

/// A probability for people, in percent, rounded down to two digits, from 99.99 % on to four. It never reads
/// 0 % or 100 %.
std::string probability_text(double probability);

/// "probability 12.30 %, below the required 99 %": the start of a reason.
std::string decision_text(double probability, double required);

}  // namespace cairn
