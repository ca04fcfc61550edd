// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/core/number_text.hpp"

#include <array>
#include <cmath>

namespace cairn {
namespace {

// Exact powers of ten, by which an integer of up to 19 digits may be divided.
constexpr std::array<std::uint64_t, 20> kPowersOfTen = [] {
  std::array<std::uint64_t, 20> powers = {1};
  for (std::size_t i = 1; i < powers.size(); ++i) powers[i] = 10 * powers[i - 1];
  return powers;
}();

bool is_digit(char c) {
  return c >= '0' && c <= '9';
}

// Appends the leading digits of a text to `integer`, which may wrap around. Returns the end of the digits.
const char* take_digits(const char* next, const char* last, std::uint64_t& integer) {
  for (; next != last && is_digit(*next); ++next) {
    integer = integer * 10 + static_cast<std::uint64_t>(*next - '0');
  }
  return next;
}

// The same, eight digits at a time if there are as many bytes, combined pairwise (Mula, Lemire).
const char* take_many_digits(const char* next, const char* last, std::uint64_t& integer) {
  if constexpr (std::endian::native == std::endian::little) {
    while (last - next >= 8) {
      std::uint64_t bytes = 0;
      std::memcpy(&bytes, next, sizeof bytes);
      bytes ^= 0x3030303030303030;
      const std::uint64_t others = (bytes | (bytes + 0x7676767676767676)) & 0x8080808080808080;
      const int count = std::countr_zero(others) / 8;
      if (count == 0) return next;
      bytes <<= 64 - 8 * count;
      bytes = bytes * 10 + (bytes >> 8);
      bytes = ((bytes & 0x000000ff000000ff) * 0x000f424000000064 +
               ((bytes >> 16) & 0x000000ff000000ff) * 0x0000271000000001) >>
              32;
      integer = integer * kPowersOfTen[static_cast<std::size_t>(count)] + bytes;
      next += count;
      if (count < 8) return next;
    }
  }
  return take_digits(next, last, integer);
}

}  // namespace

std::from_chars_result read_number(const char* first, const char* last, double& value) {
  // Fast path for an integer up to 2^53 over an exact power of ten: one division is correctly rounded
  // (Clinger 1990). The library handles all other numbers.
  constexpr std::uint64_t kLargestExact = std::uint64_t{1} << 53;
  constexpr std::ptrdiff_t kMostDigits = 19;  // fewer cannot wrap around
  const bool negative = first != last && *first == '-';
  const char* const digits = first + (negative ? 1 : 0);
  std::uint64_t integer = 0;
  const char* const point = take_digits(digits, last, integer);
  const char* stop = point;
  std::ptrdiff_t decimals = 0;
  if (point != last && *point == '.') {
    stop = take_many_digits(point + 1, last, integer);
    decimals = stop - point - 1;
  }
  const bool has_exponent = stop != last && (*stop == 'e' || *stop == 'E');
  if (point == digits || stop - digits > kMostDigits || integer > kLargestExact || has_exponent) {
    return std::from_chars(first, last, value);
  }
  const std::uint64_t power = kPowersOfTen[static_cast<std::size_t>(decimals)];
  const double magnitude =
      static_cast<double>(static_cast<std::int64_t>(integer)) / static_cast<double>(power);
  // Without a branch, because the signs of coordinates are unpredictable.
  value = std::bit_cast<double>(std::bit_cast<std::uint64_t>(magnitude) | std::uint64_t{negative}
                                                                              << 63);
  return {stop, std::errc{}};
}

std::optional<double> parse_number(std::string_view text) {
  // printf writes a plus sign, which from_chars does not accept.
  if (text.size() > 1 && text[0] == '+' && text[1] != '-') text.remove_prefix(1);
  double value = 0.0;
  const char* const end = text.data() + text.size();
  const auto [stop, error] = read_number(text.data(), end, value);
  if (error != std::errc{} || stop != end || !std::isfinite(value)) return std::nullopt;
  return value;
}

std::optional<std::uint64_t> parse_unsigned(std::string_view text) {
  std::uint64_t value = 0;
  const char* const end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, value);
  if (error != std::errc{} || stop != end) return std::nullopt;
  return value;
}

namespace {

template <class Number>
void append(std::string& out, Number value) {
  std::array<char, 32> buffer;
  const auto result = std::to_chars(buffer.data(), buffer.data() + buffer.size(), value);
  out.append(buffer.data(), result.ptr);
}

}  // namespace

void append_number(std::string& out, double value) {
  append(out, value);
}

void append_number(std::string& out, std::uint64_t value) {
  append(out, value);
}

}  // namespace cairn
