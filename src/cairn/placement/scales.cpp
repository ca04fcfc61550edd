// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/placement/scales.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "cairn/geometry/detail/central_part.hpp"

namespace cairn {
namespace {

constexpr std::size_t kSampled = 4096;  // enough for medians
constexpr double kLeastFine = 1e-3;     // of the coarse scale; maps may hold copies of one landmark

double median(std::vector<double> values) {
  if (values.empty()) return 0.0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace

double cloud_extent(const LandmarkCloud& cloud) {
  const Eigen::Vector3d centre = central_part(cloud.positions).centre;
  std::vector<double> distances;
  distances.reserve(cloud.size());
  for (const Eigen::Vector3d& position : cloud.positions) {
    distances.push_back((position - centre).norm());
  }
  return median(std::move(distances));
}

std::vector<double> landmark_spacings(std::span<const Eigen::Vector3d> points,
                                      const BatchTree& tree, const Executor& executor) {
  std::vector<double> spacings(points.size());
  tree.batch(kSpacingNeighbors + 1)
      .for_each(points, executor, [&](std::size_t i, const NearestList auto& nearest) {
        spacings[i] = std::sqrt(nearest.squared_distance(nearest.size() - 1));
      });
  return spacings;
}

CloudScales cloud_scales(const LandmarkCloud& cloud, const BatchTree& tree,
                         const Executor& executor) {
  const std::size_t stride = 1 + cloud.size() / kSampled;
  std::vector<Eigen::Vector3d> sample;
  std::vector<double> deviations;
  for (std::size_t i = 0; i < cloud.size(); i += stride) {
    sample.push_back(cloud.positions[i]);
    if (!cloud.covariances.empty()) {
      deviations.push_back(std::sqrt(cloud.covariances[i].trace() / 3.0));
    }
  }
  return {cloud_extent(cloud), median(landmark_spacings(sample, tree, executor)),
          median(std::move(deviations))};
}

KernelScales kernel_scales(const CloudScales& source, const CloudScales& target) {
  KernelScales scales;
  scales.fine =
      std::max(std::min(source.spacing, target.spacing), std::hypot(source.noise, target.noise));
  scales.fine *= kSmoothSpacings;
  scales.coarse = std::max(0.5 * std::min(source.extent, target.extent), scales.fine);
  // If all landmarks coincide.
  if (!(scales.coarse > 0.0)) scales.coarse = 1.0;
  scales.fine = std::max(scales.fine, kLeastFine * scales.coarse);
  return scales;
}

}  // namespace cairn
