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
  /// Two landmarks are similar if their descriptor distance is less than the distance from one of
  /// them to each of this many random landmarks of the other's map.
  static constexpr std::size_t kOthers = 63;
  /// Share of similar pairs among unrelated landmarks.
  static constexpr double kChance = 1.0 / (kOthers + 1);

  std::size_t compared = 0;  ///< pairs of landmarks with descriptors
  std::size_t alike = 0;     ///< similar pairs

  Likeness& operator+=(const Likeness& other);
  Likeness operator-(const Likeness& other) const;

  /// Log-likelihood ratio of the likeliest share of pairs that are the same landmark, versus
  /// chance. At least 0.
  double evidence() const;
};

/// Number of matches that agree with a pose. Matches are mutual descriptor matches, and pairs of
/// landmarks that keypoints of common images identify. The matches are found without the pose.
struct DescriptorAgreement {
  std::size_t matches = 0;
  std::size_t agreeing = 0;  ///< matches whose two landmarks are within the radius at the pose
  /// Agreeing matches outside their largest cluster: excludes a single object that stands in two places.
  std::size_t spread = 0;
  /// Number of agreeing matches expected by chance (random partners) for this pair of maps and this
  /// pose.
  double expected = 0.0;
  /// Part of `matches` and of `agreeing`: pairs of landmarks that one keypoint of a common image
  /// identifies.
  std::size_t identities = 0;
  std::size_t identical = 0;

  /// Whether these pairs prove the pose: at least four of them, and more than half, agree.
  bool is_proven() const { return identical >= 4 && 2 * identical > identities; }

  /// Log-likelihood ratio of `spread` against a Poisson count of mean `expected`, at least 0.
  double evidence() const;
};

/// Agreement of matched landmarks in contrast: lightness relative to neighbours in the same map.
struct ContrastAgreement {
  std::size_t compared = 0;  ///< matches whose landmarks have colours
  double correlation = 0.0;  ///< of the ranks of their contrasts; 0 by chance
  /// Log-likelihood ratio of a positive correlation versus none, without the sixteenth of the source that
  /// contributes most. At least 0.
  double spread = 0.0;
};

/// Log-likelihood ratio of the distances at one pose. Hypothesis: some pairs are the same landmark,
/// with Gaussian errors. Alternative: all pairs are as far apart as at the other poses.
struct ProximityEvidence {
  static constexpr double kWidest = 0.14;  ///< largest standard deviation considered, in spacings

  double all = 0.0;     ///< for the likeliest share and error of common landmarks; at least 0
  double spread = 0.0;  ///< without the sixteenth of the source that contributes most
  double share = 0.0;   ///< likeliest share of the pairs
  /// Likeliest standard deviation of the errors along an axis, in spacings.
  double deviation = 0.0;
};

/// Evidence for the overlap of two maps at a pose.
struct Support {
  /// Number of mutual nearest neighbours in the sample within r, r/2, r/4, ... (r: radius).
  static constexpr std::size_t kRadii = 6;
  std::array<std::size_t, kRadii> within = {};
  /// Index of r/4 in `within`: the widest radius at which most matches are not due to chance.
  static constexpr std::size_t kFine = 2;
  /// One-to-one matches of all landmarks, as a share of the smaller map's landmarks, estimated from
  /// the sample; at most 1. Of many landmarks matched with one landmark, only one counts.
  double share = 0.0;
  /// Log-likelihood ratio of the distances of all mutual nearest neighbours: some pairs are the
  /// same landmark, versus independent points on a surface. At least 0.
  double evidence = 0.0;
  /// `evidence` without the sixteenth of the source that contributes most. This excludes a single
  /// object that stands in both places.
  double spread_evidence = 0.0;
  /// Log-likelihood ratio of the match distances, versus the distances at the other candidates.
  ProximityEvidence proximity = {};
  /// Agreement of matches with the pose; std::nullopt if the maps have neither descriptors of one
  /// kind nor common images.
  std::optional<DescriptorAgreement> agreement = {};
  /// Descriptor similarity of the matches; std::nullopt if the maps have no descriptors of one kind.
  std::optional<Likeness> likeness = {};
  /// The likeness evidence without the sixteenth of the source that contributes most.
  double spread_likeness = 0.0;
  /// Contrast agreement; std::nullopt if a map has descriptors, or hardly any colours that differ.
  std::optional<ContrastAgreement> contrast = {};

