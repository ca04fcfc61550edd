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

/// Markdown for a summary: findings as a list, and each table with its name and title.
std::string markdown_of(const std::vector<std::string>& findings);
std::string markdown_of(const std::vector<ResultTable>& tables);

/// The folder for results. It appears when all results are written. Makes the folders above it.
/// @param folder new or empty
/// @throws Error as OutputFolder
detail::OutputFolder result_folder(const std::filesystem::path& folder);

/// Writes runs.csv and timings.csv.
void write_runs(const std::string& folder, const std::vector<TrialResult>& runs,
                const std::string& prefix = "");

/// Writes each table as tables/NAME.csv and tables/NAME.tex.
void write_tables(const std::string& folder, const std::vector<ResultTable>& tables);

/// Writes text to a file in the folder.
void write_text(const std::string& folder, const std::string& name, const std::string& text);

/// The paper's experiments on a pair of maps, as a report shows them.
struct ShownPaper {
  const PaperResults* results = nullptr;
  PoseTolerance tolerance = {};
  std::string source_name = {};  ///< for people
  std::string target_name = {};
  const MapPair* pair = nullptr;  ///< null if not available; then there is no scene
  IcpOptions align = {};          ///< options of the runs
  PointSetOptions points = {};
};

/// Adds the findings, then one configuration in 3D by every strategy (Table 1's displacement with the
/// paper's k), then the figures and tables. Sets the title and the subtitle if the report has none.
/// @param prefix prefix of the ids, for several results in one report; may be empty
void add_paper(report::Report& report, const ShownPaper& shown, const CommonArguments& common,
               const std::string& prefix = {});

/// Adds a study's findings, figures and tables.
/// @param findings study_findings(), at least one
/// @param sections study_sections()
void add_study(report::Report& report, const std::string& name,
               const std::vector<std::string>& findings, std::vector<report::Section> sections,
               const std::string& prefix = {});

/// Writes the paper's Figure 1 as figures/figure1.png: one image from each sequence. The images belong
/// to the two keyframes that have the most landmarks in common at the pose of the run with the lowest
/// score.
/// @returns a sentence that states which images these are, or why there are none
/// @throws Error (misuse) if the tool was built without OpenCV; (input) for unreadable images
std::string write_common_view(const std::string& folder, const MapPair& pair,
                              const PaperResults& results, const std::string& source_sequence,
                              const std::string& target_sequence);

}  // namespace cairn::cli
