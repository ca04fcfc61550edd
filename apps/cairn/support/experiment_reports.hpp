// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "cairn/core/detail/output_folder.hpp"
#include "cairn/experiments/paper.hpp"
#include "cairn/report/report.hpp"

#include "support/documents.hpp"

namespace cairn::cli {

Json to_json(const ResultTable& table);

/// For a summary: findings as a list, and each table with its name and title.
std::string markdown_of(const std::vector<std::string>& findings);
std::string markdown_of(const std::vector<ResultTable>& tables);

/// The folder that results go to, which appears when all are written; makes those it is to be in.
/// @param folder new or empty
/// @throws Error as OutputFolder
detail::OutputFolder result_folder(const std::filesystem::path& folder);

/// Writes runs.csv and timings.csv.
void write_runs(const std::string& folder, const std::vector<TrialResult>& runs,
                const std::string& prefix = "");

/// Writes each table as tables/NAME.csv and tables/NAME.tex.
void write_tables(const std::string& folder, const std::vector<ResultTable>& tables);

/// Text to a file in the folder.
void write_text(const std::string& folder, const std::string& name, const std::string& text);

/// The paper's experiments on a pair of maps, as a report shows them.
struct ShownPaper {
  const PaperResults* results = nullptr;
  PoseTolerance tolerance = {};
  std::string source_name = {};  ///< for people
  std::string target_name = {};
  const MapPair* pair = nullptr;  ///< null: not to be had; then there is no scene
  IcpOptions align = {};          ///< as they were run with
  PointSetOptions points = {};
};

/// Adds the findings; one configuration in 3D, Table 1's displacement with the paper's k, by every
/// strategy; then the figures and tables. A report without title or subtitle gets them.
/// @param prefix of the ids, for several results in one report; may be empty
void add_paper(report::Report& report, const ShownPaper& shown, const CommonArguments& common,
               const std::string& prefix = {});

/// Adds a study's findings, figures and tables.
/// @param findings study_findings(), at least one
/// @param sections study_sections()
void add_study(report::Report& report, const std::string& name,
               const std::vector<std::string>& findings, std::vector<report::Section> sections,
               const std::string& prefix = {});

/// Writes the paper's Figure 1 as figures/figure1.png: an image of each sequence, of those two keyframes
/// that have the most landmarks in common at the pose of the run with the lowest score.
/// @returns a sentence that says which images these are, or why there are none
/// @throws Error (misuse) where the tool was built without OpenCV; (input) for unreadable images
std::string write_common_view(const std::string& folder, const MapPair& pair,
                              const PaperResults& results, const std::string& source_sequence,
                              const std::string& target_sequence);

}  // namespace cairn::cli
