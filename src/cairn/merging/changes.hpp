// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "cairn/core/execution.hpp"
#include "cairn/merging/fusion/fuse_maps.hpp"

namespace cairn {

struct ChangeOptions {
  /// Landmarks observed less often are not looked at.
  std::size_t min_observations = 2;
  /// How far two landmarks that are one may lie apart, and how near to each other the landmarks of one
  /// thing lie; in the maps' unit, positive.
  double tolerance = 0.05;
  double reach = 0.12;
  /// Landmarks that a thing has at least; 3 or more.
  std::size_t min_landmarks = 8;
  /// Longest side of a thing's box, at least; in the maps' unit.
  double min_size = 0.1;
  /// From which confidence a thing is reported; in (0, 1).
  double min_confidence = 0.9;
  std::uint64_t seed = 0;
  Execution execution = {};

  /// @throws Error (misuse) naming the field, its value and what it may be
  void validate() const;
};

/// Landmarks near each other, and the box about nearly all of them in the world's frame.
struct ChangedPlace {
  std::vector<LandmarkIndex> landmarks;  ///< of the map that saw them, ascending
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  Eigen::Vector3d low = Eigen::Vector3d::Zero();
  Eigen::Vector3d high = Eigen::Vector3d::Zero();
};

enum class ChangeKind { kVanished, kAppeared, kMoved };

/// "vanished" and so on.
std::string_view to_string(ChangeKind kind);

/// A thing that only one of two maps has, or that both have at different places.
struct Change {
  ChangeKind kind = ChangeKind::kVanished;
  std::optional<ChangedPlace> before;  ///< in the first map; nothing of what appeared
  std::optional<ChangedPlace> after;   ///< in the second map; nothing of what vanished
  /// How the world moved under a thing that moved: x_after = after_from_before * x_before.
  std::optional<Rigid3> after_from_before;
  double confidence =
      0.0;  ///< that it is a change at all; of what moved, the lesser of both places
};

struct ChangeResult {
  std::vector<Change> changes;       ///< moved, vanished, appeared; each by descending confidence
  std::size_t comparable_first = 0;  ///< landmarks that the other map should have, too
  std::size_t comparable_second = 0;
  double repeated = 0.0;  ///< share of the comparable landmarks that the other map has
};

/// What is different in the second map, where the keyframes of both looked.
///
/// A landmark should have been seen by the other map if it lies in the view of one of that map's keyframes,
/// at a range at which the landmark was seen itself, from a direction not too different, and not behind what
/// that keyframe saw. For each such landmark there is evidence: whether the other map has a landmark that
/// looks alike within the tolerance, and whether a keyframe of the other map saw through the place where it
/// would be. How often a landmark that is still there is found again is measured on the maps themselves.
/// Landmarks whose neighbourhood says that they are gone are grouped; a group is a thing if the evidence of
/// its landmarks together is strong enough. A thing of the first map and one of the second become one that
/// moved if enough of their landmarks look alike and one rigid motion explains these.
///
/// Maps without observations have no views: then nothing is comparable. Same input and seed, same result,
/// whatever the number of threads.
/// @throws Error (misuse) for invalid options
ChangeResult find_changes(const PlacedMap& first, const PlacedMap& second,
                          const ChangeOptions& options = {});

}  // namespace cairn
