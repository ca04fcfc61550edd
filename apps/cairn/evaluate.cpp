// SPDX-License-Identifier: BSD-3-Clause
#include "commands.hpp"

namespace cairn::cli {

void add_evaluate(const Command& program) {
  const Command evaluate = program.add_group(
      "evaluate", "Compare a trajectory, an alignment or a map with ground truth");
  add_evaluate_trajectory(evaluate);
  add_evaluate_alignment(evaluate);
  add_evaluate_map(evaluate);
  evaluate.footer(
      "Example: print the errors of a trajectory\n"
      "  cairn evaluate trajectory estimate.txt groundtruth.txt");
}

}  // namespace cairn::cli
