// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "cairn/geometry/similarity3.hpp"
#include "cairn/map/landmark_map.hpp"

namespace cairn::detail {

/// Factors for the rows and columns of a pose's information matrix, in the order (δt, δφ, δ log s). They convert
/// rotations and scale to lengths, comparable to translations.
/// @param length root mean square distance of the landmarks from the pivot
Vector7d length_units(double length);

/// Uncertainty of how a map bends, from the covariances of its keyframes' poses.
///
/// A map stores the covariance of each keyframe's pose, but not the correlations between keyframes. The model is a
/// random walk: of two keyframes, the less certain one has the error of the other one plus an independent error. If the
/// first keyframe counts as exact, the covariance of the next keyframe is not drift but the error of any view, e.g. of
/// calibration and depth. All matched landmarks share this error, but the map as a whole does not. A landmark moves
/// with one of the keyframes that observed it: the middle one by certainty.
class MapDrift {
 public:
  /// A matched landmark in a least-squares pose.
  struct Term {
    std::uint32_t landmark = 0;  ///< index in the constructor's `landmarks`
    Eigen::Vector3d place;       ///< position in the target
    double weight = 0.0;
  };

  /// @param landmarks landmarks that take part in alignments
  MapDrift(const LandmarkMap& map, std::span<const LandmarkIndex> landmarks);

  /// Whether the drift is unknown: the map has no observations, or states no covariances of its keyframes' poses.
  bool empty() const { return keyframes_.empty(); }

  /// Covariance, (δt, δφ, δ log s), of a pose from matched landmarks that move with their keyframes. The map's frame
  /// moves by the mean rotation of all keyframes and the mean displacement of their cameras, so an error that all
  /// keyframes share does not count.
  /// @param terms      matched landmarks of this map
  /// @param from_map   transform from this map to the target
  /// @param origin     the point of the target whose displacement is δt: the pose's translation
  /// @param free_scale whether the scale was estimated; if not, the row and column of the scale are zero
  Matrix7d covariance(std::span<const Term> terms, const Similarity3& from_map,
                      const Eigen::Vector3d& origin, bool free_scale) const;

 private:
  // The motion of a keyframe, (δt, δφ) about the centre, is `from_walk` times the position of a random walk after this
  // keyframe's step. The first keyframe is the most certain one.
  struct Keyframe {
    Matrix6d step;  // covariance of the walk's step
    // Converts the walk's covariance to the stated one, because real covariances do not only grow.
    Matrix6d from_walk;
    Matrix6d motion_of_frame;  // motion of the map's frame per motion of the keyframe
  };

  bool has_exact_keyframe_ = false;
  Eigen::Vector3d centre_ = Eigen::Vector3d::Zero();
  std::vector<Keyframe> keyframes_;
  // Per landmark: index in keyframes_ of its keyframe; keyframes_.size() if unknown.
  std::vector<std::uint32_t> keyframe_of_;
};

}  // namespace cairn::detail
