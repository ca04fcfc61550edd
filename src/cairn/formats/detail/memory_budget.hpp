// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

namespace cairn::detail {

/// Largest memory for columns whose content a file of this size need not spell out: descriptors and named
/// columns, which have room for every landmark, and compressed columns. Real maps need less than a tenth
/// of this memory.
constexpr std::uint64_t memory_budget(std::uint64_t file_bytes) {
  constexpr std::uint64_t kAlways = std::uint64_t{64} << 20;
  constexpr std::uint64_t kTimes = 32;
  return kAlways + kTimes * file_bytes;
}

}  // namespace cairn::detail
