// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/geometry/similarity3.hpp"
#include "cairn/placement/landmark_cloud.hpp"

namespace cairn {

/// Two clouds, each moved to its centroid, so that coordinates far from an origin cost no precision.
/// Poses between the moved clouds are called centred.
class CentredPair {
 public:
  CentredPair(LandmarkCloud source, LandmarkCloud target);

  const LandmarkCloud& source() const { return source_; }
  const LandmarkCloud& target() const { return target_; }

  Similarity3 centred(const Similarity3& target_from_source) const;
  Similarity3 uncentred(const Similarity3& pose) const;
  /// Covariance of uncentred(pose) for that of a centred pose; both left perturbations, (δt, δφ).
  Matrix6d uncentred(const Matrix6d& covariance, const Rigid3& pose) const;
  /// The same with the scale's, (δt, δφ, δ log s).
  Matrix7d uncentred(const Matrix7d& covariance, const Similarity3& pose) const;

 private:
  Eigen::Vector3d source_centre_;
  Eigen::Vector3d target_centre_;
  LandmarkCloud source_;
  LandmarkCloud target_;
};

}  // namespace cairn
