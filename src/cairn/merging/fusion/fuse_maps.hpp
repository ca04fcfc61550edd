// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "cairn/adjustment/adjust.hpp"
#include "cairn/core/execution.hpp"
#include "cairn/core/option_table.hpp"
#include "cairn/map/folds.hpp"

namespace cairn {

/// A map to fuse, and its pose.
struct PlacedMap {
  const LandmarkMap* map = nullptr;  ///< not null
  std::string name;                  ///< for the provenance
  Similarity3 world_from_map;
  /// Left perturbation in the world, (δt, δφ, δ log s); zero for the map whose frame is the world's.
  Matrix7d covariance = Matrix7d::Zero();
  /// The same relative to the largest of the maps, by which landmarks are compared, so that the frame does not matter;
  /// std::nullopt: as `covariance`.
  std::optional<Matrix7d> relative_covariance = {};

  /// Whether the map's frame is the world: its pose is exactly the identity. Its values are then copied as
  /// read, to the last digit.
  bool is_in_world() const;
};

/// Indices of maps in the order in which they are worked on, whatever order they are given in: precedes().
std::vector<std::size_t> largest_first(std::span<const PlacedMap> maps);

/// Options of fuse_maps(), which fuses maps as they are, and of merge_placed().
struct FusionOptions {
  /// Least probability that two landmarks are the same; in [0.5, 1].
  double fusion_probability = 0.5;
  /// merge_placed(): whether to straighten maps that others show to be bent.
  bool straighten = true;
  /// Of splats: whether to leave out the duplicates of lower opacity; see fuse_maps().
  bool thin_splats = true;
  /// merge_placed(): whether to bundle-adjust all keyframes and landmarks of the merged map.
  bool adjust = false;
  AdjustOptions adjustment = {};
  /// Rounds of matching landmarks again after an adjustment, and adjusting again; 0 to 10.
  int matching_rounds = 2;

  static const OptionTable table;
  /// @throws Error (misuse) naming the field, its value and the constraint
  void validate() const;
};

/// Result for a map's landmarks.
struct MapFusion {
  std::size_t landmarks = 0;
  std::size_t fused = 0;  ///< number fused with landmarks of other maps
  /// Distance of fused landmarks beyond their covariances; see AssociationResult.
  double deviation = 0.0;
};

struct FusionResult {
  LandmarkMap map;
  std::vector<MapFusion> maps;                  ///< one per map
  std::vector<std::vector<FrameIndex>> frames;  ///< per map and frame: its index in `map`
};

/// Columns of a fused map that state each landmark's origin.
inline constexpr const char* kFromMapColumn = "from_map";  ///< index of the first of its maps
inline constexpr const char* kFromLandmarkColumn = "from_landmark";  ///< id there; NaN above 2^53
inline constexpr const char* kFusedColumn = "fused";  ///< number of landmarks it combines

/// Fuses maps in one frame into one map.
///
/// The order of the maps decides nothing but numbers: they are worked on by largest_first().
/// Finds the same landmarks of the maps before (associate()). A landmark's position is the information-weighted mean of
/// all maps' together: of their covariances, and of the variance per map that these do not explain. n maps of one
/// quality weigh 1/n each. The covariance is that of the mixture of "same landmark" and "one of them is another" with
/// the pairs' probabilities, with the uncertainty of the maps' poses. This moves a map's landmarks together, so it has no
/// part in the weights. A map that is given twice, wherever it is placed, counts once. Landmarks of one map are never
/// fused. A landmark that lacks a covariance in one map has none.
///
/// Poses of the maps count as independent, although maps that share links err alike: covariances of landmarks far from
/// the world's frame are then too small by what is common.
///
/// Neighbouring mini-maps of a session share a keyframe. Two maps' frames become one, with the pose of the larger map,
/// if one is the last frame of its map and the other the first of its, timestamp, image name and camera are equal, and
/// their pixels are those of one image. Images without timestamps that several maps contain (common_images()) become one
/// frame each, with the pose and camera of the largest of these maps, and landmarks that their keypoints show to be the
/// same are fused.
/// A landmark keeps its first observation in a frame of several maps.
///
/// Keeps all other frames and observations, the cameras of frames and rigs (one of equal ones), colours, descriptors of the largest map's kind,
/// and named columns, with normals turned. If images of two maps have one name, the names of all images of these maps
/// are preceded by the map's name and "/"; the log says so. Numbers frames, cameras and landmarks anew from 0, frames in
/// the order of the maps, landmarks in that of their sizes; provenance and columns state their origin. Poses, positions,
/// gravity and georeference are in the world. Length unit and gravity are those of the first map, and so is the name of the world frame if that map is
/// in the world. The same input and seed give the same result for any number of threads.
///
/// Gaussian splats are joined instead: each stays as it is, moved into the world, but for duplicates. Two splats of
/// different maps are duplicates if their Gaussians overlap by a Bhattacharyya coefficient of at least 0.8. The one of
/// lower opacity is left out and counts as fused. Columns are those of the map with the highest degree, then others.
/// Harmonics and normals that a map lacks are zero, other values unknown.
///
/// @throws Error (misuse) for no map or invalid options, (input) for more landmarks or frames than indices, or for splats
///         with maps that are none
FusionResult fuse_maps(std::span<const PlacedMap> maps, const FusionOptions& options = {},
                       const Execution& execution = {});

}  // namespace cairn
