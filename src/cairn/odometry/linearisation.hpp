// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/odometry/landmark_graph.hpp"

namespace cairn {

/// Derivatives of an observation's residuals, which are in standard deviations: their covariance is
/// the identity.
struct LinearisedObservation {
  Eigen::Matrix3d by_point;             ///< in the world
  Eigen::Matrix<double, 3, 6> by_pose;  ///< left perturbation (δt, δφ)
};

LinearisedObservation linearise(const LandmarkGraph& graph, const KeypointReference& reference,
                                const Eigen::Vector3d& x_in_world);

/// What is known of the depth of a landmark whose first observation has no (credible) depth: the
/// order of magnitude. Information along the first view's axis; zero where there is a depth.
Eigen::Matrix3d unknown_depth_information(const LandmarkGraph& graph,
                                          const TrackedLandmark& landmark);

}  // namespace cairn
