// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>

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

}  // namespace cairn::detail
