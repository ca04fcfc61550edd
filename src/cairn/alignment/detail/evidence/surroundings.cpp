// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "cairn/alignment/detail/evidence/support_counter.hpp"
#include "cairn/core/statistics.hpp"
#include "cairn/geometry/detail/centroid.hpp"
#include "cairn/geometry/similarity3.hpp"

namespace cairn::detail {
namespace {

constexpr std::size_t kNeighbourhood = 24;  // landmarks of the sample
constexpr double kDense = 0.5;              // times the median of the matches about a match
constexpr double kInside = 0.97;            // quantile of the dense matches' distances
constexpr double kMargin = 1.15;            // times that
constexpr int kMedianSteps = 30;

// The point with the least sum of distances (Weiszfeld 1937).
Eigen::Vector3d geometric_median(std::span<const Eigen::Vector3d> points) {
  Eigen::Vector3d median = centroid(points);
  for (int step = 0; step < kMedianSteps; ++step) {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    double weights = 0.0;
    for (const Eigen::Vector3d& point : points) {
      const double weight = 1.0 / std::max((point - median).norm(), 1e-12);
      sum += weight * point;
      weights += weight;
    }
    median = sum / weights;
  }
  return median;
}

// The matched points whose neighbourhood has enough matches, which excludes most chance matches.
std::vector<Eigen::Vector3d> dense(std::span<const Eigen::Vector3d> sample,
                                   std::span<const std::uint32_t> matched) {
  std::vector<char> is_matched(sample.size(), 0);
  std::vector<Eigen::Vector3d> places;
  for (const std::uint32_t i : matched) {
    is_matched[i] = 1;
    places.push_back(sample[i]);
  }
  std::vector<double> counts(places.size());
  BatchTree(sample)
      .batch(kNeighbourhood)
      .for_each(places, Executor(), [&](std::size_t m, const NearestList auto& nearest) {
        double count = 0.0;
        for (std::size_t j = 0; j < nearest.size(); ++j) count += is_matched[nearest.index(j)];
        counts[m] = count;
      });
  const double least = kDense * lower_quantile(std::vector<double>(counts), 0.5);
  std::vector<Eigen::Vector3d> result;
  for (std::size_t m = 0; m < places.size(); ++m) {
    if (counts[m] >= least) result.push_back(places[m]);
  }
  return result;
}

Ball ball_about(std::span<const Eigen::Vector3d> points) {
  const Eigen::Vector3d centre = geometric_median(points);
  std::vector<double> distances;
  distances.reserve(points.size());
  for (const Eigen::Vector3d& point : points) distances.push_back((point - centre).norm());
  return {centre, kMargin * lower_quantile(std::move(distances), kInside)};
}

std::vector<Eigen::Vector3d> outside(std::span<const Eigen::Vector3d> points, const Ball& ball) {
  std::vector<Eigen::Vector3d> result;
  std::copy_if(points.begin(), points.end(), std::back_inserter(result),
               [&](const Eigen::Vector3d& point) { return !ball.contains(point); });
  return result;
}

}  // namespace

Surroundings surroundings(const PreparedCloud& source, const PreparedCloud& target,
                          const Similarity3& pose, double radius) {
  // Share of the radius within which two landmarks are the same rather than on one surface.
  constexpr double kClose = 0.25;
  const double close = kClose * radius;
  const std::span<const Eigen::Vector3d> sample = source.sample();
  std::vector<std::uint32_t> matched;
  for (const MutualMatch& match : mutual_matches(source, target, pose, sample.size())) {
    if (match.squared_distance <= close * close) matched.push_back(match.source);
  }
  if (matched.empty()) return {};
  const Ball here = ball_about(dense(sample, matched));
  const Ball there = {pose * here.centre, pose.scale() * here.radius};
  const std::vector<Eigen::Vector3d> of_source = outside(sample, here);
  const std::vector<Eigen::Vector3d> of_target = outside(target.sample(), there);
  const auto share = [](const auto& part, const auto& all) {
    return static_cast<double>(part.size()) / static_cast<double>(all.size());
  };
  Surroundings result{
      .landmarks = {},
      .extent = there.radius / radius,
      .share = std::min(share(of_source, sample), share(of_target, target.sample()))};
  result.landmarks =
      target.views().count_around(there, moved_points(of_source, pose), target.landmarks());
  result.landmarks += source.views().count_around(here, moved_points(of_target, pose.inverse()),
                                                  source.landmarks());
  return result;
}

}  // namespace cairn::detail
