// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/odometry/detail/link_covariance.hpp"

namespace cairn {

Matrix6d link_covariance(const Matrix6d& marginal, double turn_rad) {
  constexpr double kExcess = 30.0;   // of simulated sequences, whose sensor has no systematic error
  constexpr double kLength = 0.010;  // m, each axis
  constexpr double kAngle = 0.007;   // rad, each axis
  constexpr double kAngleByTurn = 0.008;  // rad a rad
  const double by_turn = kAngleByTurn * turn_rad;
  Matrix6d covariance = kExcess * marginal;
  covariance.diagonal().head<3>().array() += kLength * kLength;
  covariance.diagonal().tail<3>().array() += kAngle * kAngle + by_turn * by_turn;
  return covariance;
}

}  // namespace cairn
