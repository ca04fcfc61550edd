// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include <pcl/common/point_tests.h>
#include <pcl/registration/correspondence_estimation.h>

#include "cairn/core/error.hpp"
#include "cairn/registration/correspondence/confident_neighbor.hpp"

/// Cairn's data association inside the Point Cloud Library's own registration classes.
namespace cairn::pcl_adapter {

/// Correspondences for any PCL registration that takes a CorrespondenceEstimationBase: the match of
/// a source point is the most confident of its k nearest target points (paper Eq. 6), by the same
/// rule as cairn::align. Reciprocal correspondences hold by that rule both ways.
///
///     icp.setCorrespondenceEstimation(
///         pcl::make_shared<cairn::pcl_adapter::ConfidenceCorrespondenceEstimation<
///             pcl::PointXYZ, pcl::PointXYZ>>(target_confidences));
///
/// Source and target have one point type: PCL 1.13's own base class does not compile for two.
/// Points with a coordinate that is not finite are never matched. PCL computes distances in single
/// precision, so choices between points about equally far can differ from cairn::align's.
template <class PointSource, class PointTarget, class Scalar = float>
class ConfidenceCorrespondenceEstimation
    : public ::pcl::registration::CorrespondenceEstimationBase<PointSource, PointTarget, Scalar> {
  using Base = ::pcl::registration::CorrespondenceEstimationBase<PointSource, PointTarget, Scalar>;

 public:
  using Ptr = ::pcl::shared_ptr<ConfidenceCorrespondenceEstimation>;
  using ConstPtr = ::pcl::shared_ptr<const ConfidenceCorrespondenceEstimation>;

  /// @param target_confidences one a point of the target cloud, or empty: the nearest is the match
  /// @param k                  candidates a point, at least 1
  /// @param source_confidences one a point of the source cloud, or empty; for reciprocal
  ///                           correspondences
  /// @throws cairn::Error (misuse) if k is 0
  explicit ConfidenceCorrespondenceEstimation(std::vector<double> target_confidences,
                                              std::size_t k = 5,
                                              std::vector<double> source_confidences = {})
      : target_confidences_(std::move(target_confidences)),
        source_confidences_(std::move(source_confidences)),
        k_(k) {
    this->corr_name_ = "ConfidenceCorrespondenceEstimation";
    if (k == 0) throw Error(ErrorKind::kMisuse, "k", "0", "at least 1");
  }

  /// @throws cairn::Error (misuse) if the confidences are not as many as the cloud's points
  void determineCorrespondences(::pcl::Correspondences& correspondences,
                                double max_distance = std::numeric_limits<double>::max()) override {
    find(correspondences, max_distance, false);
  }

  void determineReciprocalCorrespondences(
      ::pcl::Correspondences& correspondences,
      double max_distance = std::numeric_limits<double>::max()) override {
    find(correspondences, max_distance, true);
  }

  typename Base::Ptr clone() const override {
    return typename Base::Ptr(new ConfidenceCorrespondenceEstimation(*this));
  }

 private:
  void find(::pcl::Correspondences& correspondences, double max_distance, bool reciprocal) {
    correspondences.clear();
    if (!this->initCompute()) return;
    if (reciprocal && !this->initComputeReciprocal()) return;
    check("target", target_confidences_, this->target_->size());
    check("source", source_confidences_, this->input_->size());
    for (const auto i : *this->indices_) {
      const PointSource& point = (*this->input_)[static_cast<std::size_t>(i)];
      const auto match = choose(*this->tree_, point, target_confidences_, max_distance);
      if (!match) continue;
      if (reciprocal) {
        const PointTarget& matched = (*this->target_)[match->index];
        const auto back =
            choose(*this->tree_reciprocal_, matched, source_confidences_, max_distance);
        if (!back || back->index != static_cast<std::uint32_t>(i)) continue;
      }
      correspondences.emplace_back(i, static_cast<::pcl::index_t>(match->index),
                                   static_cast<float>(match->squared_distance));
    }
    this->deinitCompute();
  }

  static void check(const std::string& side, const std::vector<double>& confidences,
                    std::size_t points) {
    if (confidences.empty() || confidences.size() == points) return;
    throw Error(ErrorKind::kMisuse, side + " confidences",
                std::to_string(confidences.size()) + " of " + std::to_string(points) + " points",
                "one a point, or none");
  }

  std::optional<Neighbor> choose(const typename Base::KdTree& tree, const PointTarget& query,
                                 std::span<const double> confidences, double max_distance) const {
    if (!::pcl::isXYZFinite(query)) return std::nullopt;
    const int k = confidences.empty() ? 1 : static_cast<int>(k_);
    ::pcl::Indices indices(static_cast<std::size_t>(k));
    std::vector<float> distances(static_cast<std::size_t>(k));
    const int count = tree.nearestKSearch(query, k, indices, distances);
    std::vector<Neighbor> nearest;
    for (std::size_t i = 0; i < static_cast<std::size_t>(count); ++i) {
      nearest.push_back({static_cast<std::uint32_t>(indices[i]), distances[i]});
    }
    // PCL leaves the order of equal distances open; Cairn does not.
    std::sort(nearest.begin(), nearest.end(), [](const Neighbor& a, const Neighbor& b) {
      return std::tie(a.squared_distance, a.index) < std::tie(b.squared_distance, b.index);
    });
    return most_confident(NeighborList(nearest), confidences, max_distance * max_distance);
  }

  std::vector<double> target_confidences_;
  std::vector<double> source_confidences_;
  std::size_t k_;
};

}  // namespace cairn::pcl_adapter
