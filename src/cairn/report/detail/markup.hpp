// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <string_view>

namespace cairn::report {

/// `text` as text of an HTML or SVG document, within elements or quoted attributes: what would be
/// markup is escaped; bytes that are not UTF-8 and characters that XML has no place for become U+FFFD;
/// tabs and line ends become blanks.
std::string markup_text(std::string_view text);

}  // namespace cairn::report
