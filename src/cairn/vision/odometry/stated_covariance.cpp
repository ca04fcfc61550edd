// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/odometry/stated_covariance.hpp"

namespace cairn {

Matrix6d stated_covariance(const Matrix6d& marginal) {
  constexpr double kExcess = 100.0;  // of simulated sequences, whose sensor has no systematic error
  constexpr double kLength = 0.004;  // m, each axis
  constexpr double kAngle = 0.004;   // rad, each axis
  Matrix6d covariance = kExcess * marginal;
  covariance.diagonal().head<3>().array() += kLength * kLength;
  covariance.diagonal().tail<3>().array() += kAngle * kAngle;
  return covariance;
}

}  // namespace cairn
