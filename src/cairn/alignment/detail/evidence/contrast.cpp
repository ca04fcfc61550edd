// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/alignment/detail/evidence/contrast.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "cairn/alignment/detail/cloud_scales.hpp"

namespace cairn::detail {

std::vector<double> contrast_ranks(std::span<const double> lightness,
                                   std::span<const Eigen::Vector3d> positions,
                                   const BatchTree& tree, const Executor& executor) {
  if (lightness.empty()) return {};
  const std::size_t count = positions.size();
  std::vector<double> contrasts(count, std::numeric_limits<double>::quiet_NaN());
  tree.batch(kSpacingNeighbors + 1)
      .for_each(positions, executor, [&](std::size_t i, const NearestList auto& nearest) {
        double sum = 0.0;
        double known = 0.0;
        for (std::size_t j = 0; j < nearest.size(); ++j) {
          const double there = lightness[nearest.index(j)];
          if (nearest.index(j) == i || std::isnan(there)) continue;
          sum += there;
          ++known;
        }
        if (known > 0.0) contrasts[i] = lightness[i] - sum / known;
      });
  std::vector<std::pair<double, std::size_t>> sorted;
  for (std::size_t i = 0; i < count; ++i) {
    if (!std::isnan(contrasts[i])) sorted.emplace_back(contrasts[i], i);
  }
  if (2 * sorted.size() < count) return {};
  std::sort(sorted.begin(), sorted.end());
  for (std::size_t begin = 0; begin < sorted.size();) {
    std::size_t end = begin + 1;
    while (end < sorted.size() && sorted[end].first == sorted[begin].first) ++end;
    if (2 * (end - begin) > sorted.size()) return {};
    const auto middle = static_cast<double>(begin + end) / static_cast<double>(sorted.size());
    for (; begin < end; ++begin) contrasts[sorted[begin].second] = middle - 1.0;
  }
  return contrasts;
}

void ContrastPairs::add(double source, double target) {
  const Eigen::Vector2d pair(source, target);
  ++count_;
  sum_ += pair;
  products_ += pair * pair.transpose();
}

ContrastPairs& ContrastPairs::operator+=(const ContrastPairs& other) {
  count_ += other.count_;
  sum_ += other.sum_;
  products_ += other.products_;
  return *this;
}

ContrastPairs ContrastPairs::operator-(const ContrastPairs& other) const {
  ContrastPairs result = *this;
  result.count_ -= other.count_;
  result.sum_ -= other.sum_;
  result.products_ -= other.products_;
  return result;
}

double ContrastPairs::correlation() const {
  constexpr double kLeastVariance = 1e-6;  // of ranks from -1 to 1
  if (count_ < 3.0) return 0.0;
  const Eigen::Matrix2d covariance = (products_ - sum_ * sum_.transpose() / count_) / count_;
  const double least = covariance.diagonal().minCoeff();
  if (least < kLeastVariance) return 0.0;
  return covariance(0, 1) / std::sqrt(covariance(0, 0) * covariance(1, 1));
}

double ContrastPairs::evidence() const {
  constexpr double kMost = 0.999;  // equal ranks are not certain either
  const double r = std::clamp(correlation(), 0.0, kMost);
  return -0.5 * count_ * std::log1p(-r * r);
}

ContrastAgreement contrast_agreement(std::span<const ContrastPairs> by_group) {
  ContrastPairs all;
  for (const ContrastPairs& group : by_group) all += group;
  ContrastAgreement result{all.count(), all.correlation(), all.evidence()};
  for (const ContrastPairs& group : by_group) {
    result.spread = std::min(result.spread, (all - group).evidence());
  }
  return result;
}

}  // namespace cairn::detail
