// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>

#include "cairn/placement/centred_pair.hpp"
#include "cairn/registration/neighbors/batch_tree.hpp"

namespace cairn {

/// Counts what two clouds have in common at centred poses.
class SupportCounter {
 public:
  /// @param pair, trees of its positions; must outlive this
  /// @param sample the first of the source that are looked at; in random order, they stand for all
  SupportCounter(const CentredPair& pair, const BatchTree& source_tree,
                 const BatchTree& target_tree, std::size_t sample)
      : pair_(pair), source_tree_(source_tree), target_tree_(target_tree), sample_(sample) {}

  /// Pairs of landmarks that are each other's nearest and within the radius, as a share of the smaller
  /// cloud: what a pose cannot gain by moving many landmarks onto one.
  double operator()(const Rigid3& pose, double radius) const;

 private:
  const CentredPair& pair_;
  const BatchTree& source_tree_;
  const BatchTree& target_tree_;
  std::size_t sample_;
};

}  // namespace cairn
