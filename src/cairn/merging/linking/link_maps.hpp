// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "cairn/alignment/align.hpp"
#include "cairn/pose_graph/pose_graph.hpp"

namespace cairn {

/// What is known of how two of several maps lie to each other: what align() came to, or what another states.
struct MapLink {
  std::size_t target = 0;  ///< index of a map
  std::size_t source = 0;
  LinkKind kind = LinkKind::kPlacement;
  Verdict verdict = Verdict::kRejected;
  std::optional<double> probability;  ///< std::nullopt for a link that was not judged
  std::string reason;                 ///< one sentence for people
  /// Only if the verdict is aligned; with the covariances that Alignment states.
  std::optional<Similarity3> target_from_source;
  std::optional<Matrix6d> covariance;
  std::optional<Matrix7d> covariance_with_scale;
};

/// The link of a pose graph that an aligned pair is; its nodes have the maps' indices. Nothing of other pairs.
std::optional<PoseLink> pose_link(const MapLink& link);

/// The same the other way round, of a link that nobody judged. Its nodes' ids are indices.
MapLink stated_link(const PoseLink& link);

struct LinkOptions {
  double min_probability = 0.99;  ///< from which a pair is aligned; see AlignOptions
  double prior_odds = 1.0;        ///< see PlaceOptions
  double effort = 1.0;            ///< see PlaceOptions
  PointSetOptions points = {};
  std::uint64_t seed = 0;
  Execution execution = {};

  /// @throws Error (misuse) naming the field, its value and what it may be
  void validate() const;
};

/// A map made ready for any number of link_pair() with these options.
PreparedMap prepared_to_link(const LandmarkMap& map, const LinkOptions& options = {});

/// Aligns one map with another; the link's indices are left 0.
/// @throws Error as link_maps()
MapLink link_pair(const PreparedMap& target, const PreparedMap& source,
                  const LinkOptions& options = {});

/// Aligns every map with every map before it, which is the target. Where one of the two is of free scale,
/// the scale is searched for. Same input and seed, same links, whatever the number of threads.
/// @return one link a pair, in the order (0, 1), (0, 2), (1, 2), (0, 3), ...
/// @throws Error (cancelled) if the caller asked to stop
std::vector<MapLink> link_maps(std::span<const LandmarkMap* const> maps,
                               const LinkOptions& options = {});

/// The same of some pairs only, (target, source).
/// @return one link a pair, in their order
std::vector<MapLink> link_maps(std::span<const LandmarkMap* const> maps,
                               std::span<const std::pair<std::size_t, std::size_t>> pairs,
                               const LinkOptions& options);

}  // namespace cairn
