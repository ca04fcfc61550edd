// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/registration/coarse_to_fine.hpp"

#include <algorithm>
#include <cmath>
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

// One of each `stride` in a row, drawn at random: an even choice of a map whose landmarks are in the
// order of their frames, that no period in that order can mislead.
Sample sample_of(const MovingPoints& source, std::size_t stride) {
  Random random(stride);
  Sample sample;
  for (std::size_t begin = 0; begin < source.positions.size(); begin += stride) {
    const std::size_t i = begin + random.index(std::min(stride, source.positions.size() - begin));
    if (!source.weights.empty() && source.weights[i] == 0.0) continue;
    sample.positions.push_back(source.positions[i]);
    if (!source.confidences.empty()) sample.confidences.push_back(source.confidences[i]);
    if (!source.weights.empty()) sample.weights.push_back(source.weights[i]);
  }
  return sample;
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

CoarseAlignment align_samples(const MovingPoints& source, const ConfidentSet<BatchTree>& target,
                              const CoarseToFineOptions& options) {
  std::size_t stride = 1;
  while (source.positions.size() / (stride * kFactor) >= kFewest) stride *= kFactor;
  CoarseAlignment result;
  for (; stride > 1; stride /= kFactor) {
    const Sample sample = sample_of(source, stride);
    const std::vector<Eigen::Vector3d>& positions = sample.positions;
    if (positions.size() < kFewestMatches) continue;
    std::optional<BatchTree> tree;
    std::optional<ConfidentSet<BatchTree>> both_ways;
    if (options.reciprocal) {
      tree.emplace(positions);
      both_ways.emplace(ConfidentSet<BatchTree>{*tree, positions, sample.confidences});
    }
    const ConfidentNeighborCorrespondence<BatchTree> find_matches(
        target, both_ways, options.matching, options.executor);
    const IcpRun icp = run_icp(
        positions, result.target_from_source, find_matches,
        PointToPointEstimation(target.positions, sample.weights),
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
