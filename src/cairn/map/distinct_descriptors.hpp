// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "cairn/map/landmark_map.hpp"

namespace cairn {

/// Measure of the difference between two descriptors.
enum class DescriptorNorm {
  kHamming,  ///< bits that differ
  kSquared,  ///< sum of squared differences of bytes
};

/// Whether descriptors of a kind are compared by bits (ORB, BRIEF, BRISK, AKAZE, FREAK, LATCH); others are
/// compared by bytes.
bool is_binary(std::string_view kind);

std::uint64_t descriptor_difference(std::span<const std::uint8_t> a,
                                    std::span<const std::uint8_t> b, DescriptorNorm norm);

/// Number of descriptors that Cairn gives a landmark with so many distinct ones: four views, because more
/// cost time and hardly match more.
inline constexpr std::size_t kDistinctViews = 4;

/// Chooses the descriptors of a landmark's most distinct views: greedily, each time the one that differs
/// most from its nearest among those chosen (farthest-first traversal, Gonzalez 1985); the first of equals.
/// Considers only the first 64, beside `first`, and stops where all others equal a chosen one.
/// @param descriptors all of one size
/// @param first index of the one to begin with
/// @param most largest number, at least 1
/// @return indices in the order of choice
std::vector<std::size_t> distinct_descriptors(
    std::span<const std::span<const std::uint8_t>> descriptors, std::size_t first, std::size_t most,
    DescriptorNorm norm);

/// Appends a row to a column: the descriptors of one more landmark.
/// @param descriptors the representative first, each of column.bytes_each bytes; empty: unknown
void append_descriptors(DescriptorColumn& column,
                        std::span<const std::span<const std::uint8_t>> descriptors);

}  // namespace cairn
