// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <vector>

#include "cairn/core/execution.hpp"
#include "cairn/registration/stages.hpp"

namespace cairn {

/// Exact nearest neighbours of many queries at once; a BatchSearch. Keeps a copy of the points.
///
/// Nearby queries descend the tree together, one per lane of a vector register. The lanes compute
/// in single precision and only exclude points, with a proven error bound. The distances of the
/// remaining points are computed and ordered in double precision. The answers equal those of a
/// brute-force search, bit by bit, on every instruction set. The instruction set is chosen at run
/// time.
class BatchTree {
 public:
  class Batch;

  explicit BatchTree(std::span<const Eigen::Vector3d> points);
  ~BatchTree();
  BatchTree(BatchTree&&) noexcept;
  BatchTree& operator=(BatchTree&&) noexcept;

  std::size_t size() const;
  /// @param squared_limit largest squared distance of a point to find
  std::size_t nearest(const Eigen::Vector3d& query, std::span<Neighbor> out,
                      double squared_limit = std::numeric_limits<double>::infinity()) const;

  /// Indices of the points, in an order in which consecutive points are close.
  std::span<const std::uint32_t> order() const;

  /// A batch for repeated queries of the k nearest points; the tree must outlive the batch.
  /// @param order order of the queries, with consecutive queries close together. If it is
  ///        empty, the first search sorts its queries, and later searches keep that order.
  Batch batch(std::size_t k, std::vector<std::uint32_t> order = {}) const;

 private:
  struct Nodes;
  std::unique_ptr<const Nodes> nodes_;
};

/// The k nearest points of many queries that move little between calls. Not thread-safe.
///
/// For each query, stores a few more candidates than k and a lower bound of the distance to all
/// other points. While the query's motion stays within the proven bound, only the candidates are
/// ranked again. Otherwise, the farthest candidate bounds a new search. Large jumps of queries cost
/// time, never exactness.
class BatchTree::Batch {
 public:
  /// Neighbours per query: k, or all points if there are fewer.
  std::size_t count() const { return count_; }

  /// The nearest points of a query, as NeighborSearch defines them; computes distances on demand. Valid
  /// only during the visit.
  class Nearest;

  /// Calls `visit(i, nearest)` once for each query, with the count() points nearest to queries[i],
  /// from several threads, in any order.
  template <class Visit>
  void for_each(std::span<const Eigen::Vector3d> queries, const Executor& executor,
                const Visit& visit);

 private:
  friend class BatchTree;

  static constexpr std::size_t kBlock = 256;
  static constexpr std::size_t kParallelFrom = 2000;  // with fewer queries, threads do not pay

  struct Answers {
    std::array<std::uint8_t, kBlock> certain;  // not 0: the first candidates are the neighbours
    std::vector<Neighbor> settled;             // neighbours of each query that is not certain
  };

  Batch(const Nodes& nodes, std::size_t k, std::vector<std::uint32_t> order);

  // Puts new queries into spatial order and drops the state of the old ones.
  void prepare(std::span<const Eigen::Vector3d> queries);
  // Finds the neighbours of the queries at [begin, end) of that order, one block.
  Answers answer(std::span<const Eigen::Vector3d> queries, std::size_t begin, std::size_t end);
  // Finds the neighbours of one query that the vector code could not settle.
  void settle(const Eigen::Vector3d& query, std::size_t slot, std::span<Neighbor> found) const;
  // The first candidate of a query; the others follow kBlock apart.
  const std::uint32_t* candidates_of(std::size_t slot) const {
    return candidates_.data() + slot / kBlock * kBlock * capacity_ + slot % kBlock;
  }

  const Nodes* nodes_;
  const Eigen::Vector3d* points_;  // in the order of the tree
  const std::uint32_t* index_;     // their indices in the set
  std::size_t count_;
  std::size_t capacity_ = 0;  // candidates per query; 0: k is too large for batches
  std::vector<std::uint32_t> order_;
  // State of the queries, by place in the order: see batch_kernel::Known.
  std::array<std::vector<float>, 3> place_;
  std::vector<float> outside_;
  std::vector<std::uint32_t> candidates_;
};

class BatchTree::Batch::Nearest {
 public:
  std::size_t size() const { return batch_.count_; }

  std::uint32_t index(std::size_t j) const {
    return settled_ != nullptr ? settled_[j].index : batch_.index_[candidates_[j * kBlock]];
  }

  double squared_distance(std::size_t j) const {
    return settled_ != nullptr
               ? settled_[j].squared_distance
               : cairn::squared_distance(batch_.points_[candidates_[j * kBlock]], query_);
  }

 private:
  friend class Batch;

  // @param settled the neighbours; null: the candidates
  Nearest(const Batch& batch, const Eigen::Vector3d& query, const std::uint32_t* candidates,
          const Neighbor* settled)
      : batch_(batch), query_(query), candidates_(candidates), settled_(settled) {}

  const Batch& batch_;
  const Eigen::Vector3d& query_;
  const std::uint32_t* candidates_;
  const Neighbor* settled_;
};

template <class Visit>
void BatchTree::Batch::for_each(std::span<const Eigen::Vector3d> queries, const Executor& executor,
                                const Visit& visit) {
  prepare(queries);
  const auto run = [&](std::size_t begin, std::size_t end) {
    const Answers answers = answer(queries, begin, end);
    const Neighbor* settled = answers.settled.data();
    for (std::size_t slot = begin; slot < end; ++slot) {
      const std::size_t i = order_[slot];
      if (answers.certain[slot - begin] != 0) {
        visit(i, Nearest(*this, queries[i], candidates_of(slot), nullptr));
      } else {
        visit(i, Nearest(*this, queries[i], nullptr, settled));
        settled += count_;
      }
    }
  };
  if (queries.size() < kParallelFrom) {
    for (std::size_t begin = 0; begin < queries.size(); begin += kBlock) {
      run(begin, std::min(begin + kBlock, queries.size()));
    }
  } else {
    executor.for_blocks(queries.size(), kBlock, run);
  }
}

static_assert(BatchSearch<BatchTree>);

}  // namespace cairn
