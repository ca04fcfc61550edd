// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/placement/robust_alignment.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>

#include "cairn/core/random.hpp"
#include "cairn/core/sampling.hpp"
#include "cairn/geometry/moved_points.hpp"
#include "cairn/geometry/pose_distance.hpp"
#include "cairn/placement/spatial_groups.hpp"

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
// Share of the kernel's scale over which a motion shows how matches change. By less, hardly any does,
// and the covariance comes out too small; by more, too large.
constexpr double kStiffnessStep = 0.25;
constexpr std::size_t kErrorGroups = 64;       // parts of the matched landmarks, which err apart
constexpr std::size_t kFewestErrorGroups = 7;  // fewer leave a direction without any error
constexpr double kSignificant = 3.0;           // standard errors

// Whether landmarks gain by more than what differs between parts of the map, each of which is one
// witness. One gain a place.
bool gain_is_significant(std::span<const Eigen::Vector3d> places, std::span<const double> gains) {
  const std::vector<std::size_t> group_of = spatial_groups(places, kErrorGroups);
  std::array<double, kErrorGroups> gain{};
  std::array<bool, kErrorGroups> known{};
  for (std::size_t i = 0; i < gains.size(); ++i) {
    gain[group_of[i]] += gains[i];
    known[group_of[i]] = true;
  }
  double count = 0.0;
  double sum = 0.0;
  double squares = 0.0;
  for (std::size_t i = 0; i < kErrorGroups; ++i) {
    if (!known[i]) continue;
    ++count;
    sum += gain[i];
    squares += gain[i] * gain[i];
  }
  if (count < 2.0) return false;
  const double mean = sum / count;
  const double variance = std::max(squares - sum * mean, 0.0) / (count - 1.0);
  return mean > 0.0 && mean >= kSignificant * std::sqrt(variance / count);
}

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

std::optional<RobustAlignment::Term> RobustAlignment::term(const Eigen::Vector3d& moved,
                                                           const Match& match,
                                                           const Eigen::Matrix3d& rotation,
                                                           double scale) const {
  const LandmarkCloud& source = pair_.source();
  const LandmarkCloud& target = pair_.target();
  Eigen::Matrix3d spread = scale * scale * Eigen::Matrix3d::Identity();
  if (use_covariances_ && !source.covariances.empty()) {
    spread += rotation * source.covariances[match.source] * rotation.transpose();
  }
  if (use_covariances_ && !target.covariances.empty()) spread += target.covariances[match.target];
  const Eigen::Matrix3d information = spread.inverse();
  const Eigen::Vector3d residual = target.positions[match.target] - moved;
  const Eigen::Vector3d force = information * residual;
  const double kernel = 1.0 / (1.0 + residual.dot(force));
  if (kernel < kNegligible) return std::nullopt;
  const double trust = source.weight(match.source) * target.weight(match.target);
  return Term{information, force, trust * kernel * kernel, trust * kernel};
}

