// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "cairn/core/executor.hpp"
#include "cairn/map/landmark_map.hpp"
#include "cairn/placement/map_parts.hpp"
#include "cairn/placement/prepared_cloud.hpp"

namespace cairn {

/// What of a map takes part in alignments.
struct PrepareOptions {
  std::optional<Metric> confidence = {};  ///< how far each landmark is trusted; nothing: all alike
  PointSetOptions points = {};            ///< which landmarks take part
  CutOptions cut = {};                    ///< into how many parts the map may be cut
  std::uint64_t seed = 0;
  Executor executor = Executor();
};

/// A part of a map, ready to be placed on another map by itself. It is in the frame of the map.
struct PreparedPart {
  MapPart part;
  PreparedCloud cloud;
};

/// A map made ready for alignments with many others: what all of them need of it is computed once. It
/// does not refer to the map. Copies share it; any number of threads may use it.
class PreparedMap {
 public:
  /// @throws Error (input) where the map lacks the input of the confidence metric
  explicit PreparedMap(const LandmarkMap& map, const PrepareOptions& options = {});

  const PreparedCloud& cloud() const { return cloud_; }
  LengthUnit length_unit() const { return length_unit_; }
  /// Downwards, if the map says so.
  const std::optional<Eigen::Vector3d>& gravity() const { return gravity_; }
  /// The parts of the map, prepared when they are first asked for; none if it is too small for two.
  std::span<const PreparedPart> parts() const;
  /// Index of the part of each landmark, in the order of landmarks_to_align(); parts().size() for none.
  std::span<const std::uint32_t> part_of() const;
  /// How far along the map each of them is, in parts: 2.5 in the middle of the third. NaN for one in no
  /// part.
  std::span<const double> along() const;

 private:
  class Parts;

  PreparedCloud cloud_;
  LengthUnit length_unit_;
  std::optional<Eigen::Vector3d> gravity_;
  std::shared_ptr<Parts> parts_;
};

}  // namespace cairn
