// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/placement/refine.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <tuple>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/geometry/covariance.hpp"
#include "cairn/placement/robust_alignment.hpp"
#include "cairn/registration/score/fitness.hpp"

namespace cairn {
namespace {

template <class Value>
void require(bool valid, std::string_view field, const Value& value, std::string_view expected) {
  if (valid) return;
  throw Error(ErrorKind::kMisuse, fmt::format("RefineOptions.{}", field), fmt::format("{}", value),
              expected);
}

std::string sentence(const AlignResult& result, double fine) {
  switch (result.stop_reason) {
    case StopReason::kNoMotion:
      return fmt::format("converged after {} iterations at a kernel scale of {:.3g}",
                         result.iterations, fine);
    case StopReason::kCancelled:
      return fmt::format("cancelled after {} iterations", result.iterations);
    case StopReason::kTooFewMatches:
      return fmt::format("fewer than {} landmarks match", kFewestMatches);
    default:
      return fmt::format("stopped at the limit of {} iterations", result.iterations);
  }
}

// The same matches, seen from what was their target: of each the closest, by ascending index.
// `unit`: of what was the source, in that of what was the target.
std::vector<Match> turned_round(const std::vector<Match>& matches, double unit) {
  std::vector<Match> result;
  for (const Match& match : matches) {
    result.push_back({match.target, match.source, match.squared_distance / (unit * unit)});
  }
  std::sort(result.begin(), result.end(), [](const Match& a, const Match& b) {
    return std::tie(a.source, a.squared_distance, a.target) <
           std::tie(b.source, b.squared_distance, b.target);
  });
  const auto same_source = [](const Match& a, const Match& b) { return a.source == b.source; };
  result.erase(std::unique(result.begin(), result.end(), same_source), result.end());
  return result;
}

// What is said of the moving cloud's pose in the other's frame, as said of its inverse.
void turn_round(const Similarity3& pose, AlignResult& result) {
  const Similarity3 inverse = pose.inverse();
  result.target_from_source = inverse.rigid();
  result.scale = inverse.scale();
  result.matches = turned_round(result.matches, pose.scale());
  if (result.covariance_with_scale) {
    const Matrix7d turned = inverse_covariance(pose, *result.covariance_with_scale);
    result.covariance_with_scale = turned;
    result.covariance = turned.topLeftCorner<6, 6>();
  } else if (result.covariance) {
    result.covariance = inverse_covariance(pose.rigid(), *result.covariance);
  }
  for (OpenDirection& open : result.unobservable) {
    open = {-(inverse.linear() * open.translation), -(inverse.rigid().quaternion() * open.rotation),
            -open.log_scale};
  }
}

// The refinement of a pair, of which one is moved and the other stands. Scores and overlap are as the
// caller has them, in the unit of the caller's target.
class Refinement {
 public:
  /// @param inverted what is moved is the caller's target
  Refinement(CentredPair pair, bool inverted, const RefineOptions& options)
      : pair_(std::move(pair)),
        inverted_(inverted),
        options_(options),
        source_tree_(pair_.source().positions),
        target_tree_(pair_.target().positions) {}

  void run(AlignResult& result) const;

 private:
  std::vector<double> from_source(const Similarity3& pose) const {
    return nearest_squared_distances(pair_.source().positions, pose, target_tree_,
                                     options_.executor);
  }
  std::vector<double> from_target(const Similarity3& pose) const {
    return nearest_squared_distances(pair_.target().positions, pose.inverse(), source_tree_,
                                     options_.executor);
  }
  // Of the caller's landmarks; either way the tree is that of the caller's target.
  std::vector<double> distances(const Similarity3& pose) const {
    return inverted_ ? from_target(pose) : from_source(pose);
  }
  KernelScales kernel() const;
  IterationRecord record(RobustAlignment::Iteration iteration) const;

