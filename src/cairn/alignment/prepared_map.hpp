// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "cairn/alignment/alignment.hpp"
#include "cairn/confidence/metric.hpp"
#include "cairn/core/execution.hpp"
#include "cairn/map/landmark_map.hpp"
#include "cairn/registration/point_set.hpp"
#include "cairn/registration/result.hpp"

namespace cairn {

class MapImages;

namespace detail {
class MapDrift;
class PreparedCloud;
class PreparedParts;
}  // namespace detail

/// Landmarks observed by one keyframe.
struct LandmarkView {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();  ///< camera centre
  std::vector<std::uint32_t> landmarks;              ///< indices in the cloud
  FrameIndex frame = {};                             ///< keyframe of the map
};

/// Input of an alignment: landmark positions, their covariances, weights and descriptors, and the
/// keyframes that observed them.
struct LandmarkCloud {
  std::vector<Eigen::Vector3d> positions;
  /// Covariances of the positions: one per landmark, zero if unknown; or empty.
  std::vector<Eigen::Matrix3d> covariances;
  /// One per landmark, not negative, mean 1; or empty: all equal.
  std::vector<double> weights;
  /// A few representative keyframes; empty if unknown.
  std::vector<LandmarkView> views;
  /// One row per landmark; std::nullopt if unknown.
  std::optional<DescriptorColumn> descriptors;
  /// Lightness of the landmarks' colours in any unit, NaN if unknown: one per landmark; or empty.
  std::vector<double> lightness = {};

  std::size_t size() const { return positions.size(); }
  double weight(std::size_t i) const { return weights.empty() ? 1.0 : weights[i]; }

  /// @throws Error (misuse) for columns of different lengths, numbers that are not finite, negative
  ///        weights, views of missing landmarks, descriptors of 0 bytes or of more than
  ///        kMostDescriptorBytes, or further descriptors without a landmark
  /// @param name the cloud's name in the message
  void validate(std::string_view name) const;
};

/// The same landmarks, with all lengths multiplied by the scale.
LandmarkCloud scaled(LandmarkCloud cloud, double scale);

/// The landmarks of a map that take part in an alignment, in the order of landmarks_to_align().
/// @param weights std::nullopt: all equal
/// @throws Error (input) if the map lacks the metric's input
LandmarkCloud landmark_cloud(const LandmarkMap& map, const std::optional<Metric>& weights = {},
                             const PointSetOptions& options = {});

/// Options of PreparedMap.
struct PrepareOptions {
  std::optional<Metric> confidence =
      {};                       ///< metric of the landmarks' confidences; std::nullopt: all equal
  PointSetOptions points = {};  ///< selects the landmarks to align
  std::size_t part_landmarks =
      600;  ///< approximate number of landmarks in each part of the map; at least 1
};

/// A map prepared for alignments with many others; shared work is done once. Holds no reference to
/// the map. Copies share the data. Any number of threads may use a prepared map.
class PreparedMap {
 public:
  /// @throws Error (input) if the map lacks the input of the confidence metric
  explicit PreparedMap(const LandmarkMap& map, const PrepareOptions& options = {},
                       const Execution& execution = {});
  /// Prepares landmarks in metres, without gravity direction and without parts.
  /// @param name the cloud's name in messages
  /// @throws Error (misuse) as LandmarkCloud::validate()
  explicit PreparedMap(LandmarkCloud cloud, std::string_view name = "cloud",
                       const Execution& execution = {});

  LengthUnit length_unit() const { return length_unit_; }
  /// Unit vector downwards, in the map's frame; std::nullopt if unknown.
  const std::optional<Eigen::Vector3d>& gravity() const { return gravity_; }

  // For this module.
  const detail::PreparedCloud& cloud() const { return *cloud_; }
  /// Evenly spread landmarks of a dense cloud, e.g. from a depth camera: more than 8,192 landmarks
  /// without descriptors and views. Null for other maps.
  const std::shared_ptr<const detail::PreparedCloud>& even() const { return even_; }
  /// Images of the map, with landmarks as indices in cloud(). Null without images.
  const std::shared_ptr<const MapImages>& images() const { return images_; }
  /// Drift of the map, with landmarks as indices in cloud(). Null if the drift is unknown.
  const std::shared_ptr<const detail::MapDrift>& drift() const { return drift_; }
  /// Null if prepared from a LandmarkCloud.
  const std::shared_ptr<detail::PreparedParts>& parts() const { return parts_; }

