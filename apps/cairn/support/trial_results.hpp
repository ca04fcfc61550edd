// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "cairn/core/detail/output_folder.hpp"
#include "cairn/experiments/run.hpp"

#include "support/documents.hpp"

namespace cairn::cli {

/// One run as documents hold it, with the names of runs.csv; without its duration.
Json to_json(const TrialResult& run);
Json to_json(const ResultTable& table);

/// Each table with its name and title, for a summary.
std::string markdown_of(const std::vector<ResultTable>& tables);

/// The folder that results go to, which appears when all are written; makes those it is to be in.
/// @param folder new or empty
/// @throws Error (storage)
detail::OutputFolder result_folder(const std::filesystem::path& folder);

/// Writes runs.csv and timings.csv.
void write_runs(const std::string& folder, const std::vector<TrialResult>& runs,
                const std::string& prefix = "");

/// Writes each table as tables/NAME.csv.
void write_tables(const std::string& folder, const std::vector<ResultTable>& tables);

/// Text to a file in the folder.
void write_text(const std::string& folder, const std::string& name, const std::string& text);

}  // namespace cairn::cli
