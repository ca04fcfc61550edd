// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace cairn {

/// Separators of words within a line: space, tab, and the CR of a CR LF line end.
inline constexpr std::string_view kBlanks = " \t\r";

/// Whether `c` is one of kBlanks.
constexpr bool is_blank(char c) {
  return c == ' ' || c == '\t' || c == '\r';
}

/// Whether `c` is visible ASCII: a letter, a digit or punctuation.
constexpr bool is_visible(char c) {
  return c > ' ' && c < '\x7f';
}

/// Whether `text` is visible ASCII and not empty.
constexpr bool is_visible(std::string_view text) {
  for (const char c : text) {
    if (!is_visible(c)) return false;
  }
  return !text.empty();
}

/// `text` with its ASCII letters in lower case.
std::string lower_case(std::string_view text);

/// `text` without leading and trailing blanks; a view of the argument.
constexpr std::string_view trimmed(std::string_view text) {
  const std::size_t first = text.find_first_not_of(kBlanks);
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(kBlanks) - first + 1);
}

/// `text` without a UTF-8 byte order mark, which some editors write at the start of a file.
constexpr std::string_view without_byte_order_mark(std::string_view text) {
  constexpr std::string_view kMark = "\xEF\xBB\xBF";
  if (text.starts_with(kMark)) text.remove_prefix(kMark.size());
  return text;
}

/// `text` with `\xNN` for bytes that control a terminal or reorder text: control characters,
/// bidirectional marks and overrides, invalid UTF-8. File names and file contents may contain any
/// of them.
/// @param kept control characters to keep
std::string plain_text(std::string_view text, std::string_view kept = {});

/// Whether the bytes are valid UTF-8.
bool is_utf8(std::string_view text);

/// A URL for display: "***" replaces the password before the host and the passwords in parameters.
/// The password before the host ends at the last '@', because passwords may be unescaped. Returns
/// other text unchanged.
std::string without_password(std::string_view url);

}  // namespace cairn
