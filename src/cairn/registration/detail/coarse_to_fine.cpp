// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/registration/detail/coarse_to_fine.hpp"

#include <algorithm>
#include <cstdint>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include "cairn/core/detail/sampling.hpp"
#include "cairn/core/random.hpp"
#include "cairn/geometry/detail/pose_distance.hpp"
#include "cairn/registration/estimation/point_to_point.hpp"
#include "cairn/registration/stages.hpp"

namespace cairn::detail {
namespace {

constexpr std::size_t kFewest = 300;  // points of a sample; with fewer, the pose would be random
constexpr std::size_t kFactor = 4;    // from one sample to the next
constexpr double kStill = 1e-9;       // of the sample's radius: a negligible step

struct Sample {
  std::vector<Eigen::Vector3d> positions;
  std::vector<double> confidences;
  std::vector<double> weights;
};

// Draws samples of the usable points.
class Samples {
 public:
  // @param is_usable whether a point can be used
  template <class IsUsable>
  Samples(const SampledPoints& points, const IsUsable& is_usable) : points_(points) {
    for (std::size_t i = 0; i < points.positions.size(); ++i) {
      if (is_usable(i)) usable_.push_back(static_cast<std::uint32_t>(i));
    }
  }

  // Stride of the coarsest sample with at least kFewest points; a power of kFactor.
  std::size_t coarsest() const {
    std::size_t stride = 1;
    while (usable_.size() / (stride * kFactor) >= kFewest) stride *= kFactor;
    return stride;
  }

  Sample of(std::size_t stride, Random random) const {
    Sample sample;
    for (const std::size_t chosen : detail::one_of_each(stride, usable_.size(), random)) {
      const std::uint32_t i = usable_[chosen];
      sample.positions.push_back(points_.positions[i]);
      if (!points_.confidences.empty()) sample.confidences.push_back(points_.confidences[i]);
      if (!points_.weights.empty()) sample.weights.push_back(points_.weights[i]);
    }
    return sample;
  }

 private:
  SampledPoints points_;
  std::vector<std::uint32_t> usable_;
};

// The set in which matches are searched: a sample, or all points.
class SearchedSample {
 public:
  explicit SearchedSample(Sample sample)
      : sample_(std::move(sample)), tree_(std::in_place, sample_.positions) {}
  explicit SearchedSample(const ConfidentSet<BatchTree>& all) : all_(&all) {}

  ConfidentSet<BatchTree> set() const {
    return all_ != nullptr
               ? *all_
               : ConfidentSet<BatchTree>{*tree_, sample_.positions, sample_.confidences};
  }

 private:
  Sample sample_;
  std::optional<BatchTree> tree_;
  const ConfidentSet<BatchTree>* all_ = nullptr;
};

// Converged if the step is smaller than the sample's random error.
class WithinChance {
 public:
  WithinChance(std::span<const Eigen::Vector3d> sample, int max_iterations)
      : distance_(PoseDistance::of(sample)),
        points_(static_cast<double>(sample.size())),
        max_iterations_(max_iterations) {}

  std::optional<StopReason> operator()(const IterationState& state) const {
    if (state.iteration >= max_iterations_) return StopReason::kIterationLimit;
    const double step =
        distance_(state.target_from_source, state.step.inverse() * state.target_from_source);
    // The second condition is for exact matches, where rounding causes endless steps.
    if (step * step < state.mean_squared_distance / points_ || step < kStill * distance_.radius) {
      return StopReason::kMseChange;
    }
    return {};
  }

 private:
  PoseDistance distance_;
  double points_;
  int max_iterations_;
};

}  // namespace

CoarseAlignment align_samples(const SampledPoints& source, const ConfidentSet<BatchTree>& target,
                              const IcpOptions& options, const Execution& execution) {
  const Samples moving(
      source, [&](std::size_t i) { return source.weights.empty() || source.weights[i] > 0.0; });
  const Samples searched({target.positions, target.confidences, {}}, [&](std::size_t i) {
    return target.confidences.empty() || target.confidences[i] > 0.0;
  });
  const bool is_limited = options.max_distance < std::numeric_limits<double>::infinity();
  const std::size_t coarsest_target = is_limited ? 1 : searched.coarsest();
  CoarseAlignment result;
  for (std::size_t stride = moving.coarsest(); stride > 1; stride /= kFactor) {
    const Sample sample = moving.of(stride, Random(stride));
    const std::vector<Eigen::Vector3d>& positions = sample.positions;
    const std::size_t target_stride = std::min(stride, coarsest_target);
    // Drawn independently of the source's, because the samples of a map and its copy would otherwise be
    // equal.
    const SearchedSample among =
        target_stride == 1 ? SearchedSample(target)
                           : SearchedSample(searched.of(target_stride, Random(stride).fork(1)));
    std::optional<BatchTree> tree;
    std::optional<ConfidentSet<BatchTree>> both_ways;
    if (options.reciprocal) {
      tree.emplace(positions);
      both_ways.emplace(ConfidentSet<BatchTree>{*tree, positions, sample.confidences});
    }
    const ConfidentNeighborCorrespondence<BatchTree> find_matches(among.set(), both_ways, options,
                                                                  execution.executor);
    const IcpRun icp = run_icp(positions, result.target_from_source, find_matches,
                               PointToPointEstimation(among.set().positions, sample.weights),
                               WithinChance(positions, options.max_iterations), execution.stop);
    // With too few matches in the sample, all points may still have enough.
    if (icp.stop_reason != StopReason::kTooFewMatches) {
      result.target_from_source = icp.target_from_source;
    }
    result.iterations += icp.iterations;
    if (icp.stop_reason == StopReason::kCancelled) break;
  }
  return result;
}

}  // namespace cairn::detail
