// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <vector>

#include "cairn/core/random.hpp"
#include "cairn/geometry/similarity3.hpp"
#include "cairn/placement/detail/descriptor_matches.hpp"

namespace cairn {

struct DescriptorPoseOptions {
  std::size_t matches = 800;  ///< the most alike that poses are made from
  int draws = 4000;  ///< triples of matches that are tried; with a free scale three times as many
  std::size_t poses = 8;  ///< at most so many are proposed
  /// By how much distances between landmarks may differ, in the target's unit; positive.
  double tolerance = 0.0;
  bool free_scale = false;           ///< the source's scale is estimated; else it is 1
  double least_scale = 1.0 / 400.0;  ///< bounds of a free scale
  double most_scale = 400.0;
};

/// A pose on which several matches of descriptors agree.
struct DescriptorPose {
  Similarity3 pose;          ///< centred
  std::size_t agreeing = 0;  ///< matches that it brings within the tolerance
};

/// Centred poses that mutual matches of descriptors propose, by consensus of random triples (RANSAC,
/// Fischler and Bolles 1981): three landmarks as far from each other in one cloud as in the other, or,
/// with a free scale, in one proportion, give a pose; it is re-estimated from all matches that agree.
///
/// @return distinct, most agreeing matches first; at least four matches agree on each
std::vector<DescriptorPose> descriptor_poses(const DescriptorMatches& matches, Random random,
                                             const DescriptorPoseOptions& options);

}  // namespace cairn
