// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/geometry/similarity3.hpp"
#include "cairn/registration/result.hpp"

namespace cairn::detail {

/// Adds an error that is independent of the others to the covariances that the result has.
/// @param spread its covariance, (δt, δφ, δ log s)
inline void widen(RegistrationResult& result, const Matrix7d& spread) {
  if (result.covariance) *result.covariance += spread.topLeftCorner<6, 6>();
  if (result.covariance_with_scale) *result.covariance_with_scale += spread;
}

}  // namespace cairn::detail
