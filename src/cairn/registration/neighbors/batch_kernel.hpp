// SPDX-License-Identifier: BSD-3-Clause
// Internal to BatchTree: what its vector code sees. Not for other includers.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace cairn::batch_kernel {

/// Nodes have this many children, tested together.
inline constexpr std::size_t kFanOut = 16;
/// Queries a call at most.
inline constexpr std::size_t kMostQueries = 256;
/// Candidates a query that code is made for.
inline constexpr std::array<std::size_t, 6> kCapacities = {4, 6, 8, 12, 16, 24};

/// Bounding boxes of one level's nodes, in a multiple of kFanOut; what fills it up is infinitely far.
struct Level {
  std::array<std::vector<float>, 3> low;
  std::array<std::vector<float>, 3> high;
};

/// Points in the order of the leaves, about a common centre; rounded.
struct Tree {
  std::array<std::vector<float>, 3> points;
  std::vector<std::uint32_t> leaf_begin;  // of each leaf, and the end of the last
  std::vector<Level> levels;              // leaves first; the last has at most kFanOut nodes
};

/// Queries about the same centre, close ones next to each other; and answers.
struct Queries {
  std::size_t count = 0;
  alignas(64) std::array<std::array<float, kMostQueries>, 3> position;
  /// Only points whose squared distance is below count. After the search, points that are no
  /// candidates are not below.
  alignas(64) std::array<float, kMostQueries> bound;
};

/// Finds the `capacity` points of the least squared distance, as computed in single precision.
/// @param candidates capacity x kMostQueries: [j·kMostQueries + i] is the j-th nearest of query i, or
///        the number of points where there are no more
void search(const Tree& tree, std::size_t capacity, Queries& queries,
            std::span<std::uint32_t> candidates);

}  // namespace cairn::batch_kernel
