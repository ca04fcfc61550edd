// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <string_view>

namespace cairn {

/// `text` with everything in it as `\xNN` that would command a terminal or reorder what is read there:
/// control characters, marks and overrides of the writing direction, and bytes that are no UTF-8. Names
/// of files and texts within them may hold any of these.
/// @param kept control characters that stay
std::string plain_text(std::string_view text, std::string_view kept = {});

/// A URL as it may be shown: with "***" for the password before its host or among its parameters. Any
/// other text comes back as it is.
std::string without_password(std::string_view url);

}  // namespace cairn
