// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>

#include "cairn/alignment/landmark_cloud.hpp"
#include "cairn/geometry/similarity3.hpp"

namespace cairn {

/// A cloud moved to its centroid, so that large coordinates do not cost precision.
struct CentredCloud {
  explicit CentredCloud(LandmarkCloud cloud);

  Eigen::Vector3d centre;  ///< the original centroid, without far outliers
  LandmarkCloud landmarks;
};

/// The same landmarks, all lengths multiplied by the scale.
std::shared_ptr<const CentredCloud> scaled(const CentredCloud& cloud, double scale);

/// Two centred clouds. Poses between them are called centred.
class CentredPair {
 public:
  CentredPair(LandmarkCloud source, LandmarkCloud target);
  CentredPair(std::shared_ptr<const CentredCloud> source,
              std::shared_ptr<const CentredCloud> target);

  const LandmarkCloud& source() const { return source_->landmarks; }
  const LandmarkCloud& target() const { return target_->landmarks; }

  Similarity3 centred(const Similarity3& target_from_source) const;
  Similarity3 uncentred(const Similarity3& pose) const;
  /// Covariance of uncentred(pose) from that of a centred pose; both left perturbations, (δt, δφ).
  Matrix6d uncentred(const Matrix6d& covariance, const Rigid3& pose) const;
  /// The same with the scale, (δt, δφ, δ log s).
  Matrix7d uncentred(const Matrix7d& covariance, const Similarity3& pose) const;

 private:
  std::shared_ptr<const CentredCloud> source_;
  std::shared_ptr<const CentredCloud> target_;
};

}  // namespace cairn
