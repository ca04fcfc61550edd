// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "cairn/evaluation/pose_error.hpp"
#include "cairn/registration/align.hpp"

#include "support/arguments.hpp"
#include "support/documents.hpp"

namespace cairn::cli {

/// One pair of maps aligned by one strategy.
struct Alignment {
  std::string confidence;  ///< name of the strategy
  std::size_t k = 1;       ///< candidates it chose among
  AlignResult result;
  std::optional<PoseError> error;  ///< against the truth, where that is known
};

/// Aligns two maps by each strategy in turn, with progress and until interrupted.
/// @throws Error (cancelled)
std::vector<Alignment> align_by_all(const LandmarkMap& source, const LandmarkMap& target,
                                    const std::vector<Strategy>& strategies, AlignOptions options,
                                    const PointSetOptions& point_options,
                                    const std::optional<Rigid3>& truth,
                                    const CommonArguments& common);

/// One row a strategy, and what the columns mean.
std::string alignment_table(const std::vector<Alignment>& alignments, const AlignOptions& options,
                            LengthUnit unit);

/// One entry of a document's `results`.
Json to_json(const Alignment& alignment, const AlignOptions& options, LengthUnit unit);

}  // namespace cairn::cli
