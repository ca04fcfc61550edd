// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/core/error.hpp"

#include <fmt/format.h>

#include "cairn/core/text.hpp"

namespace cairn {
namespace {

std::string message(std::string_view where, std::string_view what, std::string_view expected) {
  std::string text;
  if (!where.empty()) text += fmt::format("{}: ", where);
  text += what;
  if (!expected.empty()) text += fmt::format("; expected {}", expected);
  return plain_text(text);
}

}  // namespace

Error::Error(ErrorKind kind, std::string_view where, std::string_view what,
             std::string_view expected)
    : std::runtime_error(message(where, what, expected)), kind_(kind) {}

std::string printable(std::string_view text) {
  constexpr std::size_t kLongest = 40;
  std::string result = "'";
  for (const char c : text.substr(0, kLongest)) {
    const auto byte = static_cast<unsigned char>(c);
    if (byte < 0x20 || byte >= 0x7f) {
      result += fmt::format("\\x{:02x}", byte);
    } else {
      result += c;
    }
  }
  return result + (text.size() > kLongest ? "'..." : "'");
}

}  // namespace cairn
