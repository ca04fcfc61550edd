// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/evaluation/trajectory_evaluation.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "cairn/core/detail/require.hpp"
#include "cairn/geometry/decompositions.hpp"

namespace cairn {
namespace {

std::string span_text(const Trajectory& trajectory) {
  if (trajectory.empty()) return "has no poses";
  return fmt::format("lasts from {:.3f} to {:.3f} s", trajectory.poses().front().timestamp_s,
                     trajectory.poses().back().timestamp_s);
}

std::optional<Similarity3> align_trajectories(const Trajectory& estimate, const Trajectory& truth,
                                              const PosePairs& pairs,
                                              TrajectoryAlignment alignment) {
  if (pairs.empty()) return std::nullopt;
  const auto estimated = [&](std::size_t i) { return estimate.poses()[i].world_from_camera; };
  const auto true_pose = [&](std::size_t i) { return truth.poses()[i].world_from_camera; };
  if (alignment == TrajectoryAlignment::kNone) return Similarity3();
  if (alignment == TrajectoryAlignment::kOrigin) {
    return Similarity3(1.0,
                       true_pose(pairs.front().second) * estimated(pairs.front().first).inverse());
  }
  if (alignment == TrajectoryAlignment::kPoses) {
    Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
    for (const auto& [a, b] : pairs) {
      sum += true_pose(b).rotation() * estimated(a).rotation().transpose();
    }
    const Eigen::Matrix3d rotation = nearest_rotation(singular_values(sum));
    Eigen::Vector3d translation = Eigen::Vector3d::Zero();
    for (const auto& [a, b] : pairs) {
      translation += true_pose(b).translation() - rotation * estimated(a).translation();
    }
    return Similarity3(Rigid3(rotation, translation / static_cast<double>(pairs.size())));
  }
  constexpr std::size_t kFewest = 3;
  if (pairs.size() < kFewest) return std::nullopt;
  std::vector<Eigen::Vector3d> from;
  std::vector<Eigen::Vector3d> to;
  for (const auto& [a, b] : pairs) {
    from.push_back(estimated(a).translation());
    to.push_back(true_pose(b).translation());
  }
  const bool with_scale = alignment == TrajectoryAlignment::kSim3;
  const bool still = std::equal(from.begin() + 1, from.end(), from.begin());
  if (with_scale && still) return std::nullopt;  // a point has no scale
  const Eigen::Matrix4d transform = least_squares_similarity(from, to, with_scale);
  const double scale = with_scale ? std::cbrt(transform.topLeftCorner<3, 3>().determinant()) : 1.0;
  if (!(scale > 0.0) || !std::isfinite(scale)) return std::nullopt;
  const Eigen::Matrix3d rotation = transform.topLeftCorner<3, 3>() / scale;
  return Similarity3(scale, Rigid3(rotation, transform.topRightCorner<3, 1>()));
}

// Position of each associated pose along the trajectory, in the interval's unit.
std::vector<double> positions_along(const Trajectory& truth, const PosePairs& pairs,
                                    RelativeInterval::Unit unit) {
  std::vector<double> result;
  double length = 0.0;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const TimedPose& pose = truth.poses()[pairs[i].second];
    if (i > 0) {
      const TimedPose& before = truth.poses()[pairs[i - 1].second];
      length +=
          (pose.world_from_camera.translation() - before.world_from_camera.translation()).norm();
    }
    switch (unit) {
      case RelativeInterval::Unit::kSeconds:
        result.push_back(pose.timestamp_s);
        break;
      case RelativeInterval::Unit::kMetres:
        result.push_back(length);
        break;
      case RelativeInterval::Unit::kFrames:
        result.push_back(static_cast<double>(i));
        break;
    }
  }
  return result;
}

}  // namespace

void TrajectoryEvaluationOptions::validate() const {
  detail::require(max_time_difference_s > 0.0, "TrajectoryEvaluationOptions.max_time_difference_s",
                  max_time_difference_s, "a positive number");
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

std::optional<AbsoluteError> absolute_error(const Trajectory& estimate, const Trajectory& truth,
                                            const PosePairs& pairs, TrajectoryAlignment alignment) {
  const auto truth_from_estimate = align_trajectories(estimate, truth, pairs, alignment);
  if (!truth_from_estimate) return std::nullopt;
  AbsoluteError result;
  result.truth_from_estimate = *truth_from_estimate;
  for (const auto& [a, b] : pairs) {
    const Rigid3& estimated = estimate.poses()[a].world_from_camera;
    const Rigid3& true_pose = truth.poses()[b].world_from_camera;
    result.translations.push_back(
        (*truth_from_estimate * estimated.translation() - true_pose.translation()).norm());
    result.rotations_rad.push_back(
        ((truth_from_estimate->rigid() * estimated).inverse() * true_pose).angle());
  }
  result.translation = *statistics_of(result.translations);
  result.rotation_rad = *statistics_of(result.rotations_rad);
  return result;
}

void RelativeInterval::validate() const {
  const bool whole = unit != Unit::kFrames || length == std::floor(length);
  detail::require(length > 0.0 && std::isfinite(length) && whole, "RelativeInterval.length", length,
                  "a positive number, whole for frames");
}

std::optional<RelativeError> relative_error(const Trajectory& estimate, const Trajectory& truth,
                                            const PosePairs& pairs,
                                            const RelativeInterval& interval) {
  interval.validate();
  const std::vector<double> along = positions_along(truth, pairs, interval.unit);
  const auto motion = [](const Trajectory& trajectory, std::size_t from, std::size_t to) {
    return trajectory.poses()[from].world_from_camera.inverse() *
           trajectory.poses()[to].world_from_camera;
  };
  std::vector<double> translations;
  std::vector<double> angles;
  std::size_t later = 0;  // the first pose at least an interval later
  for (std::size_t begin = 0; begin < pairs.size(); ++begin) {
    const double goal = along[begin] + interval.length;
    while (later < pairs.size() && along[later] < goal) ++later;
    if (later == pairs.size()) break;
    const bool earlier_is_nearer =
        later > begin + 1 && goal - along[later - 1] < along[later] - goal;
    const std::size_t end = earlier_is_nearer ? later - 1 : later;
    const Rigid3 drift = motion(truth, pairs[begin].second, pairs[end].second).inverse() *
                         motion(estimate, pairs[begin].first, pairs[end].first);
    translations.push_back(drift.translation().norm());
    angles.push_back(drift.angle());
  }
  if (translations.empty()) return std::nullopt;
  return RelativeError{*statistics_of(translations), *statistics_of(angles)};
}

}  // namespace cairn
