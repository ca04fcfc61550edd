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
  /// Largest distance of identical landmarks (tolerance), and of neighbouring landmarks of one
  /// object (reach); in the maps' unit, positive.
  double tolerance = 0.05;
  double reach = 0.12;
  /// Least number of landmarks of an object; 3 or more.
  std::size_t min_landmarks = 8;
  /// Least length of the longest side of an object's box; in the maps' unit.
  double min_size = 0.1;
  /// Least confidence of a reported change; in (0, 1).
  double min_confidence = 0.9;

  static const OptionTable table;
  /// @throws Error (misuse) naming the field, its value and the constraint
  void validate() const;
};

/// A group of neighbouring landmarks, and the box around nearly all of them, in the world frame.
struct ChangedPlace {
  std::vector<LandmarkIndex> landmarks;  ///< indices in the observing map, ascending
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  Eigen::Vector3d low = Eigen::Vector3d::Zero();
  Eigen::Vector3d high = Eigen::Vector3d::Zero();
};

enum class ChangeKind { kVanished, kAppeared, kMoved };

/// "vanished" etc.
std::string_view to_string(ChangeKind kind);

/// An object that only one of two maps contains, or that both contain at different places.
struct Change {
  ChangeKind kind = ChangeKind::kVanished;
  std::optional<ChangedPlace> before;  ///< in the first map; std::nullopt if the object appeared
  std::optional<ChangedPlace> after;   ///< in the second map; std::nullopt if the object vanished
  /// Motion of a moved object in the world: x_after = after_from_before * x_before.
  std::optional<Rigid3> after_from_before;
  double confidence =
      0.0;  ///< probability of the change; for a moved object, the smaller of two, one per place
};

struct ChangeResult {
  std::vector<Change> changes;       ///< moved, vanished, appeared; each by descending confidence
  std::size_t comparable_first = 0;  ///< landmarks that the second map should contain too
  std::size_t comparable_second = 0;
  double repeated = 0.0;  ///< share of comparable landmarks found in the other map
};

/// Finds the changes from the first map to the second, in the area that keyframes of both observed.
///
/// A landmark is comparable if at least two keyframes of the other map view its position, at a
/// range and from a direction similar to its own observations, without occlusion by landmarks that
/// they observed. The evidence of a landmark is whether the other map has a landmark with a similar
/// descriptor within the tolerance, and whether keyframes of the other map observed landmarks
/// behind its position. The rate at which unchanged landmarks are found again is estimated from the
/// maps themselves. Landmarks with evidence for a change in their neighbourhood are grouped. A
/// group is an object if the joint evidence of its landmarks is strong enough. An object of the
/// first map and an object of the second map form a moved object if enough of their landmarks have
/// similar descriptors and agree with one rigid motion. Binary descriptors are similar if at most a
/// quarter of their bits differ; others, if they differ less than 98 % of random pairs.
///
/// Maps without observations have no views, so no landmark is comparable. The same input and seed give the
/// same result for any number of threads. Reports no progress.
/// @throws Error (misuse) for invalid options, (cancelled)
ChangeResult find_changes(const PlacedMap& first, const PlacedMap& second,
                          const ChangeOptions& options = {}, const Execution& execution = {});

}  // namespace cairn
