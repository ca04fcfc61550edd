// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "cairn/experiments/result_table.hpp"
#include "cairn/experiments/run.hpp"

#include "support/documents.hpp"

namespace cairn::cli {

/// One run as documents hold it, with the names of runs.csv; without its duration.
Json to_json(const TrialResult& run);
Json to_json(const ResultTable& table);

/// Each table with its name and title, for a summary.
std::string markdown_of(const std::vector<ResultTable>& tables);

/// Makes the folder that results go to; refuses one that holds anything.
/// @throws Error (storage)
void make_result_folder(const std::string& folder);

/// Writes runs.csv and timings.csv.
void write_runs(const std::string& folder, const std::vector<TrialResult>& runs,
                const std::string& prefix = "");

/// Writes each table as tables/NAME.csv.
void write_tables(const std::string& folder, const std::vector<ResultTable>& tables);

/// Text to a file in the folder.
void write_text(const std::string& folder, const std::string& name, const std::string& text);

}  // namespace cairn::cli
