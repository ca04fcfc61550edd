// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>

#include <CLI/CLI.hpp>

namespace cairn::cli {

/// Runs a verb after its arguments were parsed; returns the exit code.
using Run = std::function<int()>;

// Each adds its verb to the program; what it returns runs the verb.
Run add_align(CLI::App& program);
Run add_convert(CLI::App& program);
Run add_demo(CLI::App& program);
Run add_evaluate(CLI::App& program);
Run add_experiment(CLI::App& program);
Run add_locate(CLI::App& program);
Run add_map(CLI::App& program);
Run add_merge(CLI::App& program);
Run add_info(CLI::App& program);
Run add_report(CLI::App& program);
Run add_simulate(CLI::App& program);

// The verbs below evaluate.
Run add_evaluate_alignment(CLI::App& evaluate);
Run add_evaluate_map(CLI::App& evaluate);
Run add_evaluate_trajectory(CLI::App& evaluate);

// The verbs below experiment.
Run add_experiment_merge(CLI::App& experiment);
Run add_experiment_paper(CLI::App& experiment);
Run add_experiment_sweep(CLI::App& experiment);

}  // namespace cairn::cli
