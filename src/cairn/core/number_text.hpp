// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bit>
#include <charconv>
#include <cstdint>
#include <cstring>
#include <optional>
#include <string>
#include <string_view>

namespace cairn {

/// Parses a number in the form of printf's "%f" ("-0.500000": up to eight digits, a point, six
/// decimals), bit-identical to std::from_chars. Inline for speed: maps contain millions of such
/// numbers.
/// @return the end of the number; null for any other text
inline const char* read_six_decimals(const char* first, const char* last, double& value) {
  if constexpr (std::endian::native != std::endian::little) return nullptr;
  const auto digit_at = [](const char* place) { return static_cast<unsigned>(*place - '0'); };
  const char* next = first + (first != last && *first == '-' ? 1 : 0);
  const char* const digits = next;
  std::uint64_t integer = 0;
  while (next != last && digit_at(next) <= 9) integer = integer * 10 + digit_at(next++);
  const bool plain = next != digits && next - digits <= 8;
  if (!plain || last - next <= 8 || *next != '.') return nullptr;
  std::uint64_t bytes = 0;
  std::memcpy(&bytes, next + 1, sizeof bytes);
  bytes ^= 0x3030303030303030;
  // The first six are digits and the seventh is none.
  const std::uint64_t others = bytes | (bytes + 0x7676767676767676);
  if ((others & 0x0080808080808080) != 0x0080000000000000) return nullptr;
  // Pairs, then all of them become one number (Mula, Lemire); what made room is zeros before it.
  bytes <<= 16;
  bytes = bytes * 10 + (bytes >> 8);
  bytes = ((bytes & 0x000000ff000000ff) * 0x000f424000000064 +
           ((bytes >> 16) & 0x000000ff000000ff) * 0x0000271000000001) >>
          32;
  // An integer below 2^53 over a power of ten rounds once, as the exact quotient does (Clinger 1990).
  const double magnitude =
      static_cast<double>(static_cast<std::int64_t>(integer * 1000000 + bytes)) / 1e6;
  // The sign of coordinates is as good as random: no branch on it.
  value = std::bit_cast<double>(std::bit_cast<std::uint64_t>(magnitude) |
                                std::uint64_t{digits != first} << 63);
  return next + 7;
}

/// The whole of `text` as a finite decimal number ("1", "-0.5", "+2e-3"); std::nullopt for any other text,
/// NaN, infinity, or a number out of the range of a double. Independent of the locale.
std::optional<double> parse_number(std::string_view text);

/// The whole of `text` as an unsigned decimal integer of at most 64 bits; std::nullopt for any other text.
std::optional<std::uint64_t> parse_unsigned(std::string_view text);

/// Appends the shortest decimal that parses back to exactly `value`.
void append_number(std::string& out, double value);
void append_number(std::string& out, std::uint64_t value);

}  // namespace cairn
