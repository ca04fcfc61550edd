// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/registration/icp.hpp"

#include <chrono>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "cairn/core/detail/require.hpp"
#include "cairn/core/error.hpp"
#include "cairn/geometry/covariance.hpp"
#include "cairn/geometry/detail/central_part.hpp"
#include "cairn/geometry/limits.hpp"
#include "cairn/geometry/similarity3.hpp"
#include "cairn/registration/correspondence/confident_neighbor.hpp"
#include "cairn/registration/detail/coarse_to_fine.hpp"
#include "cairn/registration/detail/match_history.hpp"
#include "cairn/registration/estimation/point_to_point.hpp"
#include "cairn/registration/neighbors/batch_tree.hpp"
#include "cairn/registration/score/fitness.hpp"
#include "cairn/registration/stages.hpp"

namespace cairn {
namespace {

using Points = std::vector<Eigen::Vector3d>;
using Correspondence = ConfidentNeighborCorrespondence<BatchTree>;

void check_points(const PointSet& points, std::string_view name) {
  const auto refuse = [&](std::string_view what, std::string_view expected) {
    throw Error(ErrorKind::kMisuse, name, what, expected);
  };
  if (!points.confidences.empty() && points.confidences.size() != points.positions.size()) {
    refuse(fmt::format("{} confidences of {} points", points.confidences.size(),
                       points.positions.size()),
           "one a point, or none");
  }
  for (std::size_t i = 0; i < points.positions.size(); ++i) {
    const std::string_view defect = coordinate_defect(points.positions[i]);
    if (!defect.empty()) {
      refuse(fmt::format("position of point {} {}", i, defect), kExpectedCoordinates);
    }
  }
  for (std::size_t i = 0; i < points.confidences.size(); ++i) {
    if (!std::isfinite(points.confidences[i])) {
      refuse(fmt::format("confidence of point {} is not finite", i), "a number");
    }
  }
}

std::vector<double> non_negative(std::vector<double> weights) {
  for (double& weight : weights) weight = std::max(weight, 0.0);
  return weights;
}

// Detects repeated matches.
class Repetition {
 public:
  void add(const Iteration& iteration) {
    if (cycle_) return;
    cycle_ = history_.add(iteration.matches);
    iterations_.push_back({iteration.target_from_source, iteration.mean_squared_distance});
  }

  const std::optional<MatchCycle>& cycle() const { return cycle_; }

  std::optional<RepeatedMatches> result() const {
    if (!cycle_) return {};
    return RepeatedMatches{*cycle_, best_iteration()};
  }

  const Rigid3& best_pose() const { return iterations_[best_iteration() - 1].pose; }

 private:
  struct Known {
    Rigid3 pose;        // after the iteration
    double mse_before;  // of its matches, before its step
  };

  // The error of an iteration's pose is known when the next iteration has found its matches.
  int best_iteration() const {
    const auto last = static_cast<int>(iterations_.size());
    int best = last - cycle_->length;
    for (int i = best + 1; i < last; ++i) {
      if (iterations_[i].mse_before < iterations_[best].mse_before) best = i;
    }
    return best;
  }

  detail::MatchHistory history_;
  std::optional<MatchCycle> cycle_;
  std::vector<Known> iterations_;
};

// All work is done in a frame centred on the target, with the source brought near it
// by the initial pose, so that coordinates far from the origin cost no precision.
class IcpAlignment {
 public:
  IcpAlignment(const PointSet& source, const PointSet& target, const IcpOptions& options,
               const Execution& execution)
      : options_(options),
        execution_(execution),
        centre_(central_part(target.positions).centre),
        centred_from_source_(Rigid3(Eigen::Quaterniond::Identity(), -centre_) * options.initial),
        source_(moved_points(source.positions, centred_from_source_)),
        target_(moved_points(target.positions, Rigid3(Eigen::Quaterniond::Identity(), -centre_))),
        target_tree_(target_),
        source_confidences_(source.confidences),
        target_confidences_(target.confidences) {
    if (options.reciprocal || options.overlap_radius) source_tree_.emplace(source_);
    if (options.weight_by_source_confidence) weights_ = non_negative(source.confidences);
  }

