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

/// Keyframes in the order of their times or, if one has no time, of their ids.
std::vector<FrameIndex> keyframes_in_order(const LandmarkMap& map);

/// Places each part of one map in the whole other map, by descriptors alone, and tests whether the poses
/// agree up to a bend of the map.
///
/// A part is aligned separately if place() aligns it and at least 15 descriptor matches outside their
/// largest cluster agree with the pose. There is a consensus if at least two parts of one map are aligned,
/// with landmarks of at least two parts of the other (a fifth of their matches each), consecutive parts
/// differ by at most 8 degrees and 0.15 times the map's radius, and any two by at most 20 degrees. An
/// aligned part of the other map that differs from all of them by more than that revokes the consensus.
///
/// @param options of each placement; `search` and `trace` have no effect
/// @return no parts if either map cannot be cut or has no descriptors
PartsAlignment place_by_parts(const PreparedMap& source, const PreparedMap& target,
                              const AlignOptions& options, const Execution& execution = {});

/// A bent map, straightened as the other map shows its parts. `parts.target_from_source` stays its pose, so the
/// frame is the map's own.
///
/// Each keyframe moves by the interpolated poses of the two parts around it (along_parts()). A landmark moves with the
/// middle one of the keyframes that observed it, or as the middle of the map if none did. Covariances turn with the
/// landmarks; the uncertainty of the parts' poses is not added.
///
/// @param map   the one that `parts.bend->map` names
/// @param parts with a consensus
LandmarkMap straightened(const LandmarkMap& map, const PartsAlignment& parts);

/// A pose between two maps, and a deformation of the source that makes it fit.
struct DeformedPose {
  std::shared_ptr<const detail::CrossFittedDeformation> deformation;
  /// The single pose with the least sum of distances of the matches.
  Similarity3 target_from_source;
  MapDeformation figures;
  /// Mean square of the local poses' deviations from the single pose: (δt, δφ, δ log s), a left perturbation.
  Matrix7d spread = Matrix7d::Zero();
  /// Whether the deformation is small: within the map, rotations differ by at most 20 degrees, scales by a factor of at
  /// most 1.3, and matches around one place are off their similarity by at most 23 % of their extent. Two focal lengths
  /// that are 5 % off either way change depths by a factor of 1.22. Beyond these limits no single pose means much.
  bool is_small = false;
  /// Median distance of the matches under the deformation that the other folds show, over that under the single
  /// pose; see is_clear().
  double residual = 1.0;

  /// Whether the deformation is more than noise.
  bool is_clear() const {
    constexpr double kMostResidual = 0.75;
    return residual <= kMostResidual;
  }
};

/// The source, straightened so that `pose.target_from_source` fits everywhere. Covariances turn with the landmarks.
/// Each keyframe moves with the landmarks that it observed. The deformation at the camera itself is not used: it was not
/// fitted there.
LandmarkMap straightened(const LandmarkMap& source, const DeformedPose& pose);

/// Two maps of one place that are smoothly deformed against each other, as different systems make them, for
/// example with different focal lengths.
class DeformablePair {
 public:
  DeformablePair(const PreparedMap& source, const PreparedMap& target);

  /// Fits a deformation to the descriptor matches near each of the first three poses.
  /// @return that with which most matches agree; std::nullopt if too few agree with any, or if it folds
  std::optional<DeformedPose> fit(std::span<const Similarity3> starts) const;

  /// Judges a deformed pose as place() does, by descriptors alone.
  ///
  /// The source's landmarks are divided into five folds. Each landmark moves as the matches of the other folds show,
  /// so no match supports the pose because the deformation was fitted to it. An aligned pose also needs a small
  /// deformation, and 15 agreeing matches outside their largest cluster.
  ///
  /// @param options of the placement; `search` and `trace` have no effect
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
