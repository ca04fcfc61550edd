// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "cairn/alignment/detail/evidence/contrast.hpp"
#include "cairn/alignment/detail/evidence/look_comparison.hpp"
#include "cairn/alignment/detail/prepared_cloud.hpp"
#include "cairn/core/random.hpp"

namespace cairn::detail {

/// Two landmarks that are mutual nearest neighbours at a pose.
struct MutualMatch {
  std::uint32_t source = 0;
  std::uint32_t target = 0;
  double squared_distance = 0.0;  ///< in the target's unit
};

/// Mutual matches of the first source landmarks with the whole target at a centred pose, in the order of the
/// source landmarks.
/// @param sample number of first source landmarks to match; at most the size of the source
std::vector<MutualMatch> mutual_matches(const PreparedCloud& source, const PreparedCloud& target,
                                        const Similarity3& pose, std::size_t sample);

/// Counts matches of two clouds at centred poses, and computes their evidence.
///
/// Assumption for chance: the landmarks of both clouds lie independently on one surface. Two mutual nearest
/// neighbours are then within a distance d with probability u = 1 - exp(-1.609·8·d²/h²), where h is the distance
/// to the eighth neighbour (the geometric mean of both maps'). By chance, u is therefore uniform on [0, 1]. Two
/// landmarks that are the same are much closer; their u is assumed to have the density 1 / (2·√u). The evidence is
/// the log-likelihood ratio, versus chance, of a mixture with the likeliest share of such pairs. The evidence
/// needs no radius, and weights a match by how unlikely it is at its place. Descriptors and colours are evaluated
/// separately.
class SupportCounter {
 public:
  /// Number of parts of the source; no single part should decide.
  static constexpr std::size_t kGroups = PreparedCloud::kGroups;

  /// @param sample number of first source landmarks to use, at most PreparedCloud::kSample
  /// @param random draws the landmarks for descriptor comparisons
  SupportCounter(const PreparedCloud& source, const PreparedCloud& target, std::size_t sample,
                 const Random& random);

  /// @param proximity receives the distances of mutual nearest neighbours; may be null
  Support operator()(const Similarity3& pose, double radius, Proximity* proximity = nullptr) const;

 private:
  bool has_contrasts() const {
    return !source_.contrasts().empty() && !target_.contrasts().empty();
  }
  void add_contrast(std::uint32_t source, std::uint32_t target, ContrastPairs& pairs) const;

  using Likenesses = std::array<Likeness, kGroups>;

  // Counts similar descriptors of matched landmarks by part of the source. A corner has several landmarks in each
  // map, and chance decides which of them are mutual nearest neighbours. Therefore, of the target landmarks within
  // the radius, the one with the most similar descriptor counts.
  // @param matched source landmarks of the sample that have a match
  Likenesses likeness_by_group(std::span<const std::uint32_t> matched, const Similarity3& pose,
                               double radius) const;

  PreparedCloud source_;
  PreparedCloud target_;
  std::size_t sample_;
  LookComparison looks_;
};

/// The surroundings of the matches at a centred pose. The ball is about the mutual matches within a quarter of the
/// radius. It ignores sparse matches: those with less than half as many matches around them as the median match.
///
/// @param radius distance within which landmarks count as matched
/// @return all zeros if there are no matches
Surroundings surroundings(const PreparedCloud& source, const PreparedCloud& target,
                          const Similarity3& pose, double radius);

/// The matches in the plane that contains most of them.
struct PlaneMatches {
  double share = 0.0;  ///< of all matches; 0 if there are none
  /// Matched share of the landmarks beside the plane, relative to that of the landmarks in it.
  double elsewhere = 0.0;
};

/// The mutual matches within a quarter of the radius at a centred pose, and the plane that contains most of them to
/// within that distance. Two sensors that look at a floor from one height sample it at the same places, whatever stands
/// on it.
///
/// @param radius as for surroundings()
PlaneMatches matches_in_plane(const PreparedCloud& source, const PreparedCloud& target,
                              const Similarity3& pose, double radius);

}  // namespace cairn::detail
