// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/map/distinct_descriptors.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <limits>

namespace cairn {

bool is_binary(std::string_view kind) {
  constexpr std::array<std::string_view, 6> kBinary = {"ORB",   "BRIEF", "BRISK",
                                                       "AKAZE", "FREAK", "LATCH"};
  return std::find(kBinary.begin(), kBinary.end(), kind) != kBinary.end();
}

std::uint64_t descriptor_difference(std::span<const std::uint8_t> a,
                                    std::span<const std::uint8_t> b, DescriptorNorm norm) {
  std::uint64_t sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    if (norm == DescriptorNorm::kHamming) {
      sum += static_cast<std::uint64_t>(std::popcount(static_cast<std::uint8_t>(a[i] ^ b[i])));
    } else {
      const int by = int{a[i]} - int{b[i]};
      sum += static_cast<std::uint64_t>(by * by);
    }
  }
  return sum;
}

std::vector<std::size_t> distinct_descriptors(
    std::span<const std::span<const std::uint8_t>> descriptors, std::size_t first, std::size_t most,
    DescriptorNorm norm) {
  constexpr std::size_t kMost = 64;
  const std::size_t count = std::min(descriptors.size(), kMost);
  std::vector<std::uint64_t> nearest(count, std::numeric_limits<std::uint64_t>::max());
  std::vector<std::size_t> chosen = {first};
  while (chosen.size() < most) {
    for (std::size_t i = 0; i < count; ++i) {
      nearest[i] = std::min(
          nearest[i], descriptor_difference(descriptors[i], descriptors[chosen.back()], norm));
    }
    const auto farthest = std::max_element(nearest.begin(), nearest.end());
    if (farthest == nearest.end() || *farthest == 0) break;
    chosen.push_back(static_cast<std::size_t>(farthest - nearest.begin()));
  }
  return chosen;
}

void append_descriptors(DescriptorColumn& column,
                        std::span<const std::span<const std::uint8_t>> descriptors) {
  const std::size_t row = column.known.size();
  column.known.push_back(descriptors.empty() ? 0 : 1);
  if (descriptors.empty()) {
    column.bytes.resize(column.bytes.size() + column.bytes_each);
  } else {
    column.bytes.insert(column.bytes.end(), descriptors[0].begin(), descriptors[0].end());
  }
  if (descriptors.size() > 1) {
    column.further_offsets.resize(row + 1, column.further.size() / column.bytes_each);
    for (const auto& further : descriptors.subspan(1)) {
      column.further.insert(column.further.end(), further.begin(), further.end());
    }
  }
  if (column.has_further()) {
    column.further_offsets.resize(row + 2, column.further.size() / column.bytes_each);
  }
}

}  // namespace cairn
