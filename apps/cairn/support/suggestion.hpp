// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>

namespace cairn::cli {

/// The candidate that a mistyped word most likely stands for: the one that the fewest typing errors turn into the
/// word. A typing error adds, omits or changes a letter, or swaps two neighbours. std::nullopt if every candidate
/// needs more errors than a third of the word's letters.
std::optional<std::string> likely_meant(std::string_view word,
                                        std::span<const std::string> candidates);

}  // namespace cairn::cli
