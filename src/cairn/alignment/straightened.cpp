// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/alignment/straightened.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "cairn/alignment/detail/moved_in_map.hpp"
#include "cairn/geometry/covariance.hpp"
#include "cairn/geometry/detail/centroid.hpp"
#include "cairn/geometry/detail/pose_between.hpp"
#include "cairn/map/operations.hpp"
#include "cairn/placement/map_parts.hpp"

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

// Of the map that the parts' bend names.
Straightening straightening_of(const PartsAlignment& parts, const Eigen::Vector3d& centre) {
  const MapRole role = parts.bend->map;
  const auto own = [&](const Similarity3& pose) {
    return role == MapRole::kSource ? pose : pose.inverse();
  };
  const Similarity3 own_from_whole = own(*parts.target_from_source).inverse();
  std::vector<Similarity3> poses;
  for (const PartPose& part : parts.parts) {
    if (part.map == role) poses.push_back(own_from_whole * own(*part.target_from_source));
  }
  return {std::move(poses), centre};
}

// Position of each of a map's keyframes along the map, in parts: the middle of the first is at 0.5.
std::vector<double> along_parts(const std::vector<FrameIndex>& order, const FrameTable& frames,
                                const PartsAlignment& parts) {
  std::vector<double> middles;  // rank of each part's middle keyframe
  for (const PartPose& part : parts.parts) {
    if (part.map != parts.bend->map) continue;
    const auto found = std::find_if(order.begin(), order.end(), [&](FrameIndex frame) {
      return frames.ids[frame.value] == part.middle;
    });
    middles.push_back(static_cast<double>(found - order.begin()));
  }
  std::vector<double> along(order.size());
  for (std::size_t rank = 0; rank < order.size(); ++rank) {
    const auto place = static_cast<double>(rank);
    const auto next = std::upper_bound(middles.begin() + 1, middles.end() - 1, place);
    const auto part = static_cast<double>(next - middles.begin() - 1);
    along[order[rank].value] = 0.5 + part + (place - *(next - 1)) / (*next - *(next - 1));
  }
  return along;
}

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

LandmarkMap straightened(const LandmarkMap& map, const PartsAlignment& parts) {
  const Straightening straightening = straightening_of(parts, centroid(map.landmarks().positions));
  const std::vector<FrameIndex> order = keyframes_in_order(map);
  const std::vector<double> along = along_parts(order, map.frames(), parts);
  std::vector<std::uint32_t> rank(order.size());
  for (std::uint32_t i = 0; i < order.size(); ++i) rank[order[i].value] = i;
  MapTables tables = LandmarkMap(map).tables();
  for (std::size_t i = 0; i < order.size(); ++i) {
    move_keyframe(tables.frames, i, straightening.at(along[i]));
  }
  for (std::uint32_t i = 0; i < map.landmark_count(); ++i) {
    std::vector<std::uint32_t> ranks;
    for (const FrameIndex frame : map.observing_frames(LandmarkIndex{i})) {
      ranks.push_back(rank[frame.value]);
    }
    const auto middle = ranks.begin() + static_cast<std::ptrdiff_t>(ranks.size() / 2);
    if (!ranks.empty()) std::nth_element(ranks.begin(), middle, ranks.end());
    const Similarity3 move =
        straightening.at(ranks.empty() ? std::nan("") : along[order[*middle].value]);
    move_landmark(tables.landmarks, map.has_covariances(), i, move);
  }
  return LandmarkMap(std::move(tables));
}

bool is_aligned_straightened(const PartsAlignment& parts, const PreparedMap& source,
                             const PreparedMap& target, const PlaceOptions& options) {
  const MapRole role = parts.bend->map;
  const bool of_source = role == MapRole::kSource;
  const PreparedMap& map = of_source ? source : target;
  const Straightening straightening = straightening_of(parts, map.cloud().centred()->centre);
  const PreparedCloud straight(straightened(map.cloud(), map.along(), straightening), options.seed,
                               options.execution.executor, to_string(role));
  PlaceOptions placement = options;
  placement.search = PoseSearch::kNever;
  placement.trace = false;
  placement.execution = options.execution.without_progress();
  PreparedPair pair = of_source ? PreparedPair(straight, target.cloud(), placement)
                                : PreparedPair(source.cloud(), straight, placement);
  const PlacementResult placed = pair.settle(*parts.target_from_source);
  if (placed.verdict != Verdict::kAligned || placed.candidates.empty()) return false;
  const auto& agreement = placed.candidates.front().support.agreement;
  return agreement && agreement->spread >= kDecisiveAgreement;
}

}  // namespace cairn
