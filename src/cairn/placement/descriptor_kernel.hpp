// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace cairn::descriptor_kernel {

/// How the difference of two descriptors is measured.
enum class Norm {
  kHamming,       ///< bits that differ
  kSquaredBytes,  ///< squared differences of the bytes, summed
};

/// For one descriptor, those of the other set: the smallest differences.
struct Nearest {
  static constexpr std::uint32_t kNone = 0xffffffffU;

  std::uint32_t index = kNone;   ///< of equally near ones the first
  std::uint32_t first = kNone;   ///< difference of that one
  std::uint32_t second = kNone;  ///< of the second nearest; kNone if there is none
};

struct NearestBothWays {
  std::vector<Nearest> of_a;  ///< in b, one a descriptor of a
  std::vector<Nearest> of_b;  ///< in a; without `second`
};

/// Compares each descriptor of a with each of b, exactly, in vector lanes: the same on every instruction
/// set.
/// @param a, b  rows of `bytes_each` bytes
NearestBothWays nearest_both_ways(std::span<const std::uint8_t> a, std::span<const std::uint8_t> b,
                                  std::size_t bytes_each, Norm norm);

}  // namespace cairn::descriptor_kernel
