// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "cairn/core/execution.hpp"
#include "cairn/core/option_table.hpp"
#include "cairn/merging/fusion/fuse_maps.hpp"

namespace cairn {

struct ChangeOptions {
  /// Ignores landmarks with fewer observations.
  std::size_t min_observations = 2;
  /// Largest distance of two landmarks that are the same, and of neighbouring landmarks of one thing; in
  /// the maps' unit, positive.
  double tolerance = 0.05;
  double reach = 0.12;
  /// Least number of landmarks of a thing; 3 or more.
  std::size_t min_landmarks = 8;
  /// Least length of the longest side of a thing's box; in the maps' unit.
  double min_size = 0.1;
  /// Least confidence of a reported thing; in (0, 1).
  double min_confidence = 0.9;

  static const OptionTable table;
  /// @throws Error (misuse) naming the field, its value and the constraint
  void validate() const;
};

/// Landmarks near each other, and the box around nearly all of them in the world frame.
struct ChangedPlace {
  std::vector<LandmarkIndex> landmarks;  ///< of the map that observed them, ascending
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  Eigen::Vector3d low = Eigen::Vector3d::Zero();
  Eigen::Vector3d high = Eigen::Vector3d::Zero();
};

enum class ChangeKind { kVanished, kAppeared, kMoved };

/// "vanished" etc.
std::string_view to_string(ChangeKind kind);

/// A thing that only one of two maps has, or that both have at different places.
struct Change {
  ChangeKind kind = ChangeKind::kVanished;
  std::optional<ChangedPlace> before;  ///< in the first map; std::nullopt for what appeared
  std::optional<ChangedPlace> after;   ///< in the second map; std::nullopt for what vanished
  /// Motion of a moved thing: x_after = after_from_before * x_before.
  std::optional<Rigid3> after_from_before;
  double confidence =
      0.0;  ///< probability that it is a change; for a moved thing, the smaller of both places
};

struct ChangeResult {
  std::vector<Change> changes;       ///< moved, vanished, appeared; each by descending confidence
  std::size_t comparable_first = 0;  ///< landmarks that the other map should have too
  std::size_t comparable_second = 0;
  double repeated = 0.0;  ///< share of comparable landmarks that the other map has
};

/// Differences of the second map from the first, in the area that the keyframes of both observed.
///
/// A landmark is comparable if it is in the view of a keyframe of the other map, at a range at which it was
/// itself observed, from a similar direction, and not hidden behind what that keyframe saw. Evidence for
/// each: whether the other map has a landmark with a similar descriptor within the tolerance, and whether
/// one of its keyframes saw through the landmark's place. The rate at which unchanged landmarks are found
/// again is measured on the maps themselves. Landmarks whose neighbourhood indicates a change are grouped;
/// a group is a thing if the joint evidence of its landmarks is strong enough. A thing of the first map and
/// one of the second form a moved thing if enough of their landmarks have similar descriptors and one rigid
/// motion explains these.
///
/// Maps without observations have no views, so no landmark is comparable. The same input and seed give the
/// same result for any number of threads. Reports no progress.
/// @throws Error (misuse) for invalid options, (cancelled)
ChangeResult find_changes(const PlacedMap& first, const PlacedMap& second,
                          const ChangeOptions& options = {}, const Execution& execution = {});

}  // namespace cairn
