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

/// Version of the schema `cairn.align` that is written. Version 1 is read as well.
constexpr unsigned kAlignmentVersion = 2;

/// "robust" or "icp": the names in results.
std::string_view to_string(AlignMethod method);

/// One result of an alignment document: an Alignment and how it was asked for.
struct AlignmentRecord {
  Alignment alignment;
  AlignMethod method = AlignMethod::kRobust;
  std::string confidence = "none";  ///< name of the confidence metric; "none": base ICP
  std::size_t k = 1;                ///< candidates of each match; 1 except with kIcp and a metric
  LengthUnit length_unit = LengthUnit::kMetres;
  /// Radius of the overlap, in the target's unit; std::nullopt if no overlap was computed.
  std::optional<double> overlap_radius;
  /// Matches at the estimate. The document holds their number only.
  std::size_t matches = 0;
};

/// What a document holds of the iterations.
enum class HistoryDetail {
  kNone,
  kPoses,    ///< pose, scale and mean squared distance of each
  kMatches,  ///< also score and matches
};

/// A result as JSON: one entry of `results` in a document of schema `cairn.align`, version 2. Poses are
/// 4x4 matrices with the scale in them; a quaternion (qw qx qy qz) and the scale stand beside each.
std::string to_json(const AlignmentRecord& record, HistoryDetail history = HistoryDetail::kNone);

/// Reads all results of an alignment document (schema `cairn.align` or `cairn.demo`, versions 1 and 2).
/// What to_json() wrote is read back without loss, and gives the same text again. In version 1, an
/// unjudged pose is the estimate, and a judged one is withdrawn unless its verdict is aligned.
///
/// @param document the text of the document
/// @param name     what to call it in messages, such as its path
/// @throws Error (input) naming document, field, value and what was expected
std::vector<AlignmentRecord> read_alignments(std::string_view document, const std::string& name);

}  // namespace cairn
