// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/evaluation/trajectory_evaluation.hpp"

#include <cmath>

#include <fmt/format.h>

#include "cairn/core/error.hpp"

namespace cairn {
namespace {

std::string span_text(const Trajectory& trajectory) {
  if (trajectory.empty()) return "has no poses";
  return fmt::format("lasts from {:.3f} to {:.3f} s", trajectory.poses().front().timestamp_s,
                     trajectory.poses().back().timestamp_s);
}

}  // namespace

void TrajectoryEvaluationOptions::validate() const {
  if (!(max_time_difference_s > 0.0)) {
    throw Error(ErrorKind::kMisuse, "TrajectoryEvaluationOptions.max_time_difference_s",
                fmt::format("{}", max_time_difference_s), "a positive number");
  }
  for (const RelativeInterval& interval : intervals) interval.validate();
}

TrajectoryEvaluation evaluate_trajectory(const Trajectory& estimate, const Trajectory& truth,
                                         const TrajectoryEvaluationOptions& options) {
  options.validate();
  TrajectoryEvaluation result;
  result.relative.resize(options.intervals.size());
  result.pairs = associate(estimate, truth, options.max_time_difference_s);
  if (result.pairs.empty()) {
    result.reason = fmt::format(
        "no pose of the estimate is within {:g} s of a true one: the estimate {}, the truth {}",
        options.max_time_difference_s, span_text(estimate), span_text(truth));
    return result;
  }
  result.absolute = absolute_error(estimate, truth, result.pairs, options.alignment);
  if (!result.absolute) {
    result.reason =
        result.pairs.size() < 3
            ? fmt::format("{} of the poses paired; 3 are needed to align by", result.pairs.size())
            : "the poses determine no scale";
    return result;
  }
  const double scale = result.absolute->truth_from_estimate.scale();
  const Trajectory in_scale =
      scale == 1.0 ? estimate : transformed(estimate, Similarity3(scale, Rigid3()));
  for (std::size_t i = 0; i < options.intervals.size(); ++i) {
    result.relative[i] = relative_error(in_scale, truth, result.pairs, options.intervals[i]);
  }
  return result;
}

}  // namespace cairn
