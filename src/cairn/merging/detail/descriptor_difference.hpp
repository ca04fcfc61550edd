// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>

#include "cairn/core/detail/hamming.hpp"
#include "cairn/map/landmark_map.hpp"

namespace cairn::detail {

/// Whether descriptors of the two columns can be compared: same kind and size.
inline bool comparable(const DescriptorColumn& a, const DescriptorColumn& b) {
  return a.kind == b.kind && a.bytes_each == b.bytes_each;
}

/// Hamming distance of two descriptors of one size.
inline int differing_bits(std::span<const std::uint8_t> a, std::span<const std::uint8_t> b) {
  int bits = 0;
  for (std::size_t k = 0; k < a.size(); k += 8) {
    const std::size_t count = std::min<std::size_t>(8, a.size() - k);
    std::uint64_t word_a = 0;
    std::uint64_t word_b = 0;
    std::memcpy(&word_a, a.data() + k, count);
    std::memcpy(&word_b, b.data() + k, count);
    bits += detail::hamming_distance({&word_a, 1}, {&word_b, 1});
  }
  return bits;
}

/// The smallest difference(x, y) of a descriptor x of landmark i in column a and a descriptor y of landmark
/// j in column b. Both landmarks must have known descriptors.
template <class Difference>
auto least_difference(const DescriptorColumn& a, std::size_t i, const DescriptorColumn& b,
                      std::size_t j, const Difference& difference) {
  auto least = difference(a.descriptor(i, 0), b.descriptor(j, 0));
  for (std::size_t p = 0; p < a.count(i); ++p) {
    for (std::size_t q = p == 0 ? 1 : 0; q < b.count(j); ++q) {
      least = std::min(least, difference(a.descriptor(i, p), b.descriptor(j, q)));
    }
  }
  return least;
}

/// Hamming distance of the best pair of descriptors of two landmarks.
inline int differing_bits(const DescriptorColumn& a, std::size_t i, const DescriptorColumn& b,
                          std::size_t j) {
  return least_difference(a, i, b, j, [](auto x, auto y) { return differing_bits(x, y); });
}

}  // namespace cairn::detail