  std::size_t matches() const { return within[0]; }
};

/// Free-space check: numbers of landmarks by depth relative to the landmarks that the other map's
/// keyframes observed along the same lines of sight. The space in front of an observed landmark is
/// free.
struct SightCounts {
  std::size_t agree = 0;     ///< landmarks at the observed depth
  std::size_t in_front = 0;  ///< landmarks in front of this depth, in free space: a contradiction
  std::size_t behind = 0;    ///< landmarks behind this depth, occluded

  std::size_t total() const { return agree + in_front + behind; }
  SightCounts& operator+=(const SightCounts& other);
};

/// Landmarks that, at a pose, keyframes of both maps saw from nearly one direction and distance. In
/// one place, many of them look the same. Two places built alike, e.g. hotel rooms, share shapes,
/// edges and handles, but hardly anything unique within its own map looks the same in both.
struct SeenAlike {
  /// Number of source landmarks with target landmarks seen alike within half a matching radius.
  std::size_t landmarks = 0;
  /// Number of these whose descriptors differ by less than half as much as each differs from any
  /// landmark elsewhere in its own map. Counting stops once the number is enough for the verdict.
  std::size_t distinctive = 0;
};

/// Landmarks around the matches of a pose: those outside a ball that contains nearly all matches.
/// An object that stands in two places matches as well as a single place does, but its surroundings
/// differ between the two places.
struct Surroundings {
  /// Numbers of landmarks outside the ball, in both maps, classified by the majority of the other
  /// map's lines of sight. Lines of sight into the ball are not compared.
  SightCounts landmarks = {};
  double extent = 0.0;  ///< radius of the ball, in matching radii; 0 without matches
  double share =
      0.0;  ///< share of a map's landmarks that are outside the ball; the smaller of both shares
  SeenAlike seen_alike = {};
};

/// A candidate pose, distinct from the others.
struct PlacementCandidate {
  Rigid3 target_from_source;
  double scale = 1.0;  ///< s in x_target = R·(s·x_source) + t
  Support support = {};
  /// Share of both maps' compared lines of sight with a landmark of the other map in front of the
  /// observed one; see SightCounts. std::nullopt if too few lines were compared.
  std::optional<double> contradicted = {};
  /// Probability that this pose is right. 1 minus the sum over all candidates is the probability
  /// that none of them is right.
  double probability = 0.0;

  /// The pose with its scale.
  Similarity3 similarity() const { return {scale, target_from_source}; }
};

/// One of the two maps of an alignment.
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
  Verdict verdict = Verdict::kRejected;  ///< verdict on the part alone
  double probability = 0.0;              ///< probability of `found`
  /// The pose of the part alone, whatever its verdict. x_in_target = target_from_source * x_in_source.
  std::optional<Similarity3> found;
  /// `found` is aligned separately, or agrees with separately aligned neighbouring parts.
  bool agrees = false;
  /// Pose of the part under the consensus: `found` if it agrees, else interpolated between the neighbouring
  /// parts. std::nullopt without a consensus of parts (see place_by_parts()).
  std::optional<Similarity3> target_from_source;
};

/// Deviation of a map from rigidity, measured against the other map.
struct MapBend {
  MapRole map = MapRole::kSource;
  /// Largest rotation between the poses of two parts, after smoothing; radians.
  double rotation_rad = 0.0;
  FrameId first;  ///< the bend lies between these keyframes
  FrameId last;
  /// Largest root mean square distance of a part's landmarks from their positions under the single
  /// pose, in the target's unit.
  double displacement = 0.0;
};

/// Smooth deformation between two maps of free scale. The deformation does not show which map is
/// deformed.
struct MapDeformation {
  std::size_t matches = 0;    ///< descriptor matches that agree with the deformation
  double rotation_rad = 0.0;  ///< largest rotation between the local poses of two landmarks
  double scale_ratio = 1.0;   ///< largest ratio of the scales of two local poses
  /// Root mean square distance of the matches under the single pose, in the target's unit.
  double displacement = 0.0;
};

