// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/experiments/statistics/validation.hpp"

#include <cmath>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "cairn/core/error.hpp"

namespace cairn {

void require_confidence(std::string_view where, double confidence) {
  const bool is_level = confidence > 0.0 && confidence < 1.0;  // false of NaN
  if (!is_level) {
    throw Error(ErrorKind::kMisuse, where, fmt::format("a confidence of {}", confidence),
                "above 0 and below 1, e.g. 0.95");
  }
}

void require_test_level(std::string_view where, double alpha) {
  const bool is_level = alpha > 0.0 && alpha < 0.5;
  if (!is_level) {
    throw Error(ErrorKind::kMisuse, where, fmt::format("an alpha of {}", alpha),
                "above 0 and below 0.5, e.g. 0.05");
  }
}

void require_finite(std::string_view where, std::span<const double> values) {
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (!std::isfinite(values[i])) {
      throw Error(ErrorKind::kMisuse, where, fmt::format("value {} is {}", i, values[i]),
                  "finite numbers");
    }
  }
}

void require_pairs(std::string_view where, std::size_t first, std::size_t second) {
  if (first != second) {
    throw Error(ErrorKind::kMisuse, where, fmt::format("{} and {} values", first, second),
                "as many of the one as of the other");
  }
}

void require_edges(std::string_view where, std::span<const double> edges) {
  bool ascending = edges.size() >= 2;
  for (std::size_t i = 0; i < edges.size(); ++i) {
    ascending = ascending && std::isfinite(edges[i]) && (i == 0 || edges[i - 1] < edges[i]);
  }
  if (!ascending) {
    throw Error(ErrorKind::kMisuse, where, fmt::format("edges {}", fmt::join(edges, ", ")),
                "at least two finite numbers that ascend");
  }
}

std::size_t require_blocks(std::string_view where, std::span<const std::vector<double>> blocks) {
  if (blocks.empty() || blocks.front().size() < 2) {
    const std::size_t treatments = blocks.empty() ? 0 : blocks.front().size();
    throw Error(ErrorKind::kMisuse, where,
                fmt::format("{} blocks of {} treatments", blocks.size(), treatments),
                "at least one of two");
  }
  for (std::size_t i = 0; i < blocks.size(); ++i) {
    if (blocks[i].size() != blocks.front().size()) {
      throw Error(ErrorKind::kMisuse, where,
                  fmt::format("block {} has {} values", i, blocks[i].size()),
                  fmt::format("{}, as the first", blocks.front().size()));
    }
    require_finite(fmt::format("{}, block {}", where, i), blocks[i]);
  }
  return blocks.front().size();
}

}  // namespace cairn
