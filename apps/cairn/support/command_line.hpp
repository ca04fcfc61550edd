// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

namespace cairn::cli {

/// Keeps the words that the program was called with. To be called once, first of all.
void keep_command_line(int argc, char** argv);

/// "cairn" and the words after it.
const std::vector<std::string>& command_line();

}  // namespace cairn::cli
