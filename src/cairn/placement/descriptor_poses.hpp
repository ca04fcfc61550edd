// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <vector>

#include "cairn/core/executor.hpp"
#include "cairn/core/random.hpp"
#include "cairn/placement/centred_pair.hpp"

namespace cairn {

struct DescriptorPoseOptions {
  std::size_t sample = 2048;  ///< the first landmarks of each cloud that are compared
  std::size_t matches = 600;  ///< the closest pairs of descriptors that are looked at
  int draws = 4000;           ///< triples of pairs that are tried
  std::size_t poses = 8;      ///< at most so many are proposed
  double tolerance = 0.0;     ///< by how much distances between landmarks may differ; positive
  Executor executor = Executor();
};

/// Centred poses that pairs of like descriptors propose; none where either cloud has no descriptors or
/// they are of different kinds. Nothing but proposals: whether one is right, geometry must tell.
///
/// Pairs are each other's closest: by differing bits for binary kinds (ORB, BRIEF, BRISK, AKAZE, FREAK,
/// LATCH), by the sum of squared differences of bytes for all others. Triples of pairs whose landmarks
/// are as far from each other in one cloud as in the other give poses, ranked by how many pairs they
/// bring together.
///
/// @return distinct, most pairs first; the same for any number of threads
std::vector<Rigid3> descriptor_poses(const CentredPair& pair, Random random,
                                     const DescriptorPoseOptions& options);

}  // namespace cairn
