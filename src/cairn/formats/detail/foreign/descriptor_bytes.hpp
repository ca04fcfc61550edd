// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>

namespace cairn::detail {

/// Converts the numbers of descriptors to one byte each, preserving ratios of distances. If all are integers
/// from 0 to 255 (SIFT), they are unchanged. Otherwise x becomes 128 + 127·x, rounded and clamped, because
/// learned features are in [-1, 1]. Numbers that are not finite count as 0.
/// @param bytes as many as numbers
template <class Number>
void to_bytes(std::span<const Number> numbers, std::span<std::uint8_t> bytes) {
  const bool are_bytes = std::all_of(numbers.begin(), numbers.end(), [](Number x) {
    return x >= 0 && x <= 255 && x == std::floor(x);
  });
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    const double value = std::isfinite(numbers[i]) ? double{numbers[i]} : 0.0;
    const double scaled = are_bytes ? value : 128.0 + 127.0 * value;
    bytes[i] = static_cast<std::uint8_t>(std::lround(std::clamp(scaled, 0.0, 255.0)));
  }
}

}  // namespace cairn::detail
