// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "support/command_line.hpp"

namespace cairn::cli {

// Each function adds its verb.
void add_align(const Command& program);
void add_convert(const Command& program);
void add_demo(const Command& program);
void add_evaluate(const Command& program);
void add_experiment(const Command& program);
void add_locate(const Command& program);
void add_map(const Command& program);
void add_merge(const Command& program);
void add_info(const Command& program);
void add_report(const Command& program);
void add_simulate(const Command& program);
void add_atlas(const Command& program);

// Verbs of `evaluate`.
void add_evaluate_alignment(const Command& evaluate);
void add_evaluate_map(const Command& evaluate);
void add_evaluate_trajectory(const Command& evaluate);

// Verbs of `experiment`.
void add_experiment_merge(const Command& experiment);
void add_experiment_paper(const Command& experiment);
void add_experiment_sweep(const Command& experiment);

// Verbs of `atlas`.
void add_atlas_changes(const Command& atlas);
void add_atlas_maps(const Command& atlas);
void add_atlas_queries(const Command& atlas);

}  // namespace cairn::cli
