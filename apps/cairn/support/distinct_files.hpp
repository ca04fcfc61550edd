// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <CLI/CLI.hpp>

namespace cairn::cli {

/// Refuses a command line whose output is also an input or another output, be it through links: the one
/// would be lost to the other. An input that the command line does not name is refused when it is read: see
/// refuse_to_read.
/// @param verb the innermost verb that was parsed
/// @throws Error (misuse) naming both
void require_distinct_files(const CLI::App& verb);

}  // namespace cairn::cli
