// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "cairn/core/executor.hpp"
#include "cairn/geometry/similarity3.hpp"
#include "cairn/placement/centred_pair.hpp"
#include "cairn/placement/likeness.hpp"
#include "cairn/registration/neighbors/batch_tree.hpp"

namespace cairn {

/// What two clouds have in common at a pose.
struct Support {
  /// Pairs of landmarks that are each other's nearest and within the radius, as a share of the smaller
  /// cloud: what a pose cannot gain by moving many landmarks onto one.
  double share = 0.0;
  double close_share = 0.0;  ///< the same within half the radius
  /// By how much likelier their distances are if some of these pairs are one landmark, seen twice, than
  /// if only surfaces meet: logarithm of the ratio, at least 0.
  double evidence = 0.0;
  /// The same without the part of the source, a sixteenth, that has the most of it: what one thing that
  /// stands in both places does not give.
  double spread_evidence = 0.0;
  std::optional<Likeness> likeness =
      {};  ///< of the pairs within the radius; nothing without descriptors
  /// Its evidence without the part of the source that has the most of it.
  double spread_likeness = 0.0;
};

/// Counts what two clouds have in common at centred poses.
///
/// Where landmarks of both lie on a surface independently of each other, two that are each other's nearest
/// are within a distance d with probability u = 1 - exp(-1.609·8·d²/h²), h being the distance to the
/// eighth neighbour (the geometric mean of both maps'): u is spread evenly over 0 to 1. Landmarks that
/// are one are far closer than that; their u is taken to have the density 1 / (2·√u). The evidence is
/// that of the mixture with the likeliest share of such pairs. It asks for no radius, and a match counts
/// by how little it is to be expected where it is. What landmarks look like is asked independently of that.
class SupportCounter {
 public:
  /// @param pair, trees of its positions; must outlive this
  /// @param sample the first of the source that are looked at; in random order, they stand for all
  SupportCounter(const CentredPair& pair, const BatchTree& source_tree,
                 const BatchTree& target_tree, std::size_t sample, const Executor& executor);

  Support operator()(const Similarity3& pose, double radius) const;

 private:
  const CentredPair& pair_;
  const BatchTree& source_tree_;
  const BatchTree& target_tree_;
  std::size_t sample_;
  std::vector<double> source_spacings_;  // of the sample
  std::vector<std::size_t> source_groups_;
  std::vector<double> target_spacings_;
  LikenessTest likeness_;
};

}  // namespace cairn
