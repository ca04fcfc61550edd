// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <string_view>

#include "cairn/geometry/rigid3.hpp"

namespace cairn {

/// What is to be thought of the best of several poses.
enum class Verdict {
  kAligned,    ///< it stands clear of chance and of every other pose
  kAmbiguous,  ///< it stands clear of chance, but another pose explains the maps about as well
  kRejected,   ///< it does not stand clear of chance
};

/// "aligned" and so on: the names in results.
std::string_view to_string(Verdict verdict);

/// A pose that explains the maps to some extent, distinct from the others.
struct PlacementCandidate {
  Rigid3 target_from_source;
  /// Share of the smaller map's landmarks that are matched, one to one.
  double support = 0.0;
  /// The most support there is close by, where landmarks that are one no longer meet but surfaces
  /// still do: what the shape of the scene gives alone.
  double chance = 0.0;
};

struct Judgement {
  Verdict verdict = Verdict::kRejected;
  std::string reason;  ///< one sentence for people, with its numbers
};

/// Judges the first of some candidates by the others.
///
/// The next best pose has been optimised as the best was, so its support is the most that a wrong pose
/// reaches in this very pair of maps; a right one must stand clear of it, by a share of the landmarks and
/// by what counting them leaves to chance.
///
/// @param candidates best support first
/// @param landmarks  of the smaller map, whose share the support is
/// @param radius     within which landmarks were matched, for the sentence
Judgement judge(std::span<const PlacementCandidate> candidates, std::size_t landmarks,
                double radius);

}  // namespace cairn
