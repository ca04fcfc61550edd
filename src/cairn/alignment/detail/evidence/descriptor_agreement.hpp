// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>

namespace cairn {

/// From this many agreeing matches outside their largest cluster (DescriptorAgreement::spread), descriptors
/// decide alone.
inline constexpr std::size_t kDecisiveAgreement = 15;

/// Agreement of descriptor matches, found without a pose, with a pose.
struct DescriptorAgreement {
  std::size_t matches = 0;   ///< mutual descriptor matches
  std::size_t agreeing = 0;  ///< matches whose landmarks the pose brings within the radius
  /// Agreeing matches outside their largest cluster: excludes a single object that stands in two places.
  std::size_t spread = 0;
  /// Number of agreeing matches expected by chance, with random partners, on this pair and pose.
  double expected = 0.0;

  /// Log-likelihood ratio of `spread` against a Poisson count of mean `expected`, at least 0.
  double evidence() const;
};

}  // namespace cairn
