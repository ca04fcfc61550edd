// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include "cairn/core/random.hpp"

namespace cairn::detail {

/// Draws one random index from each run of `stride` consecutive indices in [0, count); the last run may be
/// shorter. Returns an even, ascending sample, unbiased by periods in the order.
inline std::vector<std::size_t> one_of_each(std::size_t stride, std::size_t count, Random random) {
  std::vector<std::size_t> sample;
  sample.reserve(count / stride + 1);
  for (std::size_t begin = 0; begin < count; begin += stride) {
    sample.push_back(begin + random.index(std::min(stride, count - begin)));
  }
  return sample;
}

}  // namespace cairn::detail
