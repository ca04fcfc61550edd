// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/geometry/rigid3.hpp"

namespace cairn {

/// What a link between neighbouring mini-maps is worth.
///
/// The marginal covariance of the last keyframe takes the errors of all measurements for independent. They are
/// not: what depth camera, calibration and shutter have wrong alike stays after any number of observations.
/// Measured on 59 links of TUM fr1/desk, xyz and rpy (0.5 and 1 m long) against motion capture after a hand-eye
/// fit, the marginal's normalised squared error is about 5,000 where 6 is right. So it is multiplied, and a
/// constant and a part that grows with how much the camera turned are added: 5.3 on the same links.
/// See docs/method.md.
/// @param marginal of the pose, (δt, δφ)
/// @param turn_rad sum of the angles between consecutive frames; not negative
Matrix6d link_covariance(const Matrix6d& marginal, double turn_rad);

}  // namespace cairn
