// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>

namespace cairn {

/// Descriptor similarity of the landmarks that a pose matches.
struct Likeness {
  /// Two landmarks are similar if their descriptor distance beats the distances of one of them to this many
  /// others.
  static constexpr std::size_t kOthers = 63;
  /// Share of similar pairs among unrelated landmarks.
  static constexpr double kChance = 1.0 / (kOthers + 1);

  std::size_t compared = 0;  ///< pairs of landmarks with descriptors
  std::size_t alike = 0;     ///< similar pairs; see LookComparison

  Likeness& operator+=(const Likeness& other);
  Likeness operator-(const Likeness& other) const;

  /// Log-likelihood ratio, for the likeliest share of pairs that are the same landmark, versus chance. At
  /// least 0.
  double evidence() const;
};

}  // namespace cairn
