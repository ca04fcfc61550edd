// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/alignment/detail/cloud_scales.hpp"

#include <algorithm>
#include <cmath>

#include "cairn/core/statistics.hpp"
#include "cairn/geometry/detail/central_part.hpp"

namespace cairn::detail {
namespace {

constexpr std::size_t kSampled = 4096;  // enough for medians
constexpr double kLeastFine = 1e-3;     // of the coarse scale; maps may hold copies of one landmark
// Largest credible noise, as a share of the extent. Larger covariances are placeholders, e.g. the identity, with which
// all poses in a room would count as one.
constexpr double kMostNoise = 0.1;

std::size_t stride(const LandmarkCloud& cloud) {
  return 1 + cloud.size() / kSampled;
}

// The median; 0 if there are no values.
double median(std::vector<double> values) {
  return values.empty() ? 0.0 : upper_median(values);
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

double cloud_noise(const LandmarkCloud& cloud) {
  std::vector<double> deviations;
  for (std::size_t i = 0; i < cloud.covariances.size(); i += stride(cloud)) {
    deviations.push_back(std::sqrt(cloud.covariances[i].trace() / 3.0));
  }
  return median(std::move(deviations));
}

bool has_placeholder_covariances(const LandmarkCloud& cloud) {
  return cloud_noise(cloud) > kMostNoise * cloud_extent(cloud);
}

CloudScales cloud_scales(const LandmarkCloud& cloud, const BatchTree& tree,
                         const Executor& executor) {
  std::vector<Eigen::Vector3d> sample;
  for (std::size_t i = 0; i < cloud.size(); i += stride(cloud)) {
    sample.push_back(cloud.positions[i]);
  }
  return {cloud_extent(cloud), median(landmark_spacings(sample, tree, executor)),
          cloud_noise(cloud)};
}

KernelScales kernel_scales(const CloudScales& source, const CloudScales& target) {
  KernelScales scales;
  const double noise = std::hypot(source.noise, target.noise);
  const bool is_believed = noise <= kMostNoise * std::min(source.extent, target.extent);
  scales.fine = std::max(std::min(source.spacing, target.spacing), is_believed ? noise : 0.0);
  scales.fine *= kSmoothSpacings;
  scales.coarse = std::max(0.5 * std::min(source.extent, target.extent), scales.fine);
  // If all landmarks coincide.
  if (!(scales.coarse > 0.0)) scales.coarse = 1.0;
  scales.fine = std::max(scales.fine, kLeastFine * scales.coarse);
  return scales;
}

}  // namespace cairn::detail
