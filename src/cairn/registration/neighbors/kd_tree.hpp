// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <memory>
#include <span>

#include "cairn/registration/concepts.hpp"

namespace cairn {

/// Exact nearest neighbours with a k-d tree; a NeighborSearch. Keeps a copy of the points. Builds in O(n
/// log n), answers a query in about O(log n).
class KdTree {
 public:
  explicit KdTree(std::span<const Eigen::Vector3d> points);
  ~KdTree();
  KdTree(KdTree&&) noexcept;
  KdTree& operator=(KdTree&&) noexcept;

  std::size_t size() const;
  std::size_t nearest(const Eigen::Vector3d& query, std::span<Neighbor> out) const;

 private:
  struct Index;
  std::unique_ptr<Index> index_;
};

static_assert(NeighborSearch<KdTree>);

}  // namespace cairn
