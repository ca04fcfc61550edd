// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <nlohmann/json.hpp>

#include "cairn/geometry/similarity3.hpp"

namespace cairn::cli {

/// One result in the document of an alignment, as far as it can be judged.
struct SavedAlignment {
  std::string confidence;
  std::string status;
  std::string length_unit;                        ///< "metres" or "free"
  std::optional<Similarity3> target_from_source;  ///< nothing if the alignment failed
  /// Of the pose, 6x6, or with its scale, 7x7; nothing if the alignment did not state any.
  std::optional<Eigen::MatrixXd> covariance;
};

/// What `align --json` wrote.
struct SavedAlignments {
  std::vector<SavedAlignment> results;
  std::optional<std::string> source_path;  ///< as it was given then; nothing if there was no file
  std::optional<std::string> source_hash;
  std::optional<std::size_t> min_observations;
};

/// @throws Error (input) naming the file and what is wrong with it
SavedAlignments read_alignments(const std::string& path);

/// Four rows of four numbers; nothing if `rows` is anything else.
std::optional<Matrix4d> matrix_of_rows(const nlohmann::json& rows);

}  // namespace cairn::cli
