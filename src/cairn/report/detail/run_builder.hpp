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

/// Aligned points as landmarks of the report's maps: entry i is the position of point i in its Map. Needed
/// because matches of a RegistrationResult index points of a PointSet, which leaves out landmarks and has
/// its own order.
struct ShownPoints {
  std::size_t landmark_count = 0;               ///< of the Map
  std::vector<std::uint32_t> landmarks = {};    ///< one per point
  std::vector<Eigen::Vector3d> positions = {};  ///< one per point

  /// For a map that shows only the aligned landmarks, in the order of the PointSet: the Map is made with
  /// MapOptions::landmarks = landmarks_to_align(map, options).
  static ShownPoints only_aligned(const LandmarkMap& map, const PointSetOptions& options);
  /// For a map that shows all its landmarks.
  static ShownPoints among_all(const LandmarkMap& map, const PointSetOptions& options);
};

struct RunOptions {
  std::string name = {};                  ///< e.g. "base"
  Rigid3 initial = {};                    ///< initial target_from_source
  std::size_t k = 1;                      ///< candidates per match
  std::optional<Similarity3> truth = {};  ///< true target_from_source; adds errors
  /// Displayed status; empty: the result's.
  std::string status = {};
  bool rejected = false;  ///< by the verdict: the summary states no error and no scale
};

/// An alignment by iteration; its last pose is the result's, if that has one. Includes scores and matches of
/// each iteration with IcpOptions::trace, else only those in the result.
/// @throws Error (misuse) if a match names a missing point
AlignmentRun make_run(const RegistrationResult& result, const ShownPoints& source,
                      const ShownPoints& target, const RunOptions& options);

/// An alignment as a run of a scene: the result of make_run(), with the alignment's status and reason.
/// @throws Error as make_run()
AlignmentRun make_run(const Alignment& alignment, const ShownPoints& source,
                      const ShownPoints& target, RunOptions options);

/// Differential coding: `history` as match lists of points.
Matches delta_coded(std::span<const IterationRecord> history, const ShownPoints& source,
                    const ShownPoints& target);

/// Score by iteration; for runs without scores, the mean squared distance of their matches.
LinesChart convergence_chart(std::span<const AlignmentRun> runs, LengthUnit unit);
/// Error by iteration: displacement of the centroid if `translation`, else angle of the rotation. No series
/// if no run knows the truth.
LinesChart error_chart(std::span<const AlignmentRun> runs, LengthUnit unit, bool translation);
/// One row per run, from the summaries of make_run().
Table run_table(std::span<const AlignmentRun> runs, LengthUnit unit);

}  // namespace cairn::report::detail
