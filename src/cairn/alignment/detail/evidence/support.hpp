// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <optional>

#include "cairn/alignment/detail/evidence/descriptor_agreement.hpp"
#include "cairn/alignment/detail/refinement/proximity.hpp"
#include "cairn/alignment/detail/search/likeness.hpp"

namespace cairn {

/// What two clouds have in common at a pose; computed by SupportCounter.
struct Support {
  /// Mutual nearest neighbours within r, r/2, r/4, ... of the radius r, in the sample.
  static constexpr std::size_t kRadii = 6;
  std::array<std::size_t, kRadii> within = {};
  /// Of `within`: the widest radius, a quarter of r, at which most matches are no chance.
  static constexpr std::size_t kFine = 2;
  /// One-to-one matches of all landmarks, as a share of the smaller cloud, estimated from the sample; at most 1.
  /// Mapping many landmarks onto one does not increase it.
  double share = 0.0;
  /// Log-likelihood ratio of the match distances, of all mutual nearest neighbours at any distance: some
  /// are the same landmarks, versus independent points on a surface. At least 0.
  double evidence = 0.0;
  /// The same without the sixteenth of the source that contributes most: excludes a single object that
  /// stands in both places.
  double spread_evidence = 0.0;
  /// Log-likelihood ratio of the match distances, versus those at the other candidates.
  ProximityEvidence proximity = {};
  /// Agreement of mutual descriptor matches with the pose; std::nullopt if the clouds have no descriptors
  /// of one kind.
  std::optional<DescriptorAgreement> agreement = {};
  /// Descriptor similarity of the matches; std::nullopt if the clouds have no descriptors of one kind.
  std::optional<Likeness> likeness = {};
  /// The likeness evidence without the part of the source that contributes most.
  double spread_likeness = 0.0;

  std::size_t matches() const { return within[0]; }
};

}  // namespace cairn
