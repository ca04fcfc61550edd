// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <string_view>
#include <vector>

#include "cairn/alignment/evidence/verdict.hpp"
#include "cairn/core/ids.hpp"
#include "cairn/geometry/similarity3.hpp"

namespace cairn {

/// Which of the two maps of an alignment.
enum class MapRole { kSource, kTarget };

/// "source" or "target": the names in results.
std::string_view to_string(MapRole role);

/// Part of one map, placed in the whole other map.
struct PartPose {
  MapRole map = MapRole::kSource;
  FrameId first;  ///< keyframes of the part
  FrameId middle;
  FrameId last;
  std::size_t landmarks = 0;
  Verdict verdict = Verdict::kRejected;  ///< on the part alone
  double probability = 0.0;              ///< of `found`
  /// The pose of the part alone, whatever its verdict. x_in_target = target_from_source * x_in_source.
  std::optional<Similarity3> found;
  /// `found` is aligned separately, or agrees with neighbouring parts that are.
  bool agrees = false;
  /// Pose of the part under the consensus: `found` if it agrees, else interpolated between the neighbouring
  /// parts. std::nullopt without a consensus.
  std::optional<Similarity3> target_from_source;
};

/// Deviation of a map from a rigid one, as the other map shows it.
struct MapBend {
  MapRole map = MapRole::kSource;
  /// Largest rotation between the poses of two parts, after smoothing; radians.
  double rotation_rad = 0.0;
  FrameId first;  ///< the bend lies between these keyframes
  FrameId last;
  /// Largest root mean square distance of a part's landmarks from their places under the single pose, in
  /// the target's unit.
  double displacement = 0.0;
};

/// Smooth deformation of two maps of free scale against each other. It does not show which of them is deformed.
struct MapDeformation {
  std::size_t matches = 0;    ///< descriptor matches that agree with it
  double rotation_rad = 0.0;  ///< largest rotation between the local poses of two landmarks
  double scale_ratio = 1.0;   ///< largest ratio of their scales
  /// Root mean square distance of the matches under the single pose, in the target's unit.
  double displacement = 0.0;
};

/// Result of place_by_parts().
struct PartsAlignment {
  std::vector<PartPose> parts;  ///< parts of the source first, in the order of their keyframes
  std::size_t aligned = 0;      ///< number of parts that are aligned separately
  /// At least two parts of one map are aligned separately, with landmarks of two parts of the other, and
  /// agree up to a bend; no aligned part contradicts them.
  bool consensus = false;
  bool contradictory = false;  ///< parts that are aligned separately contradict each other
  /// Whether the straightened map is aligned as a whole; std::nullopt if not tested.
  std::optional<bool> confirmed = {};
  std::optional<MapBend> bend;  ///< with a consensus
  /// With a consensus: the pose that fits all landmarks of the bent map best, each at the place that its
  /// part's pose gives. The covariance includes the deviations of the parts' poses from it.
  std::optional<Similarity3> target_from_source;
  std::optional<Matrix6d> covariance;
  std::optional<Matrix7d> covariance_with_scale = {};  ///< the same, if a scale is estimated
  double probability = 0.0;                            ///< the largest of the parts that agree
};

}  // namespace cairn
