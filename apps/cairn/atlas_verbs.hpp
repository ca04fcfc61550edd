// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "commands.hpp"

namespace cairn::cli {

Run add_atlas(CLI::App& program);

// The verbs below atlas.
Run add_atlas_init(CLI::App& atlas);
Run add_atlas_add(CLI::App& atlas);
Run add_atlas_link(CLI::App& atlas);
Run add_atlas_unlink(CLI::App& atlas);
Run add_atlas_optimize(CLI::App& atlas);
Run add_atlas_merge(CLI::App& atlas);
Run add_atlas_show(CLI::App& atlas);
Run add_atlas_path(CLI::App& atlas);
Run add_atlas_export(CLI::App& atlas);
Run add_atlas_remove(CLI::App& atlas);
Run add_atlas_split(CLI::App& atlas);
Run add_atlas_log(CLI::App& atlas);
Run add_atlas_undo(CLI::App& atlas);
Run add_atlas_diff(CLI::App& atlas);
Run add_atlas_verify(CLI::App& atlas);
Run add_atlas_compact(CLI::App& atlas);
Run add_atlas_salvage(CLI::App& atlas);

}  // namespace cairn::cli
