// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "cairn/alignment/align.hpp"
#include "cairn/alignment/alignment.hpp"
#include "cairn/map/landmark_map.hpp"

namespace cairn {

namespace detail {
class DescriptorMatches;
struct CrossFittedDeformation;
struct DeformationFit;
}  // namespace detail

/// Keyframes ordered by time, or by id if a keyframe has no time.
std::vector<FrameIndex> keyframes_in_order(const LandmarkMap& map);

/// Places each part of one map in the whole other map, by descriptors alone, and tests whether the poses
/// agree up to a bend of the map.
///
/// A part is aligned separately if place() aligns it and at least 15 descriptor matches outside
/// their largest cluster agree with the pose. A consensus needs two or more aligned parts of one map
/// that match different parts of the other map. A part matches another if a fifth of its matches
/// lie there. The poses of consecutive aligned parts must differ by at most 8 degrees and 0.15 times
/// the map's radius, any two by at most 20 degrees. There is no consensus if an aligned part of the
/// other map has a pose that differs from each of these poses by more than 8 degrees or 0.15 radii.
///
/// @param options options of each placement; `search` and `trace` have no effect
/// @return no parts if either map cannot be cut or has no descriptors
PartsAlignment place_by_parts(const PreparedMap& source, const PreparedMap& target,
                              const AlignOptions& options, const Execution& execution = {});

/// Straightens a bent map by the poses of its parts in the other map. `parts.target_from_source`
/// remains the pose of the map, so its frame does not change.
///
/// Each keyframe moves by the interpolated poses of the two parts around it (along_parts()). A
/// landmark moves with the middle one of its observing keyframes, or with the middle of the map if
/// no keyframe observed it. Covariances rotate with the landmarks; the uncertainty of the parts'
/// poses is not added.
///
/// @param map   the map that `parts.bend->map` names
/// @param parts result with a consensus
LandmarkMap straightened(const LandmarkMap& map, const PartsAlignment& parts);

/// A pose between two maps, and a deformation of the source under which the pose fits.
struct DeformedPose {
  std::shared_ptr<const detail::CrossFittedDeformation> deformation;
  /// The single pose with the least sum of distances of the matches.
  Similarity3 target_from_source;
  MapDeformation figures;
  /// Mean square of the local poses' deviations from the single pose: (δt, δφ, δ log s), a left perturbation.
  Matrix7d spread = Matrix7d::Zero();
  /// Whether the deformation is small: within the map, rotations differ by at most 20 degrees,
  /// scales differ by a factor of at most 1.3, and matches around one position deviate from a
  /// similarity by at most 23 % of their extent. Focal lengths with errors of 5 % in opposite
  /// directions change depths by a factor of 1.22. Beyond these limits, no single pose is
  /// meaningful.
  bool is_small = false;
  /// Median match distance under the deformation fitted to the other folds of the cross-validation,
  /// divided by the median match distance under the single pose; see is_clear().
  double residual = 1.0;

  /// Whether the deformation exceeds the noise.
  bool is_clear() const {
    constexpr double kMostResidual = 0.75;
    return residual <= kMostResidual;
  }
};

/// Straightens the source so that `pose.target_from_source` fits everywhere. Covariances rotate
/// with the landmarks. Each keyframe moves with its observed landmarks, because the deformation was
/// not fitted at the camera itself.
LandmarkMap straightened(const LandmarkMap& source, const DeformedPose& pose);

/// Two maps of one place with a smooth deformation between them, e.g. from systems with different
/// focal lengths.
class DeformablePair {
 public:
  DeformablePair(const PreparedMap& source, const PreparedMap& target);

  /// Fits a deformation to the descriptor matches, starting at each of the first three poses.
  /// @return the deformation with the most agreeing matches; std::nullopt if too few agree, or if
  ///        the deformation is not locally invertible
  std::optional<DeformedPose> fit(std::span<const Similarity3> starts) const;

  /// Judges a deformed pose as place() does, by descriptors alone.
  ///
  /// The source's landmarks are divided into five folds for cross-validation. Each landmark moves
  /// by the deformation fitted to the matches of the other folds, so no match supports a
  /// deformation fitted to itself. An aligned pose also requires a small deformation, and 15
  /// agreeing matches outside their largest cluster.
  ///
  /// @param options options of the placement; `search` and `trace` have no effect
  Alignment judge(const DeformedPose& pose, const AlignOptions& options,
                  const Execution& execution = {}) const;

 private:
  std::optional<detail::DeformationFit> fitted(const Similarity3& start,
                                               std::optional<std::size_t> without = {}) const;
  std::optional<DeformedPose> described(const detail::DeformationFit& fit,
                                        detail::CrossFittedDeformation deformation) const;
  Eigen::Vector3d source_place(std::size_t match) const;
  Eigen::Vector3d target_place(std::size_t match) const;

  PreparedMap source_;
  PreparedMap target_;
  std::shared_ptr<const detail::DescriptorMatches> matches_;
};

}  // namespace cairn
