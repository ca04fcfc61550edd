// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/formats/detail/own/numbered_fields.hpp"

namespace cairn::detail {

int hex_value(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return -1;
}

std::string escaped(std::string_view text) {
  std::string result;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const auto byte = static_cast<unsigned char>(text[i]);
    const bool at_edge = i == 0 || i + 1 == text.size();
    if (byte < 0x20 || byte == 0x7f || byte == '%' || (byte == ' ' && at_edge)) {
      result += {'%', kHexDigits[byte >> 4], kHexDigits[byte & 15]};
    } else {
      result += text[i];
    }
  }
  return result;
}

std::string unescaped(std::string_view text, const NumberedFields& fields) {
  std::string result;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] != '%') {
      result += text[i];
      continue;
    }
    const bool complete = i + 2 < text.size();
    const int high = complete ? hex_value(text[i + 1]) : -1;
    const int low = complete ? hex_value(text[i + 2]) : -1;
    if (high < 0 || low < 0) {
      fields.refuse("'%' that starts no escape", "two hexadecimal digits after each '%'");
    }
    result += static_cast<char>(high * 16 + low);
    i += 2;
  }
  return result;
}

}  // namespace cairn::detail
