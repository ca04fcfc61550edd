// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "cairn/geometry/similarity3.hpp"
#include "cairn/placement/seen_views.hpp"
#include "cairn/placement/support.hpp"
#include "cairn/registration/icp.hpp"

namespace cairn {

/// What is to be thought of the best of several poses.
enum class Verdict {
  kAligned,    ///< it is right beyond doubt
  kAmbiguous,  ///< something is the same beyond doubt, but it does not make one pose of several right
  kRejected,  ///< perhaps none is right
};

/// "aligned" and so on: the names in results.
std::string_view to_string(Verdict verdict);

/// A pose that explains the maps to some extent, distinct from the others.
struct PlacementCandidate {
  Rigid3 target_from_source;
  double scale = 1.0;  ///< of the source, which is scaled before it is moved
  Support support = {};
  /// Share of the lines of sight of either map's keyframes on which the other map has a landmark in front
  /// of what they saw; nothing where too few lines were compared to say. See SeenViews.
  std::optional<double> contradicted = {};
  /// That it is the right pose; what is missing to 1 over all candidates is that none is.
  double probability = 0.0;

  /// The pose with its scale.
  Similarity3 similarity() const { return {scale, target_from_source}; }
};

struct Judgement {
  Verdict verdict = Verdict::kRejected;
  std::string reason;  ///< one sentence for people, with its numbers
};

/// Judges the best of some candidates by their probabilities. A pose is at most ambiguous, however likely
/// it is, without a covariance, with an open direction, or where what surrounds its matches contradicts it:
/// one thing that stands in two places matches as well as a place does.
///
/// @param candidates likeliest first
/// @param result     the first candidate's pose, with its covariance and open directions
/// @param landmarks  of the smaller map, whose share the supports are
/// @param least      probability from which the pose is aligned
/// @param around     surrounding_sights() of the first candidate
Judgement judge(std::span<const PlacementCandidate> candidates, const RegistrationResult& result,
                std::size_t landmarks, double least = 0.99, const SightCounts& around = {});

}  // namespace cairn
