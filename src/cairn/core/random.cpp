// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/core/random.hpp"

#include <cmath>
#include <limits>
#include <numbers>

#include "cairn/core/error.hpp"

namespace cairn {
namespace {

// Finaliser of SplitMix64 (Steele, Lea, Flood 2014): neighbouring seeds give unrelated streams.
std::uint64_t mix(std::uint64_t x) {
  x += 0x9e3779b97f4a7c15ULL;
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ULL;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebULL;
  return x ^ (x >> 31);
}

}  // namespace

Random::Random(std::uint64_t seed) : seed_(seed), engine_(mix(seed)) {}

Random Random::fork(std::uint64_t stream) const {
  return Random(mix(seed_) ^ mix(~stream));
}

std::uint64_t Random::draw_seed() {
  return engine_() >> 11;
}

double Random::uniform() {
  return static_cast<double>(draw_seed()) * 0x1p-53;
}

double Random::uniform(double low, double high) {
  return low + (high - low) * uniform();
}

std::size_t Random::index(std::size_t count) {
  if (count == 0) throw Error(ErrorKind::kMisuse, "Random::index", "count is 0", "at least 1");
  // Rejection keeps every value equally likely.
  const std::uint64_t excess = (std::numeric_limits<std::uint64_t>::max() % count + 1) % count;
  std::uint64_t draw = engine_();
  while (draw > std::numeric_limits<std::uint64_t>::max() - excess) draw = engine_();
  return static_cast<std::size_t>(draw % count);
}

double Random::normal() {
  // Box-Muller; the second value is dropped so that the state is the engine's alone.
  const double radius = std::sqrt(-2.0 * std::log(1.0 - uniform()));
  return radius * std::cos(2.0 * std::numbers::pi * uniform());
}

}  // namespace cairn
