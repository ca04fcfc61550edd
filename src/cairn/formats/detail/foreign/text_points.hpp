// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string_view>

// Private to cairn/interchange.
namespace cairn::detail {

/// Whether a text begins as points do: with three numbers, or with names of which three are of x, y and z.
bool looks_like_points(std::string_view first_bytes);

}  // namespace cairn::detail
