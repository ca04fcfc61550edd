// SPDX-License-Identifier: BSD-3-Clause
#include <utility>
#include <vector>

#include "commands.hpp"
#include "support/verbs.hpp"

namespace cairn::cli {

Run add_evaluate(CLI::App& program) {
  CLI::App* const evaluate = program.add_subcommand(
      "evaluate", "Compare a trajectory, an alignment or a map with ground truth");
  std::vector<Run> runs = {add_evaluate_trajectory(*evaluate), add_evaluate_alignment(*evaluate),
                           add_evaluate_map(*evaluate)};
  evaluate->footer(
      "Example: print the errors of a trajectory\n"
      "  cairn evaluate trajectory estimate.txt groundtruth.txt");
  return run_of_verb(*evaluate, std::move(runs));
}

}  // namespace cairn::cli
