// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <random>

namespace cairn {

/// Seeded random numbers, the same on every platform: the standard fixes the engine but not its
/// distributions, so Cairn has its own.
class Random {
 public:
  explicit Random(std::uint64_t seed);

  /// An independent generator for a numbered part of the work; does not advance this one. Draws of one part
  /// do not affect those of others.
  Random fork(std::uint64_t stream) const;

  /// Uniform in [0, 1), all 53 bits.
  double uniform();
  /// Uniform in [low, high).
  double uniform(double low, double high);
  /// Uniform in {0, ..., count - 1}; `count` must be positive.
  std::size_t index(std::size_t count);
  /// Standard normal.
  double normal();
  /// A seed for another generator, 53 bits.
  std::uint64_t draw_seed();
  /// True with the given probability.
  bool chance(double probability) { return uniform() < probability; }

 private:
  std::uint64_t seed_;
  std::mt19937_64 engine_;
};

}  // namespace cairn
