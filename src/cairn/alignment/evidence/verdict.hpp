// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>

#include "cairn/alignment/detail/evidence/seen_views.hpp"
#include "cairn/alignment/detail/evidence/support.hpp"
#include "cairn/geometry/similarity3.hpp"
#include "cairn/pose_graph/pose_graph.hpp"
#include "cairn/registration/icp.hpp"

namespace cairn {

/// A candidate pose, distinct from the others.
struct PlacementCandidate {
  Rigid3 target_from_source;
  double scale = 1.0;  ///< s in x_target = R·(s·x_source) + t
  Support support = {};
  /// Share of compared lines of sight, of both maps' keyframes, on which the other map has a landmark in
  /// front of what the keyframe saw. std::nullopt if too few lines were compared. See SeenViews.
  std::optional<double> contradicted = {};
  /// Probability that this pose is right. 1 minus the sum over all candidates is that none is.
  double probability = 0.0;

  /// The pose with its scale.
  Similarity3 similarity() const { return {scale, target_from_source}; }
};

struct Judgement {
  Verdict verdict = Verdict::kRejected;
  std::string
      reason;  ///< one sentence for people: the decision and the number behind it, then the evidence
};

/// Judges the likeliest candidate. A pose without a covariance, with an open direction, with another pose at which
/// the landmarks match as well, or contradicted by the surroundings of its matches is at most ambiguous: an object
/// that stands in two places matches as well as a place does.
///
/// @param candidates likeliest first
/// @param result     pose of the first candidate, with covariance and open directions
/// @param landmarks  number in the smaller map, to which the supports refer
/// @param least      least probability of an aligned pose
/// @param around     surrounding_sights() of the first candidate
Judgement judge(std::span<const PlacementCandidate> candidates, const RegistrationResult& result,
                std::size_t landmarks, double least = 0.99, const SightCounts& around = {});

}  // namespace cairn
