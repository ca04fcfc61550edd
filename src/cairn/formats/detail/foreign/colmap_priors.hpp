// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>

#include "cairn/formats/map_file.hpp"
#include "cairn/storage/sqlite/database.hpp"

namespace cairn::detail {

/// Priors of a model's images, from the table pose_priors of COLMAP's database.
struct ColmapPriors {
  OptionalColumn<GnssFix> gnss;  ///< per frame; empty if unknown
  std::optional<Eigen::Vector3d>
      gravity;  ///< unit vector downwards in the model, if all images agree
};

/// Images are matched by name. Logs positions that are not in WGS84 as a loss.
ColmapPriors read_colmap_priors(const LandmarkMap& model, sqlite::Database& database,
                                const Execution& execution);

}  // namespace cairn::detail
