// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "cairn/alignment/bends/map_bend.hpp"
#include "cairn/alignment/detail/bends/deformation.hpp"
#include "cairn/alignment/prepared_cloud.hpp"
#include "cairn/alignment/search/place.hpp"
#include "cairn/map/landmark_map.hpp"

namespace cairn {

class DescriptorMatches;

/// A pose between two maps, and a deformation of the source that makes it fit.
struct DeformedPose {
  Similarity3 start;        ///< target_from_source, before the deformation
  Deformation deformation;  ///< of the target's frame
  /// For each fold of the source's landmarks: as the matches of the other folds show it.
  std::vector<Deformation> of_folds;
  /// The single pose with the least sum of distances of the matches.
  Similarity3 target_from_source;
  MapDeformation figures;
  /// Mean square of the local poses' deviations from the single pose: (δt, δφ, δ log s), a left perturbation.
  Matrix7d spread = Matrix7d::Zero();
  /// Whether the deformation is small: within the map, rotations differ by at most 20 degrees, scales by a factor of at
  /// most 1.3, and matches around one place are off their similarity by at most 23 % of their extent. Two focal lengths that are 5 % off either way
  /// change depths by a factor of 1.22. Beyond these limits no single pose means much.
  bool is_small = false;
  /// Median distance of the matches under the deformation that the other folds show, over that under the single
  /// pose; see is_clear().
  double residual = 1.0;

  /// Whether the deformation is more than noise.
  bool is_clear() const {
    constexpr double kMostResidual = 0.75;
    return residual <= kMostResidual;
  }

  Eigen::Vector3d operator()(const Eigen::Vector3d& x_in_source) const {
    return deformation(start * x_in_source);
  }
  /// The pose that holds around a point.
  Similarity3 near(const Eigen::Vector3d& x_in_source) const {
    return deformation.near(start * x_in_source) * start;
  }
};

/// Two maps of one place that are smoothly deformed against each other, as different systems make them, for
/// example with different focal lengths.
class DeformablePair {
 public:
  /// @param source, target must outlive this
  DeformablePair(const PreparedCloud& source, const PreparedCloud& target);

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
  PlacementResult judge(const DeformedPose& pose, const PlaceOptions& options) const;

 private:
  std::optional<DeformationFit> fitted(const Similarity3& start,
                                       std::optional<std::size_t> without = {}) const;
  std::optional<DeformedPose> described(const Similarity3& start, const DeformationFit& fit,
                                        std::vector<Deformation> of_folds) const;
  Eigen::Vector3d source_place(std::size_t match) const;
  Eigen::Vector3d target_place(std::size_t match) const;

  const PreparedCloud* source_;
  const PreparedCloud* target_;
  std::shared_ptr<const DescriptorMatches> matches_;
};

/// The source, deformed so that `pose.target_from_source` fits everywhere. Covariances turn with the landmarks.
/// Each keyframe moves with the landmarks that it observed. The deformation at the camera itself is not used: it was not
/// fitted there.
LandmarkMap deformed(const LandmarkMap& source, const DeformedPose& pose);

}  // namespace cairn
