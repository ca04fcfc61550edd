// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/geometry/similarity3.hpp"
#include "cairn/registration/result.hpp"

namespace cairn::detail {

/// Adds the covariance of a further, independent error to the covariances that the result has.
/// @param spread covariance of this error, (δt, δφ, δ log s)
inline void widen(RegistrationResult& result, const Matrix7d& spread) {
  if (result.covariance) *result.covariance += spread.topLeftCorner<6, 6>();
  if (result.covariance_with_scale) *result.covariance_with_scale += spread;
}

}  // namespace cairn::detail
