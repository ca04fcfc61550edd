// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <span>

namespace cairn {

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

/// Log-likelihood ratio of the distances at one pose: some pairs are the same landmark, with Gaussian
/// errors, versus all pairs being as far apart as at the other poses.
struct ProximityEvidence {
  static constexpr double kWidest = 0.14;  ///< largest standard deviation considered, in spacings

  double all = 0.0;     ///< for the likeliest share and error of common landmarks; at least 0
  double spread = 0.0;  ///< without the part of the source that contributes most
  double share = 0.0;   ///< likeliest share of the pairs
  /// Likeliest standard deviation of the errors along an axis, in spacings.
  double deviation = 0.0;
};

/// @param others the same clouds at other poses, refined alike: the distribution by chance. If empty,
///        independent points on a surface are assumed.
ProximityEvidence proximity_evidence(const Proximity& at_pose,
                                     std::span<const Proximity* const> others);

}  // namespace cairn
