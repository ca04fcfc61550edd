// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <span>

#include "cairn/alignment/alignment.hpp"

namespace cairn::detail {

/// Distances of mutual nearest neighbours at a pose: for each part of the source, a histogram of distance
/// divided by spacing. The spacing is the geometric mean of both landmarks' distances to their eighth
/// neighbours.
class Proximity {
 public:
  static constexpr std::size_t kGroups = 16;  ///< spatial parts of the source
  /// Four bins per octave; the first is for ratios up to 2^-6, the last for ratios above 2.
  static constexpr std::size_t kBins = 30;

  void add(double ratio, std::size_t group);

  using Counts = std::array<double, kBins>;
  Counts counts() const;
  Counts counts(std::size_t group) const;

 private:
  std::array<std::array<std::size_t, kBins>, kGroups> counts_{};
};

/// Probability that two mutual nearest neighbours are at most this far apart, if both clouds lie
/// independently on one surface: 1 - exp(-1.609·8·d²/h²).
/// @param squared_ratio d²/h², h being the distance to the eighth neighbour
double chance_on_surface(double squared_ratio);

/// @param others the same clouds at other poses, refined in the same way; they show the distribution by
///        chance. If empty, independent points on a surface are assumed.
ProximityEvidence proximity_evidence(const Proximity& at_pose,
                                     std::span<const Proximity* const> others);

}  // namespace cairn::detail
