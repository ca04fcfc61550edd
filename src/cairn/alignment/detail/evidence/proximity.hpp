// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <span>

#include "cairn/alignment/alignment.hpp"

namespace cairn::detail {

/// Distances of mutual nearest neighbours at a pose: a histogram of distance divided by spacing, the
/// geometric mean of both landmarks' distances to their eighth neighbours, for each part of the source.
class Proximity {
 public:
  static constexpr std::size_t kGroups = 16;  ///< spatial parts of the source
  /// Four bins per octave, from 2^-6 and less to 2 and more.
  static constexpr std::size_t kBins = 30;

  void add(double ratio, std::size_t group);

  using Counts = std::array<double, kBins>;
  Counts counts() const;
  Counts counts(std::size_t group) const;

 private:
  std::array<std::array<std::size_t, kBins>, kGroups> counts_{};
};

/// Probability that two mutual nearest landmarks are at most this close, if both clouds lie independently
/// on one surface: 1 - exp(-1.609·8·d²/h²).
/// @param squared_ratio d²/h², h being the distance to the eighth neighbour
double chance_on_surface(double squared_ratio);

/// @param others the same clouds at other poses, refined alike: the distribution by chance. If empty,
///        independent points on a surface are assumed.
ProximityEvidence proximity_evidence(const Proximity& at_pose,
                                     std::span<const Proximity* const> others);

}  // namespace cairn::detail
