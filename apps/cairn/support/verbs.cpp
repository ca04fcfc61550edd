// SPDX-License-Identifier: BSD-3-Clause
#include "support/verbs.hpp"

#include <utility>

#include "cairn/core/error.hpp"

namespace cairn::cli {

Run run_of_verb(CLI::App& parent, std::vector<Run> runs) {
  parent.require_subcommand(1);
  const std::vector<CLI::App*> verbs = parent.get_subcommands(nullptr);
  for (CLI::App* const verb : verbs) verb->group("Verbs");
  return [name = parent.get_name(), runs = std::move(runs), verbs] {
    for (std::size_t i = 0; i < verbs.size(); ++i) {
      if (verbs[i]->parsed()) return runs[i]();
    }
    throw Error(ErrorKind::kMisuse, name, "no verb", "a verb");
  };
}

}  // namespace cairn::cli
