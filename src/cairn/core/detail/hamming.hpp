// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace cairn::detail {

/// Hamming distance of two descriptors of equal length.
///
/// Counts the bits of a 64-bit word in parallel (Warren, "Hacker's Delight", 5-1). std::popcount takes four
/// times as long if the processor's instruction cannot be assumed, as on x86-64, because it then calls a
/// library.
inline int hamming_distance(std::span<const std::uint64_t> a, std::span<const std::uint64_t> b) {
  std::uint64_t sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    std::uint64_t bits = a[i] ^ b[i];
    bits -= (bits >> 1) & 0x5555555555555555ULL;
    bits = (bits & 0x3333333333333333ULL) + ((bits >> 2) & 0x3333333333333333ULL);
    bits = (bits + (bits >> 4)) & 0x0f0f0f0f0f0f0f0fULL;
    sum += (bits * 0x0101010101010101ULL) >> 56;
  }
  return static_cast<int>(sum);
}

}  // namespace cairn::detail
