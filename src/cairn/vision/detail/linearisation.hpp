// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>

#include "cairn/vision/detail/landmark_graph.hpp"

namespace cairn::detail {

/// Derivatives of an observation's residuals in standard deviations, so that their covariance is the
/// identity.
struct LinearisedObservation {
  Eigen::Matrix3d by_point;             ///< in the world
  Eigen::Matrix<double, 3, 6> by_pose;  ///< left perturbation (δt, δφ)
};

LinearisedObservation linearise(const LandmarkGraph& graph, const KeypointReference& reference,
                                const Eigen::Vector3d& x_in_world);

/// Information of the n-th observation of a landmark (n = 1 is the first), relative to an independent one.
/// Nearby views share errors of the patch's appearance and of the surface's depth. With a correlation c
/// between any two, n observations equal n / (1 + (n - 1)·c) independent ones; returns the increment of the
/// n-th.
double information_share(std::size_t n);

/// Mean squared residual of a landmark per degree of freedom, at least 1 (Birge ratio), by which its
/// covariance is multiplied: a landmark that does not fit, e.g. at an occluding edge, is less certain.
double excess_of_residuals(const LandmarkGraph& graph, const TrackedLandmark& landmark);

/// Prior information on the depth of a landmark whose first observation has no credible depth: its order of
/// magnitude, along the first view's axis; zero if it has a depth.
Eigen::Matrix3d unknown_depth_information(const LandmarkGraph& graph,
                                          const TrackedLandmark& landmark);

}  // namespace cairn::detail
