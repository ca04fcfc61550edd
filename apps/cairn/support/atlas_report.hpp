// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "cairn/atlas/atlas.hpp"
#include "cairn/report/report.hpp"

namespace cairn::cli {

/// Answer, network and log of an atlas.
/// @param location of the atlas, for the commands that undo
void add_atlas_state(report::Report& report, Atlas& atlas, const AtlasState& state,
                     const std::string& location);

}  // namespace cairn::cli
