// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "cairn/alignment/detail/cloud_scales.hpp"
#include "cairn/alignment/detail/search/descriptor_matches.hpp"
#include "cairn/alignment/prepared_map.hpp"
#include "cairn/core/execution.hpp"
#include "cairn/core/random.hpp"
#include "cairn/geometry/similarity3.hpp"

namespace cairn::detail {

class PreparedCloud;

/// Evenly spread, deterministic rotations over SO(3): super-Fibonacci spirals (Alexa, CVPR 2022). Every rotation is
/// within about 4.5 rad / n^(1/3) of the nearest of n such rotations.
std::vector<Eigen::Quaterniond> all_rotations(std::size_t count);

/// Rotations that turn direction `from` into direction `to`, at even steps about `to`.
std::vector<Eigen::Quaterniond> rotations_about(const Eigen::Vector3d& from,
                                                const Eigen::Vector3d& to, std::size_t count);

/// A pose found by the search.
struct SearchCandidate {
  Rigid3 target_from_source;
  double score = 0.0;  ///< mean of the kernel over the sampled source points, in [0, 1]
};

/// Poses that bring source points close to target points. The search starts from each rotation with many translations.
/// It refines by iteratively reweighted least squares with the Geman-McClure kernel 1 / (1 + d²/σ²)². σ decreases from
/// coarse to fine, and ever fewer poses are kept.
///
/// Each step depends only on the input, so any number of threads gives the same poses.
///
/// @param source, target points centred near both centroids, so that single precision suffices; the source
///        in random order, because its first points are the sample
/// @param accept     whether a pose may be a candidate
/// @param candidates largest number of poses
/// @param execution  when stopped, returns what was found so far
/// @return distinct poses, best score first
std::vector<SearchCandidate> search_poses(
    std::span<const Eigen::Vector3d> source, std::span<const double> source_weights,
    std::span<const Eigen::Vector3d> target, std::span<const double> target_weights,
    std::span<const Eigen::Quaterniond> rotations, const std::function<bool(const Rigid3&)>& accept,
    const KernelScales& kernel, std::size_t candidates, const Execution& execution = {});

constexpr std::size_t kMostConstellationPoses = 24;

/// A pose that aligns a constellation and its surroundings.
struct ConstellationPose {
  Rigid3 target_from_source;
  double evidence = 0.0;  ///< log-likelihood ratio of the landmarks around the constellation
};

/// Poses from constellations. A constellation is three source points; a pose maps them to three target points with the
/// same distances, and the points around them close to other target points. This finds maps that share only a small
/// part, for which no coarse pose stands out. Each constellation is compared with the whole target (as in 4-points
/// congruent sets, Aiger et al. 2008, but with three local points). Each pose is checked against the voxels that target
/// points occupy.
///
/// The same input gives the same poses for any number of threads.
/// @param fine      unit of all lengths here: the fine kernel scale, about three times the landmark spacing; positive
/// @param draws     number of source constellations to search for in the target
/// @param execution when stopped, returns what was found so far
/// @return distinct poses, most evidence first
std::vector<ConstellationPose> constellation_poses(std::span<const Eigen::Vector3d> source,
                                                   std::span<const Eigen::Vector3d> target,
                                                   Random random, double fine, std::size_t draws,
                                                   const Execution& execution = {});

constexpr std::size_t kMostQuadPoses = 24;

/// A pose that aligns a quad and its surroundings.
struct QuadPose {
  Similarity3 target_from_source;
  double evidence = 0.0;  ///< log-likelihood ratio of the landmarks around the quad
};

/// Centred poses, with any scale, from quads. A quad is a landmark and three of its nearest neighbours. The proportions
/// of its sides identify a quad at any scale, as they identify stars in a photograph (Lang et al. 2010). A pose is
/// tested on the neighbours of the quad.
///
/// The same input gives the same poses for any number of threads.
/// @param scales    bounds of the source's scale
/// @param fine      fine kernel scale, in the target's unit; poses closer than half of it count as one
/// @param execution when stopped, returns what was found so far
/// @return distinct poses, most evidence first
std::vector<QuadPose> quad_poses(const PreparedCloud& source, const PreparedCloud& target,
                                 const ScaleRange& scales, double fine,
                                 const Execution& execution = {});

constexpr std::size_t kMostDescriptorPoses = 8;

/// A pose that several descriptor matches agree with.
struct DescriptorPose {
  Similarity3 pose;          ///< centred
  std::size_t agreeing = 0;  ///< matches within the tolerance
};

/// The least-squares pose of pairs of points; with a free scale by Umeyama (1991).
Similarity3 fitted_pose(const std::vector<Eigen::Vector3d>& from,
                        const std::vector<Eigen::Vector3d>& to, bool free_scale);

/// Centred poses from mutual descriptor matches, by consensus of random triples of matches (RANSAC, Fischler and Bolles
/// 1981). A triple gives a pose if the distances of its landmarks are equal in both clouds, or with a free scale in
/// equal proportions. The pose is re-estimated from all agreeing matches.
///
/// @param tolerance largest difference between distances of landmarks, in the target's unit; positive
/// @param scale     bounds of the source's scale, which is then estimated; std::nullopt: the scale is 1
/// @return distinct poses, most agreeing matches first; each with at least four
std::vector<DescriptorPose> descriptor_poses(const DescriptorMatches& matches, Random random,
                                             double tolerance,
                                             const std::optional<ScaleRange>& scale = {});

}  // namespace cairn::detail
