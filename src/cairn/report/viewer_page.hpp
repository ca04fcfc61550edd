// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string_view>

namespace cairn::report {

/// Whether this build contains the viewer (CMake option CAIRN_WITH_VIEWER), which reports need.
bool has_viewer();

/// The viewer's page, for write_report().
/// @throws Error (misuse) if this build has none
std::string_view viewer_page();

}  // namespace cairn::report
