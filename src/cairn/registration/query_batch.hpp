// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <span>
#include <utility>
#include <vector>

#include "cairn/registration/concepts.hpp"

namespace cairn {

/// A batch for a NeighborSearch without batches: one query after the other.
template <NeighborSearch Search>
class OneByOneBatch {
 public:
  /// @param search must outlive this
  OneByOneBatch(const Search& search, std::size_t k)
      : search_(&search), count_(std::min(k, std::size_t{search.size()})) {}

  template <class Visit>
  void for_each(std::span<const Eigen::Vector3d> queries, const Executor& executor,
                const Visit& visit) const {
    constexpr std::size_t kBlock = 256;
    executor.for_blocks(queries.size(), kBlock, [&](std::size_t begin, std::size_t end) {
      std::vector<Neighbor> found(count_);
      for (std::size_t i = begin; i < end; ++i) {
        search_->nearest(queries[i], found);
        visit(i, NeighborList(found));
      }
    });
  }

 private:
  const Search* search_;
  std::size_t count_;
};

/// Asks a search for the k nearest points of many queries, with the search's own batches if it has them:
/// see BatchSearch.
template <NeighborSearch Search>
auto query_batch(const Search& search, std::size_t k) {
  if constexpr (BatchSearch<Search>) {
    return search.batch(k);
  } else {
    return OneByOneBatch<Search>(search, k);
  }
}

template <NeighborSearch Search>
using QueryBatch = decltype(query_batch(std::declval<const Search&>(), std::size_t{}));

}  // namespace cairn
