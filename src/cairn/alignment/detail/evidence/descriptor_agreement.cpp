// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/alignment/detail/evidence/descriptor_agreement.hpp"

#include <cmath>

namespace cairn {

double DescriptorAgreement::evidence() const {
  // Lower bound, because chance agreements are counted on a finite number of pairs.
  constexpr double kLeastExpected = 0.25;
  const double mean = expected > kLeastExpected ? expected : kLeastExpected;
  const auto count = static_cast<double>(spread);
  if (count <= mean) return 0.0;
  return count * std::log(count / mean) - (count - mean);
}

}  // namespace cairn
