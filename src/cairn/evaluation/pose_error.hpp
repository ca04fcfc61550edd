// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>

#include "cairn/geometry/similarity3.hpp"

namespace cairn {

/// Error of an estimated pose.
struct PoseError {
  double rotation_rad = 0.0;  ///< angle of the relative rotation, in [0, π]
  double translation =
      0.0;  ///< displacement of the source landmarks' centroid, target's unit of length
  double log_scale = 0.0;  ///< absolute logarithm of the ratio of the scales
};

/// The error of `estimate` against `truth`, both target_from_source. Translation is measured at the
/// landmarks' centroid. At the source's origin, which may be far away, the translation error would
/// include the rotation error.
/// @param source landmarks in the source frame; if empty, the origin replaces the centroid
PoseError pose_error(const Similarity3& estimate, const Similarity3& truth,
                     std::span<const Eigen::Vector3d> source);

/// Whether `truth` seems to be source_from_target, as if the maps had been swapped. Compares two
/// root mean square distances of the landmarks: between their positions under `estimate` and under
/// the inverse of `truth`, and between their positions under `estimate` and under `truth`. The
/// first must be less than a tenth of the landmarks' extent. The second must exceed this tenth, and
/// five times the first. Arguments as for pose_error().
bool fits_inverse(const Similarity3& estimate, const Similarity3& truth,
                  std::span<const Eigen::Vector3d> source);

}  // namespace cairn
