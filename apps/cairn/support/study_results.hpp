// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "cairn/experiments/study.hpp"
#include "cairn/map/landmark_map.hpp"
#include "cairn/report/report.hpp"

#include "support/arguments.hpp"
#include "support/documents.hpp"

namespace cairn::cli {

/// A pair's paths, which are relative to the study's file, as seen from here.
PairFiles study_paths(PairFiles files, const std::string& study_path);

/// Fails before hours of work rather than after them: files that are not there, places and paths that
/// no simulation knows.
/// @throws Error (input) naming the study's file and the pair
void check_pairs(const Study& study, const std::string& study_path);

/// A file that the runs of a study depend on.
struct StudyInput {
  std::string pair;  ///< name
  std::string role;  ///< source, target or truth
  std::string path;
  std::string hash;

  /// As StudyFolder takes it.
  std::string line() const;
  /// For after the file was read.
  /// @throws Error (input) naming the file if its content is another now
  void require_unchanged() const;
};

/// The files of a study, with the hashes of their content.
std::vector<StudyInput> study_inputs(const Study& study, const std::string& study_path);

/// A map in metres.
/// @throws Error (input)
LandmarkMap read_study_map(const std::string& path);

/// What follows from the runs of a study.
struct StudyConclusion {
  std::size_t runs = 0;
  std::vector<std::string> findings;
  std::vector<report::Section> sections;
  Json json;  ///< experiment.json
};

/// Reads a complete study's runs.csv, and writes beside it what follows from them: tables/, summary.md and
/// experiment.json.
StudyConclusion conclude_study(const Study& study, const std::string& folder,
                               const CommonArguments& common);

/// Writes the document and the report that the user asked for; prints the findings.
/// @param folder of the results
void tell_study(const Study& study, StudyConclusion conclusion, const std::string& folder,
                const CommonArguments& common);

}  // namespace cairn::cli
