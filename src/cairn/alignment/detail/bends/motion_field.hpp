// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <cstddef>
#include <span>
#include <vector>

#include "cairn/alignment/alignment.hpp"
#include "cairn/alignment/bends.hpp"
#include "cairn/alignment/detail/bends/deformation.hpp"
#include "cairn/alignment/detail/bends/map_parts.hpp"

namespace cairn::detail {

/// A piecewise motion of a map: a similarity for each keyframe and for each landmark, by index, in the map's frame.
struct MotionField {
  std::vector<Similarity3> keyframes;
  std::vector<Similarity3> landmarks;
};

/// The motions that straighten a bent map. A motion depends on the position along the parts (along_parts()): it is
/// interpolated between the middles of two parts, and constant beyond the outermost middles.
/// @param parts result with a consensus
/// @param along positions along the map that `parts.bend` names
MotionField straightening(const PartsAlignment& parts, const AlongParts& along);

/// The similarity with the least sum of distances between pairs of points, by reweighted least squares.
Similarity3 closest_similarity(std::span<const Eigen::Vector3d> from,
                               std::span<const Eigen::Vector3d> to);

/// Motion of a camera in a deformed map: the similarity closest to the deformation of the landmarks that the camera
/// saw. If these are few, the deformation around the camera's centre.
class CameraMotion {
 public:
  /// @param pose deformation of the source; the motion is in the source's frame
  /// @param back source_from_target
  CameraMotion(const CrossFittedDeformation& pose, const Similarity3& back)
      : pose_(pose), back_(back) {}

  void add(const Eigen::Vector3d& landmark) {
    if (from_.size() == kMostSeen) return;
    from_.push_back(landmark);
    to_.emplace_back(back_ * pose_(landmark));
  }
  Similarity3 at(const Eigen::Vector3d& centre) const {
    if (from_.size() < kFewestSeen) return back_ * pose_.near(centre);
    return closest_similarity(from_, to_);
  }

 private:
  static constexpr std::size_t kFewestSeen = 8;
  static constexpr std::size_t kMostSeen = 200;

  const CrossFittedDeformation& pose_;
  const Similarity3& back_;
  std::vector<Eigen::Vector3d> from_;
  std::vector<Eigen::Vector3d> to_;
};

/// Moves each keyframe and landmark of a map. Camera orientations and covariances rotate too. Frames of a rig move
/// with the rig's leading frame.
LandmarkMap moved(const LandmarkMap& map, const MotionField& field);

/// The left perturbation (δt, δφ, δ log s) that moves `from` to `to`.
inline Vector7d pose_difference(const Similarity3& from, const Similarity3& to) {
  Vector7d result;
  result << from.rigid().difference_to(to.rigid()), std::log(to.scale() / from.scale());
  return result;
}

}  // namespace cairn::detail
