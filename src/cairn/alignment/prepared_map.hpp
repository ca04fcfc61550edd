// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "cairn/alignment/detail/bends/map_parts.hpp"
#include "cairn/alignment/prepared_cloud.hpp"
#include "cairn/core/executor.hpp"
#include "cairn/map/landmark_map.hpp"

namespace cairn {

/// Options of PreparedMap.
struct PrepareOptions {
  std::optional<Metric> confidence =
      {};                       ///< metric of the landmarks' confidences; std::nullopt: all equal
  PointSetOptions points = {};  ///< landmarks that take part
  CutOptions cut = {};          ///< limits of the parts that the map can be cut into
  std::uint64_t seed = 0;
  Executor executor = Executor();
};

/// A part of a map, prepared to be placed separately. It is in the frame of the map.
struct PreparedPart {
  MapPart part;
  PreparedCloud cloud;
};

/// A map prepared for alignments with many others: computes shared work once. Does not refer to the map.
/// Copies share the data; any number of threads may use it.
class PreparedMap {
 public:
  /// @throws Error (input) if the map lacks the input of the confidence metric
  explicit PreparedMap(const LandmarkMap& map, const PrepareOptions& options = {});

  const PreparedCloud& cloud() const { return cloud_; }
  LengthUnit length_unit() const { return length_unit_; }
  /// Unit vector downwards; std::nullopt if the map does not state it.
  const std::optional<Eigen::Vector3d>& gravity() const { return gravity_; }
  /// The parts of the map, prepared on first use; empty if it is too small for two.
  std::span<const PreparedPart> parts() const;
  /// Index of each landmark's part, in the order of landmarks_to_align(); parts().size() for none.
  std::span<const std::uint32_t> part_of() const;
  /// Where the keyframes, by index in the map, and the landmarks, in the order of landmarks_to_align(), lie along its
  /// parts; empty without parts.
  const AlongParts& along() const;

 private:
  class Parts;

  PreparedCloud cloud_;
  LengthUnit length_unit_;
  std::optional<Eigen::Vector3d> gravity_;
  std::shared_ptr<Parts> parts_;
};

}  // namespace cairn
