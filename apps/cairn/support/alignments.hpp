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
  std::optional<PoseError> error;  ///< of the estimate, where the truth is known
  bool fits_inverse = false;       ///< of the truth, see cairn::fits_inverse()
};

/// What a truth is likely to be whose inverse fits `what`, such as "the pose".
std::string swapped_truth_text(std::string_view what);

/// "aligned: REASON"; if that is more than a line, a line for each clause of the reason. Ends with a newline.
std::string verdict_text(std::string_view verdict, std::string_view reason);

/// Whether there is a pose to go on with: judged aligned, or, where none is judged, what the method came to.
bool has_answer(const Alignment& alignment);

/// By the paper's ICP from the initial pose, which the caller holds against a truth: without a verdict.
AlignOptions by_icp_alone(const IcpOptions& options, const PointSetOptions& points);

/// Aligns two maps by each strategy in turn, with progress and until interrupted.
/// @param options of all; the confidence is each strategy's
/// @throws Error (cancelled)
std::vector<StrategyResult> align_by_all(const LandmarkMap& source, const LandmarkMap& target,
                                         const std::vector<Strategy>& strategies,
                                         AlignOptions options,
                                         const std::optional<Similarity3>& truth,
                                         const CommonArguments& common);

/// One row a strategy, and what the columns mean.
std::string alignment_table(const std::vector<StrategyResult>& results, LengthUnit unit);

/// The verdict and reason of one result, its pose if that is an answer, the directions that are open, and candidates.
/// @param with_parts also the poses of the maps' parts
std::string alignment_text(const StrategyResult& result, LengthUnit unit, bool with_scale,
                           bool with_parts);

/// Of the two quaternions of a rotation the one with qw >= 0.
Eigen::Quaterniond shown_quaternion(const Rigid3& pose);

/// One entry of a document's `results`.
Json to_json(const StrategyResult& result, HistoryDetail history);

}  // namespace cairn::cli
