// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <span>
#include <string_view>
#include <vector>

/// What the functions of this folder demand of their arguments, in one wording.
namespace cairn {

/// @throws Error (misuse) naming `where` unless 0 < confidence < 1
void require_confidence(std::string_view where, double confidence);
/// @throws Error (misuse) naming `where` unless 0 < alpha < 0.5
void require_test_level(std::string_view where, double alpha);
/// @throws Error (misuse) naming `where` and the first position of infinity or NaN
void require_finite(std::string_view where, std::span<const double> values);
/// @throws Error (misuse) naming `where` unless both have as many values
void require_pairs(std::string_view where, std::size_t first, std::size_t second);
/// @throws Error (misuse) naming `where` unless there are two edges or more, finite and ascending
void require_edges(std::string_view where, std::span<const double> edges);

/// How many treatments the blocks have.
/// @throws Error (misuse) naming `where`, of no blocks, blocks of different lengths, fewer than two
///         treatments or values that are not finite
std::size_t require_blocks(std::string_view where, std::span<const std::vector<double>> blocks);

}  // namespace cairn
