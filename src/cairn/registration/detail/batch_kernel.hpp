// SPDX-License-Identifier: BSD-3-Clause
// Internal to BatchTree: the data of its vector code. Not for other includers.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace cairn::batch_kernel {

/// Children per node, tested together.
inline constexpr std::size_t kFanOut = 16;
/// Points per leaf; the last one is padded with kFarAway.
inline constexpr std::size_t kLeafSize = 8;
/// Larger than any coordinate of points and queries, with a finite square.
inline constexpr float kFarAway = 1e18F;
/// Queries per block.
inline constexpr std::size_t kBlock = 256;
/// Candidates per query for which code is instantiated.
inline constexpr std::array<std::size_t, 7> kCapacities = {2, 4, 6, 8, 12, 16, 24};

// Error bounds of single precision: the relative error of a squared distance is less than kRelative, or its
// absolute error less than kTiny if numbers are too small for that.
inline constexpr float kRelative = 1.0F / (1 << 20);
inline constexpr float kTiny = 1e-37F;

/// Bounding boxes of the nodes of one level, padded to a multiple of kFanOut with boxes infinitely far
/// away.
struct Level {
  std::array<std::vector<float>, 3> low;
  std::array<std::vector<float>, 3> high;
};

/// Points in the order of the leaves, relative to a common centre, rounded.
struct Tree {
  std::array<std::vector<float>, 3> points;  // of all leaves, and of one more without points
  std::vector<Level> levels;                 // leaves first; the last has at most kFanOut nodes
};

/// State of the queries of a block between calls; neighbouring queries are close to each other.
struct Known {
  std::array<float*, 3> place;  // position of the query when its candidates were found
  float* outside;               // points that are no candidates are at least this far from `place`;
                                // negative: nothing is known
  std::uint32_t* candidates;    // [j·kBlock + i]: the j-th of query i, nearest first, as places of
                                // points in the tree
};

/// Queries of a block relative to the same centre, and their results.
struct Queries {
  std::size_t count = 0;
  alignas(64) std::array<std::array<float, kBlock>, 3> position;
  /// Largest distance error from rounding points and queries.
  float rounding = 0.0F;
  /// Not 0: the first k candidates are the k nearest points, in order.
  alignas(64) std::array<std::uint8_t, kBlock> certain;
};

/// Updates the candidates of a block's queries: reorders them, and searches the tree where that leaves a
/// query uncertain.
/// @param capacity candidates per query, one of kCapacities, more than k
void update(const Tree& tree, std::size_t capacity, std::size_t k, Queries& queries, Known& known);

}  // namespace cairn::batch_kernel
