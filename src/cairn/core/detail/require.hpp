// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string_view>

#include <fmt/format.h>

#include "cairn/core/error.hpp"

namespace cairn::detail {

/// @param field    field of an options struct, or argument, e.g. "FeatureOptions.count"
/// @param expected the constraint, e.g. "50 to 20000"
/// @throws Error (misuse) unless `holds`
template <class Value>
void require(bool holds, std::string_view field, const Value& value, std::string_view expected) {
  if (!holds) throw Error(ErrorKind::kMisuse, field, fmt::format("{}", value), expected);
}

}  // namespace cairn::detail
