// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>

#include "cairn/core/executor.hpp"
#include "cairn/map/landmark_map.hpp"
#include "cairn/placement/prepared_cloud.hpp"

namespace cairn {

/// What of a map takes part in alignments.
struct PrepareOptions {
  std::optional<Metric> confidence = {};  ///< how far each landmark is trusted; nothing: all alike
  PointSetOptions points = {};            ///< which landmarks take part
  std::uint64_t seed = 0;
  Executor executor = Executor();
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

 private:
  PreparedCloud cloud_;
  LengthUnit length_unit_;
  std::optional<Eigen::Vector3d> gravity_;
};

}  // namespace cairn
