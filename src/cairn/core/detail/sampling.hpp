// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include "cairn/core/random.hpp"

namespace cairn {

/// Of [0, count) one number of each `stride` in a row (fewer in the last), drawn at random: an even
/// sample, ascending, that no period in the order can mislead.
inline std::vector<std::size_t> one_of_each(std::size_t stride, std::size_t count, Random random) {
  std::vector<std::size_t> sample;
  sample.reserve(count / stride + 1);
  for (std::size_t begin = 0; begin < count; begin += stride) {
    sample.push_back(begin + random.index(std::min(stride, count - begin)));
  }
  return sample;
}

}  // namespace cairn
