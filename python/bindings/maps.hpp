// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <string_view>

#include "cairn/formats/map_file.hpp"

#include "bindings/support.hpp"

namespace cairn::python {

/// "metres" or "free".
std::string_view to_string(LengthUnit unit);
/// @throws Error (misuse) for another word
LengthUnit length_unit_of(const std::string& text);

using MapClass = py::class_<LandmarkMap, SharedMap>;

/// Adds LandmarkMap.from_arrays().
void bind_from_arrays(MapClass& map);

Keywords<MapWriteOptions> write_keywords();

}  // namespace cairn::python
