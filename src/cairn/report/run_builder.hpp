// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "cairn/registration/icp.hpp"
#include "cairn/report/report.hpp"

namespace cairn::report {

/// The points that were aligned as landmarks of the report's maps: entry i is the position of point i
/// in its Map. Matches of an RegistrationResult count points of a PointSet, which leaves landmarks out and has
/// an order of its own.
struct ShownPoints {
  std::size_t landmark_count = 0;               ///< of the Map
  std::vector<std::uint32_t> landmarks = {};    ///< one a point
  std::vector<Eigen::Vector3d> positions = {};  ///< one a point

  /// Of a map of which just what is aligned is shown, in the order of the PointSet: the Map is made
  /// with MapOptions::landmarks = landmarks_to_align(map, options).
  static ShownPoints only_aligned(const LandmarkMap& map, const PointSetOptions& options);
  /// Of a map that is shown with all its landmarks.
  static ShownPoints among_all(const LandmarkMap& map, const PointSetOptions& options);
};

struct RunOptions {
  std::string name = {};                  ///< e.g. "base"
  Rigid3 initial = {};                    ///< target_from_source that the alignment started from
  std::size_t k = 1;                      ///< candidates it chose among
  std::optional<Similarity3> truth = {};  ///< true target_from_source: adds errors
  /// What people read as its status; empty: the result's.
  std::string status = {};
};

/// An alignment, iteration by iteration. With IcpOptions::trace it has the scores and matches of
/// each; without, only those that the result holds.
/// @throws Error (misuse) if a match names a point that is not there
AlignmentRun make_run(const RegistrationResult& result, const ShownPoints& source,
                      const ShownPoints& target, const RunOptions& options);

/// The same coded as differences: `history` as match lists of points.
Matches delta_coded(std::span<const IterationRecord> history, const ShownPoints& source,
                    const ShownPoints& target);

/// How the score fell; of runs without scores the mean squared distance of their matches.
LinesChart convergence_chart(std::span<const AlignmentRun> runs, LengthUnit unit);
/// How the errors fell; `translation`: the centroid's displacement, else the rotation's angle. Of no
/// series where no run knows the truth.
LinesChart error_chart(std::span<const AlignmentRun> runs, LengthUnit unit, bool translation);
/// One row a run, from the summaries that make_run() gives.
Table run_table(std::span<const AlignmentRun> runs, LengthUnit unit);

}  // namespace cairn::report
