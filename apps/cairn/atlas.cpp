// SPDX-License-Identifier: BSD-3-Clause
#include <utility>
#include <vector>

#include "atlas_verbs.hpp"
#include "support/verbs.hpp"

namespace cairn::cli {

Run add_atlas(CLI::App& program) {
  CLI::App* const atlas = program.add_subcommand(
      "atlas", "Keep maps, their links and their history in one file or database");
  std::vector<Run> runs = {
      add_atlas_init(*atlas),     add_atlas_add(*atlas),    add_atlas_link(*atlas),
      add_atlas_optimize(*atlas), add_atlas_merge(*atlas),  add_atlas_show(*atlas),
      add_atlas_path(*atlas),     add_atlas_export(*atlas), add_atlas_remove(*atlas),
      add_atlas_split(*atlas),    add_atlas_unlink(*atlas), add_atlas_log(*atlas),
      add_atlas_undo(*atlas),     add_atlas_diff(*atlas),   add_atlas_verify(*atlas),
      add_atlas_compact(*atlas),  add_atlas_salvage(*atlas)};
  atlas->footer(
      "Example: merge two sessions; the atlas can take more later\n"
      "  cairn atlas init --atlas town.atlas\n"
      "  cairn atlas add monday.map tuesday.map --atlas town.atlas\n"
      "  cairn atlas link --atlas town.atlas\n"
      "  cairn atlas optimize --atlas town.atlas\n"
      "  cairn atlas merge --atlas town.atlas -o town.map");
  return run_of_verb(*atlas, std::move(runs));
}

}  // namespace cairn::cli
