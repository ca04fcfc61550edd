// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace cairn::detail::descriptor_kernel {

/// Distance between two descriptors.
enum class Norm {
  kHamming,       ///< number of differing bits
  kSquaredBytes,  ///< sum of squared byte differences
};

/// The nearest descriptors in the other set.
struct Nearest {
  static constexpr std::uint32_t kNone = 0xffffffffU;

  std::uint32_t index = kNone;  ///< index of the nearest descriptor; the first of equals
  std::uint32_t first = kNone;  ///< its distance
  /// Distance of the second nearest descriptor; with owners, of the nearest one that has another owner.
  /// kNone if there is none.
  std::uint32_t second = kNone;
};

struct NearestBothWays {
  std::vector<Nearest> of_a;  ///< nearest in b, one per descriptor of a
  std::vector<Nearest> of_b;  ///< nearest in a, without `second`
};

/// Compares each descriptor of a with each of b, exactly, with vector instructions; the result is the same
/// for every instruction set.
/// @param a, b  rows of `bytes_each` bytes
/// @param owners_of_b owner of each row of b, if several rows are of one landmark; rows of one owner do
///        not compete for `second`. Empty: each row has its own owner.
NearestBothWays nearest_both_ways(std::span<const std::uint8_t> a, std::span<const std::uint8_t> b,
                                  std::size_t bytes_each, Norm norm,
                                  std::span<const std::uint32_t> owners_of_b = {});

/// A row of each of two sets; kNone if a set has no rows.
struct NearestPair {
  std::size_t a = Nearest::kNone;
  std::size_t b = Nearest::kNone;
  std::uint32_t distance = Nearest::kNone;
};

/// The nearest pair of a row of a and a row of b; the first of equals, by a and then by b. Faster than
/// nearest_both_ways() for few rows.
/// @param a, b rows of `bytes_each` bytes
NearestPair nearest_pair(std::span<const std::uint8_t> a, std::span<const std::uint8_t> b,
                         std::size_t bytes_each, Norm norm);

}  // namespace cairn::detail::descriptor_kernel
