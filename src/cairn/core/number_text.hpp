// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <charconv>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace cairn {

/// As std::from_chars, to the bit, and faster for what maps are full of: some digits and a point.
std::from_chars_result read_number(const char* first, const char* last, double& value);

/// The whole of `text` as a finite decimal number ("1", "-0.5", "+2e-3"); nothing if it is anything
/// else, NaN, infinite, or too large or small for a double. Independent of the locale.
std::optional<double> parse_number(std::string_view text);

/// The whole of `text` as an unsigned decimal integer of at most 64 bits; nothing if anything else.
std::optional<std::uint64_t> parse_unsigned(std::string_view text);

/// Appends the shortest decimal that parses back to exactly `value`.
void append_number(std::string& out, double value);
void append_number(std::string& out, std::uint64_t value);

}  // namespace cairn
