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
std::vector<Match> turned_round(const std::vector<Match>& matches) {
  std::vector<Match> result;
  for (const Match& match : matches) {
    result.push_back({match.target, match.source, match.squared_distance});
  }
  std::sort(result.begin(), result.end(), [](const Match& a, const Match& b) {
    return std::tie(a.source, a.squared_distance, a.target) <
           std::tie(b.source, b.squared_distance, b.target);
  });
  const auto same_source = [](const Match& a, const Match& b) { return a.source == b.source; };
  result.erase(std::unique(result.begin(), result.end(), same_source), result.end());
  return result;
}

// What is said of the moving cloud's pose in the other's frame, as said of its inverse. Score and
// overlap are not of the pose's sense.
void turn_round(AlignResult& result) {
  const Rigid3 pose = result.target_from_source;
  result.target_from_source = pose.inverse();
  result.matches = turned_round(result.matches);
  for (IterationRecord& record : result.history) {
    record.target_from_source = record.target_from_source.inverse();
    record.matches = turned_round(record.matches);
  }
  if (result.covariance) result.covariance = inverse_covariance(pose, *result.covariance);
  const Eigen::Matrix3d back = -result.target_from_source.rotation();
  for (OpenDirection& open : result.unobservable) {
    open = {back * open.translation, back * open.rotation};
  }
}

// `inverted`: the pair's source is the caller's target. Scores and overlap are as the caller has them.
void run(const CentredPair& pair, bool inverted, const RefineOptions& options,
         AlignResult& result) {
  const BatchTree source_tree(pair.source().positions);
  const BatchTree target_tree(pair.target().positions);
  // Asked of the clouds only where the caller has not said.
  const KernelScales own =
      options.fine && options.coarse
          ? KernelScales{}
          : kernel_scales(cloud_scales(pair.source(), source_tree, options.executor),
                          cloud_scales(pair.target(), target_tree, options.executor));
  const double fine = options.fine.value_or(std::min(own.fine, options.coarse.value_or(own.fine)));
  const double coarse = options.coarse.value_or(std::max(own.coarse, fine));
  const RobustAlignment alignment(pair, target_tree, options.use_covariances, options.one_to_one,
                                  options.executor);
  const auto from_source = [&](const Rigid3& pose) {
    return nearest_squared_distances(pair.source().positions, pose, target_tree, options.executor);
  };
  const auto from_target = [&](const Rigid3& pose) {
    return nearest_squared_distances(pair.target().positions, pose.inverse(), source_tree,
                                     options.executor);
  };
  const auto from_callers_source = [&](const Rigid3& pose) {
    return inverted ? from_target(pose) : from_source(pose);
  };
  const Rigid3 initial = pair.centred(inverted ? options.initial.inverse() : options.initial);
  result.initial_score = fitness_score(from_callers_source(initial));
  const IcpRun icp = alignment.run(
      initial, {.coarse = coarse, .fine = fine, .max_iterations = options.max_iterations},
      options.stop, [&](Iteration iteration) {
        IterationRecord record;
        record.target_from_source = pair.uncentred(iteration.target_from_source);
        record.mean_squared_distance = iteration.mean_squared_distance;
        record.match_count = iteration.matches.size();
        if (options.trace) {
          record.score = fitness_score(from_callers_source(iteration.target_from_source));
          record.matches = std::move(iteration.matches);
        }
        result.history.push_back(std::move(record));
        if (options.progress) {
          options.progress(static_cast<double>(result.history.size()) / options.max_iterations);
        }
      });
  const Rigid3& pose = icp.target_from_source;
  result.iterations = icp.iterations;
  result.stop_reason = icp.stop_reason;
  result.target_from_source = pair.uncentred(pose);
  result.matches = alignment.matches(pose);
  const std::vector<double> distances = from_callers_source(pose);
  result.score = fitness_score(distances);
  if (options.overlap_radius) {
    const std::vector<double> back = inverted ? from_source(pose) : from_target(pose);
    result.overlap = Overlap{*share_within(distances, *options.overlap_radius),
                             *share_within(back, *options.overlap_radius)};
  }
  // Only of an optimum there is something to say.
  if (icp.stop_reason == StopReason::kNoMotion || icp.stop_reason == StopReason::kIterationLimit) {
    PoseUncertainty uncertainty = alignment.uncertainty(pose, fine, result.matches);
    result.unobservable = std::move(uncertainty.unobservable);
    if (uncertainty.covariance) result.covariance = pair.uncentred(*uncertainty.covariance, pose);
  }
  result.reason = sentence(result, fine);
  if (inverted) turn_round(result);
}

}  // namespace

void RefineOptions::validate() const {
  const auto require_length = [](const std::optional<double>& length, std::string_view field) {
    require(!length || (*length > 0.0 && std::isfinite(*length)), field, length.value_or(0.0),
            "a positive number");
  };
  require(initial.matrix().allFinite(), "initial", "not finite", "a rigid transform");
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
  if (source.size() < kFewestMatches || target.size() < kFewestMatches) {
    result.reason = fmt::format("{} source and {} target landmarks: at least {} of each are needed",
                                source.size(), target.size(), kFewestMatches);
  } else {
    // Landmarks of the larger map beside the smaller one would pull it their way.
    const bool inverted = cloud_extent(source) > cloud_extent(target);
    run(inverted ? CentredPair(target, source) : CentredPair(source, target), inverted, options,
        result);
  }
  result.status = status_of(result.stop_reason);
  result.duration_s =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return result;
}

}  // namespace cairn
