// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/geometry/rigid3.hpp"

namespace cairn {

/// Covariance that a map states of a keyframe's pose, and a link of the next mini-map's.
///
/// The marginal covariance assumes independent errors, but the common errors of depth camera, calibration
/// and shutter remain after any number of observations. Therefore it is multiplied, and a constant is added. The
/// constants are from 50 links of TUM fr1/desk, xyz and rpy (0.5 and 1 m long), compared with motion capture
/// after a hand-eye fit. Errors did not grow with the camera's rotation there. See docs/evidence.md.
/// @param marginal of the pose relative to the map's first keyframe, (δt, δφ)
Matrix6d stated_covariance(const Matrix6d& marginal);

}  // namespace cairn
