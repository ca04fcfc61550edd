// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/alignment/refinement/centred_pair.hpp"

#include <utility>

#include "cairn/geometry/covariance.hpp"
#include "cairn/geometry/detail/central_part.hpp"

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

CentredCloud::CentredCloud(LandmarkCloud cloud)
    : centre(central_part(cloud.positions).centre), landmarks(moved(std::move(cloud), -centre)) {}

std::shared_ptr<const CentredCloud> scaled(const CentredCloud& cloud, double scale) {
  auto result = std::make_shared<CentredCloud>(cloud);
  result->centre *= scale;
  result->landmarks = scaled(std::move(result->landmarks), scale);
  return result;
}

CentredPair::CentredPair(LandmarkCloud source, LandmarkCloud target)
    : CentredPair(std::make_shared<const CentredCloud>(std::move(source)),
                  std::make_shared<const CentredCloud>(std::move(target))) {}

CentredPair::CentredPair(std::shared_ptr<const CentredCloud> source,
                         std::shared_ptr<const CentredCloud> target)
    : source_(std::move(source)), target_(std::move(target)) {}

Similarity3 CentredPair::centred(const Similarity3& target_from_source) const {
  return Similarity3(translation(-target_->centre)) * target_from_source *
         Similarity3(translation(source_->centre));
}

Similarity3 CentredPair::uncentred(const Similarity3& pose) const {
  return Similarity3(translation(target_->centre)) * pose *
         Similarity3(translation(-source_->centre));
}

Matrix6d CentredPair::uncentred(const Matrix6d& covariance, const Rigid3& pose) const {
  // The translations differ by R·source_centre and a constant, so a rotation error also acts on that lever
  // arm.
  Matrix6d jacobian = Matrix6d::Identity();
  jacobian.topRightCorner<3, 3>() = skew(pose.quaternion() * source_->centre);
  return propagated_covariance(jacobian, covariance);
}

Matrix7d CentredPair::uncentred(const Matrix7d& covariance, const Similarity3& pose) const {
  const Eigen::Vector3d arm = pose.linear() * source_->centre;
  Matrix7d jacobian = Matrix7d::Identity();
  jacobian.block<3, 3>(0, 3) = skew(arm);
  jacobian.block<3, 1>(0, 6) = -arm;
  return propagated_covariance(jacobian, covariance);
}

}  // namespace cairn
