// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/geometry/limits.hpp"

#include <algorithm>
#include <cmath>

#include "cairn/geometry/covariance.hpp"

namespace cairn {

std::string_view coordinate_defect(std::initializer_list<double> numbers) {
  const auto is_finite = [](double number) { return std::isfinite(number); };
  if (!std::all_of(numbers.begin(), numbers.end(), is_finite)) return "is not finite";
  const auto is_beyond = [](double number) { return std::abs(number) > kLargestCoordinate; };
  if (std::any_of(numbers.begin(), numbers.end(), is_beyond)) return "is beyond the limit";
  return {};
}

std::string_view coordinate_defect(const Eigen::Vector3d& point) {
  if (are_coordinates(point)) return {};
  return coordinate_defect({point.x(), point.y(), point.z()});
}

std::string_view coordinate_defect(const Rigid3& pose) {
  if (!pose.quaternion().coeffs().allFinite()) return "is not finite";
  return coordinate_defect(pose.translation());
}

std::string landmark_covariance_defect(const Eigen::Matrix3d& covariance) {
  std::string defect = covariance_defect(covariance);
  // The largest entry of a covariance matrix is a variance.
  if (defect.empty() && covariance.diagonal().maxCoeff() > kLargestVariance) {
    defect = "beyond the limit: it has a variance of more than 1e18";
  }
  return defect;
}

}  // namespace cairn
