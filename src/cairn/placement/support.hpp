// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/placement/centred_pair.hpp"
#include "cairn/registration/align.hpp"
#include "cairn/registration/neighbors/batch_tree.hpp"

namespace cairn {

/// What two clouds have in common at a pose.
struct PoseSupport {
  /// Pairs of landmarks that are each other's nearest and within the radius, as a share of the
  /// smaller cloud: what a pose cannot gain by moving many landmarks onto one.
  double mutual = 0.0;
  Overlap overlap;  ///< within the radius
};

/// Counts support of centred poses.
class SupportCounter {
 public:
  /// @param pair and trees of its positions; must outlive this
  SupportCounter(const CentredPair& pair, const BatchTree& source_tree,
                 const BatchTree& target_tree)
      : pair_(pair), source_tree_(source_tree), target_tree_(target_tree) {}

  PoseSupport operator()(const Rigid3& pose, double radius) const;

 private:
  const CentredPair& pair_;
  const BatchTree& source_tree_;
  const BatchTree& target_tree_;
};

}  // namespace cairn
