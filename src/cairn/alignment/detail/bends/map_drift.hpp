// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "cairn/geometry/similarity3.hpp"
#include "cairn/map/landmark_map.hpp"

namespace cairn::detail {

/// Factors of the rows and columns of a pose's information, (δt, δφ, δ log s), that make rotations and scale lengths,
/// comparable to translations.
/// @param length root mean square distance of the landmarks from the pivot
Vector7d length_units(double length);

/// Uncertainty of how a map bends, by the covariances of its keyframes' poses.
///
/// A map stores each keyframe's covariance, not how two of them correlate. The model is a random walk: of two keyframes,
/// the less certain one has the other's error and an independent one more. Where the first keyframe counts as exact, the
/// covariance of the next is not drift but the error of any view, as of calibration and depth: it is common to the
/// landmarks that are matched, but not to the map. A landmark moves with the middle one, by certainty, of the keyframes
/// that observed it.
class MapDrift {
 public:
  /// A landmark's part in a least-squares pose.
  struct Term {
    std::uint32_t landmark = 0;  ///< index in the landmarks of the constructor
    Eigen::Vector3d place;       ///< in the target
    double weight = 0.0;
  };

  /// @param landmarks that take part in alignments
  MapDrift(const LandmarkMap& map, std::span<const LandmarkIndex> landmarks);

  /// Whether the drift is unknown: the map has no observations, or states no covariances of its keyframes' poses.
  bool empty() const { return keyframes_.empty(); }

  /// Covariance, (δt, δφ, δ log s), of a pose from matched landmarks that move with their keyframes. The map's frame moves
  /// with all its keyframes, by their mean rotation and the mean displacement of their cameras: an error that all share
  /// does not count.
  /// @param terms      of landmarks of this map
  /// @param from_map   from this map to the target
  /// @param origin     the point whose displacement is δt, in the target: the pose's translation
  /// @param free_scale whether the scale was estimated; if not, its row and column are zero
  Matrix7d covariance(std::span<const Term> terms, const Similarity3& from_map,
                      const Eigen::Vector3d& origin, bool free_scale) const;

 private:
  // A keyframe's motion, (δt, δφ) about the centre, is `from_walk` times a random walk's position after its step. The
  // first keyframe is the most certain.
  struct Keyframe {
    Matrix6d step;       // covariance that the walk gains
    Matrix6d from_walk;  // makes the covariance the stated one, because real ones do not just grow
    Matrix6d motion_of_frame;  // how the map's frame follows the keyframe
  };

  bool has_exact_keyframe_ = false;
  Eigen::Vector3d centre_ = Eigen::Vector3d::Zero();
  std::vector<Keyframe> keyframes_;
  std::vector<std::uint32_t> keyframe_of_;  // of each landmark; the number of keyframes if unknown
};

}  // namespace cairn::detail
