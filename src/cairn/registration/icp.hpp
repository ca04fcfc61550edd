// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <limits>
#include <optional>

#include "cairn/core/execution.hpp"
#include "cairn/registration/convergence/pcl_criteria.hpp"
#include "cairn/registration/point_set.hpp"
#include "cairn/registration/result.hpp"

namespace cairn {

/// How to iterate. The defaults are the paper's.
struct IcpOptions {
  Rigid3 initial = {};  ///< target_from_source to start from
  std::size_t k = 5;  ///< candidates a point among which the most confident is matched; at least 1
  /// At least 1; of a coarse_to_fine alignment, with each sample.
  int max_iterations = PclCriteria().max_iterations;
  /// Stop below this change of the mean squared match distance.
  double mse_change_threshold = PclCriteria().mse_change_threshold;
  /// Stop as soon as matches come back, when all that would follow is known (see MatchHistory). Without
  /// it an alignment goes on, as PCL's does, until the change or the limit above ends it: in a limit
  /// cycle at whichever of its poses the limit falls upon.
  bool stop_at_repetition = true;
  /// Align growing samples of both first (see align_samples): faster, and it may end at
  /// another optimum than without.
  bool coarse_to_fine = false;
  double max_distance = std::numeric_limits<double>::infinity();  ///< of a match; positive
  bool reciprocal = false;        ///< keep only matches that hold both ways
  double trimmed_fraction = 0.0;  ///< share of the matches, the farthest, left out; in [0, 1)
  /// Weigh each match in the estimate by its source point's confidence (the paper does not).
  bool weight_by_source_confidence = false;
  /// Within which distance points count as overlapping; nothing: overlap is not computed.
  std::optional<double> overlap_radius = {};
  bool trace = false;  ///< keep score and matches of every iteration

  Execution execution = {};

  /// @throws Error (misuse) naming the field, its value and what it may be
  void validate() const;
};

/// Aligns one set of points to another: the paper's ICP. Base if the target has no confidences,
/// weighted if it has.
///
/// An expected failure (an empty set, too few matches) is a status, not an exception. Same input, same
/// result, whatever the executor's number of threads.
///
/// @throws Error (misuse) for invalid options, confidences whose number differs from the points', or
///         positions or confidences that are not finite
RegistrationResult icp(const PointSet& source, const PointSet& target,
                       const IcpOptions& options = {});

/// Aligns two maps with the confidences of one metric.
/// @param metric nothing: base ICP
/// @throws Error also where a map lacks the metric's input
RegistrationResult icp(const LandmarkMap& source, const LandmarkMap& target,
                       const std::optional<Metric>& metric, const IcpOptions& options = {},
                       const PointSetOptions& point_options = {});

}  // namespace cairn
