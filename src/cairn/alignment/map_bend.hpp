// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <string_view>
#include <vector>

#include "cairn/core/ids.hpp"
#include "cairn/geometry/similarity3.hpp"
#include "cairn/placement/verdict.hpp"

namespace cairn {

/// Which of the two maps of an alignment.
enum class MapRole { kSource, kTarget };

/// "source" or "target": the names in results.
std::string_view to_string(MapRole role);

/// A part of one map, placed on the whole other map.
struct PartPose {
  MapRole map = MapRole::kSource;
  FrameId first;  ///< keyframes of the part
  FrameId middle;
  FrameId last;
  std::size_t landmarks = 0;
  Verdict verdict = Verdict::kRejected;  ///< on the part alone, as align() judges a map
  double probability = 0.0;              ///< of the pose that was found for the part alone
  /// The pose found for the part alone, right or not. x_in_target = target_from_source * x_in_source.
  std::optional<Similarity3> found;
  /// Whether `found` is aligned by itself, or agrees with the parts beside it that are.
  bool agrees = false;
  /// The pose that the consensus gives the part: `found` if that agrees, else what lies between those of the
  /// parts beside it. Nothing without a consensus.
  std::optional<Similarity3> target_from_source;
};

/// How far a map departs from a rigid one, as the other map shows it.
struct MapBend {
  MapRole map = MapRole::kSource;
  /// The largest rotation between the poses of two of its parts, after smoothing; radians.
  double rotation_rad = 0.0;
  FrameId first;  ///< it happens between these keyframes
  FrameId last;
  /// How far from its place, at most, the single pose puts a part: root mean square over its landmarks, in the target's unit.
  double displacement = 0.0;
};

/// What the parts of two maps came to.
struct PartsAlignment {
  std::vector<PartPose> parts;  ///< those of the source first, in the order of their keyframes
  std::size_t aligned = 0;      ///< how many are aligned by themselves
  /// At least two parts of one map are aligned by themselves, with landmarks of two parts of the other, and
  /// agree up to a bend, and no aligned part contradicts them.
  bool consensus = false;
  bool contradictory = false;  ///< parts that are aligned by themselves contradict each other
  /// Whether the bent map is aligned as a whole once it is straightened; std::nullopt if that was not asked.
  std::optional<bool> confirmed = {};
  std::optional<MapBend> bend;  ///< with a consensus
  /// With a consensus: the pose that fits all landmarks of the map that bends best, each at its
  /// part's place. Its covariance includes how far the parts' poses differ from it.
  std::optional<Similarity3> target_from_source;
  std::optional<Matrix6d> covariance;
  double probability = 0.0;  ///< of the likeliest of the parts that agree
};

}  // namespace cairn
