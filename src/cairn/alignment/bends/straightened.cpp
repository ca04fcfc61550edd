// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/alignment/bends/straightened.hpp"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "cairn/alignment/detail/bends/map_parts.hpp"
#include "cairn/alignment/detail/bends/moved_in_map.hpp"
#include "cairn/geometry/covariance.hpp"
#include "cairn/geometry/detail/pose_between.hpp"

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

std::vector<FrameId> middles_of(const PartsAlignment& parts) {
  std::vector<FrameId> middles;
  for (const PartPose& part : parts.parts) {
    if (part.map == parts.bend->map) middles.push_back(part.middle);
  }
  return middles;
}

// The straightened landmarks of a map, in the order of the prepared cloud.
LandmarkCloud straightened(const PreparedMap& map, const Straightening& straightening) {
  const PreparedCloud& prepared = map.cloud();
  const CentredCloud& centred = *prepared.centred();
  LandmarkCloud cloud = centred.landmarks;
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const Similarity3 move = straightening.at(map.along().landmarks[prepared.order()[i]]);
    cloud.positions[i] = move * (cloud.positions[i] + centred.centre);
    if (cloud.covariances.empty()) continue;
    cloud.covariances[i] = move.scale() * move.scale() *
                           rotated_covariance(cloud.covariances[i], move.rigid().rotation());
  }
  for (LandmarkView& view : cloud.views) {
    view.centre =
        straightening.at(map.along().keyframes[view.frame.value]) * (view.centre + centred.centre);
  }
  return cloud;
}

}  // namespace

LandmarkMap straightened(const LandmarkMap& map, const PartsAlignment& parts) {
  const AlongParts along = along_parts(map, middles_of(parts));
  const Straightening straightening = straightening_of(parts, along.centre);
  MapTables tables = LandmarkMap(map).tables();
  for (std::size_t i = 0; i < map.frame_count(); ++i) {
    move_keyframe(tables.frames, i, straightening.at(along.keyframes[i]));
  }
  for (std::uint32_t i = 0; i < map.landmark_count(); ++i) {
    move_landmark(tables.landmarks, map.has_covariances(), i, straightening.at(along.landmarks[i]));
  }
  return LandmarkMap(std::move(tables));
}

bool is_aligned_straightened(const PartsAlignment& parts, const PreparedMap& source,
                             const PreparedMap& target, const PlaceOptions& options) {
  const MapRole role = parts.bend->map;
  const bool of_source = role == MapRole::kSource;
  const PreparedMap& map = of_source ? source : target;
  const Straightening straightening = straightening_of(parts, map.along().centre);
  const PreparedCloud straight(straightened(map, straightening), options.seed,
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
