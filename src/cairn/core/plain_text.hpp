// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <string_view>

namespace cairn {

/// `text` with `\xNN` for everything that controls a terminal or reorders text: control characters, marks
/// and overrides of the writing direction, and invalid UTF-8. File names and their content may contain any
/// of these.
/// @param kept control characters to keep
std::string plain_text(std::string_view text, std::string_view kept = {});

/// Whether the bytes are valid UTF-8.
bool is_utf8(std::string_view text);

/// A URL for display: with "***" for the password before its host, up to the last @ because it may not be escaped, and
/// for those in its parameters. Other text is returned unchanged.
std::string without_password(std::string_view url);

}  // namespace cairn
