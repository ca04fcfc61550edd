// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/alignment/detail/refinement/refine.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <span>
#include <tuple>
#include <utility>

#include <Eigen/Eigenvalues>
#include <fmt/format.h>

#include "cairn/alignment/detail/bends/map_drift.hpp"
#include "cairn/alignment/detail/refinement/robust_alignment.hpp"
#include "cairn/alignment/detail/refinement/widen.hpp"
#include "cairn/core/detail/require.hpp"
#include "cairn/core/error.hpp"
#include "cairn/geometry/covariance.hpp"
#include "cairn/geometry/limits.hpp"
#include "cairn/registration/icp.hpp"
#include "cairn/registration/score/fitness.hpp"

namespace cairn {
namespace {

using namespace detail;

// ICP's pose replaces the guess only if its objective is this many times larger. With little overlap, most poses have
// some matches, and the guess is more reliable.
constexpr double kClearlyBetter = 2.0;

// @param icp_iterations before the refinement; 0: it started at the initial pose
std::string sentence(const RegistrationResult& result, double finest, int icp_iterations) {
  if (result.iterations == 0 && result.stop_reason == StopReason::kNoMotion) {
    return fmt::format("held at the initial pose, at a kernel scale of {:.3g}", finest);
  }
  switch (result.stop_reason) {
    case StopReason::kNoMotion:
      return fmt::format(
          "converged after {} iterations{} at a kernel scale of {:.3g}", result.iterations,
          icp_iterations > 0 ? fmt::format(", the first {} by ICP,", icp_iterations) : "", finest);
    case StopReason::kCancelled:
      return fmt::format("cancelled after {} iterations", result.iterations);
    case StopReason::kTooFewMatches:
      return fmt::format("fewer than {} landmarks match", kFewestMatches);
    default:
      return fmt::format("stopped at the limit of {} iterations", result.iterations);
  }
}

// Exchanges source and target of matches: the closest match of each former target landmark, by ascending
// index.
// @param unit of the former source, in that of the former target
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

// Converts the result for a pose to that for its inverse.
void turn_round(const Similarity3& pose, RegistrationResult& result) {
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

// How a map drifts, and the scale that its cloud was multiplied by; null if unknown.
struct ScaledDrift {
  const MapDrift* drift = nullptr;
  Similarity3 scaling;
};

// Refinement of a pair, which moves one cloud. Scores and overlap are in the unit of the caller's target.
class Refinement {
 public:
  /// @param inverted moves the caller's target
  /// @param known    see refine_with_known(), of this source and target
  Refinement(const PreparedCloud& source, const PreparedCloud& target, bool inverted,
             const RefineOptions& options, KnownMatches known, const ScaledDrift& source_drift,
             const ScaledDrift& target_drift, const Execution& execution)
      : source_(source),
        target_(target),
        inverted_(inverted),
        options_(options),
        known_(std::move(known)),
        source_drift_(source_drift),
        target_drift_(target_drift),
        execution_(execution) {}

  void run(RegistrationResult& result) const;

 private:
  // One path to an optimum, in the centred frames.
  struct Path {
    RobustAlignment::Run run;
    int icp_iterations = 0;         // before the run
    int coarse_icp_iterations = 0;  // before these, on samples
    std::vector<IterationRecord> history;
    std::vector<Match> matches;
    double value = 0.0;  // of the objective
  };

  // @param path at the start of the run; continued
  void follow(const RobustAlignment& alignment, const KernelScales& kernel, Path& path) const;
  // The result of a path.
  void conclude(const RobustAlignment& alignment, const KernelScales& kernel, Path path,
                RegistrationResult& result) const;
  std::optional<Path> drawn_in(const Similarity3& initial) const;
  Similarity3 uncentred(const Similarity3& pose) const {
    return uncentred_pose(source_, target_, pose);
  }
  std::vector<double> from_source(const Similarity3& pose) const {
    return nearest_squared_distances(source_.landmarks().positions, pose, target_.tree(),
                                     execution_.executor);
  }
  std::vector<double> from_target(const Similarity3& pose) const {
    return nearest_squared_distances(target_.landmarks().positions, pose.inverse(), source_.tree(),
                                     execution_.executor);
  }
  // For the caller's source landmarks and the tree of the caller's target, also if inverted.
  std::vector<double> distances(const Similarity3& pose) const {
    return inverted_ ? from_target(pose) : from_source(pose);
  }
  KernelScales kernel() const;
  double finest_of(const KernelScales& kernel) const {
    return options_.finest.value_or(kFinest * kernel.fine);
  }
  double error_scale_of(const KernelScales& kernel) const {
    return options_.error_scale.value_or(std::min(kErrorScale * finest_of(kernel), kernel.fine));
  }
  IterationRecord record(RobustAlignment::Iteration iteration, std::size_t match_count) const;
  PoseUncertainty uncertainty_of_fit(const Similarity3& pose) const;
  // What the maps' drift adds to the covariance of an uncentred pose from these matches. The matches have indices of
  // the clouds, not of the caller.
  Matrix7d by_drift(const Similarity3& pose, double error_scale,
                    std::span<const Match> matches) const;

  // With the indices of the caller's landmarks.
  std::vector<Match> as_given(std::vector<Match> matches) const;

  PreparedCloud source_;
  PreparedCloud target_;
  bool inverted_;
  const RefineOptions& options_;
  KnownMatches known_;
  ScaledDrift source_drift_;
  ScaledDrift target_drift_;
  const Execution& execution_;
};

std::vector<Match> Refinement::as_given(std::vector<Match> matches) const {
  for (Match& match : matches) {
    match.source = source_.as_given(match.source);
    match.target = target_.as_given(match.target);
  }
  std::sort(matches.begin(), matches.end(),
            [](const Match& a, const Match& b) { return a.source < b.source; });
  return matches;
}

KernelScales Refinement::kernel() const {
  // Computed from the clouds only if the caller gave none.
  const KernelScales own =
      options_.fine && options_.coarse
          ? KernelScales{}
          : kernel_scales(cloud_scales(source_.landmarks(), source_.tree(), execution_.executor),
                          cloud_scales(target_.landmarks(), target_.tree(), execution_.executor));
  const double fine =
      options_.fine.value_or(std::min(own.fine, options_.coarse.value_or(own.fine)));
  return {.coarse = options_.coarse.value_or(std::max(own.coarse, fine)), .fine = fine};
}

IterationRecord Refinement::record(RobustAlignment::Iteration iteration,
                                   std::size_t match_count) const {
  const Similarity3 pose = uncentred(iteration.target_from_source);
  const Similarity3 callers = inverted_ ? pose.inverse() : pose;
  const double unit = inverted_ ? pose.scale() : 1.0;
  IterationRecord record;
  record.target_from_source = callers.rigid();
  record.scale = callers.scale();
  record.mean_squared_distance = iteration.mean_squared_distance / (unit * unit);
  record.match_count = match_count;
  if (options_.trace) {
    record.score = fitness_score(distances(iteration.target_from_source));
    record.matches = as_given(std::move(iteration.matches));
    if (inverted_) record.matches = turned_round(record.matches, unit);
  }
  return record;
}

// ICP on samples first, which reaches the same pose as plain ICP in less time; std::nullopt if it fails.
std::optional<Refinement::Path> Refinement::drawn_in(const Similarity3& initial) const {
  IcpOptions drawing;
  drawing.initial = initial.rigid();
  drawing.k = 1;
  drawing.max_iterations = options_.max_iterations;
  drawing.coarse_to_fine = true;
  drawing.trace = options_.trace;
  RegistrationResult result =
      icp(PointSet{.positions = source_.landmarks().positions, .confidences = {}},
          PointSet{.positions = target_.landmarks().positions, .confidences = {}}, drawing,
          execution_.without_progress());
  if (!result.has_pose()) return std::nullopt;
  Path path;
  path.run.target_from_source = Similarity3(1.0, result.target_from_source);
  path.icp_iterations = result.iterations;
  path.coarse_icp_iterations = result.coarse_iterations;
  for (IterationRecord& one : result.history) {
    path.history.push_back(record({Similarity3(1.0, one.target_from_source),
                                   one.mean_squared_distance, std::move(one.matches)},
                                  one.match_count));
  }
  return path;
}

void Refinement::follow(const RobustAlignment& alignment, const KernelScales& kernel,
                        Path& path) const {
  path.run = alignment.run(
      path.run.target_from_source,
      {.coarse = kernel.coarse,
       .fine = kernel.fine,
       .finest = finest_of(kernel),
       .max_iterations = options_.max_iterations,
       .free_scale = options_.scale.has_value()},
      execution_.stop, [&](RobustAlignment::Iteration iteration) {
        const std::size_t count = iteration.matches.size();
        path.history.push_back(record(std::move(iteration), count));
        if (execution_.progress) {
          const auto done = static_cast<int>(path.history.size()) - path.icp_iterations;
          execution_.progress(static_cast<double>(done) / options_.max_iterations);
        }
      });
  path.matches = alignment.matches(path.run.target_from_source);
  path.value = alignment.value(path.run.target_from_source, finest_of(kernel), path.matches);
}

void Refinement::run(RegistrationResult& result) const {
  const KernelScales scales = kernel();
  const RobustAlignment alignment(source_, target_, options_.one_to_one, execution_.executor);
  const bool free_scale = options_.scale.has_value();
  const Similarity3 initial =
      centred_pose(source_, target_, inverted_ ? options_.initial.inverse() : options_.initial);
  result.initial_score = fitness_score(distances(initial));
  Path path;
  path.run.target_from_source = initial;
  if (options_.hold) {
    path.run.stop_reason = StopReason::kNoMotion;
    path.matches = alignment.matches(initial);
    return conclude(alignment, scales, std::move(path), result);
  }
  follow(alignment, scales, path);
  if (options_.by_icp_too && !free_scale && path.run.stop_reason != StopReason::kCancelled) {
    if (auto other = drawn_in(initial)) {
      follow(alignment, scales, *other);
      if (other->value > kClearlyBetter * path.value) path = std::move(*other);
    }
  }
  conclude(alignment, scales, std::move(path), result);
}

// Uncertainty of the least-squares fit to the known matches, whose errors are independent and of one size.
PoseUncertainty Refinement::uncertainty_of_fit(const Similarity3& pose) const {
  // The variance is that of few residuals; so many fewer make the 95 % ellipsoid hold 95 % of the errors.
  constexpr double kFewer = 4.0;
  constexpr double kLeastInformation = 1e-6;  // of the largest, along any direction
  constexpr double kBestAccuracy = 1e-4;      // of any map, relative to the extent of its matches
  const bool free_scale = options_.scale.has_value();
  const int freedoms = free_scale ? 7 : 6;
  Matrix7d information = Matrix7d::Zero();
  double squares = 0.0;
  for (const Match& match : known_.pairs) {
    const Eigen::Vector3d arm = pose.linear() * source_.landmarks().positions[match.source];
    const auto jacobian = point_by_pose(arm);
    information += jacobian.transpose() * jacobian;
    squares +=
        (arm + pose.translation() - target_.landmarks().positions[match.target]).squaredNorm();
  }
  const double spare = 3.0 * static_cast<double>(known_.pairs.size()) - freedoms - kFewer;
  if (spare <= 0.0) return {};
  const double length = std::sqrt(information(6, 6) / information(0, 0));
  const Vector7d unit = length_units(length);
  const Matrix7d scaled = unit.asDiagonal() * information * unit.asDiagonal();
  const Eigen::MatrixXd used = scaled.topLeftCorner(freedoms, freedoms);
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(used);
  if (!(solver.eigenvalues()[0] > kLeastInformation * solver.eigenvalues()[freedoms - 1]))
    return {};
  Matrix7d covariance = Matrix7d::Zero();
  covariance.topLeftCorner(freedoms, freedoms) =
      std::max(squares / spare, std::pow(kBestAccuracy * length, 2)) * used.inverse();
  covariance = unit.asDiagonal() * covariance * unit.asDiagonal();
  PoseUncertainty result;
  result.covariance = covariance.topLeftCorner<6, 6>();
  if (free_scale) result.covariance_with_scale = covariance;
  return result;
}

Matrix7d Refinement::by_drift(const Similarity3& pose, double error_scale,
                              std::span<const Match> matches) const {
  const auto of_map = [&](const ScaledDrift& map, const Similarity3& to_target,
                          std::uint32_t Match::*landmark) -> Matrix7d {
    if (map.drift == nullptr) return Matrix7d::Zero();
    std::vector<MapDrift::Term> terms;
    terms.reserve(matches.size());
    for (const Match& match : matches) {
      const double kernel = 1.0 / (1.0 + match.squared_distance / (error_scale * error_scale));
      terms.push_back({match.*landmark,
                       target_.landmarks().positions[match.target] + target_.centre(),
                       kernel * kernel});
    }
    return map.drift->covariance(terms, to_target * map.scaling, pose.translation(),
                                 options_.scale.has_value());
  };
  return of_map(source_drift_, pose, &Match::source) + of_map(target_drift_, {}, &Match::target);
}

void Refinement::conclude(const RobustAlignment& alignment, const KernelScales& kernel, Path path,
                          RegistrationResult& result) const {
  const bool free_scale = options_.scale.has_value();
  const RobustAlignment::Run& run = path.run;
  result.history = std::move(path.history);
  const Similarity3& centred = run.target_from_source;
  const Similarity3 pose = uncentred(centred);
  result.iterations = path.icp_iterations + run.iterations;
  result.coarse_iterations = path.coarse_icp_iterations;
  result.stop_reason = run.stop_reason;
  result.target_from_source = pose.rigid();
  result.scale = pose.scale();
  result.matches = std::move(path.matches);
  const std::vector<double> there = distances(centred);
  result.score = fitness_score(there);
  if (options_.overlap_radius) {
    const double radius = *options_.overlap_radius;
    // The new distances are in the unit of the caller's source.
    const std::vector<double> back = inverted_ ? from_source(centred) : from_target(centred);
    const double unit = inverted_ ? pose.scale() : 1.0 / pose.scale();
    result.overlap = Overlap{*share_within(there, radius), *share_within(back, radius * unit)};
  }
  // Uncertainty exists only at an optimum. The caller's translation is that of the source's origin instead of its centre.
  if (run.stop_reason == StopReason::kNoMotion || run.stop_reason == StopReason::kIterationLimit) {
    PoseUncertainty uncertainty =
        alignment.uncertainty(centred, error_scale_of(kernel), result.matches, free_scale);
    std::span<const Match> matches = result.matches;
    if (known_.decide) {
      uncertainty = uncertainty_of_fit(centred);
      matches = known_.pairs;
    } else if (!uncertainty.covariance && !known_.pairs.empty()) {
      PoseUncertainty told =
          alignment.uncertainty(centred, error_scale_of(kernel), known_.pairs, free_scale, true);
      if (told.covariance) {
        uncertainty = std::move(told);
        matches = known_.pairs;
      }
    }
    result.unobservable = std::move(uncertainty.unobservable);
    if (uncertainty.covariance_with_scale) {
      const Matrix7d covariance = covariance_at_point(*uncertainty.covariance_with_scale,
                                                      -(centred.linear() * source_.centre()));
      result.covariance_with_scale = covariance;
      result.covariance = covariance.topLeftCorner<6, 6>();
    } else if (uncertainty.covariance) {
      result.covariance = covariance_at_point(*uncertainty.covariance,
                                              -(centred.rigid().quaternion() * source_.centre()));
    }
    if (result.covariance) widen(result, by_drift(pose, error_scale_of(kernel), matches));
  }
  result.matches = as_given(std::move(result.matches));
  result.reason = sentence(result, finest_of(kernel), path.icp_iterations);
  if (inverted_) turn_round(pose, result);
}

}  // namespace

void RefineOptions::validate() const {
  const auto require = [](bool valid, std::string_view field, const auto& value,
                          std::string_view expected) {
    detail::require(valid, fmt::format("RefineOptions.{}", field), value, expected);
  };
  const auto require_length = [&](const std::optional<double>& length, std::string_view field) {
    require(!length || (*length > 0.0 && std::isfinite(*length)), field, length.value_or(0.0),
            "a positive number");
  };
  const std::string_view defect = coordinate_defect(initial);
  require(defect.empty(), "initial", defect, "a rigid transform, coordinates from -1e9 to 1e9");
  require_length(scale, "scale");
  require_length(coarse, "coarse");
  require_length(fine, "fine");
  require(!coarse || !fine || *fine <= *coarse, "fine", fine.value_or(0.0), "at most coarse");
  require_length(finest, "finest");
  require(!finest || !fine || *finest <= *fine, "finest", finest.value_or(0.0), "at most fine");
  require_length(error_scale, "error_scale");
  require(max_iterations >= 1, "max_iterations", max_iterations, "at least 1");
  require_length(overlap_radius, "overlap_radius");
}

namespace {

RegistrationResult refined(const PreparedCloud& source, const PreparedCloud& target,
                           const RefineOptions& options, const Execution& execution,
                           KnownMatches known = {}, const MapDrift* source_drift = nullptr,
                           const MapDrift* target_drift = nullptr) {
  const auto start = std::chrono::steady_clock::now();
  RegistrationResult result;
  result.target_from_source = options.initial;
  result.scale = options.scale.value_or(1.0);
  if (std::min(source.size(), target.size()) < kFewestMatches) {
    result.reason = fmt::format("{} source and {} target landmarks: at least {} of each are needed",
                                source.size(), target.size(), kFewestMatches);
  } else {
    // Scales the source first, so that the scale to be estimated is about 1.
    const double scale = options.scale.value_or(1.0);
    const PreparedCloud moving = source.scaled_plainly(scale);
    // Moves the smaller map, because landmarks of the larger one outside the overlap would bias the pose.
    const bool inverted = moving.extent() > target.extent();
    if (inverted) {
      for (Match& match : known.pairs) std::swap(match.source, match.target);
    }
    ScaledDrift of_moving{source_drift, Similarity3(scale, Rigid3())};
    ScaledDrift of_target{target_drift, Similarity3()};
    if (inverted) std::swap(of_moving, of_target);
    Refinement(inverted ? target : moving, inverted ? moving : target, inverted, options,
               std::move(known), of_moving, of_target, execution)
        .run(result);
    result.scale *= scale;  // run() estimated the scale of the scaled source
    for (IterationRecord& record : result.history) record.scale *= scale;
  }
  result.status = status_of(result.stop_reason);
  result.duration_s =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return result;
}

}  // namespace

RegistrationResult refine(const LandmarkCloud& source, const LandmarkCloud& target,
                          const RefineOptions& options, const Execution& execution) {
  options.validate();
  source.validate("source");
  target.validate("target");
  return refined(PreparedCloud::plain(source), PreparedCloud::plain(target), options, execution);
}

RegistrationResult refine(const PreparedMap& source, const PreparedMap& target,
                          const RefineOptions& options, const Execution& execution) {
  options.validate();
  return refined(source.cloud(), target.cloud(), options, execution, {}, source.drift().get(),
                 target.drift().get());
}

RegistrationResult detail::refine_with_known(const PreparedMap& source, const PreparedMap& target,
                                             const RefineOptions& options, KnownMatches known,
                                             const Execution& execution) {
  options.validate();
  return refined(source.cloud(), target.cloud(), options, execution, std::move(known),
                 source.drift().get(), target.drift().get());
}

}  // namespace cairn
