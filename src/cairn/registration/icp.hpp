// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <limits>
#include <optional>

#include "cairn/core/execution.hpp"
#include "cairn/core/option_table.hpp"
#include "cairn/registration/convergence/pcl_criteria.hpp"
#include "cairn/registration/point_set.hpp"
#include "cairn/registration/result.hpp"

namespace cairn {

/// Options of icp(). The defaults follow the paper.
struct IcpOptions {
  Rigid3 initial = {};  ///< initial target_from_source
  /// Number of nearest target points per source point, at least 1; the most confident is matched.
  std::size_t k = 5;
  /// Iteration limit, per sample with coarse_to_fine; at least 1.
  int max_iterations = PclCriteria().max_iterations;
  /// Stop if the mean squared match distance changes by less than this (length²).
  double mse_change_threshold = PclCriteria().mse_change_threshold;
  /// Stop when the matches repeat, because all further iterations are then known (see
  /// MatchHistory). If false, iterate until the threshold or the iteration limit is reached, as PCL
  /// does. If the matches cycle, the result is then the pose of the last iteration.
  bool stop_at_repetition = true;
  /// Align growing samples of both sets first (see align_samples). Faster, but may converge to
  /// another optimum.
  bool coarse_to_fine = false;
  double max_distance = std::numeric_limits<double>::infinity();  ///< limit for matches; positive
  bool reciprocal = false;                                        ///< keep only mutual matches
  /// Share of the matches to reject, the largest distances first; in [0, 1).
  double trimmed_fraction = 0.0;
  /// Weight each match in the estimate by its source point's confidence (the paper does not).
  bool weight_by_source_confidence = false;
  /// A point overlaps if the other set has a point within this distance. std::nullopt: no overlap
  /// is computed.
  std::optional<double> overlap_radius = {};
  bool trace = false;  ///< record score and matches of every iteration

  static const OptionTable table;
  /// @throws Error (misuse) naming the field, its value and the constraint
  void validate() const;
};

/// Aligns one point set to another with the paper's ICP: base ICP if the target has no confidences,
/// else weighted ICP.
///
/// An expected failure (an empty set, too few matches) is reported as a status. The same input
/// gives the same result for any number of threads.
///
/// @throws Error (misuse) for invalid options, a wrong number of confidences, or positions or confidences
///        that are not finite
RegistrationResult icp(const PointSet& source, const PointSet& target,
                       const IcpOptions& options = {}, const Execution& execution = {});

/// Aligns two maps with the confidences of one metric.
/// @param metric std::nullopt: base ICP
/// @throws Error as above, and (input) if a map lacks the metric's input
RegistrationResult icp(const LandmarkMap& source, const LandmarkMap& target,
                       const std::optional<Metric>& metric, const IcpOptions& options = {},
                       const PointSetOptions& point_options = {}, const Execution& execution = {});

}  // namespace cairn
