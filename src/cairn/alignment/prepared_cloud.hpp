// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include "cairn/alignment/detail/evidence/seen_views.hpp"
#include "cairn/alignment/detail/refinement/proximity.hpp"
#include "cairn/alignment/refinement/centred_pair.hpp"
#include "cairn/alignment/search/scales.hpp"
#include "cairn/core/executor.hpp"
#include "cairn/registration/neighbors/batch_tree.hpp"

namespace cairn {

/// A landmark cloud with everything computed once that alignments with any other cloud need. Copies share
/// the data; any number of threads may use it.
class PreparedCloud {
 public:
  /// Number of landmarks in the sample.
  static constexpr std::size_t kSample = 4096;
  static constexpr std::size_t kGroups = Proximity::kGroups;  ///< spatial parts of the sample

  /// Leaves out covariances that are placeholders (has_placeholder_covariances()).
  /// @param seed of the random order, which also depends on the landmarks
  /// @param name of the cloud, for messages
  /// @throws Error (misuse) as LandmarkCloud::validate()
  explicit PreparedCloud(LandmarkCloud cloud, std::uint64_t seed = 0,
                         const Executor& executor = Executor(), std::string_view name = "cloud");

  std::size_t size() const { return landmarks().size(); }
  /// Whether the cloud's covariances were placeholders, and so were left out.
  bool ignores_covariances() const { return ignores_covariances_; }
  /// Centred, in random order; landmarks of larger weight tend to come earlier. The first n are a sample.
  const LandmarkCloud& landmarks() const { return centred_->landmarks; }
  const std::shared_ptr<const CentredCloud>& centred() const { return centred_; }
  /// Index of each landmark in the original cloud.
  std::span<const std::uint32_t> order() const { return *order_; }
  /// Of the landmarks' positions.
  const BatchTree& tree() const { return parts_->tree; }
  std::shared_ptr<const BatchTree> shared_tree() const { return {parts_, &parts_->tree}; }
  const CloudScales& scales() const { return parts_->scales; }
  /// Of the first kSample, whose spacing is larger.
  const CloudScales& sample_scales() const { return parts_->sample_scales; }
  /// landmark_spacings() of each landmark.
  std::span<const double> spacings() const { return parts_->spacings; }
  /// spatial_groups() of the first kSample.
  std::span<const std::size_t> groups() const { return parts_->groups; }
  const SeenViews& views() const { return parts_->views; }

  /// The same landmarks in the same order, all lengths multiplied by the scale.
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
  bool ignores_covariances_ = false;
};

}  // namespace cairn
