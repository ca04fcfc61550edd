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

/// What one keyframe saw.
struct LandmarkView {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();  ///< of its camera
  std::vector<std::uint32_t> landmarks;              ///< indices in the cloud
  FrameIndex frame = {};                             ///< keyframe of the map
};

/// Input of an alignment: landmark positions, their covariances, weights and descriptors, and the
/// keyframes that saw them.
struct LandmarkCloud {
  std::vector<Eigen::Vector3d> positions;
  /// Of the positions: one per landmark, zero if unknown; or empty.
  std::vector<Eigen::Matrix3d> covariances;
  /// One per landmark, not negative, mean 1; or empty: all equal.
  std::vector<double> weights;
  /// A few representative keyframes; empty if unknown.
  std::vector<LandmarkView> views;
  /// One row per landmark; std::nullopt if unknown.
  std::optional<DescriptorColumn> descriptors;

  std::size_t size() const { return positions.size(); }
  double weight(std::size_t i) const { return weights.empty() ? 1.0 : weights[i]; }

  /// @throws Error (misuse) for columns of different lengths, numbers that are not finite, negative
  ///        weights, views of missing landmarks, descriptors of 0 or more than kMostDescriptorBytes
  ///        bytes, and further descriptors that no landmark has
  /// @param name of the cloud, for the message
  void validate(std::string_view name) const;
};

/// The same landmarks, all lengths multiplied by the scale.
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
  PointSetOptions points = {};  ///< landmarks that take part
  std::size_t part_landmarks =
      600;  ///< approximate number in each part that the map can be cut into; at least 1
};

/// A map prepared for alignments with many others: computes shared work once. Does not refer to the map.
/// Copies share the data; any number of threads may use it.
class PreparedMap {
 public:
  /// @throws Error (input) if the map lacks the input of the confidence metric
  explicit PreparedMap(const LandmarkMap& map, const PrepareOptions& options = {},
                       const Execution& execution = {});
  /// Landmarks in metres, without a vertical and without parts.
  /// @param name of the cloud, for messages
  /// @throws Error (misuse) as LandmarkCloud::validate()
  explicit PreparedMap(LandmarkCloud cloud, std::string_view name = "cloud",
                       const Execution& execution = {});

  LengthUnit length_unit() const { return length_unit_; }
  /// Unit vector downwards; std::nullopt if the map does not state it.
  const std::optional<Eigen::Vector3d>& gravity() const { return gravity_; }

  // For this module.
  const detail::PreparedCloud& cloud() const { return *cloud_; }
  /// Evenly spread landmarks of a dense cloud, such as a depth camera's: more than 8,192 landmarks without descriptors and
  /// views. Null for other maps.
  const std::shared_ptr<const detail::PreparedCloud>& even() const { return even_; }
  /// Null for landmarks without a map. Its landmarks are indices in cloud().
  const std::shared_ptr<const MapImages>& images() const { return images_; }
  /// Null if the map does not state how it drifts. Its landmarks are indices in cloud().
  const std::shared_ptr<const detail::MapDrift>& drift() const { return drift_; }
  /// Null for landmarks without a map.
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

/// The downward direction in both maps. The rotation about it and a small tilt remain free.
struct GravityPrior {
  Eigen::Vector3d source = -Eigen::Vector3d::UnitZ();  ///< downwards, in the source's frame
  Eigen::Vector3d target = -Eigen::Vector3d::UnitZ();  ///< the same in the target's
  double max_tilt_rad = 0.17;  ///< largest angle between the two after alignment; in (0, π]
};

/// Bounds of s in x_target = R·(s·x_source) + t.
struct ScaleRange {
  double least = 1.0 / 20.0;
  double most = 20.0;
};

/// When rotations are searched. If many mutual descriptor matches agree on a pose, they decide.
enum class PoseSearch {
  kWhereNeeded,  ///< if descriptors do not decide
  kAlways,
  kNever,  ///< only descriptors propose poses: fast, and finds no pose without them
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
  /// Final kernel scale, at most `coarse`. std::nullopt: the expected error of a match, from spacing and
  /// covariances.
  std::optional<double> fine = {};
  /// From `fine` down to this scale, matches are one to one; at most `fine`. std::nullopt: a twelfth of
  /// `fine`, the accuracy of most maps.
  std::optional<double> finest = {};
  /// Kernel scale for the covariance; larger than the errors of single landmarks, because maps bend.
  /// std::nullopt: four times `finest`, at most `fine`.
  std::optional<double> error_scale = {};
  /// Keep the initial pose: matches, scores and covariance are those of this pose.
  bool hold = false;
  /// Also refines from ICP's result, whose match distances are unlimited, and keeps it if its objective is
  /// at least twice as large. ICP converges from larger errors if the maps share most landmarks, else often
  /// to a wrong pose. Not with a scale.
  bool by_icp_too = true;
  bool one_to_one = false;   ///< match each target landmark only with its nearest source landmark
  int max_iterations = 100;  ///< of each method; at least 1
  /// A landmark overlaps if the other map has one within this distance. std::nullopt: no overlap is
  /// computed.
  std::optional<double> overlap_radius = {};
  bool trace = false;  ///< record score and matches of every iteration

  /// @throws Error (misuse) naming the field, its value and the constraint
  void validate() const;
};

/// Robust probabilistic refinement of a pose by iteratively reweighted least squares.
///
/// Moves the smaller cloud and matches each of its landmarks with the nearest of the other. A residual r
/// enters with its squared Mahalanobis distance, m² = rᵀ·(s²·R·Cs·Rᵀ + Ct + σ²·I)⁻¹·r with the covariances
/// of both landmarks, under the kernel of Geman and McClure, m²/(1 + m²). The kernel scale σ falls from
/// coarse to fine (graduated non-convexity; Black and Rangarajan 1996). From fine to finest, each landmark
/// of the other cloud is matched at most once, with the nearest.
///
/// The pose covariance is a sandwich estimator, from the change of the objective when the pose is moved and
/// all matches are found anew, and from the gradients of 16 groups of matches. It is enlarged for that
/// small number, so that the 95 % ellipsoid holds 95 % of the errors: 2.4 times for 16 groups and 6 degrees
/// of freedom. Mean squared errors are therefore smaller than its diagonal. Prepared maps add the drift that the
/// covariances of their keyframes' poses state. There is no covariance for fewer than 12 groups with a match (14 with a scale). A direction is unobservable if moving by two kernel
/// scales along it hardly changes the objective, or if its standard deviation is larger than that.
/// An expected failure (too few landmarks or matches) is a status. The same input gives the same result for
/// any number of threads.
///
/// @throws Error (misuse) for invalid options or clouds
RegistrationResult refine(const LandmarkCloud& source, const LandmarkCloud& target,
                          const RefineOptions& options = {}, const Execution& execution = {});
RegistrationResult refine(const PreparedMap& source, const PreparedMap& target,
                          const RefineOptions& options = {}, const Execution& execution = {});

}  // namespace cairn