  CentredPair pair_;
  bool inverted_;
  const RefineOptions& options_;
  BatchTree source_tree_;
  BatchTree target_tree_;
};

KernelScales Refinement::kernel() const {
  // Asked of the clouds only where the caller has not said.
  const KernelScales own =
      options_.fine && options_.coarse
          ? KernelScales{}
          : kernel_scales(cloud_scales(pair_.source(), source_tree_, options_.executor),
                          cloud_scales(pair_.target(), target_tree_, options_.executor));
  const double fine =
      options_.fine.value_or(std::min(own.fine, options_.coarse.value_or(own.fine)));
  return {.coarse = options_.coarse.value_or(std::max(own.coarse, fine)), .fine = fine};
}

IterationRecord Refinement::record(RobustAlignment::Iteration iteration) const {
  const Similarity3 pose = pair_.uncentred(iteration.target_from_source);
  const Similarity3 callers = inverted_ ? pose.inverse() : pose;
  const double unit = inverted_ ? pose.scale() : 1.0;
  IterationRecord record;
  record.target_from_source = callers.rigid();
  record.scale = callers.scale();
  record.mean_squared_distance = iteration.mean_squared_distance / (unit * unit);
  record.match_count = iteration.matches.size();
  if (options_.trace) {
    record.score = fitness_score(distances(iteration.target_from_source));
    record.matches =
        inverted_ ? turned_round(iteration.matches, unit) : std::move(iteration.matches);
  }
  return record;
}

void Refinement::run(AlignResult& result) const {
  const auto [coarse, fine] = kernel();
  const RobustAlignment alignment(pair_, target_tree_, options_.use_covariances,
                                  options_.one_to_one, options_.executor);
  const bool free_scale = options_.scale.has_value();
  const Similarity3 initial =
      pair_.centred(inverted_ ? options_.initial.inverse() : options_.initial);
  result.initial_score = fitness_score(distances(initial));
  const RobustAlignment::Run run = alignment.run(
      initial,
      {.coarse = coarse,
       .fine = fine,
       .max_iterations = options_.max_iterations,
       .free_scale = free_scale},
      options_.stop, [&](RobustAlignment::Iteration iteration) {
        result.history.push_back(record(std::move(iteration)));
        if (options_.progress) {
          options_.progress(static_cast<double>(result.history.size()) / options_.max_iterations);
        }
      });
  const Similarity3& centred = run.target_from_source;
  const Similarity3 pose = pair_.uncentred(centred);
  result.iterations = run.iterations;
  result.stop_reason = run.stop_reason;
  result.target_from_source = pose.rigid();
  result.scale = pose.scale();
  result.matches = alignment.matches(centred);
  const std::vector<double> there = distances(centred);
  result.score = fitness_score(there);
  if (options_.overlap_radius) {
    const double radius = *options_.overlap_radius;
    // These are in the unit of the caller's source.
    const std::vector<double> back = inverted_ ? from_source(centred) : from_target(centred);
    const double unit = inverted_ ? pose.scale() : 1.0 / pose.scale();
    result.overlap = Overlap{*share_within(there, radius), *share_within(back, radius * unit)};
  }
  // Only of an optimum there is something to say.
  if (run.stop_reason == StopReason::kNoMotion || run.stop_reason == StopReason::kIterationLimit) {
    PoseUncertainty uncertainty = alignment.uncertainty(centred, fine, result.matches, free_scale);
    result.unobservable = std::move(uncertainty.unobservable);
    if (uncertainty.covariance_with_scale) {
      const Matrix7d covariance = pair_.uncentred(*uncertainty.covariance_with_scale, centred);
      result.covariance_with_scale = covariance;
      result.covariance = covariance.topLeftCorner<6, 6>();
    } else if (uncertainty.covariance) {
      result.covariance = pair_.uncentred(*uncertainty.covariance, centred.rigid());
    }
  }
  result.reason = sentence(result, fine);
  if (inverted_) turn_round(pose, result);
}

}  // namespace

void RefineOptions::validate() const {
  const auto require_length = [](const std::optional<double>& length, std::string_view field) {
    require(!length || (*length > 0.0 && std::isfinite(*length)), field, length.value_or(0.0),
            "a positive number");
  };
  require(initial.matrix().allFinite(), "initial", "not finite", "a rigid transform");
  require_length(scale, "scale");
  require_length(coarse, "coarse");
  require_length(fine, "fine");
  require(!coarse || !fine || *fine <= *coarse, "fine", fine.value_or(0.0), "at most coarse");
  require(max_iterations >= 1, "max_iterations", max_iterations, "at least 1");
  require_length(overlap_radius, "overlap_radius");
}

AlignResult refine(const LandmarkCloud& source, const LandmarkCloud& target,
                   const RefineOptions& options) {
  const auto start = std::chrono::steady_clock::now();
  options.validate();
  source.validate("source");
  target.validate("target");
  AlignResult result;
  result.target_from_source = options.initial;
  result.scale = options.scale.value_or(1.0);
  if (source.size() < kFewestMatches || target.size() < kFewestMatches) {
    result.reason = fmt::format("{} source and {} target landmarks: at least {} of each are needed",
                                source.size(), target.size(), kFewestMatches);
  } else {
    // In one unit, or nearly so, the scale to be estimated is about 1.
    const double scale = options.scale.value_or(1.0);
    LandmarkCloud moving = scaled(source, scale);
    // Landmarks of the larger map beside the smaller one would pull it their way.
    const bool inverted = cloud_extent(moving) > cloud_extent(target);
    Refinement(
        inverted ? CentredPair(target, std::move(moving)) : CentredPair(std::move(moving), target),
        inverted, options)
        .run(result);
    result.scale *= scale;  // run() has that of what was scaled already
    for (IterationRecord& record : result.history) record.scale *= scale;
  }
  result.status = status_of(result.stop_reason);
  result.duration_s =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return result;
}

}  // namespace cairn
