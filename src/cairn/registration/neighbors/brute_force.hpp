// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "cairn/registration/concepts.hpp"

namespace cairn {

/// Nearest neighbours by looking at every point; a NeighborSearch. The plain definition that faster
/// searches are tested against.
class BruteForceSearch {
 public:
  explicit BruteForceSearch(std::span<const Eigen::Vector3d> points);

  std::size_t size() const { return points_.size(); }
  std::size_t nearest(const Eigen::Vector3d& query, std::span<Neighbor> out) const;

 private:
  std::vector<Eigen::Vector3d> points_;
};

static_assert(NeighborSearch<BruteForceSearch>);

}  // namespace cairn
