// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "cairn/core/executor.hpp"
#include "cairn/registration/concepts.hpp"

namespace cairn {

/// Exact nearest neighbours of many queries at once; a BatchSearch. Keeps a copy of the points.
///
/// Queries that are close together descend the tree together, one in each lane of a vector register.
/// The lanes compute in single precision and only rule points out, by a proven bound of their error;
/// what is left is measured and ordered in double precision. So the answers are those of looking at
/// every point, bit by bit, on every instruction set; which one is used is decided at run time.
class BatchTree {
 public:
  class Batch;

  explicit BatchTree(std::span<const Eigen::Vector3d> points);
  ~BatchTree();
  BatchTree(BatchTree&&) noexcept;
  BatchTree& operator=(BatchTree&&) noexcept;

  std::size_t size() const;
  std::size_t nearest(const Eigen::Vector3d& query, std::span<Neighbor> out) const;

  /// For asking for the k nearest points of many queries, again and again; the tree must outlive it.
  Batch batch(std::size_t k) const;

 private:
  struct Nodes;
  std::unique_ptr<const Nodes> nodes_;
};

/// The k nearest points of many queries that move little from one call to the next. Not thread-safe.
///
/// For each query it keeps a few more candidates than k, and how far from where the query then was
/// all other points are. While the query's motion since is less than the proven bound, only its
/// candidates are ranked again; else the farthest of them bounds a new search. Queries that jump cost
/// time, never exactness.
class BatchTree::Batch {
 public:
  /// How many neighbours each query has: k, or all points if there are fewer.
  std::size_t count() const { return count_; }

  /// Calls `visit(i, neighbors)` once for each query, from several threads and in no particular
  /// order, with the count() points nearest to queries[i] as NeighborSearch defines them.
  template <class Visit>
  void for_each(std::span<const Eigen::Vector3d> queries, const Executor& executor,
                const Visit& visit) {
    if (count_ == 0) {
      for (std::size_t i = 0; i < queries.size(); ++i) visit(i, std::span<const Neighbor>());
      return;
    }
    prepare(queries);
    const auto run = [&](std::size_t begin, std::size_t end) {
      std::vector<Neighbor> found((end - begin) * count_);
      answer(queries, begin, end, found);
      const std::span<const Neighbor> all = found;
      for (std::size_t slot = begin; slot < end; ++slot) {
        visit(std::size_t{order_[slot]}, all.subspan((slot - begin) * count_, count_));
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

 private:
  friend class BatchTree;

  static constexpr std::size_t kBlock = 256;
  static constexpr std::size_t kParallelFrom = 2000;  // fewer are hardly worth the threads

  // What is known of a query.
  struct Known {
    Eigen::Vector3d place;  // where it was when its candidates were found
    double outside = -1.0;  // points that are no candidates are at least this far from there
  };

  // The candidates of a query in order.
  struct Ranked {
    bool exact;   // no other point can be among the nearest
    double kth;   // squared distance of the count_-th
    double last;  // and of the last
  };

  Batch(const Nodes& nodes, std::size_t k);

  // Puts new queries into spatial order and forgets what was known of others.
  void prepare(std::span<const Eigen::Vector3d> queries);
  // The neighbours of the queries in places [begin, end) of that order.
  void answer(std::span<const Eigen::Vector3d> queries, std::size_t begin, std::size_t end,
              std::span<Neighbor> found);
  template <std::size_t kCapacity>
  void answer_with(std::span<const Eigen::Vector3d> queries, std::size_t begin, std::size_t end,
                   std::span<Neighbor> found);
  // Orders the candidates of a query by their distances; `found` if exact.
  template <std::size_t kCapacity>
  Ranked rank(std::size_t slot, const Eigen::Vector3d& query, double outside, Neighbor* found);

  const Nodes* nodes_;
  std::size_t count_;
  std::size_t capacity_;  // candidates a query; 0: more than batches are made for
  std::vector<std::uint32_t> order_;
  std::vector<Known> known_;               // by place in the order
  std::vector<std::uint32_t> candidates_;  // capacity_ each, places in the tree
};

static_assert(BatchSearch<BatchTree>);

}  // namespace cairn
