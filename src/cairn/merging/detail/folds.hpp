// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "cairn/map/common_images.hpp"
#include "cairn/merging/fusion/fuse_maps.hpp"

namespace cairn::detail {

/// How far the poses of two maps' common images differ in the world, in the order of CommonImages::same.
struct PoseDifferences {
  std::vector<double> apart;
  std::vector<double> turned_deg;
};

PoseDifferences pose_differences(const PlacedMap& first, const PlacedMap& second,
                                 const CommonImages& common);

/// The fold of each map, as others show it: see MapFold.
std::vector<std::optional<MapFold>> find_folds(std::span<const PlacedMap> maps);

}  // namespace cairn::detail
