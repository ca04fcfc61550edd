// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "cairn/core/file.hpp"
#include "cairn/formats/format_registry.hpp"
#include "cairn/formats/options.hpp"
#include "cairn/map/landmark_map.hpp"

namespace cairn {

/// Reads sfm_data.json of OpenMVG (docs/formats.md): views with a pose become frames, the structure
/// landmarks of free scale.
/// @throws Error (input) naming source, place, value and constraint
LandmarkMap read_openmvg(ByteSource& source, const MapReadOptions& options = {});

/// The format "openmvg".
std::vector<MapFormat> openmvg_formats();

}  // namespace cairn
