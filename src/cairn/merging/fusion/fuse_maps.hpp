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
  /// Left perturbation in the world, (δt, δφ, δ log s); zero for the map that defines the world
  /// frame.
  Matrix7d covariance = Matrix7d::Zero();
  /// The same relative to the largest map. Landmarks are compared by this covariance, so that the
  /// world frame does not matter. If std::nullopt, `covariance` is used.
  std::optional<Matrix7d> relative_covariance = {};
  /// Splats: the SfM model that they were trained on, in the map's frame and unit; its keyframes show
  /// floaters of other maps. Null: unknown.
  const LandmarkMap* model = nullptr;
  /// Splats: `map`, if it may be emptied once its splats are joined, which saves memory. Null: it stays.
  LandmarkMap* disposable = nullptr;

  /// Whether the map's frame is the world: its pose is exactly the identity. The values of such a
  /// map are copied exactly.
  bool is_in_world() const;
};

/// Indices of maps in the order of processing (precedes()), independent of the order of the input.
std::vector<std::size_t> largest_first(std::span<const PlacedMap> maps);

/// Options of fuse_maps(), which fuses maps as they are, and of merge_placed().
struct FusionOptions {
  /// Least probability that two landmarks are the same; in [0.5, 1].
  double fusion_probability = 0.5;
  /// merge_placed(): whether to straighten maps that others show to be bent.
  bool straighten = true;
  /// Splats: whether to leave out the duplicates of lower opacity; see fuse_maps().
  bool thin_splats = true;
  /// Splats: whether to leave out floaters; see fuse_maps().
  bool drop_floaters = false;
  /// merge_placed(): whether to bundle-adjust all keyframes and landmarks of the merged map.
  bool adjust = false;
  AdjustOptions adjustment = {};
  /// Rounds of renewed matching and adjustment after the first adjustment; 0 to 10.
  int matching_rounds = 2;

  static const OptionTable table;
  /// @throws Error (misuse) naming the field, its value and the constraint
  void validate() const;
};

/// Result for a map's landmarks.
struct MapFusion {
  std::size_t landmarks = 0;
  std::size_t fused = 0;  ///< number fused with landmarks of other maps
  /// Deviation of fused landmarks beyond their covariances, per coordinate, in the world's unit.
  double deviation = 0.0;
  /// Splats: number of floaters; std::nullopt if no other map has a model.
  std::optional<std::size_t> floaters = {};
};

struct FusionResult {
  LandmarkMap map;
  std::vector<MapFusion> maps;                  ///< one per map
  std::vector<std::vector<FrameIndex>> frames;  ///< per map and frame: its index in `map`
  /// Per map and camera: its index in `map`; std::nullopt if `map` lacks it. None for splats.
  std::vector<std::vector<std::optional<CameraIndex>>> cameras;
};

/// Columns of a fused map that state each landmark's origin.
inline constexpr const char* kFromMapColumn = "from_map";  ///< index of the landmark's first map
inline constexpr const char* kFromLandmarkColumn = "from_landmark";  ///< id there; NaN above 2^53
inline constexpr const char* kFusedColumn = "fused";  ///< number of combined landmarks

/// Fuses maps in one frame into one map.
///
/// Maps are processed in the order of largest_first(), so the order of the input affects only the
/// numbering. Each map's landmarks are associated with the landmarks of the maps processed before
/// it (associate()). The fused position is the information-weighted mean over all maps. The weights
/// follow from the landmark covariances and from an additional variance per map, for distances that
/// the covariances do not explain. n maps of equal quality weigh 1/n each. The fused covariance is
/// the covariance of the mixture of "same landmark" and "one is a different landmark" with the
/// pairs' probabilities, plus the uncertainty of the map poses. The pose uncertainty moves a map's
/// landmarks together, so it does not affect the weights. A map that is given twice, at any pose,
/// counts once. Landmarks of one map are never fused. If one map lacks the covariance of a
/// landmark, the fused landmark has no covariance.
///
/// Map poses count as independent, although shared links correlate their errors. Covariances of
/// landmarks far from the world's origin are then too small by the common part.
///
/// Consecutive mini-maps of a session share a keyframe. The last frame of one map and the first
/// frame of another map become one frame, with the pose of the larger map, if timestamp, image name
/// and camera are equal and the pixels belong to one image. An image without timestamp that several
/// maps contain (common_images()) becomes one frame, with the pose of the largest of these maps;
/// landmarks that its keypoints identify are fused. A frame of several maps has the camera of the
/// largest map that knows it, and timestamp, image name and GNSS fix of the first that knows them.
/// In it, a landmark keeps only its first observation.
///
/// Keeps all other frames and observations, the cameras of frames and rigs without duplicates,
/// colours, descriptors of the largest map's kind, and named columns with normals rotated into the
/// world. If images of two maps have the same name, the map's name and "/" are prepended to all
/// image names of these maps, and the log reports this. Frames, cameras and landmarks are
/// renumbered from 0: frames in the order of the maps, landmarks in the order of largest_first().
/// Provenance and columns state their origin. Poses, positions, gravity and georeference are in the
/// world. Length unit and gravity come from the first map. The name of the world frame also comes
/// from the first map if that map is in the world. The same input and seed give the same result for
/// any number of threads.
///
/// Gaussian splats are concatenated instead: each splat except a duplicate is moved into the world
/// without other changes. Two splats of different maps are duplicates if the Bhattacharyya
/// coefficient of their Gaussians is at least 0.8, and if their colour difference deviates by at
/// most 25 of 255 from the median of such pairs. A splat is left out if a duplicate of higher
/// opacity stays, and counts as fused. Columns of the map with the highest harmonic degree come
/// first, then other columns. Missing harmonics and normals are zero; other missing values are
/// unknown. If another map has a model, floaters are counted and, on request, left out. A floater
/// is a splat where that map has no splat, that at least three keyframes of that model look
/// through, and that the keyframes of the own map's model, if any, do not confirm.
///
/// @throws Error (misuse) without maps, for invalid options, or for drop_floaters without splats
///         and a model; (input) for more landmarks or frames than 32-bit indices, or for splats
///         mixed with other maps
FusionResult fuse_maps(std::span<const PlacedMap> maps, const FusionOptions& options = {},
                       const Execution& execution = {});

}  // namespace cairn
