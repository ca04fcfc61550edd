// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/alignment/document.hpp"
#include "cairn/evaluation/pose_error.hpp"

#include "support/arguments.hpp"
#include "support/documents.hpp"

namespace cairn::cli {

/// One pair of maps aligned by one strategy.
struct StrategyResult : AlignmentRecord {
  std::optional<PoseError> error;  ///< error of the estimate, if the truth is known
  /// Whether the inverse of the truth fits, see cairn::fits_inverse().
  bool fits_inverse = false;
};

/// States what the truth probably is if its inverse fits `what`, e.g. "the pose".
std::string swapped_truth_text(std::string_view what);

/// "aligned: REASON"; if this is longer than a line, one line for each clause of the reason. Ends with a newline.
std::string verdict_text(std::string_view verdict, std::string_view reason);

/// Whether there is a pose to use: an aligned pose or, if the pose was not judged, the method's pose.
bool has_answer(const Alignment& alignment);

/// Options for the paper's ICP from the initial pose, without a verdict, because the caller compares the pose with a
/// truth.
AlignOptions by_icp_alone(const IcpOptions& options, const PointSetOptions& points);

/// Aligns two maps by each strategy in turn, with progress and until interrupted.
/// @param options options of all alignments; the confidence is replaced by that of each strategy
/// @throws Error (cancelled)
std::vector<StrategyResult> align_by_all(const LandmarkMap& source, const LandmarkMap& target,
                                         const std::vector<Strategy>& strategies,
                                         AlignOptions options,
                                         const std::optional<Similarity3>& truth,
                                         const CommonArguments& common);

/// One row per strategy, and an explanation of the columns.
std::string alignment_table(const std::vector<StrategyResult>& results, LengthUnit unit);

/// The verdict and reason of one result, its pose if has_answer(), the open directions, and the candidates.
/// @param with_parts also the poses of the maps' parts
std::string alignment_text(const StrategyResult& result, LengthUnit unit, bool with_scale,
                           bool with_parts);

/// The quaternion of the pose's rotation that has qw >= 0.
Eigen::Quaterniond shown_quaternion(const Rigid3& pose);

/// One entry of a document's `results`.
Json to_json(const StrategyResult& result, HistoryDetail history);

}  // namespace cairn::cli
