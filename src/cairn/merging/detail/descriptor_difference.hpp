// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>

#include "cairn/core/hamming.hpp"
#include "cairn/map/landmark_map.hpp"

namespace cairn {

/// Whether descriptors of the two columns can be compared: same kind and size.
inline bool comparable(const DescriptorColumn& a, const DescriptorColumn& b) {
  return a.kind == b.kind && a.bytes_each == b.bytes_each;
}

/// Hamming distance of the descriptors of landmark i of one column and j of the other.
inline int differing_bits(const DescriptorColumn& a, std::size_t i, const DescriptorColumn& b,
                          std::size_t j) {
  const std::size_t size = a.bytes_each;
  int bits = 0;
  for (std::size_t k = 0; k < size; k += 8) {
    const std::size_t count = std::min<std::size_t>(8, size - k);
    std::uint64_t word_a = 0;
    std::uint64_t word_b = 0;
    std::memcpy(&word_a, a.bytes.data() + i * size + k, count);
    std::memcpy(&word_b, b.bytes.data() + j * size + k, count);
    bits += hamming_distance({&word_a, 1}, {&word_b, 1});
  }
  return bits;
}

}  // namespace cairn
