// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string_view>

namespace cairn::report {

/// Whether this build carries the viewer (CMake option CAIRN_WITH_VIEWER), without which no report can
/// be written.
bool has_viewer();

/// The viewer's page, to be given to write_report().
/// @throws Error (misuse) if this build carries none
std::string_view viewer_page();

}  // namespace cairn::report
