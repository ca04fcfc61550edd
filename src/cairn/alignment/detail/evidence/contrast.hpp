// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "cairn/alignment/alignment.hpp"
#include "cairn/core/execution.hpp"
#include "cairn/registration/neighbors/batch_tree.hpp"

namespace cairn::detail {

/// Contrasts of the landmarks of a cloud, as ranks from -1 (darkest) to 1. The contrast is a landmark's lightness
/// minus the mean of its eight nearest neighbours. It depends less on exposure, illumination and surface than the
/// lightness does. NaN if unknown.
/// @param lightness LandmarkCloud::lightness
/// @param tree      search tree of the positions
/// @return empty if most contrasts are unknown or equal, e.g. if all landmarks have one colour
std::vector<double> contrast_ranks(std::span<const double> lightness,
                                   std::span<const Eigen::Vector3d> positions,
                                   const BatchTree& tree, const Executor& executor);

/// Sums over pairs of ranks, for their correlation.
class ContrastPairs {
 public:
  void add(double source, double target);
  ContrastPairs& operator+=(const ContrastPairs& other);
  ContrastPairs operator-(const ContrastPairs& other) const;

  std::size_t count() const { return static_cast<std::size_t>(count_); }
  double correlation() const;  ///< 0 if undefined
  /// Log-likelihood ratio of a positive correlation versus none, for a bivariate normal distribution: -n/2·ln(1 - r²).
  double evidence() const;

 private:
  double count_ = 0.0;
  Eigen::Vector2d sum_ = Eigen::Vector2d::Zero();
  Eigen::Matrix2d products_ = Eigen::Matrix2d::Zero();
};

/// @param by_group pairs of each part of the source
ContrastAgreement contrast_agreement(std::span<const ContrastPairs> by_group);

}  // namespace cairn::detail
