// SPDX-License-Identifier: BSD-3-Clause
#include <utility>
#include <vector>

#include "commands.hpp"
#include "support/verbs.hpp"

namespace cairn::cli {

Run add_experiment(CLI::App& program) {
  CLI::App* const experiment = program.add_subcommand(
      "experiment", "Align maps from many initial poses: the paper's experiments, or a study");
  std::vector<Run> runs = {add_experiment_paper(*experiment), add_experiment_sweep(*experiment),
                           add_experiment_merge(*experiment)};
  experiment->footer(
      "Example: run the paper's 45 configurations on two maps of one place\n"
      "  cairn experiment paper later.map earlier.map -o results");
  return run_of_verb(*experiment, std::move(runs));
}

}  // namespace cairn::cli
