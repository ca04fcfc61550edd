// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/evaluation/covariance_calibration.hpp"

#include <algorithm>
#include <cmath>
#include <string_view>
#include <type_traits>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "cairn/core/error.hpp"
#include "cairn/core/error_statistics.hpp"
#include "cairn/geometry/decompositions.hpp"

namespace cairn {
namespace {

template <class Bound>
void require_ascending(const std::vector<Bound>& bins, std::string_view field) {
  bool ascending = true;
  for (std::size_t i = 0; i < bins.size(); ++i) {
    // Written so that NaN fails.
    if constexpr (std::is_floating_point_v<Bound>) ascending = ascending && std::isfinite(bins[i]);
    if (i > 0) ascending = ascending && bins[i - 1] < bins[i];
  }
  if (!ascending) {
    throw Error(ErrorKind::kMisuse, fmt::format("CovarianceCalibrationOptions.{}", field),
                fmt::format("{}", fmt::join(bins, ", ")), "finite numbers that ascend");
  }
}

std::optional<NeesStatistics> nees_statistics(const std::vector<double>& nees) {
  if (nees.empty()) return std::nullopt;
  NeesStatistics result;
  result.count = nees.size();
  std::size_t inside = 0;
  for (const double value : nees) {
    result.mean += value / static_cast<double>(nees.size());
    inside += value < kNees95 ? 1 : 0;
  }
  result.median = quantile(nees, 0.5);
  result.inside_95 = static_cast<double>(inside) / static_cast<double>(nees.size());
  return result;
}

// Sorts the judged landmarks into bins by one of their properties.
template <class Bound>
std::vector<NeesBin<Bound>> binned(std::span<const LandmarkEstimate> landmarks,
                                   const std::vector<std::optional<double>>& nees,
                                   const std::vector<Bound>& bounds,
                                   std::optional<Bound> LandmarkEstimate::*property) {
  std::vector<std::vector<double>> values(bounds.size());
  for (std::size_t i = 0; i < landmarks.size(); ++i) {
    const auto& value = landmarks[i].*property;
    if (!nees[i] || !value) continue;
    const auto above = std::upper_bound(bounds.begin(), bounds.end(), *value) - bounds.begin();
    if (above > 0) values[static_cast<std::size_t>(above - 1)].push_back(*nees[i]);
  }
  std::vector<NeesBin<Bound>> bins;
  for (std::size_t i = 0; i < bounds.size(); ++i) {
    NeesBin<Bound> bin;
    bin.from = bounds[i];
    if (i + 1 < bounds.size()) bin.to = bounds[i + 1];
    bin.statistics = nees_statistics(values[i]);
    bins.push_back(std::move(bin));
  }
  return bins;
}

}  // namespace

void CovarianceCalibrationOptions::validate() const {
  require_ascending(depth_bins, "depth_bins");
  require_ascending(observation_bins, "observation_bins");
}

std::optional<double> normalised_squared_error(const Eigen::Vector3d& error,
                                               const Eigen::Matrix3d& covariance) {
  constexpr double kSmallestRatio = 1e-14;
  const auto [variances, directions] = symmetric_eigen<3>(covariance);
  if (!(variances[0] > kSmallestRatio * variances[2])) return std::nullopt;
  const Eigen::Vector3d along = directions.transpose() * error;
  return (along.array().square() / variances.array()).sum();
}

CovarianceCalibration calibrate_covariances(std::span<const LandmarkEstimate> landmarks,
                                            const CovarianceCalibrationOptions& options) {
  options.validate();
  CovarianceCalibration result;
  result.nees.resize(landmarks.size());
  std::vector<double> judged;
  for (std::size_t i = 0; i < landmarks.size(); ++i) {
    const LandmarkEstimate& landmark = landmarks[i];
    if (!landmark.truth) {
      ++result.without_truth;
    } else if (!landmark.covariance) {
      ++result.without_covariance;
    } else {
      result.nees[i] =
          normalised_squared_error(landmark.estimate - *landmark.truth, *landmark.covariance);
      if (result.nees[i]) {
        judged.push_back(*result.nees[i]);
      } else {
        ++result.singular;
      }
    }
  }
  result.all = nees_statistics(judged);
  result.by_depth = binned(landmarks, result.nees, options.depth_bins, &LandmarkEstimate::depth);
  result.by_observations =
      binned(landmarks, result.nees, options.observation_bins, &LandmarkEstimate::observations);
  return result;
}

}  // namespace cairn
