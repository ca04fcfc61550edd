// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/placement/landmark_cloud.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <string_view>
#include <utility>

#include <fmt/format.h>

#include "cairn/core/error.hpp"

namespace cairn {

void LandmarkCloud::validate(std::string_view name) const {
  const auto require = [&](bool valid, std::string_view what, std::string_view expected) {
    if (!valid) throw Error(ErrorKind::kMisuse, name, what, expected);
  };
  require(covariances.empty() || covariances.size() == size(),
          fmt::format("{} covariances of {} landmarks", covariances.size(), size()),
          "one a landmark, or none");
  require(weights.empty() || weights.size() == size(),
          fmt::format("{} weights of {} landmarks", weights.size(), size()),
          "one a landmark, or none");
  for (std::size_t i = 0; i < size(); ++i) {
    require(positions[i].allFinite(), fmt::format("position of landmark {} is not finite", i),
            "numbers");
    require(covariances.empty() || covariances[i].allFinite(),
            fmt::format("covariance of landmark {} is not finite", i), "numbers");
    require(weight(i) >= 0.0 && std::isfinite(weight(i)),
            fmt::format("weight of landmark {} is {}", i, weight(i)), "0 or a positive number");
  }
}

LandmarkCloud landmark_cloud(const LandmarkMap& map, const std::optional<Metric>& weights,
                             const PointSetOptions& options) {
  PointSet points = point_set(map, weights, options);
  LandmarkCloud cloud;
  cloud.positions = std::move(points.positions);
  cloud.weights = std::move(points.confidences);
  for (double& weight : cloud.weights) weight = std::max(weight, 0.0);
  const double total = std::reduce(cloud.weights.begin(), cloud.weights.end());
  if (total > 0.0) {
    for (double& weight : cloud.weights) weight *= static_cast<double>(cloud.size()) / total;
  }
  if (map.has_covariances()) {
    cloud.covariances.reserve(cloud.size());
    for (const LandmarkIndex landmark : landmarks_to_align(map, options)) {
      cloud.covariances.push_back(
          map.covariance(landmark).value_or(Eigen::Matrix3d(Eigen::Matrix3d::Zero())));
    }
  }
  return cloud;
}

}  // namespace cairn
