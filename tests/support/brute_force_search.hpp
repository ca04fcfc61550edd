// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <tuple>
#include <vector>

#include "cairn/registration/stages.hpp"

namespace cairn::testing {

/// Nearest neighbours by looking at every point: the plain definition that searches are tested
/// against, and a NeighborSearch for tests of other stages.
class BruteForceSearch {
 public:
  explicit BruteForceSearch(std::span<const Eigen::Vector3d> points)
      : points_(points.begin(), points.end()) {}

  std::size_t size() const { return points_.size(); }

  std::size_t nearest(const Eigen::Vector3d& query, std::span<Neighbor> out) const {
    std::vector<Neighbor> all(points_.size());
    for (std::uint32_t i = 0; i < points_.size(); ++i) {
      all[i] = {i, (points_[i] - query).squaredNorm()};
    }
    const std::size_t count = std::min(out.size(), all.size());
    std::partial_sort(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(count), all.end(),
                      [](const Neighbor& a, const Neighbor& b) {
                        return std::tie(a.squared_distance, a.index) <
                               std::tie(b.squared_distance, b.index);
                      });
    std::copy_n(all.begin(), count, out.begin());
    return count;
  }

 private:
  std::vector<Eigen::Vector3d> points_;
};

static_assert(NeighborSearch<BruteForceSearch>);

}  // namespace cairn::testing
