// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "cairn/core/random.hpp"
#include "cairn/geometry/similarity3.hpp"
#include "cairn/placement/detail/look_comparison.hpp"
#include "cairn/placement/prepared_cloud.hpp"
#include "cairn/placement/support.hpp"

namespace cairn {

/// Counts what two clouds have in common at centred poses.
///
/// Where landmarks of both lie on a surface independently of each other, two that are each other's nearest
/// are within a distance d with probability u = 1 - exp(-1.609·8·d²/h²), h being the distance to the
/// eighth neighbour (the geometric mean of both maps'): u is spread evenly over 0 to 1. Landmarks that
/// are one are far closer than that; their u is taken to have the density 1 / (2·√u). The evidence is
/// that of the mixture with the likeliest share of such pairs. It asks for no radius, and a match counts
/// by how little it is to be expected where it is. What landmarks look like is asked apart from that.
class SupportCounter {
 public:
  /// Parts of the source, none of which is to decide alone.
  static constexpr std::size_t kGroups = PreparedCloud::kGroups;

  /// @param sample the first of the source that are looked at, at most PreparedCloud::kSample
  /// @param random draws what looks are compared with
  SupportCounter(const PreparedCloud& source, const PreparedCloud& target, std::size_t sample,
                 const Random& random);

  /// @param proximity takes the distances of mutual nearest neighbours; may be null
  Support operator()(const Similarity3& pose, double radius, Proximity* proximity = nullptr) const;

 private:
  using Likenesses = std::array<Likeness, kGroups>;

  // A corner has several landmarks in either map: which of them are each other's nearest is by chance. So
  // of the partners within the radius the one that looks most like it counts.
  // @param matched of the sample
  Likenesses likeness_by_group(std::span<const std::uint32_t> matched, const Similarity3& pose,
                               double radius) const;

  PreparedCloud source_;
  PreparedCloud target_;
  std::size_t sample_;
  LookComparison looks_;
};

}  // namespace cairn
