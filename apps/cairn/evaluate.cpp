// SPDX-License-Identifier: BSD-3-Clause
#include <string>
#include <utility>
#include <vector>

#include "cairn/core/error.hpp"

#include "commands.hpp"

namespace cairn::cli {

Run add_evaluate(CLI::App& program) {
  CLI::App* const evaluate = program.add_subcommand(
      "evaluate", "Measure a trajectory, an alignment or a map against the truth");
  evaluate->require_subcommand(1);
  const std::vector<Run> runs = {add_evaluate_trajectory(*evaluate),
                                 add_evaluate_alignment(*evaluate), add_evaluate_map(*evaluate)};
  const std::vector<CLI::App*> verbs = evaluate->get_subcommands(nullptr);
  for (CLI::App* const verb : verbs) verb->group("Verbs");
  evaluate->footer(
      "Example: how far a trajectory is from the true one\n"
      "  cairn evaluate trajectory estimate.txt groundtruth.txt");
  return [runs, verbs] {
    for (std::size_t i = 0; i < verbs.size(); ++i) {
      if (verbs[i]->parsed()) return runs[i]();
    }
    throw Error(ErrorKind::kMisuse, "evaluate", "nothing to do", "a verb");
  };
}

}  // namespace cairn::cli