RobustAlignment::Equations RobustAlignment::equations(std::span<const Eigen::Vector3d> moved,
                                                      std::span<const Match> matches,
                                                      const Rigid3& pose, double scale,
                                                      const Arm& arm) const {
  constexpr std::size_t kBlock = 1024;
  const Eigen::Matrix3d rotation = pose.rotation();
  std::vector<Equations> parts((matches.size() + kBlock - 1) / kBlock);
  executor_.for_blocks(matches.size(), kBlock, [&](std::size_t begin, std::size_t end) {
    Equations& part = parts[begin / kBlock];
    for (std::size_t i = begin; i < end; ++i) {
      const Eigen::Vector3d& point = moved[matches[i].source];
      const std::optional<Term> one = term(point, matches[i], rotation, scale);
      if (!one) continue;
      Jacobian jacobian;
      jacobian << Eigen::Matrix3d::Identity(), -skew(point - arm.pivot) / arm.length;
      part.information += one->weight * jacobian.transpose() * one->information * jacobian;
      part.gradient += one->weight * jacobian.transpose() * one->force;
      part.weight += one->weight;
      ++part.count;
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
    Equations sum = equations(moved, matches, run.target_from_source, scale,
                              {run.target_from_source.translation(), length});
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

// Tries motions out on some thousands of source landmarks, which stand for all.
class RobustAlignment::Trial {
 public:
  Trial(const RobustAlignment& alignment, const Rigid3& pose, double scale, const Arm& arm)
      : alignment_(alignment),
        pose_(pose),
        scale_(scale),
        arm_(arm),
        queries_(alignment.target_tree_.batch(1)),
        moved_(all()),
        here_(terms(pose)) {}

  // How the gradient of all landmarks answers small motions, each finding its match anew. With the
  // matches held it would seem much stiffer: a landmark that is none of the target's is not held by
  // its neighbour.
  Matrix6d stiffness() {
    const double step = kStiffnessStep * scale_;
    const double share = static_cast<double>(tried_.size()) / static_cast<double>(all().size());
    Matrix6d result;
    for (int i = 0; i < 6; ++i) {
      const Vector6d direction = Vector6d::Unit(i);
      result.col(i) = (gradient(moved(-step * direction)) - gradient(moved(step * direction))) /
                      (2.0 * step * share);
    }
    return 0.5 * (result + result.transpose());
  }

  // Whether landmarks fit better here than a little way along the direction, on both sides.
  bool holds(const Vector6d& direction) {
    return is_better_than(moved(-kProbe * scale_ * direction)) &&
           is_better_than(moved(kProbe * scale_ * direction));
  }

 private:
  static constexpr std::size_t kTried = 16384;
  static constexpr double kProbe = 2.0;  // of the kernel's scale

  const std::vector<Eigen::Vector3d>& all() const { return alignment_.pair_.source().positions; }

  Rigid3 moved(const Vector6d& direction) const {
    const Rigid3 turn(rotation_exp(direction.tail<3>() / arm_.length), Eigen::Vector3d::Zero());
    const Rigid3 about_pivot(turn.quaternion(),
                             arm_.pivot - turn * arm_.pivot + direction.head<3>());
    return about_pivot * pose_;
  }

  // Of the landmarks tried, at a pose; moved_ has their places then.
  std::vector<Match> matches(const Rigid3& pose) {
    std::vector<Eigen::Vector3d> places;
    places.reserve(tried_.size());
    for (const std::size_t landmark : tried_) {
      places.push_back(moved_[landmark] = pose * all()[landmark]);
    }
    std::vector<Match> found = alignment_.find_matches(places, queries_);
    for (Match& match : found) match.source = static_cast<std::uint32_t>(tried_[match.source]);
    return found;
  }

  Vector6d gradient(const Rigid3& pose) {
    const std::vector<Match> found = matches(pose);
    const Arm arm = {pose * (pose_.inverse() * arm_.pivot), arm_.length};
    return alignment_.equations(moved_, found, pose, scale_, arm).gradient;
  }

  // What each landmark adds to the objective, one a landmark of the source; 0 of those not tried.
  std::vector<double> terms(const Rigid3& pose) {
    std::vector<double> values(all().size(), 0.0);
    const Eigen::Matrix3d rotation = pose.rotation();
    for (const Match& match : matches(pose)) {
      const auto one = alignment_.term(moved_[match.source], match, rotation, scale_);
      if (one) values[match.source] = one->value;
    }
    return values;
  }

  bool is_better_than(const Rigid3& other) {
    const std::vector<double> there = terms(other);
    // Landmarks that meet nothing at either pose say nothing. Those that do at the other alone count:
    // without them, every pose would seem better than its neighbours.
    std::vector<Eigen::Vector3d> places;
    std::vector<double> gains;
    for (const std::size_t landmark : tried_) {
      if (here_[landmark] == 0.0 && there[landmark] == 0.0) continue;
      places.push_back(pose_ * all()[landmark]);
      gains.push_back(here_[landmark] - there[landmark]);
    }
    return gain_is_significant(places, gains);
  }

  const RobustAlignment& alignment_;
  Rigid3 pose_;
  double scale_;
  Arm arm_;
  BatchTree::Batch queries_;
  std::vector<std::size_t> tried_ =
      one_of_each((all().size() + kTried - 1) / kTried, all().size(), Random(0));
  std::vector<Eigen::Vector3d> moved_;  // one a landmark of the source
  std::vector<double> here_;            // terms at the pose
};

PoseUncertainty RobustAlignment::uncertainty(const Rigid3& pose, double scale,
                                             std::vector<Match> matches) const {
  const std::vector<Eigen::Vector3d> moved = moved_points(pair_.source().positions, pose);
  const Eigen::Matrix3d rotation = pose.rotation();
  std::erase_if(matches, [&](const Match& match) {
    return !term(moved[match.source], match, rotation, scale);
  });
  if (matches.size() < kFewestMatches) return {};
  std::vector<Eigen::Vector3d> places;
  for (const Match& match : matches) places.push_back(moved[match.source]);
  // Of what is matched: elsewhere a turn moves it much or hardly at all.
  const PoseDistance spread = PoseDistance::of(places);
  const Arm arm = {spread.centroid, spread.radius > 0.0 ? spread.radius : 1.0};
  PoseEvidence evidence;
  evidence.pivot = arm.pivot;
  evidence.length = arm.length;
  Trial trial(*this, pose, scale, arm);
  evidence.information = trial.stiffness();

  PoseUncertainty open;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 6, 6>> eigen(evidence.information);
  for (int i = 0; i < 6; ++i) {
    const Vector6d direction = eigen.eigenvectors().col(i);
    if (trial.holds(direction)) continue;
    open.unobservable.push_back({direction.head<3>(), direction.tail<3>() / evidence.length});
  }
  if (!open.unobservable.empty()) return open;

  // Landmarks next to each other err alike: of one keyframe, or matched to the same landmark.
  const std::vector<std::size_t> group_of = spatial_groups(places, kErrorGroups);
  std::vector<std::vector<Match>> groups(kErrorGroups);
  for (std::size_t i = 0; i < matches.size(); ++i) groups[group_of[i]].push_back(matches[i]);
  std::erase_if(groups, [](const auto& group) { return group.empty(); });
  for (const std::vector<Match>& group : groups) {
    const Vector6d pull = equations(moved, group, pose, scale, arm).gradient;
    evidence.scatter += pull * pull.transpose();
  }
  if (groups.size() < kFewestErrorGroups) return {};
  evidence.count = static_cast<double>(groups.size());
  return pose_uncertainty(pose, evidence);
}

}  // namespace cairn
