// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>

namespace cairn {

/// From how many agreeing matches outside their largest cluster (DescriptorAgreement::spread) descriptors
/// decide by themselves.
inline constexpr std::size_t kDecisiveAgreement = 15;

/// How well matches of descriptors, found without regard to any pose, agree with a pose.
struct DescriptorAgreement {
  std::size_t matches = 0;   ///< mutual matches of descriptors
  std::size_t agreeing = 0;  ///< those whose landmarks the pose brings within the radius
  /// Agreeing matches outside the cluster that has most of them: one thing that stands in two places
  /// gives none of these.
  std::size_t spread = 0;
  /// Agreeing matches to expect if partners were drawn at random: measured on this pair, at this pose.
  double expected = 0.0;

  /// Log-likelihood ratio of `spread` against a Poisson count of mean `expected`, at least 0.
  double evidence() const;
};

}  // namespace cairn
