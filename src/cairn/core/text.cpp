// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/core/text.hpp"

#include <algorithm>
#include <vector>

#include <fmt/format.h>

namespace cairn {
namespace {

struct CodePoint {
  char32_t value = 0;
  std::size_t size = 0;  // in bytes; 0: not UTF-8
};

// The first code point of a text that is not empty.
CodePoint first_code_point(std::string_view text) {
  const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(text[i]); };
  const unsigned char lead = byte(0);
  if (lead < 0x80) return {lead, 1};
  const std::size_t size = lead >= 0xF0 ? 4 : lead >= 0xE0 ? 3 : 2;
  constexpr char32_t kSmallest[] = {0, 0, 0x80, 0x800, 0x10000};
  if (lead < 0xC0 || lead > 0xF4 || size > text.size()) return {};
  char32_t value = lead & (0x7FU >> size);
  for (std::size_t i = 1; i < size; ++i) {
    if ((byte(i) & 0xC0U) != 0x80U) return {};
    value = (value << 6U) | (byte(i) & 0x3FU);
  }
  const bool is_surrogate = value >= 0xD800 && value <= 0xDFFF;
  if (value < kSmallest[size] || value > 0x10FFFF || is_surrogate) return {};
  return {value, size};
}

bool is_harmless(char32_t c) {
  const bool is_control = c < 0x20 || (c >= 0x7F && c < 0xA0);
  const bool is_direction = c == 0x61C || c == 0x200E || c == 0x200F ||
                            (c >= 0x202A && c <= 0x202E) || (c >= 0x2066 && c <= 0x2069);
  const bool is_line_end = c == 0x2028 || c == 0x2029;
  return !is_control && !is_direction && !is_line_end;
}

}  // namespace

std::string plain_text(std::string_view text, std::string_view kept) {
  std::string result;
  result.reserve(text.size());
  while (!text.empty()) {
    const CodePoint c = first_code_point(text);
    const std::string_view bytes = text.substr(0, std::max<std::size_t>(c.size, 1));
    const bool stays = c.size == 1 && kept.find(text[0]) != std::string_view::npos;
    if (stays || (c.size > 0 && is_harmless(c.value))) {
      result += bytes;
    } else {
      for (const char byte : bytes) {
        result += fmt::format("\\x{:02x}", static_cast<unsigned char>(byte));
      }
    }
    text.remove_prefix(bytes.size());
  }
  return result;
}

bool is_utf8(std::string_view text) {
  while (!text.empty()) {
    const std::size_t size = first_code_point(text).size;
    if (size == 0) return false;
    text.remove_prefix(size);
  }
  return true;
}

std::string without_password(std::string_view url) {
  const std::size_t scheme = url.find("://");
  if (scheme == std::string_view::npos) return std::string(url);
  const std::size_t begin = scheme + 3;
  std::vector<bool> hidden(url.size() + 1, false);
  const auto hide = [&](std::size_t from, std::size_t to) {
    for (std::size_t i = from; i < to; ++i) hidden[i] = true;
  };
  // Up to the last @: a password that is not escaped as it has to be may hold any character.
  const std::size_t at = url.rfind('@');
  const std::size_t colon = url.find(':', begin);
  if (at != std::string_view::npos && colon < at) hide(colon + 1, at);
  // "password" and "sslpassword".
  constexpr std::string_view kKey = "password=";
  for (std::size_t key = url.find(kKey, begin); key != std::string_view::npos;
       key = url.find(kKey, key + 1)) {
    hide(key + kKey.size(), std::min(url.find('&', key), url.size()));
  }
  std::string shown;
  for (std::size_t i = 0; i < url.size(); ++i) {
    if (!hidden[i]) shown += url[i];
    if (hidden[i] && !hidden[i + 1]) shown += "***";
  }
  return shown;
}

std::string lower_case(std::string_view text) {
  std::string result(text);
  for (char& c : result) {
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  }
  return result;
}

}  // namespace cairn
