// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/registration/coarse_to_fine.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include "cairn/core/random.hpp"
#include "cairn/geometry/moved_points.hpp"
#include "cairn/geometry/pose_distance.hpp"
#include "cairn/registration/estimation/point_to_point.hpp"
#include "cairn/registration/icp.hpp"

namespace cairn {
namespace {

constexpr std::size_t kFewest = 300;  // points of a sample; with fewer the pose would be chance
constexpr std::size_t kFactor = 4;    // from one sample to the next

struct Sample {
  std::vector<Eigen::Vector3d> positions;
  std::vector<double> confidences;
  std::vector<double> weights;
};

// The samples of a set, from coarse to fine, have one point in so many: powers of the factor.
std::size_t coarsest_stride(std::size_t points) {
  std::size_t stride = 1;
  while (points / (stride * kFactor) >= kFewest) stride *= kFactor;
  return stride;
}

// One of each `stride` in a row, drawn at random: an even choice of a map whose landmarks are in the
// order of their frames, that no period in that order can mislead.
Sample sample_of(const SampledPoints& points, std::size_t stride, Random random) {
  Sample sample;
  const std::size_t count = points.positions.size();
  for (std::size_t begin = 0; begin < count; begin += stride) {
    const std::size_t i = begin + random.index(std::min(stride, count - begin));
    if (!points.weights.empty() && points.weights[i] == 0.0) continue;
    sample.positions.push_back(points.positions[i]);
    if (!points.confidences.empty()) sample.confidences.push_back(points.confidences[i]);
    if (!points.weights.empty()) sample.weights.push_back(points.weights[i]);
  }
  return sample;
}

// A sample of a set that matches are sought in, or all of it.
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

SearchedSample searched(const ConfidentSet<BatchTree>& all, std::size_t stride) {
  if (stride == 1) return SearchedSample(all);
  // Not the source's choice: of a map and its copy, the two samples would be one.
  return SearchedSample(
      sample_of({all.positions, all.confidences, {}}, stride, Random(stride).fork(1)));
}

// Ends where the rest of the way is within the sample's chance.
class WithinChance {
 public:
  WithinChance(std::span<const Eigen::Vector3d> moved_sample, int max_iterations)
      : distance_(PoseDistance::of(moved_sample)),
        points_(static_cast<double>(moved_sample.size())),
        max_iterations_(max_iterations) {}

  std::optional<StopReason> operator()(const IterationState& state) const {
    if (state.iteration >= max_iterations_) return StopReason::kIterationLimit;
    const double step = distance_(state.step, Rigid3());
    if (step * step < state.mean_squared_distance / points_) return StopReason::kMseChange;
    return {};
  }

 private:
  PoseDistance distance_;
  double points_;
  int max_iterations_;
};

}  // namespace

CoarseAlignment align_samples(const SampledPoints& source, const ConfidentSet<BatchTree>& target,
                              const CoarseToFineOptions& options) {
  const bool is_limited = options.matching.max_distance < std::numeric_limits<double>::infinity();
  const std::size_t target_stride = is_limited ? 1 : coarsest_stride(target.positions.size());
  CoarseAlignment result;
  for (std::size_t stride = coarsest_stride(source.positions.size()); stride > 1;
       stride /= kFactor) {
    const Sample sample = sample_of(source, stride, Random(stride));
    const std::vector<Eigen::Vector3d>& positions = sample.positions;
    if (positions.size() < kFewestMatches) continue;
    const SearchedSample among = searched(target, std::min(stride, target_stride));
    ConfidentNeighborOptions matching = options.matching;
    matching.k = std::min(matching.k, among.set().positions.size());
    std::optional<BatchTree> tree;
    std::optional<ConfidentSet<BatchTree>> both_ways;
    if (options.reciprocal) {
      tree.emplace(positions);
      both_ways.emplace(ConfidentSet<BatchTree>{*tree, positions, sample.confidences});
    }
    const ConfidentNeighborCorrespondence<BatchTree> find_matches(among.set(), both_ways, matching,
                                                                  options.executor);
    const IcpRun icp = run_icp(
        positions, result.target_from_source, find_matches,
        PointToPointEstimation(among.set().positions, sample.weights),
        WithinChance(moved_points(positions, result.target_from_source), options.max_iterations),
        options.stop);
    // Too few matches in the sample say nothing yet of all points.
    if (icp.stop_reason != StopReason::kTooFewMatches) {
      result.target_from_source = icp.target_from_source;
    }
    result.iterations += icp.iterations;
    if (icp.stop_reason == StopReason::kCancelled) break;
  }
  return result;
}

}  // namespace cairn
