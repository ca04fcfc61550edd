// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include "cairn/alignment/detail/cloud_scales.hpp"
#include "cairn/alignment/detail/evidence/proximity.hpp"
#include "cairn/alignment/detail/evidence/seen_views.hpp"
#include "cairn/alignment/prepared_map.hpp"
#include "cairn/core/execution.hpp"
#include "cairn/registration/neighbors/batch_tree.hpp"

namespace cairn::detail {

/// A landmark cloud with all data that any alignment needs, computed once. Its landmarks are moved to their centroid,
/// so that large coordinates do not cost precision. Poses between such clouds are called centred. Copies share the
/// data. Any number of threads may use a prepared cloud.
class PreparedCloud {
 public:
  /// Number of landmarks in the sample.
  static constexpr std::size_t kSample = 4096;
  static constexpr std::size_t kGroups = Proximity::kGroups;  ///< spatial groups of the sample

  /// Leaves out placeholder covariances (has_placeholder_covariances()). Dithers positions that lie on a grid, unless
  /// the grid is much finer than their spacing.
  /// @param seed seed of the random order, which also depends on the landmarks
  /// @param name name of the cloud in messages
  /// @throws Error (misuse) as LandmarkCloud::validate()
  explicit PreparedCloud(LandmarkCloud cloud, std::uint64_t seed = 0,
                         const Executor& executor = Executor(), std::string_view name = "cloud");

  /// Prepares a cloud for a refinement alone: in the given order, with all covariances, without scales, spacings,
  /// groups and views.
  static PreparedCloud plain(LandmarkCloud cloud);

  std::size_t size() const { return landmarks().size(); }
  /// Whether the cloud's covariances were placeholders, and so were left out.
  bool ignores_covariances() const { return ignores_covariances_; }
  /// The landmarks, centred and in random order, so that the first n are a sample. Landmarks of larger weight tend to
  /// come earlier.
  const LandmarkCloud& landmarks() const { return *landmarks_; }
  /// Positions of the first kSample landmarks, or of all if there are fewer.
  std::span<const Eigen::Vector3d> sample() const;
  /// The original centroid, without far outliers.
  const Eigen::Vector3d& centre() const { return centre_; }
  /// CloudScales::extent.
  double extent() const { return extent_; }
  /// Index of each landmark in the original cloud; empty if the order is the original one.
  std::span<const std::uint32_t> order() const { return *order_; }
  /// Index of a landmark in the original cloud.
  std::uint32_t as_given(std::uint32_t landmark) const {
    return order_->empty() ? landmark : (*order_)[landmark];
  }
  /// Whether a sensor or a program sampled the points on a lattice, as in a depth image or a scan. A cloud with
  /// descriptors has landmarks instead.
  bool is_lattice() const { return is_lattice_; }
  /// Search tree of the landmarks' positions.
  const BatchTree& tree() const { return *tree_; }
  /// Indices of the first `first` landmarks, ordered so that consecutive landmarks are close, for BatchTree::batch().
  std::vector<std::uint32_t> close_by(std::size_t first) const;
  const CloudScales& scales() const { return more_->scales; }
  /// Scales of the first kSample landmarks, whose spacing is larger.
  const CloudScales& sample_scales() const { return more_->sample_scales; }
  /// landmark_spacings() of each landmark.
  std::span<const double> spacings() const { return more_->spacings; }
  /// spatial_groups() of the first kSample landmarks.
  std::span<const std::size_t> groups() const { return more_->groups; }
  const SeenViews& views() const { return more_->views; }
  /// contrast_ranks() of all landmarks; empty if the cloud has descriptors, which say more.
  std::span<const double> contrasts() const { return more_->contrasts; }

  /// The same landmarks in the same order, all lengths multiplied by the scale.
  PreparedCloud scaled(double scale, const Executor& executor) const;
  /// The same for a refinement alone; see plain().
  PreparedCloud scaled_plainly(double scale) const;
  /// The earliest landmark in each cell of the finest grid that has at most kSample occupied cells. The result does not
  /// depend on how densely a sensor sampled a surface. It has no descriptors and views.
  PreparedCloud even(const Executor& executor) const;
  /// The mirror image, with positions, covariances and weights only.
  PreparedCloud mirrored() const;

 private:
  struct More {
    More(const LandmarkCloud& landmarks, const BatchTree& tree, const Executor& executor);

    std::vector<double> spacings;
    CloudScales scales;
    CloudScales sample_scales;
    std::vector<std::size_t> groups;
    SeenViews views;
    std::vector<double> contrasts;
  };

  PreparedCloud() = default;

  Eigen::Vector3d centre_ = Eigen::Vector3d::Zero();
  double extent_ = 0.0;
  std::shared_ptr<const LandmarkCloud> landmarks_;
  std::shared_ptr<const std::vector<std::uint32_t>> order_;
  std::shared_ptr<const BatchTree> tree_;
  std::shared_ptr<const More> more_;  // null if plain
  bool ignores_covariances_ = false;
  bool is_lattice_ = false;
};

/// Converts a pose between the original clouds to a centred pose.
Similarity3 centred_pose(const PreparedCloud& source, const PreparedCloud& target,
                         const Similarity3& target_from_source);
/// The inverse of centred_pose().
Similarity3 uncentred_pose(const PreparedCloud& source, const PreparedCloud& target,
                           const Similarity3& centred);

}  // namespace cairn::detail
