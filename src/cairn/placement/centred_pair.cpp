// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/placement/centred_pair.hpp"

#include <utility>

#include "cairn/geometry/central_part.hpp"
#include "cairn/geometry/covariance.hpp"

namespace cairn {
namespace {

LandmarkCloud moved(LandmarkCloud cloud, const Eigen::Vector3d& by) {
  for (Eigen::Vector3d& position : cloud.positions) position += by;
  for (LandmarkView& view : cloud.views) view.centre += by;
  return cloud;
}

Rigid3 translation(const Eigen::Vector3d& by) {
  return {Eigen::Quaterniond::Identity(), by};
}

}  // namespace

CentredPair::CentredPair(LandmarkCloud source, LandmarkCloud target)
    : source_centre_(central_part(source.positions).centre),
      target_centre_(central_part(target.positions).centre),
      source_(moved(std::move(source), -source_centre_)),
      target_(moved(std::move(target), -target_centre_)) {}

Similarity3 CentredPair::centred(const Similarity3& target_from_source) const {
  return Similarity3(translation(-target_centre_)) * target_from_source *
         Similarity3(translation(source_centre_));
}

Similarity3 CentredPair::uncentred(const Similarity3& pose) const {
  return Similarity3(translation(target_centre_)) * pose *
         Similarity3(translation(-source_centre_));
}

Matrix6d CentredPair::uncentred(const Matrix6d& covariance, const Rigid3& pose) const {
  // The translations differ by R·source_centre and a constant: a rotation error acts on that arm too.
  Matrix6d jacobian = Matrix6d::Identity();
  jacobian.topRightCorner<3, 3>() = skew(pose.quaternion() * source_centre_);
  return propagated_covariance(jacobian, covariance);
}

Matrix7d CentredPair::uncentred(const Matrix7d& covariance, const Similarity3& pose) const {
  const Eigen::Vector3d arm = pose.linear() * source_centre_;
  Matrix7d jacobian = Matrix7d::Identity();
  jacobian.block<3, 3>(0, 3) = skew(arm);
  jacobian.block<3, 1>(0, 6) = -arm;
  return propagated_covariance(jacobian, covariance);
}

}  // namespace cairn
