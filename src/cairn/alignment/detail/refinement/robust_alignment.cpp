// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/alignment/detail/refinement/robust_alignment.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include <Eigen/LU>

#include "cairn/alignment/detail/spatial_groups.hpp"
#include "cairn/core/detail/sampling.hpp"
#include "cairn/core/random.hpp"
#include "cairn/geometry/decompositions.hpp"
#include "cairn/geometry/detail/pose_distance.hpp"

namespace cairn::detail {
namespace {

template <int kFreedoms>
using Vector = Eigen::Matrix<double, kFreedoms, 1>;

// Factor of the scale per step. Slower is not better; faster sometimes leaves the basin of attraction.
constexpr double kCooling = 0.85;
// Below the fine scale, where matches are one to one and rarely change.
constexpr double kFineCooling = 0.75;
// The scale is reduced when a step is shorter than this share of it, or after this number of longer steps.
constexpr double kSettled = 0.05;
constexpr int kMostUnsettled = 8;
// A step shorter than this share of the fine scale means convergence.
constexpr double kStill = 1e-4;
constexpr double kDamping = 1e-9;
// The source's scale is estimated below this kernel scale, in fine scales, because with a wider kernel,
// matches outside the overlap would enlarge or shrink the source.
constexpr double kScaleFreed = 2.0;
constexpr double kMostGrowth = 0.25;  // of the logarithm of the scale, in one step
// Matches beyond 5 standard deviations, of weight 0.0015, are ignored.
constexpr double kNegligible = 1.0 / 26.0;
constexpr double kFarthestSquared = 1.0 / kNegligible;  // and one more for rounding
// Motion, as a share of the kernel's scale, by which the stiffness is measured. With a smaller one, hardly
// any match changes and the covariance is too small; with a larger one, it is too large.
constexpr double kStiffnessStep = 0.25;
// A direction is determined if the poses at this distance on both sides, in scales of the kernel, are worse,
// and the covariance in it is not larger.
constexpr double kProbe = 2.0;
constexpr std::size_t kErrorGroups = 16;  // parts of the matched landmarks with independent errors
constexpr std::size_t kGainGroups = 64;   // parts with independent gains
constexpr double kSignificant = 2.0;      // standard errors

// Whether the mean gain of the map's parts is at least kSignificant standard errors above zero.
// @param gains one per place
bool gain_is_significant(std::span<const Eigen::Vector3d> places, std::span<const double> gains) {
  const std::vector<std::size_t> group_of = spatial_groups(places, kGainGroups);
  std::array<double, kGainGroups> gain{};
  std::array<bool, kGainGroups> known{};
  for (std::size_t i = 0; i < gains.size(); ++i) {
    gain[group_of[i]] += gains[i];
    known[group_of[i]] = true;
  }
  double count = 0.0;
  double sum = 0.0;
  double squares = 0.0;
  for (std::size_t i = 0; i < kGainGroups; ++i) {
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

// Factor of the covariance by which the 95 % ellipsoid contains 95 % of the errors although the scatter is
// that of few parts: about the ratio of the quantiles of Hotelling's and the chi-squared distribution for 16
// parts and 6 or 7 degrees of freedom; larger for fewer parts. std::nullopt for fewer than 12 parts, or 14
// with a scale, because the ellipsoid would be too large to be useful.
std::optional<double> correction_for_few(std::size_t parts, int freedoms) {
  const double spent = 1.57 * freedoms;
  const auto count = static_cast<double>(parts);
  if (count < 1.2 * spent) return std::nullopt;
  return count / (count - spent);
}

// The pose after a small motion about a pivot in the target frame: translation, rotation and, with 7 degrees
// of freedom, the logarithm of a scale; the last two multiplied by the arm's length.
template <int kFreedoms>
Similarity3 moved_about(const Similarity3& pose, const Vector<kFreedoms>& delta,
                        const Eigen::Vector3d& pivot, double length) {
  double scale = 1.0;
  if constexpr (kFreedoms == 7) {
    scale = std::exp(std::clamp(delta[6] / length, -kMostGrowth, kMostGrowth));
  }
  const Rigid3 turn(rotation_exp(delta.template segment<3>(3) / length), Eigen::Vector3d::Zero());
  const Rigid3 about_pivot(turn.quaternion(),
                           pivot - scale * (turn * pivot) + delta.template head<3>());
  return Similarity3(scale, about_pivot) * pose;
}

// Derivative of a point at the end of the arm with respect to the degrees of freedom after the translation. The
// derivative with respect to the translation is the identity.
template <int kFreedoms>
Eigen::Matrix<double, 3, kFreedoms - 3> lever_at(const Eigen::Vector3d& arm, double length) {
  Eigen::Matrix<double, 3, kFreedoms - 3> lever;
  lever.template leftCols<3>() = -skew(arm) / length;
  if constexpr (kFreedoms == 7) lever.col(3) = arm / length;
  return lever;
}

}  // namespace

RobustAlignment::RobustAlignment(const PreparedCloud& source, const PreparedCloud& target,
                                 bool one_to_one, const Executor& executor)
    : source_(source), target_(target), one_to_one_(one_to_one), executor_(executor) {}

template <int kFreedoms>
RobustAlignment::Equations<kFreedoms>& RobustAlignment::Equations<kFreedoms>::operator+=(
    const Equations& other) {
  information += other.information;
  gradient += other.gradient;
  weight += other.weight;
  count += other.count;
  return *this;
}

double RobustAlignment::radius(std::size_t points) const {
  double sum = 0.0;
  for (std::size_t i = 0; i < points; ++i) sum += source_.landmarks().positions[i].squaredNorm();
  const double radius = std::sqrt(sum / static_cast<double>(points));
  return radius > 0.0 ? radius : 1.0;
}

std::vector<Match> RobustAlignment::find_matches(std::span<const Eigen::Vector3d> moved,
                                                 BatchTree::Batch& queries, bool one_to_one) const {
  std::vector<Match> matches(moved.size());
  queries.for_each(moved, executor_, [&](std::size_t i, const NearestList auto& nearest) {
    matches[i] = {static_cast<std::uint32_t>(i), nearest.index(0), nearest.squared_distance(0)};
  });
  if (!one_to_one) return matches;
  // The source landmark that each target landmark keeps: the closest; of equally close ones, the first.
  constexpr auto kNobody = std::numeric_limits<std::uint32_t>::max();
  std::vector<std::uint32_t> owner(target_.tree().size(), kNobody);
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
                                                           const Eigen::Matrix3d& linear,
                                                           double scale) const {
  const LandmarkCloud& source = source_.landmarks();
  const LandmarkCloud& target = target_.landmarks();
  const Eigen::Matrix3d* const of_source =
      !source.covariances.empty() ? &source.covariances[match.source] : nullptr;
  const Eigen::Matrix3d* const of_target =
      !target.covariances.empty() ? &target.covariances[match.target] : nullptr;
  const Eigen::Vector3d residual = target.positions[match.target] - moved;
  // Upper bound of the variance in any direction, which suffices to find most negligible matches.
  double variance = scale * scale;
  if (of_source != nullptr) variance += linear.col(0).squaredNorm() * of_source->trace();
  if (of_target != nullptr) variance += of_target->trace();
  if (residual.squaredNorm() > kFarthestSquared * variance) return std::nullopt;
  Eigen::Matrix3d spread = scale * scale * Eigen::Matrix3d::Identity();
  if (of_source != nullptr) spread += linear * *of_source * linear.transpose();
  if (of_target != nullptr) spread += *of_target;
  const Eigen::Matrix3d information = spread.inverse();
  const Eigen::Vector3d force = information * residual;
  const double kernel = 1.0 / (1.0 + residual.dot(force));
  if (kernel < kNegligible) return std::nullopt;
  const double trust = source.weight(match.source) * target.weight(match.target);
  return Term{information, force, trust * kernel * kernel, trust * kernel};
}

template <int kFreedoms>
RobustAlignment::Equations<kFreedoms> RobustAlignment::equations(
    std::span<const Eigen::Vector3d> moved, std::span<const Match> matches, const Similarity3& pose,
    double scale, const Arm& arm) const {
  constexpr std::size_t kBlock = 1024;
  constexpr int kTurned = kFreedoms - 3;
  const Eigen::Matrix3d linear = pose.linear();
  std::vector<Equations<kFreedoms>> parts((matches.size() + kBlock - 1) / kBlock);
  executor_.for_blocks(matches.size(), kBlock, [&](std::size_t begin, std::size_t end) {
    Equations<kFreedoms>& part = parts[begin / kBlock];
    for (std::size_t i = begin; i < end; ++i) {
      const Eigen::Vector3d& point = moved[matches[i].source];
      const std::optional<Term> one = term(point, matches[i], linear, scale);
      if (!one) continue;
      const auto lever = lever_at<kFreedoms>(point - arm.pivot, arm.length);
      const Eigen::Matrix3d information = one->weight * one->information;
      const Eigen::Vector3d force = one->weight * one->force;
      const Eigen::Matrix<double, 3, kTurned> turned = information * lever;
      part.information.template topLeftCorner<3, 3>() += information;
      part.information.template topRightCorner<3, kTurned>() += turned;
      part.information.template bottomRightCorner<kTurned, kTurned>().noalias() +=
          lever.transpose() * turned;
      part.gradient.template head<3>() += force;
      part.gradient.template tail<kTurned>().noalias() += lever.transpose() * force;
      part.weight += one->weight;
      ++part.count;
    }
  });
  // In the order of the blocks, so that rounding does not depend on the threads.
  Equations<kFreedoms> sum;
  for (const Equations<kFreedoms>& part : parts) sum += part;
  sum.information.template bottomLeftCorner<kTurned, 3>() =
      sum.information.template topRightCorner<3, kTurned>().transpose();
  return sum;
}

RobustAlignment::Run RobustAlignment::run(const Similarity3& initial, const Schedule& schedule,
                                          const std::stop_token& stop,
                                          const std::function<void(Iteration)>& observe) const {
  return schedule.free_scale ? run_with<7>(initial, schedule, stop, observe)
                             : run_with<6>(initial, schedule, stop, observe);
}

template <int kFreedoms>
RobustAlignment::Run RobustAlignment::run_with(
    const Similarity3& initial, const Schedule& schedule, const std::stop_token& stop,
    const std::function<void(Iteration)>& observe) const {
  const std::size_t count = std::min(schedule.points, source_.landmarks().size());
  const std::span<const Eigen::Vector3d> source =
      std::span(source_.landmarks().positions).first(count);
  const double length = initial.scale() * radius(count);
  BatchTree::Batch queries = target_.tree().batch(1, source_.close_by(count));
  Run run;
  run.target_from_source = initial;
  double scale = schedule.coarse;
  int unsettled = 0;  // steps at this scale
  const double last =
      schedule.finest > 0.0 ? std::min(schedule.finest, schedule.fine) : schedule.fine;
  while (run.iterations < schedule.max_iterations) {
    if (stop.stop_requested()) {
      run.stop_reason = StopReason::kCancelled;
      break;
    }
    const std::vector<Eigen::Vector3d> moved = moved_points(source, run.target_from_source);
    std::vector<Match> matches = find_matches(moved, queries, one_to_one_ || scale < schedule.fine);
    // The pivot is the moved centroid, which the centred source has at its origin.
    const Eigen::Vector3d pivot = run.target_from_source.translation();
    Equations<kFreedoms> sum =
        equations<kFreedoms>(moved, matches, run.target_from_source, scale, {pivot, length});
    // Fewer matches do not determine the rotation.
    if (sum.count < kFewestMatches || !(sum.weight > 0.0)) {
      run.stop_reason = StopReason::kTooFewMatches;
      break;
    }
    if constexpr (kFreedoms == 7) {
      if (scale > kScaleFreed * schedule.fine) {
        sum.information.row(6).setZero();
        sum.information.col(6).setZero();
        sum.gradient[6] = 0.0;
      }
    }
    // The pose does not move along directions that the matches do not determine.
    sum.information.diagonal().array() += kDamping * sum.information.trace();
    const Vector<kFreedoms> delta = solve_symmetric<kFreedoms>(sum.information, sum.gradient);
    const double motion = delta.norm();
    run.target_from_source = moved_about<kFreedoms>(run.target_from_source, delta, pivot, length);
    ++run.iterations;
    if (observe) {
      observe({run.target_from_source, mean_squared_distance(matches), std::move(matches)});
    }
    if (scale <= last && motion < kStill * last) {
      run.stop_reason = StopReason::kNoMotion;
      break;
    }
    if (scale > schedule.fine) {
      scale = std::max(kCooling * scale, schedule.fine);
    } else if (motion < kSettled * scale || ++unsettled == kMostUnsettled) {
      scale = std::max(kFineCooling * scale, last);
      unsettled = 0;
    }
  }
  return run;
}

std::vector<Match> RobustAlignment::matches(const Similarity3& pose) const {
  BatchTree::Batch queries = target_.tree().batch(1);
  return find_matches(moved_points(source_.landmarks().positions, pose), queries, one_to_one_);
}

double RobustAlignment::value(const Similarity3& pose, double scale,
                              std::span<const Match> matches) const {
  const Eigen::Matrix3d linear = pose.linear();
  double sum = 0.0;
  for (const Match& match : matches) {
    const Eigen::Vector3d moved = pose * source_.landmarks().positions[match.source];
    if (const auto one = term(moved, match, linear, scale)) sum += one->value;
  }
  return sum;
}

// Evaluates motions on a sample of some thousands of source landmarks.
template <int kFreedoms>
class RobustAlignment::Trial {
 public:
  using Direction = Vector<kFreedoms>;
  using Matrix = typename Equations<kFreedoms>::Matrix;

  Trial(const RobustAlignment& alignment, const Similarity3& pose, double scale, const Arm& arm)
      : alignment_(alignment),
        pose_(pose),
        scale_(scale),
        arm_(arm),
        queries_(alignment.target_.tree().batch(1)),
        moved_(all()),
        here_(terms(pose)) {}

  // Change of the gradient of all landmarks with small motions, with new matches. With fixed matches, the
  // stiffness would be much too large, because a landmark that the target lacks is not tied to its match.
  Matrix stiffness() {
    const double step = kStiffnessStep * scale_;
    const double share = static_cast<double>(tried_.size()) / static_cast<double>(all().size());
    Matrix result;
    for (int i = 0; i < kFreedoms; ++i) {
      const Direction direction = Direction::Unit(i);
      result.col(i) = (gradient(moved(-step * direction)) - gradient(moved(step * direction))) /
                      (2.0 * step * share);
    }
    return 0.5 * (result + result.transpose());
  }

  // Whether landmarks fit better here than at a small motion along the direction, on both sides.
  bool holds(const Direction& direction) {
    return is_better_than(moved(-kProbe * scale_ * direction)) &&
           is_better_than(moved(kProbe * scale_ * direction));
  }

 private:
  static constexpr std::size_t kTried = 16384;

  const std::vector<Eigen::Vector3d>& all() const {
    return alignment_.source_.landmarks().positions;
  }

  Similarity3 moved(const Direction& direction) const {
    return moved_about<kFreedoms>(pose_, direction, arm_.pivot, arm_.length);
  }

  // Matches of the sampled landmarks at a pose; sets moved_ to their positions.
  std::vector<Match> matches(const Similarity3& pose) {
    std::vector<Eigen::Vector3d> places;
    places.reserve(tried_.size());
    for (const std::size_t landmark : tried_) {
      places.push_back(moved_[landmark] = pose * all()[landmark]);
    }
    std::vector<Match> found = alignment_.find_matches(places, queries_, alignment_.one_to_one_);
    for (Match& match : found) match.source = static_cast<std::uint32_t>(tried_[match.source]);
    return found;
  }

  Direction gradient(const Similarity3& pose) {
    const std::vector<Match> found = matches(pose);
    const Arm arm = {pose * (pose_.inverse() * arm_.pivot), arm_.length};
    return alignment_.template equations<kFreedoms>(moved_, found, pose, scale_, arm).gradient;
  }

  // Contribution of each source landmark to the objective; 0 for those outside the sample.
  std::vector<double> terms(const Similarity3& pose) {
    std::vector<double> values(all().size(), 0.0);
    const Eigen::Matrix3d linear = pose.linear();
    for (const Match& match : matches(pose)) {
      const auto one = alignment_.term(moved_[match.source], match, linear, scale_);
      if (one) values[match.source] = one->value;
    }
    return values;
  }

  bool is_better_than(const Similarity3& other) {
    const std::vector<double> there = terms(other);
    // Ignores landmarks without a match at both poses. Counts those with a match only at the other pose,
    // because otherwise every pose would seem better than its neighbours.
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
  Similarity3 pose_;
  double scale_;
  Arm arm_;
  BatchTree::Batch queries_;
  std::vector<std::size_t> tried_ =
      detail::one_of_each((all().size() + kTried - 1) / kTried, all().size(), Random(0));
  std::vector<Eigen::Vector3d> moved_;  // one per source landmark
  std::vector<double> here_;            // terms at the pose
};

PoseUncertainty RobustAlignment::uncertainty(const Similarity3& pose, double scale,
                                             std::vector<Match> matches, bool free_scale,
                                             bool known) const {
  return free_scale ? uncertainty_with<7>(pose, scale, std::move(matches), known)
                    : uncertainty_with<6>(pose, scale, std::move(matches), known);
}

template <int kFreedoms>
PoseUncertainty RobustAlignment::uncertainty_with(const Similarity3& pose, double scale,
                                                  std::vector<Match> matches, bool known) const {
  const std::vector<Eigen::Vector3d> moved = moved_points(source_.landmarks().positions, pose);
  const Eigen::Matrix3d linear = pose.linear();
  std::erase_if(matches, [&](const Match& match) {
    return !term(moved[match.source], match, linear, scale);
  });
  if (matches.size() < kFewestMatches) return {};
  std::vector<Eigen::Vector3d> places;
  for (const Match& match : matches) places.push_back(moved[match.source]);
  // Of the matched landmarks, because elsewhere a rotation moves points more or less.
  const PoseDistance spread = PoseDistance::of(places);
  const Arm arm = {spread.centroid, spread.radius > 0.0 ? spread.radius : 1.0};
  PoseEvidence<kFreedoms> evidence;
  evidence.pivot = arm.pivot;
  evidence.length = arm.length;
  if (known) {
    evidence.information = equations<kFreedoms>(moved, matches, pose, scale, arm).information;
  } else {
    Trial<kFreedoms> trial(*this, pose, scale, arm);
    evidence.information = trial.stiffness();
    PoseUncertainty open;
    const SymmetricEigen<kFreedoms> eigen = symmetric_eigen<kFreedoms>(evidence.information);
    for (int i = 0; i < kFreedoms; ++i) {
      const Vector<kFreedoms> direction = eigen.vectors.col(i);
      if (trial.holds(direction)) continue;
      open.unobservable.push_back(open_direction<kFreedoms>(direction, evidence.length));
    }
    if (!open.unobservable.empty()) return open;
  }

  // Errors of neighbouring landmarks are correlated, by a common keyframe, a common match, or drift. A small
  // number of large parts includes that.
  const std::vector<std::size_t> group_of = spatial_groups(places, kErrorGroups);
  std::vector<std::vector<Match>> groups(kErrorGroups);
  for (std::size_t i = 0; i < matches.size(); ++i) groups[group_of[i]].push_back(matches[i]);
  std::erase_if(groups, [](const auto& group) { return group.empty(); });
  for (const std::vector<Match>& group : groups) {
    const Vector<kFreedoms> pull = equations<kFreedoms>(moved, group, pose, scale, arm).gradient;
    evidence.scatter += pull * pull.transpose();
  }
  const std::optional<double> correction = correction_for_few(groups.size(), kFreedoms);
  if (!correction) return {};
  evidence.scatter *= *correction;
  evidence.reach = kProbe * scale;
  return pose_uncertainty(pose, evidence);
}

}  // namespace cairn::detail