/// Result of place_by_parts().
struct PartsAlignment {
  std::vector<PartPose> parts;  ///< parts of the source first, in the order of their keyframes
  std::size_t aligned = 0;      ///< number of parts that are aligned separately
  /// At least two parts of one map are aligned separately, match landmarks of at least two parts of
  /// the other map, and agree up to a bend. No aligned part contradicts them.
  bool consensus = false;
  bool contradictory = false;  ///< parts that are aligned separately contradict each other
  /// Whether the straightened map is aligned as a whole; std::nullopt if not tested.
  std::optional<bool> confirmed = {};
  std::optional<MapBend> bend;  ///< std::nullopt without a consensus
  /// With a consensus: the pose that best fits all landmarks of the bent map, each placed by the
  /// pose of its part. The covariance includes the deviations of the parts' poses from this pose.
  std::optional<Similarity3> target_from_source;
  std::optional<Matrix6d> covariance;
  std::optional<Matrix7d> covariance_with_scale = {};  ///< the same, if a scale is estimated
  double probability = 0.0;                            ///< largest of separately aligned parts
};

/// Standard deviations of a pose along and about the target's axes.
struct PoseDeviations {
  Eigen::Vector3d translation =
      Eigen::Vector3d::Zero();  ///< at a point of the source; the target's unit
  Eigen::Vector3d rotation_rad = Eigen::Vector3d::Zero();
  std::optional<double> log_scale = {};  ///< if a scale was estimated
};

/// Result of an alignment.
struct Alignment {
  /// std::nullopt if not judged: `judge` is false, the method failed, or the caller stopped the work.
  std::optional<Verdict> verdict;
  std::optional<double> probability;  ///< that the estimate is right; std::nullopt if not judged
  std::string reason;                 ///< one sentence for people, the decision first
  /// std::nullopt unless the verdict is aligned. x_in_target = target_from_source * x_in_source.
  std::optional<Similarity3> target_from_source;
  /// The best pose, whatever the verdict; std::nullopt if the method found none.
  std::optional<Similarity3> estimate;
  /// All poses compared, likeliest first; empty if not judged. After place(), the first is the
  /// refined pose, and the second is the runner-up.
  std::vector<PlacementCandidate> candidates;
  /// Index in `candidates` of the pose in `estimate`. std::nullopt for a judged pose that is near a
  /// better candidate.
  std::optional<std::size_t> own;
  /// Surroundings of the likeliest candidate.
  Surroundings around;
  /// Score, iterations, history, matches, covariance, unobservable directions and overlap of the
  /// estimate.
  RegistrationResult registration;
  /// Centre of the source's landmarks, in its frame; std::nullopt if read from a document that does
  /// not state it.
  std::optional<Eigen::Vector3d> centre;
  double radius = 0.0;  ///< landmarks within this distance count as matched; 0 if unknown
  /// Poses of the maps' parts, and whether they agree; std::nullopt if no parts were placed.
  std::optional<PartsAlignment> parts;
  /// Deformation between the maps, if it clearly exceeds the noise; covariances then include the
  /// deviations of the local poses from the single pose. std::nullopt if not clear or not tested.
  std::optional<MapDeformation> deformation;
  /// Scale of the source at which the descriptors agree on a pose, if the maps are not aligned at
  /// one scale. The unit of one map is then probably wrong.
  std::optional<double> other_scale;
  std::size_t common_images = 0;  ///< images that both maps contain: see common_images()
  bool one_map = false;           ///< one map is a copy of the other: the alignment proves nothing
  /// The time limit ended the search or the last refinement early. A pose may be missing from the
  /// candidates; the probability does not account for missing poses.
  bool cut_short = false;
  bool deterministic = true;  ///< false with a time limit
  double duration_s = 0.0;    ///< wall time of the whole call
};

/// Standard deviations of the estimate at `centre`, or at the source's origin if `centre` is
/// unknown. At the origin, they grow with its distance from the landmarks. std::nullopt without a
/// covariance.
std::optional<PoseDeviations> deviations_of(const Alignment& alignment);

/// Name of the verdict; if there is none, "converged", "stopped", "failed" or "cancelled".
std::string_view status_of(const Alignment& alignment);

/// A probability for people, in percent, rounded down to two decimals, or to four from 99.99 %. The
/// text is never 0 % or 100 %.
std::string probability_text(double probability);

/// "probability 12.30 %, below the required 99 %": the start of a reason.
std::string decision_text(double probability, double required);

}  // namespace cairn