  RegistrationResult run() const {
    RegistrationResult result;
    const Correspondence find_any_matches = correspondence();
    const auto find_matches = [&](std::span<const Eigen::Vector3d> moved_source,
                                  const Rigid3& pose) {
      std::vector<Match> matches = find_any_matches(moved_source, pose);
      // A match of weight 0 does not affect the pose.
      if (!weights_.empty()) {
        std::erase_if(matches, [&](const Match& match) { return weights_[match.source] == 0.0; });
      }
      return matches;
    };
    const PointToPointEstimation estimate_step(target_, weights_);
    const PclCriteria as_pcl{options_.max_iterations, options_.mse_change_threshold};
    Repetition repetition;
    const auto converged = [&](const IterationState& state) -> std::optional<StopReason> {
      if (const auto reason = as_pcl(state)) return reason;
      if (!options_.stop_at_repetition || !repetition.cycle()) return {};
      return repetition.cycle()->length == 1 ? StopReason::kFixedPoint : StopReason::kCycle;
    };
    // The score reuses the matches' queries, because it needs neighbours of the same points.
    BatchTree::Batch& queries = find_any_matches.source_queries();
    result.initial_score = score(Rigid3(), queries);
    Rigid3 start;
    if (options_.coarse_to_fine) {
      const detail::CoarseAlignment coarse = align_samples();
      start = coarse.target_from_source;
      result.coarse_iterations = coarse.iterations;
    }
    IcpRun run = run_icp(source_, start, find_matches, estimate_step, converged, execution_.stop,
                         [&](Iteration iteration) {
                           repetition.add(iteration);
                           result.history.push_back(record(std::move(iteration), queries));
                           report_progress(result.history.size());
                         });
    result.iterations = run.iterations;
    result.stop_reason = run.stop_reason;
    result.repetition = repetition.result();
    if (run.stop_reason == StopReason::kCycle) run.target_from_source = repetition.best_pose();
    result.target_from_source = uncentred(run.target_from_source);
    // One after another, because each needs most of the memory for large maps.
    describe_fit(run.target_from_source, queries, result);
    const Points moved_source = moved_points(source_, run.target_from_source);
    result.matches = find_matches(moved_source, run.target_from_source);
    describe_uncertainty(run.target_from_source, moved_source, result);
    return result;
  }

 private:
  Correspondence correspondence() const {
    std::optional<ConfidentSet<BatchTree>> source;
    if (options_.reciprocal) source.emplace(*source_tree_, source_, source_confidences_);
    return {target_set(), source, options_, execution_.executor};
  }

  ConfidentSet<BatchTree> target_set() const {
    return {target_tree_, target_, target_confidences_};
  }

  detail::CoarseAlignment align_samples() const {
    return detail::align_samples({source_, source_confidences_, weights_}, target_set(), options_,
                                 execution_);
  }

  // centred_target_from_centred_source as target_from_source.
  Rigid3 uncentred(const Rigid3& pose) const {
    return Rigid3(Eigen::Quaterniond::Identity(), centre_) * pose * centred_from_source_;
  }

  std::optional<double> score(const Rigid3& pose, BatchTree::Batch& queries) const {
    return fitness_score(nearest_squared_distances(source_, pose, queries, execution_.executor));
  }

  IterationRecord record(Iteration iteration, BatchTree::Batch& queries) const {
    IterationRecord result;
    result.target_from_source = uncentred(iteration.target_from_source);
    result.mean_squared_distance = iteration.mean_squared_distance;
    result.match_count = iteration.matches.size();
    if (options_.trace) {
      result.score = score(iteration.target_from_source, queries);
      result.matches = std::move(iteration.matches);
    }
    return result;
  }

  void report_progress(std::size_t iterations) const {
    if (!execution_.progress) return;
    execution_.progress(static_cast<double>(iterations) / options_.max_iterations);
  }

  void describe_fit(const Rigid3& pose, BatchTree::Batch& queries,
                    RegistrationResult& result) const {
    const std::vector<double> distances =
        nearest_squared_distances(source_, pose, queries, execution_.executor);
    result.score = fitness_score(distances);
    if (options_.overlap_radius) {
      const std::vector<double> back =
          nearest_squared_distances(target_, pose.inverse(), *source_tree_, execution_.executor);
      result.overlap = Overlap{*share_within(distances, *options_.overlap_radius),
                               *share_within(back, *options_.overlap_radius)};
    }
  }

  void describe_uncertainty(const Rigid3& pose, const Points& moved_source,
                            RegistrationResult& result) const {
    PoseUncertainty uncertainty =
        pose_uncertainty(pose, moved_source, target_, result.matches, weights_);
    result.unobservable = std::move(uncertainty.unobservable);
    if (!uncertainty.covariance) return;
    // That of the centred pose, whose translation differs from target_from_source's by
    // R·centred_from_source.translation() + centre: a rotation error acts on that arm too.
    result.covariance = covariance_at_point(
        *uncertainty.covariance,
        Eigen::Vector3d(pose.quaternion() * centred_from_source_.translation()));
  }

