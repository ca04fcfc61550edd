// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/alignment/align.hpp"
#include "cairn/map/landmark_map.hpp"

namespace cairn {

/// Version of the schema `cairn.align` in written documents. Version 1 can also be read.
constexpr unsigned kAlignmentVersion = 2;

/// "robust" or "icp": the names in results.
std::string_view to_string(AlignMethod method);

/// One result in an alignment document: an Alignment and its settings.
struct AlignmentRecord {
  Alignment alignment;
  AlignMethod method = AlignMethod::kRobust;
  std::string confidence = "base";  ///< name of the confidence metric; "base": none
  std::size_t k = 1;                ///< candidates per match; 1 except with kIcp and a metric
  LengthUnit length_unit = LengthUnit::kMetres;
  /// Overlap radius in the target's unit; std::nullopt if no overlap was computed.
  std::optional<double> overlap_radius;
  /// Number of matches at the estimate; the document does not hold the matches.
  std::size_t matches = 0;
};

/// What a document contains about the iterations.
enum class HistoryDetail {
  kNone,
  kPoses,    ///< pose, scale and mean squared distance
  kMatches,  ///< also score and matches
};

/// A result as JSON: one entry of `results` in a document of schema `cairn.align`, version 2. Poses
/// are 4x4 matrices that include the scale; each pose also has a quaternion (qw qx qy qz) and the
/// scale.
std::string to_json(const AlignmentRecord& record, HistoryDetail history = HistoryDetail::kNone);

/// Reads all results in an alignment document (schema `cairn.align` or `cairn.demo`, versions 1 and 2). A
/// round trip through to_json() is lossless. In version 1, an unjudged pose is the estimate, and a judged
/// pose counts only if its verdict is aligned.
///
/// @param document text of the document
/// @param name     its name in messages, such as its path
/// @throws Error (input) naming document, field, value and constraint
std::vector<AlignmentRecord> read_alignments(std::string_view document, const std::string& name);

}  // namespace cairn
