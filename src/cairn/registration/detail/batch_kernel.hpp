// SPDX-License-Identifier: BSD-3-Clause
// Internal to BatchTree: what its vector code sees. Not for other includers.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace cairn::batch_kernel {

/// Nodes have this many children, tested together.
inline constexpr std::size_t kFanOut = 16;
/// Points in a leaf; what fills the last one up is kFarAway.
inline constexpr std::size_t kLeafSize = 8;
/// Farther along each axis than points and queries may be, yet its square is a number.
inline constexpr float kFarAway = 1e18F;
/// Queries in a block.
inline constexpr std::size_t kBlock = 256;
/// Candidates a query that code is made for.
inline constexpr std::array<std::size_t, 7> kCapacities = {2, 4, 6, 8, 12, 16, 24};

// What single precision can be off by. Computing a squared distance is off by less than kRelative of
// itself, or, where numbers are too small for that to hold, by less than kTiny.
inline constexpr float kRelative = 1.0F / (1 << 20);
inline constexpr float kTiny = 1e-37F;

/// Bounding boxes of one level's nodes, in a multiple of kFanOut; what fills it up is infinitely far.
struct Level {
  std::array<std::vector<float>, 3> low;
  std::array<std::vector<float>, 3> high;
};

/// Points in the order of the leaves, about a common centre; rounded.
struct Tree {
  std::array<std::vector<float>, 3> points;  // of all leaves, and of one more without points
  std::vector<Level> levels;                 // leaves first; the last has at most kFanOut nodes
};

/// What is known of the queries of a block, close ones next to each other, from one call to the next.
struct Known {
  std::array<float*, 3> place;  // where a query was when its candidates were found
  float* outside;               // points that are no candidates are at least this far from there;
                                // negative: nothing is known
  std::uint32_t* candidates;    // [j·kBlock + i]: the j-th of query i, nearest first, as places of
                                // points in the tree
};

/// A block's queries about the same centre, and what came of them.
struct Queries {
  std::size_t count = 0;
  alignas(64) std::array<std::array<float, kBlock>, 3> position;
  /// By how much a distance may be off because points and queries are rounded.
  float rounding = 0.0F;
  /// Not 0: the first k candidates are the k nearest points, in order.
  alignas(64) std::array<std::uint8_t, kBlock> certain;
};

/// Brings the candidates of a block's queries up to date: orders them anew, and searches where that
/// leaves doubt.
/// @param capacity candidates a query, of kCapacities, more than k
void update(const Tree& tree, std::size_t capacity, std::size_t k, Queries& queries, Known& known);

}  // namespace cairn::batch_kernel
