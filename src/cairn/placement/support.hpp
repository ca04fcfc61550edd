// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <optional>

#include "cairn/placement/descriptor_agreement.hpp"
#include "cairn/placement/likeness.hpp"
#include "cairn/placement/proximity.hpp"

namespace cairn {

/// What two clouds have in common at a pose: see SupportCounter.
struct Support {
  /// Mutual nearest neighbours within r, r/2, r/4, ... of the radius r, among the landmarks looked at.
  static constexpr std::size_t kRadii = 6;
  std::array<std::size_t, kRadii> within = {};
  /// The matches of all landmarks, as a share of the smaller cloud: what a pose cannot gain by moving
  /// many landmarks onto one.
  double share = 0.0;
  /// By how much likelier the distances of all pairs that are each other's nearest, whatever the radius,
  /// are if some of these pairs are one landmark, seen twice, than if only surfaces meet: logarithm of the
  /// ratio, at least 0.
  double evidence = 0.0;
  /// The same without the part of the source, a sixteenth, that has the most of it: what one thing that
  /// stands in both places does not give.
  double spread_evidence = 0.0;
  /// Of the distances of mutual nearest neighbours, against those at the other candidates.
  ProximityEvidence proximity = {};
  /// Of mutual descriptor matches; std::nullopt if the clouds have no descriptors of one kind.
  std::optional<DescriptorAgreement> agreement = {};
  /// Of the matches; nothing where the clouds have no descriptors to compare.
  std::optional<Likeness> likeness = {};
  /// Its evidence without the part of the source that has the most of it.
  double spread_likeness = 0.0;

  std::size_t matches() const { return within[0]; }
};

}  // namespace cairn
