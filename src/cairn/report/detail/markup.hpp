// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <string_view>

namespace cairn::report {

/// `text` for an HTML or SVG document, in elements or quoted attributes: escapes markup; replaces invalid
/// UTF-8 and characters that XML forbids by U+FFFD; replaces tabs and line ends by blanks.
std::string markup_text(std::string_view text);

}  // namespace cairn::report
