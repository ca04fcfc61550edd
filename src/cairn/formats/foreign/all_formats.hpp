// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/formats/format_registry.hpp"

namespace cairn {

/// All map formats of Cairn: native_formats() and those of other systems (docs/formats.md).
const FormatRegistry& all_formats();

}  // namespace cairn
