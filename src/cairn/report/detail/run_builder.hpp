// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "cairn/alignment/align.hpp"
#include "cairn/registration/icp.hpp"
#include "cairn/report/report.hpp"

namespace cairn::report::detail {

/// Positions of the points of an alignment, in the order of a PointSet. The Map of a report with matches is made
/// with MapOptions::landmarks = landmarks_to_align(), so that its landmarks have this order too.
using Points = std::vector<Eigen::Vector3d>;

struct RunOptions {
  std::string name = {};                  ///< e.g. "base"
  Rigid3 initial = {};                    ///< initial target_from_source
  std::size_t k = 1;                      ///< candidates per match
  std::optional<Similarity3> truth = {};  ///< true target_from_source; adds errors
  /// Displayed status; empty: the result's.
  std::string status = {};
  /// Whether the verdict rejects the pose; the summary then states no error and no scale.
  bool rejected = false;
};

/// An alignment by iteration; if the result has a pose, it is the last one. Includes the scores and matches
/// of each iteration if IcpOptions::trace was set; otherwise only those of the result.
/// @throws Error (misuse) if a match names a missing point
AlignmentRun make_run(const RegistrationResult& result, const Points& source, const Points& target,
                      const RunOptions& options);

/// An alignment as a run of a scene: the result of make_run(), with the alignment's status and reason.
/// @throws Error as make_run()
AlignmentRun make_run(const Alignment& alignment, const Points& source, const Points& target,
                      RunOptions options);

/// The matches of `history` in differential coding.
Matches delta_coded(std::span<const IterationRecord> history, const Points& source,
                    const Points& target);

/// Score by iteration; for runs without scores, the mean squared distance of their matches.
LinesChart convergence_chart(std::span<const AlignmentRun> runs, LengthUnit unit);
/// Error by iteration: displacement of the centroid if `translation`, else angle of the rotation. No series
/// if no run knows the truth.
LinesChart error_chart(std::span<const AlignmentRun> runs, LengthUnit unit, bool translation);
/// One row per run, from the summaries of make_run().
Table run_table(std::span<const AlignmentRun> runs, LengthUnit unit);

}  // namespace cairn::report::detail
