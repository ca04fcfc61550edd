// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "commands.hpp"

namespace cairn::cli {

/// For a verb that has verbs of its own: requires one, and runs the one that was given.
/// @param runs one a verb, in the order in which they were added
Run run_of_verb(CLI::App& parent, std::vector<Run> runs);

}  // namespace cairn::cli
