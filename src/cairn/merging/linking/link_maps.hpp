// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "cairn/alignment/align.hpp"
#include "cairn/core/option_table.hpp"
#include "cairn/pose_graph/pose_graph.hpp"

namespace cairn {

/// "stated", or the name of the verdict.
std::string_view link_status(const std::optional<Verdict>& verdict);

/// Whether a link may place a map: it has a pose, which is stated or judged aligned.
inline bool connects(const std::optional<Verdict>& verdict,
                     const std::optional<Similarity3>& target_from_source) {
  return target_from_source && verdict.value_or(Verdict::kAligned) == Verdict::kAligned;
}

/// Relation of two of several maps: the result of align(), or a stated link.
struct MapLink {
  std::size_t target = 0;  ///< index of a map
  std::size_t source = 0;
  LinkKind kind = LinkKind::kPlacement;
  std::optional<Verdict> verdict;     ///< std::nullopt for a stated link, which was not judged
  std::optional<double> probability;  ///< std::nullopt for a stated link
  std::string reason;                 ///< one sentence for people
  /// Only if the link is stated or its verdict is aligned; with the covariances of Alignment.
  std::optional<Similarity3> target_from_source;
  std::optional<Matrix6d> covariance;
  std::optional<Matrix7d> covariance_with_scale;
};

/// The pose graph's link for an aligned pair or a stated link, with the maps' indices as nodes; std::nullopt for other
/// pairs.
std::optional<PoseLink> pose_link(const MapLink& link);

/// The inverse conversion, for a link that was not judged. Its nodes' ids are indices.
MapLink stated_link(const PoseLink& link);

struct LinkOptions {
  double min_probability = 0.99;  ///< least probability of an aligned pair; see AlignOptions
  double prior_odds = 1.0;        ///< see PlaceOptions
  double effort = 1.0;            ///< see PlaceOptions
  PointSetOptions points = {};
  std::uint64_t seed = 0;
  Execution execution = {};

  static const OptionTable table;
  /// @throws Error (misuse) naming the field, its value and the constraint
  void validate() const;
};

/// A map prepared for any number of link_pair() with these options.
PreparedMap prepared_to_link(const LandmarkMap& map, const LinkOptions& options = {});

/// Aligns one map with another; leaves the link's indices 0.
/// @throws Error as link_maps()
MapLink link_pair(const PreparedMap& target, const PreparedMap& source,
                  const LinkOptions& options = {});

/// The parts of two maps, which show whether one is bent: place_by_parts(). std::nullopt if they do not agree.
std::optional<PartsAlignment> parts_of_pair(const PreparedMap& target, const PreparedMap& source,
                                            const LinkOptions& options = {});

/// Aligns every map with every other one. The larger of the two is the target (precedes()), so that the order of the maps
/// does not matter. Estimates the scale if one of the two has a free scale. The same input and seed give the same links
/// for any number of threads.
/// @return one link per pair, in the order (0, 1), (0, 2), (1, 2), (0, 3), ...
/// @throws Error (cancelled) if the caller asked to stop
std::vector<MapLink> link_maps(std::span<const LandmarkMap* const> maps,
                               const LinkOptions& options = {});

/// The same for some pairs only.
/// @return one link per pair, in their order
std::vector<MapLink> link_maps(std::span<const LandmarkMap* const> maps,
                               std::span<const std::pair<std::size_t, std::size_t>> pairs,
                               const LinkOptions& options);

}  // namespace cairn
