// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>

namespace cairn {

/// What descriptors have to say of landmarks that a pose brings together.
struct Likeness {
  /// Two look alike if they are more alike than one of them is to any of so many others.
  static constexpr std::size_t kOthers = 63;
  /// Share of the pairs that look alike where those that meet have nothing to do with each other.
  static constexpr double kChance = 1.0 / (kOthers + 1);

  std::size_t compared = 0;  ///< pairs of landmarks with descriptors
  std::size_t alike = 0;     ///< those that look alike: see LookComparison

  Likeness& operator+=(const Likeness& other);
  Likeness operator-(const Likeness& other) const;

  /// By how much likelier this is if some pairs are one landmark, seen twice, than by chance: logarithm
  /// of the ratio for the likeliest share of them, at least 0.
  double evidence() const;
};

}  // namespace cairn
