// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "cairn/experiments/run.hpp"
#include "cairn/map/landmark_map.hpp"

#include "support/alignments.hpp"
#include "support/documents.hpp"

namespace cairn::cli {

/// A map as named in a document.
struct SavedMap {
  std::optional<std::string> path;  ///< as given to the run that wrote the document
  std::optional<std::string> hash;
};

/// What `cairn align --json` or `cairn demo --json` wrote, read back with its whole history.
struct SavedResult {
  std::string file;  ///< path of the document
  SavedMap source;
  SavedMap target;
  std::vector<std::pair<std::string, Json>> inputs;  ///< role and description
  Json options;
  std::size_t min_observations = 2;
  std::string camera;  ///< camera stated for all frames; empty: none
  Rigid3 initial;
  std::optional<Similarity3> truth;
  LengthUnit unit = LengthUnit::kMetres;
  bool with_scale = false;    ///< whether the scale was estimated
  bool with_gravity = false;  ///< whether the vertical of both maps was used
  /// Options that the verdict depends on: min_probability, prior_odds, effort, parts, deformation.
  AlignOptions judging;
  std::uint64_t seed = 0;
  std::vector<StrategyResult> results;
};

/// @param text text of a document of one of these schemas, which is in `file`
/// @throws Error (input) naming file, field, value and what was expected
SavedResult saved_result(const std::string& text, const std::string& file);

/// What `cairn experiment paper` wrote besides its runs.
struct SavedPaper {
  SavedMap source;
  SavedMap target;
  std::vector<std::pair<std::string, Json>> inputs;
  std::optional<Rigid3> truth;
  double success_score = 0.0;
  Agreement agreement;
  PoseTolerance tolerance;
  IcpOptions align;
  PointSetOptions points;
};

/// @throws Error as saved_result()
SavedPaper saved_paper(const std::string& text, const std::string& file);

}  // namespace cairn::cli
