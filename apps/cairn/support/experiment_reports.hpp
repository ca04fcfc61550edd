// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "cairn/experiments/paper.hpp"
#include "cairn/report/report.hpp"

#include "support/arguments.hpp"

namespace cairn::cli {

/// The paper's experiments on a pair of maps, as a report shows them.
struct ShownPaper {
  const PaperResults* results = nullptr;
  PoseTolerance tolerance = {};
  std::string source_name = {};  ///< for people
  std::string target_name = {};
  const MapPair* pair = nullptr;  ///< null: not to be had; then there is no scene
  IcpOptions align = {};          ///< as they were run with
  PointSetOptions points = {};
  std::vector<report::Section> sections = {};  ///< paper_sections()
};

/// Adds how many runs succeed; one configuration in 3D, Table 1's displacement with the paper's k, by every
/// strategy; then the figures and tables. A report without title or subtitle gets them.
/// @param prefix of the ids, for several results in one report; may be empty
void add_paper(report::Report& report, ShownPaper shown, const CommonArguments& common,
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
