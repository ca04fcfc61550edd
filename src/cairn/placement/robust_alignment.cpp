// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/placement/robust_alignment.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "cairn/geometry/moved_points.hpp"

namespace cairn {
namespace {

using Jacobian = Eigen::Matrix<double, 3, 6>;

// The scale falls by this a step: slower gains nothing, faster leaves the basin now and then.
constexpr double kCooling = 0.85;
// A step below this share of the fine scale changes nothing worth knowing.
constexpr double kStill = 1e-4;
constexpr double kDamping = 1e-9;
// A match 5 standard deviations apart weighs 0.0015: it may as well not be there.
constexpr double kNegligible = 1.0 / 26.0;

}  // namespace

RobustAlignment::RobustAlignment(const CentredPair& pair, const BatchTree& target_tree,
                                 bool use_covariances, bool one_to_one, const Executor& executor)
    : pair_(pair),
      target_tree_(target_tree),
      use_covariances_(use_covariances),
      one_to_one_(one_to_one),
      executor_(executor) {}

RobustAlignment::Equations& RobustAlignment::Equations::operator+=(const Equations& other) {
  information += other.information;
  gradient += other.gradient;
  scatter += other.scatter;
  curvature += other.curvature;
  weight += other.weight;
  count += other.count;
  return *this;
}

double RobustAlignment::radius(std::size_t points) const {
  double sum = 0.0;
  for (std::size_t i = 0; i < points; ++i) sum += pair_.source().positions[i].squaredNorm();
  const double radius = std::sqrt(sum / static_cast<double>(points));
  return radius > 0.0 ? radius : 1.0;
}

std::vector<Match> RobustAlignment::find_matches(std::span<const Eigen::Vector3d> moved,
                                                 BatchTree::Batch& queries) const {
  std::vector<Match> matches(moved.size());
  queries.for_each(moved, executor_, [&](std::size_t i, const NearestList auto& nearest) {
    matches[i] = {static_cast<std::uint32_t>(i), nearest.index(0), nearest.squared_distance(0)};
  });
  if (!one_to_one_) return matches;
  // Whom each target landmark keeps: the closest; of equally close ones, the first.
  constexpr auto kNobody = std::numeric_limits<std::uint32_t>::max();
  std::vector<std::uint32_t> owner(target_tree_.size(), kNobody);
  for (const Match& match : matches) {
    std::uint32_t& kept = owner[match.target];
    if (kept == kNobody || match.squared_distance < matches[kept].squared_distance) {
      kept = match.source;
    }
  }
  std::erase_if(matches, [&](const Match& match) { return owner[match.target] != match.source; });
  return matches;
}

void RobustAlignment::add(const Eigen::Vector3d& moved, const Match& match,
                          const Eigen::Matrix3d& rotation, const Eigen::Vector3d& pivot,
                          double scale, double length, bool for_uncertainty, Equations& sum) const {
  const LandmarkCloud& source = pair_.source();
  const LandmarkCloud& target = pair_.target();
  Eigen::Matrix3d spread = scale * scale * Eigen::Matrix3d::Identity();
  if (use_covariances_ && !source.covariances.empty()) {
    spread += rotation * source.covariances[match.source] * rotation.transpose();
  }
  if (use_covariances_ && !target.covariances.empty()) spread += target.covariances[match.target];
  const Eigen::Matrix3d information = spread.inverse();
  const Eigen::Vector3d residual = target.positions[match.target] - moved;
  const Eigen::Vector3d weighted = information * residual;
  const double kernel = 1.0 / (1.0 + residual.dot(weighted));
  if (kernel < kNegligible) return;
  const double trust = source.weight(match.source) * target.weight(match.target);
  const double weight = trust * kernel * kernel;
  const Eigen::Vector3d arm = moved - pivot;
  Jacobian jacobian;
  jacobian << Eigen::Matrix3d::Identity(), -skew(arm) / length;
  const Eigen::Matrix<double, 6, 1> pull = jacobian.transpose() * weighted;
  const Matrix6d evidence = weight * jacobian.transpose() * information * jacobian;
  sum.information += evidence;
  sum.gradient += weight * pull;
  sum.weight += weight;
  ++sum.count;
  if (!for_uncertainty) return;
  const Matrix6d outer = pull * pull.transpose();
  sum.scatter += weight * weight * outer;
  // Second derivative of the kernel: where it bends back, a match says less.
  sum.curvature += evidence - 4.0 * weight * kernel * outer;
}

RobustAlignment::Equations RobustAlignment::equations(std::span<const Eigen::Vector3d> moved,
                                                      std::span<const Match> matches,
                                                      const Rigid3& pose, double scale,
                                                      double length, bool for_uncertainty) const {
  constexpr std::size_t kBlock = 1024;
  const Eigen::Matrix3d rotation = pose.rotation();
  std::vector<Equations> parts((matches.size() + kBlock - 1) / kBlock);
  executor_.for_blocks(matches.size(), kBlock, [&](std::size_t begin, std::size_t end) {
    Equations& part = parts[begin / kBlock];
    for (std::size_t i = begin; i < end; ++i) {
      add(moved[matches[i].source], matches[i], rotation, pose.translation(), scale, length,
          for_uncertainty, part);
    }
  });
  // In the order of the blocks, so that rounding does not depend on the threads.
  Equations sum;
  for (const Equations& part : parts) sum += part;
  return sum;
}

IcpRun RobustAlignment::run(const Rigid3& initial, const Schedule& schedule,
                            const std::stop_token& stop,
                            const std::function<void(Iteration)>& observe) const {
  const std::size_t count = std::min(schedule.points, pair_.source().size());
  const std::span<const Eigen::Vector3d> source = std::span(pair_.source().positions).first(count);
  const double length = radius(count);
  BatchTree::Batch queries = target_tree_.batch(1);
  IcpRun run;
  run.target_from_source = initial;
  run.stop_reason = StopReason::kIterationLimit;
  double scale = schedule.coarse;
  while (run.iterations < schedule.max_iterations) {
    if (stop.stop_requested()) {
      run.stop_reason = StopReason::kCancelled;
      break;
    }
    const std::vector<Eigen::Vector3d> moved = moved_points(source, run.target_from_source);
    std::vector<Match> matches = find_matches(moved, queries);
    Equations sum = equations(moved, matches, run.target_from_source, scale, length, false);
    // Fewer matches than these would be free to turn.
    if (sum.count < kFewestMatches || !(sum.weight > 0.0)) {
      run.stop_reason = StopReason::kTooFewMatches;
      break;
    }
    // What the matches leave open does not move.
    sum.information.diagonal().array() += kDamping * sum.information.trace();
    Eigen::Matrix<double, 6, 1> delta =
        Eigen::Matrix<double, 6, 6>(sum.information).ldlt().solve(sum.gradient);
    const double motion = delta.norm();
    delta.tail<3>() /= length;
    // The pivot is the moved centroid, which the centred source has at its origin.
    run.target_from_source = run.target_from_source.perturbed(delta);
    ++run.iterations;
    if (observe) {
      observe({run.target_from_source, mean_squared_distance(matches), std::move(matches)});
    }
    if (scale <= schedule.fine && motion < kStill * schedule.fine) {
      run.stop_reason = StopReason::kNoMotion;
      break;
    }
    scale = std::max(kCooling * scale, schedule.fine);
  }
  return run;
}

std::vector<Match> RobustAlignment::matches(const Rigid3& pose) const {
  BatchTree::Batch queries = target_tree_.batch(1);
  return find_matches(moved_points(pair_.source().positions, pose), queries);
}

PoseUncertainty RobustAlignment::uncertainty(const Rigid3& pose, double scale) const {
  const std::vector<Eigen::Vector3d> moved = moved_points(pair_.source().positions, pose);
  BatchTree::Batch queries = target_tree_.batch(1);
  PoseEvidence evidence;
  evidence.pivot = pose.translation();
  evidence.length = radius(moved.size());
  const Equations sum =
      equations(moved, find_matches(moved, queries), pose, scale, evidence.length, true);
  if (sum.count < kFewestMatches) return {};
  evidence.information = sum.curvature;
  evidence.scatter = sum.scatter;
  evidence.count = static_cast<double>(sum.count);
  return pose_uncertainty(pose, evidence);
}

}  // namespace cairn
