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

Keywords<MapWriteOptions> write_keywords();

}  // namespace cairn::python
