// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/geometry/rigid3.hpp"

namespace cairn {

/// Covariance of a link between neighbouring mini-maps.
///
/// The marginal covariance of the last keyframe assumes independent errors, but the common errors of depth
/// camera, calibration and shutter remain after any number of observations. On 59 links of TUM fr1/desk,
/// xyz and rpy (0.5 and 1 m long), compared with motion capture after a hand-eye fit, the marginal's
/// normalised squared error is about 5,000 instead of 6. Therefore it is multiplied, and a constant and a
/// part that grows with the camera's rotation are added: 5.3 on the same links. See docs/method.md.
/// @param marginal of the pose, (δt, δφ)
/// @param turn_rad sum of the angles between consecutive frames; not negative
Matrix6d link_covariance(const Matrix6d& marginal, double turn_rad);

}  // namespace cairn
