// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>

namespace cairn::cli {

/// The candidate that a mistyped word was most likely meant to be: the one with the fewest letters added, left
/// out, changed or swapped with the next. Nothing if that is more than a third of the word.
std::optional<std::string> likely_meant(std::string_view word,
                                        std::span<const std::string> candidates);

}  // namespace cairn::cli
