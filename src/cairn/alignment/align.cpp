// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/alignment/align.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <iterator>
#include <string_view>
#include <utility>

#include <Eigen/Eigenvalues>
#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/placement/refine.hpp"

namespace cairn {
namespace {

constexpr double kPriorDeviations = 3.0;  // how many of its own a prior pose may be off

template <class Value>
void require(bool valid, std::string_view field, const Value& value, std::string_view expected) {
  if (valid) return;
  throw Error(ErrorKind::kMisuse, fmt::format("AlignOptions.{}", field), fmt::format("{}", value),
              expected);
}

// @param unit symbol of the target's unit of length; may be empty
PlaceOptions placement_of(const AlignOptions& options, std::string_view unit = {}) {
  PlaceOptions placement;
  placement.unit = unit;
  placement.seed = options.seed;
  placement.effort = options.effort;
  placement.prior_odds = options.prior_odds;
  placement.min_probability = options.min_probability;
  placement.gravity = options.gravity;
  placement.scale = options.scale;
  placement.time_limit_s = options.time_limit_s;
  placement.overlap_radius = options.overlap_radius;
  placement.trace = options.trace;
  placement.execution = options.execution;
  return placement;
}

IcpOptions icp_of(const AlignOptions& options) {
  IcpOptions icp = options.icp;
  if (options.prior) icp.initial = options.prior->target_from_source.rigid();
  icp.overlap_radius = options.overlap_radius;
  icp.trace = options.trace;
  icp.execution = options.execution;
  return icp;
}

// Root mean square of how far the prior may put landmarks from where they are.
double displacement(const PosePrior& prior, const LandmarkCloud& source) {
  double sum = 0.0;
  for (const Eigen::Vector3d& position : source.positions) {
    // Of the left perturbation t + δt, Exp(δφ)·R, which turns about the source's origin.
    const Eigen::Vector3d arm =
        prior.target_from_source * position - prior.target_from_source.translation();
    Eigen::Matrix<double, 3, 6> jacobian;
    jacobian << Eigen::Matrix3d::Identity(), -skew(arm);
    sum += (jacobian * *prior.covariance * jacobian.transpose()).trace();
  }
  return std::sqrt(sum / static_cast<double>(std::max<std::size_t>(source.size(), 1)));
}

RegistrationResult refined(const LandmarkCloud& source, const LandmarkCloud& target,
                           const AlignOptions& options) {
  const PosePrior& prior = *options.prior;
  RefineOptions refinement;
  refinement.initial = prior.target_from_source.rigid();
  if (options.scale) refinement.scale = prior.target_from_source.scale();
  if (prior.covariance) {
    const double off = kPriorDeviations * displacement(prior, source);
    if (off > 0.0) refinement.coarse = off;
    refinement.by_icp_too = false;
  }
  refinement.one_to_one = options.one_to_one;
  refinement.max_iterations = options.icp.max_iterations;
  refinement.overlap_radius = options.overlap_radius;
  refinement.trace = options.trace;
  refinement.execution = options.execution;
  return refine(source, target, refinement);
}

// The way from the prior pose, and what came of it at the end.
RegistrationResult joined(RegistrationResult way, RegistrationResult end) {
  end.initial_score = way.initial_score;
  end.iterations += way.iterations;
  way.history.insert(way.history.end(), std::make_move_iterator(end.history.begin()),
                     std::make_move_iterator(end.history.end()));
  end.history = std::move(way.history);
  return end;
}

// ICP's result with what the verdict rests on.
RegistrationResult completed(RegistrationResult result, RegistrationResult held) {
  if (held.status == RegistrationStatus::kCancelled) result.status = held.status;
  result.covariance = held.covariance;
  result.covariance_with_scale = held.covariance_with_scale;
  result.unobservable = std::move(held.unobservable);
  if (held.overlap) result.overlap = held.overlap;
  return result;
}

void take_verdict(PlacementResult placed, Alignment& alignment) {
  alignment.verdict = placed.verdict;
  alignment.probability = placed.probability;
  alignment.reason = std::move(placed.reason);
  alignment.candidates = std::move(placed.candidates);
  alignment.radius = placed.radius;
  alignment.cut_short = placed.cut_short;
}

void take_pose(Alignment& alignment) {
  const RegistrationResult& result = alignment.registration;
  if (result.status != RegistrationStatus::kFailed) alignment.estimate = result.similarity();
  if (alignment.verdict == Verdict::kAligned) alignment.target_from_source = alignment.estimate;
}

// @param found by the method, from the prior pose; nothing: by search
Alignment concluded(const LandmarkCloud& source, const LandmarkCloud& target,
                    const AlignOptions& options, std::string_view unit,
                    std::optional<RegistrationResult> found) {
  Alignment alignment;
  alignment.deterministic = !options.time_limit_s;
  const bool cancelled = found && found->status == RegistrationStatus::kCancelled;
  if (found && (!options.judge || cancelled || !found->has_pose())) {
    alignment.registration = std::move(*found);
    alignment.reason = alignment.registration.reason;
  } else {
    PreparedPair pair(source, target, placement_of(options, unit));
    const bool by_icp = options.method == AlignMethod::kIcp;
    PlacementResult placed = !found   ? pair.place()
                             : by_icp ? pair.judge(found->similarity())
                                      : pair.settle(found->similarity());
    RegistrationResult end = std::move(placed.alignment);
    const bool stopped = end.status == RegistrationStatus::kCancelled;
    alignment.registration = !found   ? std::move(end)
                             : by_icp ? completed(std::move(*found), std::move(end))
                                      : joined(std::move(*found), std::move(end));
    if (options.judge && !stopped) {
      take_verdict(std::move(placed), alignment);
    } else {
      alignment.reason = alignment.registration.reason;
    }
  }
  take_pose(alignment);
  return alignment;
}

double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

Alignment judge_pose(const LandmarkCloud& source, const LandmarkCloud& target,
                     const Similarity3& pose, std::string_view unit, const AlignOptions& options) {
  const auto start = std::chrono::steady_clock::now();
  Alignment alignment;
  alignment.deterministic = !options.time_limit_s;
  PlacementResult placed = PreparedPair(source, target, placement_of(options, unit)).judge(pose);
  alignment.registration = std::move(placed.alignment);
  if (alignment.registration.status == RegistrationStatus::kCancelled) {
    alignment.reason = alignment.registration.reason;
  } else {
    take_verdict(std::move(placed), alignment);
  }
  take_pose(alignment);
  alignment.estimate = pose;
  if (alignment.target_from_source) alignment.target_from_source = pose;
  alignment.duration_s = seconds_since(start);
  return alignment;
}

std::string_view unit_of(const LandmarkMap& target) {
  return target.info().length_unit == LengthUnit::kMetres ? "m" : "";
}

Alignment align(const LandmarkCloud& source, const LandmarkCloud& target,
                const PointSet& source_points, const PointSet& target_points, std::string_view unit,
                const AlignOptions& options) {
  const auto start = std::chrono::steady_clock::now();
  std::optional<RegistrationResult> found;
  if (options.method == AlignMethod::kIcp) {
    found = icp(source_points, target_points, icp_of(options));
  } else if (options.prior) {
    found = refined(source, target, options);
  }
  Alignment alignment = concluded(source, target, options, unit, std::move(found));
  alignment.duration_s = seconds_since(start);
  return alignment;
}

}  // namespace

void AlignOptions::validate() const {
  require(min_probability >= 0.5 && min_probability < 1.0, "min_probability", min_probability,
          "at least 0.5 and below 1");
  require(method != AlignMethod::kIcp || !scale, "scale", "given with ICP", "AlignMethod::kRobust");
  if (prior) {
    const double unit = prior->target_from_source.scale();
    require(scale || std::abs(unit - 1.0) < 1e-9, "prior.target_from_source",
            fmt::format("scale {}", unit), "1, or AlignOptions.scale");
    if (prior->covariance) {
      const Matrix6d& covariance = *prior->covariance;
      const bool finite = covariance.allFinite();
      const bool symmetric =
          finite && (covariance - covariance.transpose()).norm() <= 1e-9 * covariance.norm();
      const bool valid = symmetric && Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 6, 6>>(
                                          covariance, Eigen::EigenvaluesOnly)
                                              .eigenvalues()
                                              .minCoeff() >= -1e-9 * covariance.norm();
      require(valid, "prior.covariance", "no covariance",
              "a symmetric matrix without negative eigenvalues");
    }
  }
  placement_of(*this).validate();
  icp_of(*this).validate();
}

std::string_view status_of(const Alignment& alignment) {
  return alignment.verdict ? to_string(*alignment.verdict)
                           : to_string(alignment.registration.status);
}

Alignment align(const LandmarkCloud& source, const LandmarkCloud& target,
                const AlignOptions& options) {
  options.validate();
  source.validate("source");
  target.validate("target");
  return align(source, target, {source.positions, source.weights},
               {target.positions, target.weights}, {}, options);
}

Alignment align(const LandmarkMap& source, const LandmarkMap& target, const AlignOptions& options) {
  options.validate();
  const bool by_icp = options.method == AlignMethod::kIcp;
  const auto points = [&](const LandmarkMap& map) {
    return by_icp ? point_set(map, options.confidence, options.points) : PointSet{};
  };
  // What ICP alone does not look at.
  const auto cloud = [&](const LandmarkMap& map) {
    if (by_icp && !options.judge) return LandmarkCloud{};
    return landmark_cloud(map, options.confidence, options.points);
  };
  return align(cloud(source), cloud(target), points(source), points(target), unit_of(target),
               options);
}

Alignment judge_pose(const LandmarkCloud& source, const LandmarkCloud& target,
                     const Similarity3& target_from_source, const AlignOptions& options) {
  options.validate();
  source.validate("source");
  target.validate("target");
  return judge_pose(source, target, target_from_source, std::string_view(), options);
}

Alignment judge_pose(const LandmarkMap& source, const LandmarkMap& target,
                     const Similarity3& target_from_source, const AlignOptions& options) {
  options.validate();
  return judge_pose(landmark_cloud(source, options.confidence, options.points),
                    landmark_cloud(target, options.confidence, options.points), target_from_source,
                    unit_of(target), options);
}

GravityPrior gravity_prior(const LandmarkMap& source, const LandmarkMap& target) {
  GravityPrior gravity;
  gravity.source = source.info().gravity.value_or(gravity.source);
  gravity.target = target.info().gravity.value_or(gravity.target);
  return gravity;
}

}  // namespace cairn
