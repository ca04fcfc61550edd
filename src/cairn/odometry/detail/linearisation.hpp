// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>

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

/// How much the n-th observation of a landmark (n = 1 is the first) adds, 1 if it were independent of
/// those before. Views from nearby have the same errors in part: of how a patch is seen, of the
/// depth that its surface is given. With a correlation c between any two, n of them are worth
/// n / (1 + (n - 1)·c) independent ones; this is what the n-th adds to that.
double information_share(std::size_t n);

/// By how much a landmark's own residuals exceed what the noise explains: the mean squared residual a
/// degree of freedom, at least 1. Its covariance is multiplied by that (Birge ratio), for a landmark
/// that does not fit, e.g. at an edge that is elsewhere from each side, is known less well than others.
double excess_of_residuals(const LandmarkGraph& graph, const TrackedLandmark& landmark);

/// What is known of the depth of a landmark whose first observation has no (credible) depth: the
/// order of magnitude. Information along the first view's axis; zero where there is a depth.
Eigen::Matrix3d unknown_depth_information(const LandmarkGraph& graph,
                                          const TrackedLandmark& landmark);

}  // namespace cairn
