// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/core/number_text.hpp"

#include <array>
#include <cmath>

namespace cairn {

std::optional<double> parse_number(std::string_view text) {
  // printf writes a plus sign, which from_chars does not accept.
  if (text.size() > 1 && text[0] == '+' && text[1] != '-') text.remove_prefix(1);
  double value = 0.0;
  const char* const end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, value);
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
