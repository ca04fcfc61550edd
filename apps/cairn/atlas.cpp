// SPDX-License-Identifier: BSD-3-Clause
#include "commands.hpp"

namespace cairn::cli {

void add_atlas(const Command& program) {
  const Command atlas = program.add_group(
      "atlas", "Keep maps, their links and their history in one file or database");
  add_atlas_maps(atlas);
  add_atlas_queries(atlas);
  add_atlas_changes(atlas);
  atlas.footer(
      "Example: merge two sessions; the atlas can take more later\n"
      "  cairn atlas init --atlas town.atlas\n"
      "  cairn atlas add monday.map tuesday.map --atlas town.atlas\n"
      "  cairn atlas link --atlas town.atlas\n"
      "  cairn atlas optimize --atlas town.atlas\n"
      "  cairn atlas merge --atlas town.atlas -o town.map");
}

}  // namespace cairn::cli