 private:
  std::shared_ptr<const detail::PreparedCloud> cloud_;
  std::shared_ptr<const detail::PreparedCloud> even_;
  LengthUnit length_unit_ = LengthUnit::kMetres;
  std::optional<Eigen::Vector3d> gravity_;
  std::shared_ptr<const MapImages> images_;
  std::shared_ptr<const detail::MapDrift> drift_;
  std::shared_ptr<detail::PreparedParts> parts_;
};

/// The downward direction in both maps. The rotation about this direction and a small tilt remain
/// free.
struct GravityPrior {
  Eigen::Vector3d source = -Eigen::Vector3d::UnitZ();  ///< downwards, in the source's frame
  Eigen::Vector3d target = -Eigen::Vector3d::UnitZ();  ///< downwards, in the target's frame
  double max_tilt_rad = 0.17;  ///< largest angle between both after alignment; in (0, π]
};

/// Bounds of s in x_target = R·(s·x_source) + t.
struct ScaleRange {
  double least = 1.0 / 20.0;
  double most = 20.0;
};

/// When to search rotations. Descriptors are decisive if many mutual matches agree on a pose.
enum class PoseSearch {
  kWhereNeeded,  ///< if descriptors are not decisive
  kAlways,
  kNever,  ///< only descriptors propose poses: fast, but finds no pose without descriptors
};

/// Options of refine(). Lengths are in the unit of the maps, or of the target if a scale is estimated.
struct RefineOptions {
  Rigid3 initial = {};  ///< initial target_from_source
  /// Initial scale of the source, which is then estimated with the pose (see RegistrationResult::scale);
  /// positive. std::nullopt: both maps have one scale.
  std::optional<double> scale = {};
  /// Initial kernel scale; matches much farther apart hardly count. std::nullopt: half the extent of the
  /// smaller cloud, which tolerates large initial errors.
  std::optional<double> coarse = {};
  /// Kernel scale at the end of the first stage; at most `coarse`. std::nullopt: the expected error
  /// of a match, from spacing and covariances.
  std::optional<double> fine = {};
  /// Kernel scale at the end of the second stage, whose matches are one to one; at most `fine`.
  /// std::nullopt: a twelfth of `fine`, the accuracy of most maps.
  std::optional<double> finest = {};
  /// Kernel scale for the covariance; larger than the errors of single landmarks, because maps bend.
  /// std::nullopt: four times `finest`, at most `fine`.
  std::optional<double> error_scale = {};
  /// Keep the initial pose; matches, scores and covariance describe this pose.
  bool hold = false;
  /// Also refines from the result of ICP with unlimited match distances. Keeps that pose if its
  /// objective (larger is better) is at least twice the other's. ICP converges from larger errors
  /// if the maps share most landmarks; else its pose is often wrong. No effect with a free scale.
  bool by_icp_too = true;
  bool one_to_one = false;   ///< match each target landmark only with its nearest source landmark
  int max_iterations = 100;  ///< limit of each method; at least 1
  /// A landmark overlaps if the other map has a landmark within this distance. std::nullopt: no
  /// overlap is computed.
  std::optional<double> overlap_radius = {};
  bool trace = false;  ///< record score and matches of every iteration

  /// @throws Error (misuse) naming the field, its value and the constraint
  void validate() const;
};

/// Robust probabilistic refinement of a pose by iteratively reweighted least squares.
///
/// Moves the smaller cloud and matches each of its landmarks with the nearest landmark of the other
/// cloud. The squared Mahalanobis distance of a residual r is m² = rᵀ·(s²·R·Cs·Rᵀ + Ct + σ²·I)⁻¹·r
/// with the covariances of both landmarks. Its loss is the kernel of Geman and McClure,
/// m²/(1 + m²). The kernel scale σ falls from coarse to fine (graduated non-convexity; Black and
/// Rangarajan 1996). From fine to finest, each landmark of the other cloud is matched at most once,
/// with the nearest landmark.
///
/// The pose covariance is a sandwich estimator. Its Hessian comes from the change of the objective
/// when the pose moves and all matches are found again. Its scatter comes from the gradients of 16
/// groups of matches. Because of this small number, the covariance is enlarged (2.4 times for 16
/// groups and 6 degrees of freedom), so that the 95 % ellipsoid holds 95 % of the errors. Mean
/// squared errors are therefore smaller than the covariance's diagonal. For prepared maps, the
/// drift from the pose covariances of their keyframes is added. There is no covariance if fewer
/// than 12 groups (14 with a scale) have a match. A direction is unobservable if a motion of two
/// kernel scales along it hardly changes the objective, or if its standard deviation exceeds two
/// kernel scales. An expected failure (too few landmarks or matches) is reported as a status. The
/// same input gives the same result for any number of threads.
///
/// @throws Error (misuse) for invalid options or clouds
RegistrationResult refine(const LandmarkCloud& source, const LandmarkCloud& target,
                          const RefineOptions& options = {}, const Execution& execution = {});
RegistrationResult refine(const PreparedMap& source, const PreparedMap& target,
                          const RefineOptions& options = {}, const Execution& execution = {});

}  // namespace cairn
