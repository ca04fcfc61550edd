// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

namespace cairn::detail {

/// How much memory the columns of a map may take that a file of so many bytes spells out only in part:
/// those of descriptors and of named numbers, which every landmark has room for, and compressed ones. Maps
/// that people make take less than a tenth.
constexpr std::uint64_t memory_budget(std::uint64_t file_bytes) {
  constexpr std::uint64_t kAlways = std::uint64_t{64} << 20;
  constexpr std::uint64_t kTimes = 32;
  return kAlways + kTimes * file_bytes;
}

}  // namespace cairn::detail
