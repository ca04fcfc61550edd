// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <random>

namespace cairn {

/// Seeded random numbers, identical on every platform: the C++ standard specifies the engine but
/// not the distributions, so Cairn implements them.
class Random {
 public:
  explicit Random(std::uint64_t seed);

  /// Independent generator for part `stream` of the work; does not advance this generator. Draws of
  /// one part do not affect other parts.
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
