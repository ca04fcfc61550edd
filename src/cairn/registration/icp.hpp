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

/// Options of icp(). The defaults are the paper's.
struct IcpOptions {
  Rigid3 initial = {};  ///< initial target_from_source
  /// nearest target points per source point, of which the most confident is matched; at least 1
  std::size_t k = 5;
  /// At least 1; per sample with coarse_to_fine.
  int max_iterations = PclCriteria().max_iterations;
  /// Stop if the mean squared match distance changes by less than this.
  double mse_change_threshold = PclCriteria().mse_change_threshold;
  /// Stop when the matches repeat, because all further iterations are then known (see MatchHistory). If
  /// false, iterate until the change or the limit above ends it, as PCL does; in a limit cycle, the result
  /// is then the pose at the limit.
  bool stop_at_repetition = true;
  /// Align growing samples of both sets first (see align_samples): faster; may converge to another optimum.
  bool coarse_to_fine = false;
  double max_distance = std::numeric_limits<double>::infinity();  ///< of a match; positive
  bool reciprocal = false;                                        ///< keep only mutual matches
  /// share of the matches to leave out, those with the largest distances; in [0, 1)
  double trimmed_fraction = 0.0;
  /// Weight each match in the estimate by its source point's confidence (the paper does not).
  bool weight_by_source_confidence = false;
  /// A point overlaps if the other set has one within this distance. std::nullopt: no overlap is computed.
  std::optional<double> overlap_radius = {};
  bool trace = false;  ///< record score and matches of every iteration

  static const OptionTable table;
  /// @throws Error (misuse) naming the field, its value and the constraint
  void validate() const;
};

/// Aligns one point set to another with the paper's ICP: base ICP if the target has no confidences, else
/// weighted.
///
/// An expected failure (an empty set, too few matches) is a status. The same input gives the same result
/// for any number of threads.
///
/// @throws Error (misuse) for invalid options, a wrong number of confidences, or positions or confidences
///        that are not finite
RegistrationResult icp(const PointSet& source, const PointSet& target,
                       const IcpOptions& options = {}, const Execution& execution = {});

/// Aligns two maps with the confidences of one metric.
/// @param metric std::nullopt: base ICP
/// @throws Error also (input) if a map lacks the metric's input
RegistrationResult icp(const LandmarkMap& source, const LandmarkMap& target,
                       const std::optional<Metric>& metric, const IcpOptions& options = {},
                       const PointSetOptions& point_options = {}, const Execution& execution = {});

}  // namespace cairn
