// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "cairn/core/random.hpp"
#include "cairn/core/statistics.hpp"
#include "cairn/map/landmark_map.hpp"
#include "cairn/map/operations.hpp"

namespace cairn::detail {

/// Whether descriptors of the two columns can be compared: same kind and size.
inline bool comparable(const DescriptorColumn& a, const DescriptorColumn& b) {
  return a.kind == b.kind && a.bytes_each == b.bytes_each;
}

/// The smallest difference of a descriptor of landmark i in column a and a descriptor of landmark j in
/// column b. Both landmarks must have known descriptors.
inline std::uint64_t least_difference(const DescriptorColumn& a, std::size_t i,
                                      const DescriptorColumn& b, std::size_t j,
                                      DescriptorNorm norm) {
  std::uint64_t least = descriptor_difference(a.descriptor(i, 0), b.descriptor(j, 0), norm);
  for (std::size_t p = 0; p < a.count(i); ++p) {
    for (std::size_t q = p == 0 ? 1 : 0; q < b.count(j); ++q) {
      least = std::min(least, descriptor_difference(a.descriptor(i, p), b.descriptor(j, q), norm));
    }
  }
  return least;
}

/// Share of random pairs whose descriptors count as alike.
inline constexpr double kAlikeByChance = 0.02;

/// The largest difference of two landmarks that look alike, from random pairs; 0 if a column knows no descriptor.
/// @param first comparable with `second`
inline std::uint64_t largest_alike(const DescriptorColumn& first, const DescriptorColumn& second,
                                   std::uint64_t seed) {
  const auto known = [](const DescriptorColumn& column) {
    std::vector<std::uint32_t> rows;
    for (std::uint32_t i = 0; i < column.known.size(); ++i) {
      if (column.known[i] != 0) rows.push_back(i);
    }
    return rows;
  };
  const std::vector<std::uint32_t> a = known(first);
  const std::vector<std::uint32_t> b = known(second);
  if (a.empty() || b.empty()) return 0;
  constexpr std::size_t kPairs = 4000;
  const DescriptorNorm norm = descriptor_norm(first.kind);
  Random random(seed);
  std::vector<std::uint64_t> differences(kPairs);
  for (std::uint64_t& each : differences) {
    const std::uint32_t j = b[random.index(b.size())];
    const std::uint32_t i = a[random.index(a.size())];
    each = least_difference(first, i, second, j, norm);
  }
  return nth_lowest(differences, static_cast<std::size_t>(kAlikeByChance * kPairs));
}

}  // namespace cairn::detail
