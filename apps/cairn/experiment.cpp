// SPDX-License-Identifier: BSD-3-Clause
#include "commands.hpp"

namespace cairn::cli {

void add_experiment(const Command& program) {
  const Command experiment = program.add_group(
      "experiment", "Align maps from many initial poses: the paper's experiments, or a study");
  add_experiment_paper(experiment);
  add_experiment_sweep(experiment);
  add_experiment_merge(experiment);
  experiment.footer(
      "Example: run the paper's 45 configurations on two maps of one place\n"
      "  cairn experiment paper later.map earlier.map -o results");
}

}  // namespace cairn::cli
