// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>

#include "cairn/geometry/similarity3.hpp"

namespace cairn {

/// How far an estimated pose is from the true one.
struct PoseError {
  double rotation_rad = 0.0;  ///< angle of the relative rotation, in [0, π]
  double translation =
      0.0;  ///< displacement of the source landmarks' centroid, target's unit of length
  double log_scale = 0.0;  ///< magnitude of the logarithm of the ratio of the scales
};

/// The error of `estimate` against `truth`, both target_from_source. Translation is measured at the
/// landmarks: at the source's origin, which may be far from them, it would count rotation twice.
/// @param source landmarks in the source frame; of none, the origin stands in for their centroid
PoseError pose_error(const Similarity3& estimate, const Similarity3& truth,
                     std::span<const Eigen::Vector3d> source);

/// Whether `truth` seems to be source_from_target, as if the maps had been swapped: the estimate moves the landmarks
/// (root mean square) by less than a tenth of their extent from where the inverse of `truth` puts them, and by more
/// than that, and five times as far, from where `truth` does. Arguments as of pose_error().
bool fits_inverse(const Similarity3& estimate, const Similarity3& truth,
                  std::span<const Eigen::Vector3d> source);

}  // namespace cairn