  const IcpOptions& options_;
  const Execution& execution_;
  Eigen::Vector3d centre_;
  Rigid3 centred_from_source_;
  Points source_;
  Points target_;
  BatchTree target_tree_;
  std::optional<BatchTree> source_tree_;
  std::span<const double> source_confidences_;
  std::span<const double> target_confidences_;
  std::vector<double> weights_;
};

std::string sentence(const RegistrationResult& result, std::size_t source_size,
                     std::size_t target_size) {
  const std::string iterations = result.coarse_iterations == 0
                                     ? fmt::format("{} iterations", result.iterations)
                                     : fmt::format("{} iterations, {} on samples before them",
                                                   result.iterations, result.coarse_iterations);
  switch (result.stop_reason) {
    case StopReason::kMseChange:
      return fmt::format("converged after {}: the mean squared match distance settled", iterations);
    case StopReason::kNoMotion:
      return fmt::format("converged after {}: nothing moved any more", iterations);
    case StopReason::kFixedPoint:
      return fmt::format("converged after {}: the matches settled", iterations);
    case StopReason::kCycle:
      return fmt::format(
          "stopped after {}: from iteration {} on the matches repeat every {}; taken is "
          "the best of the poses in that cycle, after iteration {}",
          iterations, result.repetition->cycle.first, result.repetition->cycle.length,
          result.repetition->best_iteration);
    case StopReason::kIterationLimit:
      return fmt::format("stopped at the limit of {}", iterations);
    case StopReason::kCancelled:
      return fmt::format("cancelled after {}", iterations);
    case StopReason::kTimeLimit:  // does not occur here
    case StopReason::kTooFewMatches:
      break;
  }
  if (source_size == 0 || target_size == 0) {
    return fmt::format("the {} has no landmarks to align", source_size == 0 ? "source" : "target");
  }
  return fmt::format("fewer than {} matches between {} source and {} target landmarks",
                     kFewestMatches, source_size, target_size);
}

}  // namespace

constexpr OptionField kIcpFields[] = {
    {"k", option_at<&IcpOptions::k>, kAtLeastOne, "-k,--neighbors",
     "With icp: match a source landmark to the most confident of this many nearest target "
     "landmarks"},
    {"max_iterations", option_at<&IcpOptions::max_iterations>, kAtLeastOne, "--max-iterations",
     "Largest number of iterations"},
    {"mse_change_threshold", option_at<&IcpOptions::mse_change_threshold>, kNotNegative},
    {"stop_at_repetition", option_at<&IcpOptions::stop_at_repetition>, kAny, "!--stop-as-pcl",
     "With icp: stop as PCL does, when the mean squared distance converges or at the "
     "iteration limit, not when the matches repeat"},
    {"coarse_to_fine", option_at<&IcpOptions::coarse_to_fine>, kAny, "--fast",
     "With icp: align growing samples of the maps first; faster, but may converge to "
     "another optimum"},
    {"max_distance", option_at<&IcpOptions::max_distance>, kPositive, "--max-distance",
     "With icp: largest distance of a match, in the maps' unit (default: unlimited)"},
    {"reciprocal", option_at<&IcpOptions::reciprocal>, kAny, "--reciprocal",
     "With icp: keep only mutual nearest neighbours"},
    {"trimmed_fraction",
     option_at<&IcpOptions::trimmed_fraction>,
     {.least = 0.0,
      .most = 1.0,
      .expected = "a share from 0 to below 1",
      .most_is = OptionRange::End::kExcluded},
     "--trim",
     "With icp: share of the matches to leave out, those with the largest distances"},
    {"weight_by_source_confidence", option_at<&IcpOptions::weight_by_source_confidence>, kAny,
     "--weight-by-confidence",
     "With icp: weight each match by the confidence of its source landmark"},
    {"overlap_radius", option_at<&IcpOptions::overlap_radius>, kPositive},
    {"trace", option_at<&IcpOptions::trace>},
};
constinit const OptionTable IcpOptions::table = {"IcpOptions", kIcpFields};

void IcpOptions::validate() const {
  const std::string defect(coordinate_defect(initial));
  detail::require(defect.empty(), "IcpOptions.initial", defect,
                  "a rigid transform, coordinates from -1e9 to 1e9");
  check_options(*this);
}

RegistrationResult icp(const PointSet& source, const PointSet& target, const IcpOptions& options,
                       const Execution& execution) {
  const auto start = std::chrono::steady_clock::now();
  options.validate();
  check_points(source, "source");
  check_points(target, "target");
  refuse_if(options.weight_by_source_confidence && source.confidences.empty() &&
                !source.positions.empty(),
            "IcpOptions.weight_by_source_confidence", "the source has no confidences",
            "one a point");
  RegistrationResult result;
  result.target_from_source = options.initial;
  if (!source.positions.empty() && !target.positions.empty()) {
    result = IcpAlignment(source, target, options, execution).run();
  }
  result.status = status_of(result.stop_reason);
  result.reason = sentence(result, source.positions.size(), target.positions.size());
  result.duration_s =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return result;
}

RegistrationResult icp(const LandmarkMap& source, const LandmarkMap& target,
                       const std::optional<Metric>& metric, const IcpOptions& options,
                       const PointSetOptions& point_options, const Execution& execution) {
  return icp(point_set(source, metric, point_options), point_set(target, metric, point_options),
             options, execution);
}

}  // namespace cairn
