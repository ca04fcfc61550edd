// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include "cairn/core/executor.hpp"
#include "cairn/placement/centred_pair.hpp"
#include "cairn/placement/proximity.hpp"
#include "cairn/placement/scales.hpp"
#include "cairn/placement/seen_views.hpp"
#include "cairn/registration/neighbors/batch_tree.hpp"

namespace cairn {

/// A cloud of landmarks with all that is needed of it alone to find and judge poses between it and any
/// other, computed once. Copies share it; any number of threads may use it.
class PreparedCloud {
 public:
  /// How many landmarks are looked for in another cloud.
  static constexpr std::size_t kSample = 4096;
  static constexpr std::size_t kGroups = Proximity::kGroups;  ///< spatial parts of these

  /// @param seed of the random order, which depends on the landmarks too
  /// @param name of the cloud, for messages
  /// @throws Error (misuse) as LandmarkCloud::validate()
  explicit PreparedCloud(LandmarkCloud cloud, std::uint64_t seed = 0,
                         const Executor& executor = Executor(), std::string_view name = "cloud");

  std::size_t size() const { return landmarks().size(); }
  /// Centred, and in random order, the likelier early the more they weigh: the first n are a sample.
  const LandmarkCloud& landmarks() const { return centred_->landmarks; }
  const std::shared_ptr<const CentredCloud>& centred() const { return centred_; }
  /// Index of each of the landmarks in the cloud that was prepared.
  std::span<const std::uint32_t> order() const { return *order_; }
  /// Of the landmarks' positions.
  const BatchTree& tree() const { return parts_->tree; }
  std::shared_ptr<const BatchTree> shared_tree() const { return {parts_, &parts_->tree}; }
  const CloudScales& scales() const { return parts_->scales; }
  /// Of the first kSample alone, whose landmarks are farther apart.
  const CloudScales& sample_scales() const { return parts_->sample_scales; }
  /// landmark_spacings() of each landmark.
  std::span<const double> spacings() const { return parts_->spacings; }
  /// spatial_groups() of the first kSample.
  std::span<const std::size_t> groups() const { return parts_->groups; }
  const SeenViews& views() const { return parts_->views; }

  /// The same landmarks in the same order, all lengths times the scale.
  PreparedCloud scaled(double scale, const Executor& executor) const;

 private:
  struct Parts {
    Parts(const LandmarkCloud& landmarks, const Executor& executor);

    BatchTree tree;
    std::vector<double> spacings;
    CloudScales scales;
    CloudScales sample_scales;
    std::vector<std::size_t> groups;
    SeenViews views;
  };

  PreparedCloud() = default;

  std::shared_ptr<const CentredCloud> centred_;
  std::shared_ptr<const std::vector<std::uint32_t>> order_;
  std::shared_ptr<const Parts> parts_;
};

}  // namespace cairn
