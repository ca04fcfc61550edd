// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <vector>

#include "cairn/alignment/search/descriptor_matches.hpp"
#include "cairn/core/random.hpp"
#include "cairn/geometry/similarity3.hpp"

namespace cairn {

struct DescriptorPoseOptions {
  std::size_t matches = 800;  ///< number of matches to use, the most similar ones
  int draws = 4000;           ///< number of triples to try; three times as many with a free scale
  std::size_t poses = 8;      ///< largest number of proposals
  /// Largest difference between distances of landmarks, in the target's unit; positive.
  double tolerance = 0.0;
  bool free_scale = false;           ///< estimate the source's scale; if false, it is 1
  double least_scale = 1.0 / 400.0;  ///< bounds of a free scale
  double most_scale = 400.0;
};

/// A pose that several descriptor matches agree with.
struct DescriptorPose {
  Similarity3 pose;          ///< centred
  std::size_t agreeing = 0;  ///< matches within the tolerance
};

/// Centred poses from mutual descriptor matches, by consensus of random triples (RANSAC, Fischler and
/// Bolles 1981): three landmarks with equal distances in both clouds, or with a free scale equal
/// proportions, give a pose, which is re-estimated from all agreeing matches.
///
/// @return distinct poses, most agreeing matches first; each with at least four
std::vector<DescriptorPose> descriptor_poses(const DescriptorMatches& matches, Random random,
                                             const DescriptorPoseOptions& options);

}  // namespace cairn
