// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/alignment/straightened.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "cairn/geometry/covariance.hpp"
#include "cairn/geometry/detail/pose_between.hpp"
#include "cairn/map/operations.hpp"

namespace cairn {
namespace {

// Straightens a map. The motion of a landmark depends on its position along the map, in parts: it is
// interpolated between the middles of two parts, and constant beyond the outermost ones.
class Straightening {
 public:
  // @param poses  of the parts, in order
  // @param centre of the map
  Straightening(std::vector<Similarity3> poses, const Eigen::Vector3d& centre)
      : poses_(std::move(poses)), centre_(centre) {}

  Similarity3 at(double along) const {
    const double last = static_cast<double>(poses_.size() - 1);
    const double place = std::isfinite(along) ? std::clamp(along - 0.5, 0.0, last) : 0.5 * last;
    const auto i = std::min(static_cast<std::size_t>(place), poses_.size() - 2);
    return pose_between(poses_[i], poses_[i + 1], place - static_cast<double>(i), centre_);
  }

 private:
  std::vector<Similarity3> poses_;
  Eigen::Vector3d centre_;
};

// The straightened landmarks of a map, in the order of the prepared cloud.
// @param along position of each landmark along the map, in the map's order
LandmarkCloud straightened(const PreparedCloud& prepared, std::span<const double> along,
                           const Straightening& straightening) {
  const CentredCloud& centred = *prepared.centred();
  LandmarkCloud cloud = centred.landmarks;
  std::vector<double> of_landmark(cloud.size());
  for (std::size_t i = 0; i < cloud.size(); ++i) of_landmark[i] = along[prepared.order()[i]];
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const Similarity3 move = straightening.at(of_landmark[i]);
    cloud.positions[i] = move * (cloud.positions[i] + centred.centre);
    if (cloud.covariances.empty()) continue;
    cloud.covariances[i] = move.scale() * move.scale() *
                           rotated_covariance(cloud.covariances[i], move.rigid().rotation());
  }
  for (LandmarkView& view : cloud.views) {
    // A keyframe moves with most of the landmarks that it observes.
    std::vector<double> seen;
    for (const std::uint32_t landmark : view.landmarks) {
      if (std::isfinite(of_landmark[landmark])) seen.push_back(of_landmark[landmark]);
    }
    const auto middle = seen.begin() + static_cast<std::ptrdiff_t>(seen.size() / 2);
    if (!seen.empty()) std::nth_element(seen.begin(), middle, seen.end());
    view.centre =
        straightening.at(seen.empty() ? std::nan("") : *middle) * (view.centre + centred.centre);
  }
  return cloud;
}

}  // namespace

bool is_aligned_straightened(const PartsAlignment& parts, const PreparedMap& source,
                             const PreparedMap& target, const PlaceOptions& options) {
  const MapRole role = parts.bend->map;
  const bool of_source = role == MapRole::kSource;
  const PreparedMap& map = of_source ? source : target;
  const auto own = [&](const Similarity3& pose) { return of_source ? pose : pose.inverse(); };
  const Similarity3& whole = *parts.target_from_source;
  std::vector<Similarity3> poses;
  for (const PartPose& part : parts.parts) {
    if (part.map != role) continue;
    poses.push_back(own(whole).inverse() * own(*part.target_from_source));
  }
  const Straightening straightening(std::move(poses), map.cloud().centred()->centre);
  const PreparedCloud straight(straightened(map.cloud(), map.along(), straightening), options.seed,
                               options.execution.executor, to_string(role));
  PlaceOptions placement = options;
  placement.search = PoseSearch::kNever;
  placement.trace = false;
  placement.execution = options.execution.without_progress();
  PreparedPair pair = of_source ? PreparedPair(straight, target.cloud(), placement)
                                : PreparedPair(source.cloud(), straight, placement);
  const PlacementResult placed = pair.settle(whole);
  if (placed.verdict != Verdict::kAligned || placed.candidates.empty()) return false;
  const auto& agreement = placed.candidates.front().support.agreement;
  return agreement && agreement->spread >= kDecisiveAgreement;
}

}  // namespace cairn
