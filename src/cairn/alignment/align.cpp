// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/alignment/align.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <iterator>
#include <numbers>
#include <span>
#include <string_view>
#include <utility>

#include <fmt/format.h>

#include "cairn/alignment/bends.hpp"
#include "cairn/alignment/detail/bends/by_parts.hpp"
#include "cairn/alignment/detail/bends/map_parts.hpp"
#include "cairn/alignment/detail/evidence/verdict.hpp"
#include "cairn/alignment/detail/prepared_cloud.hpp"
#include "cairn/alignment/detail/refinement/widen.hpp"
#include "cairn/alignment/detail/search/placement.hpp"
#include "cairn/core/detail/require.hpp"
#include "cairn/core/error.hpp"
#include "cairn/geometry/angles.hpp"
#include "cairn/geometry/covariance.hpp"
#include "cairn/geometry/decompositions.hpp"
#include "cairn/geometry/detail/central_part.hpp"
#include "cairn/geometry/detail/pose_distance.hpp"
#include "cairn/map/operations.hpp"
#include "cairn/map/splats.hpp"
#include "cairn/pose_graph/optimise_poses.hpp"
#include "cairn/registration/neighbors/batch_tree.hpp"

namespace cairn {
namespace {

using namespace detail;

constexpr double kPriorDeviations = 3.0;  // largest error of a prior pose, in standard deviations

IcpOptions icp_of(const AlignOptions& options) {
  IcpOptions icp = options.icp;
  if (options.prior) icp.initial = options.prior->target_from_source.rigid();
  icp.overlap_radius = options.overlap_radius;
  icp.trace = options.trace;
  return icp;
}

// Root mean square displacement of the landmarks by the prior's error.
double displacement(const PosePrior& prior, const PreparedCloud& source) {
  double sum = 0.0;
  for (const Eigen::Vector3d& position : source.landmarks().positions) {
    // For the left perturbation (t + δt, Exp(δφ)·R), which rotates about the source's origin.
    const Eigen::Vector3d arm = prior.target_from_source.linear() * (source.centre() + position);
    Eigen::Matrix<double, 3, 6> jacobian;
    jacobian << Eigen::Matrix3d::Identity(), -skew(arm);
    sum += (jacobian * *prior.covariance * jacobian.transpose()).trace();
  }
  const std::size_t count = std::max<std::size_t>(source.size(), 1);
  return std::sqrt(sum / static_cast<double>(count));
}

RegistrationResult refined(const PreparedMap& source, const PreparedMap& target,
                           const AlignOptions& options, const Execution& execution) {
  const PosePrior& prior = *options.prior;
  RefineOptions refinement;
  refinement.initial = prior.target_from_source.rigid();
  if (options.scale) refinement.scale = prior.target_from_source.scale();
  if (prior.covariance) {
    const double off = kPriorDeviations * displacement(prior, source.cloud());
    if (off > 0.0) refinement.coarse = off;
    refinement.by_icp_too = false;
  }
  refinement.one_to_one = options.one_to_one;
  refinement.max_iterations = options.icp.max_iterations;
  refinement.overlap_radius = options.overlap_radius;
  refinement.trace = options.trace;
  return refine(source, target, refinement, execution);
}

// Joins the result of the refinement from the prior pose with that of the refinement at its end.
RegistrationResult joined(RegistrationResult way, RegistrationResult end) {
  end.initial_score = way.initial_score;
  end.iterations += way.iterations;
  way.history.insert(way.history.end(), std::make_move_iterator(end.history.begin()),
                     std::make_move_iterator(end.history.end()));
  end.history = std::move(way.history);
  return end;
}

// ICP's result with the covariance, open directions and overlap that the verdict uses.
RegistrationResult completed(RegistrationResult result, RegistrationResult held) {
  result.covariance = held.covariance;
  result.covariance_with_scale = held.covariance_with_scale;
  result.unobservable = std::move(held.unobservable);
  if (held.overlap) result.overlap = held.overlap;
  return result;
}

// The result for a pose that is not judged.
Alignment unjudged(RegistrationResult found) {
  Alignment alignment;
  alignment.registration = std::move(found);
  alignment.reason = alignment.registration.reason;
  take_pose(alignment);
  return alignment;
}

// Whether the result needs no judgement: not requested, cancelled, or without a pose.
bool is_final(const RegistrationResult& found, const AlignOptions& options) {
  return !options.judge || found.status == RegistrationStatus::kCancelled || !found.has_pose();
}

// @param found result of the method from the prior pose; std::nullopt: search for the pose
Alignment concluded(const PreparedMap& source, const PreparedMap& target,
                    const AlignOptions& options, const Execution& execution,
                    std::optional<RegistrationResult> found) {
  PreparedPair pair(source, target, options, execution);
  const bool by_icp = options.method == AlignMethod::kIcp;
  Alignment placed = !found   ? pair.place()
                     : by_icp ? pair.judge(found->similarity())
                              : pair.settle(found->similarity());
  // The search's candidates are already known, so checking whether it found a likelier pose costs little.
  const bool refuted =
      found && !by_icp && placed.verdict != Verdict::kAligned && !execution.stop.stop_requested();
  if (refuted) {
    Alignment everywhere = pair.place();
    if (everywhere.probability > placed.probability) {
      everywhere.reason =
          "the search found a likelier pose than the guess led to: " + everywhere.reason;
      placed = std::move(everywhere);
    }
  }
  if (found) {
    RegistrationResult end = std::move(placed.registration);
    placed.registration = by_icp ? completed(std::move(*found), std::move(end))
                                 : joined(std::move(*found), std::move(end));
    take_pose(placed);
  }
  if (!options.judge || execution.stop.stop_requested()) {
    Alignment alignment = unjudged(std::move(placed.registration));
    alignment.radius = placed.radius;
    return alignment;
  }
  return placed;
}

Alignment judged_as_a_whole(const PreparedMap& source, const PreparedMap& target,
                            const Similarity3& pose, const AlignOptions& options,
                            const Execution& execution) {
  Alignment alignment = PreparedPair(source, target, options, execution).judge(pose);
  alignment.estimate = pose;
  if (alignment.target_from_source) alignment.target_from_source = pose;
  return alignment;
}

Alignment aligned_as_a_whole(const PreparedMap& source, const PreparedMap& target,
                             const AlignOptions& options, const Execution& execution) {
  if (!options.prior) return concluded(source, target, options, execution, std::nullopt);
  RegistrationResult found = refined(source, target, options, execution);
  if (is_final(found, options)) return unjudged(std::move(found));
  return concluded(source, target, options, execution, std::move(found));
}

// Keeps the estimate without a verdict, because a stopped stage may have missed decisive evidence.
Alignment cancelled(Alignment stopped) {
  Alignment alignment;
  alignment.estimate = stopped.estimate;
  alignment.centre = stopped.centre;
  alignment.radius = stopped.radius;
  alignment.registration = std::move(stopped.registration);
  alignment.registration.status = RegistrationStatus::kCancelled;
  alignment.registration.stop_reason = StopReason::kCancelled;
  alignment.reason = alignment.registration.reason = "cancelled before the alignment was complete";
  return alignment;
}

// Result of work() with its duration; cancelled if the caller asked to stop, at whatever stage.
template <class Work>
Alignment timed(const AlignOptions& options, const Execution& execution, const Work& work) {
  const auto start = std::chrono::steady_clock::now();
  Alignment alignment = work();
  if (execution.stop.stop_requested()) alignment = cancelled(std::move(alignment));
  alignment.deterministic = !options.time_limit_s;
  alignment.duration_s =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return alignment;
}

// "the source bends by 6.8 deg between keyframes 40 and 95 (...)".
std::string bend_text(const MapBend& bend, LengthUnit unit) {
  return fmt::format(
      "the {} bends by {:.1f} deg between keyframes {} and {} (landmarks of a part are up to "
      "{:.2g}{} from where this pose puts them)",
      to_string(bend.map), degrees(bend.rotation_rad), bend.first.value, bend.last.value,
      bend.displacement, unit == LengthUnit::kMetres ? " m" : "");
}

// Number of separately aligned parts, and of all parts.
std::string parts_text(const PartsAlignment& parts) {
  return fmt::format("{} of {} parts are aligned separately", parts.aligned, parts.parts.size());
}

// Whether a pose is near that of any part.
bool is_near_a_part(const PartsAlignment& parts, const Similarity3& pose,
                    const PreparedMap& source) {
  const PoseDistance distance = PoseDistance::of(source.cloud().landmarks().positions);
  const Eigen::Vector3d& centre = source.cloud().centre();
  const auto centred = [&](const Similarity3& one) {
    return one * Similarity3(Rigid3(Eigen::Quaterniond::Identity(), centre));
  };
  constexpr double kNear = 0.3;  // times the map's radius
  return std::any_of(parts.parts.begin(), parts.parts.end(), [&](const PartPose& part) {
    return part.target_from_source && distance(centred(*part.target_from_source), centred(pose)) <
                                          kNear * distance.radius * pose.scale();
  });
}

// The result for a pose that is not refined.
RegistrationResult held(const PreparedMap& source, const PreparedMap& target,
                        const AlignOptions& options, const Execution& execution,
                        const Similarity3& pose, Alignment& alignment) {
  RefineOptions refinement;
  refinement.initial = pose.rigid();
  if (options.scale) refinement.scale = pose.scale();
  refinement.hold = true;
  refinement.overlap_radius = options.overlap_radius;
  if (!refinement.overlap_radius && alignment.radius > 0.0) {
    refinement.overlap_radius = alignment.radius;
  }
  RegistrationResult result = refine(source, target, refinement, execution);
  result.initial_score = alignment.registration.initial_score;
  result.iterations = alignment.registration.iterations;
  result.history = std::move(alignment.registration.history);
  result.unobservable.clear();
  return result;
}

// Makes a pose the aligned one. The candidates of the unchanged maps share the remaining probability.
void take_aligned(const Similarity3& pose, double probability, Alignment& alignment) {
  alignment.verdict = Verdict::kAligned;
  alignment.probability = probability;
  for (PlacementCandidate& candidate : alignment.candidates) {
    candidate.probability *= 1.0 - probability;
  }
  PlacementCandidate own;
  own.target_from_source = pose.rigid();
  own.scale = pose.scale();
  own.probability = probability;
  alignment.candidates.insert(alignment.candidates.begin(), own);
  alignment.estimate = alignment.target_from_source = pose;
}

// Makes the consensus pose of the parts the result.
void take_consensus(const PreparedMap& source, const PreparedMap& target,
                    const AlignOptions& options, const Execution& execution, Alignment& alignment) {
  const PartsAlignment& parts = *alignment.parts;
  RegistrationResult result =
      held(source, target, options, execution, *parts.target_from_source, alignment);
  result.covariance = parts.covariance;
  result.covariance_with_scale = parts.covariance_with_scale;
  alignment.registration = std::move(result);
  alignment.reason = fmt::format("{} and agree up to a bend: {}; as a whole: {}", parts_text(parts),
                                 bend_text(*parts.bend, target.length_unit()), alignment.reason);
  take_aligned(*parts.target_from_source, parts.probability, alignment);
}

// "the maps are deformed against each other: directions differ by up to 3.1 deg, lengths by up to 12 % (...)".
std::string deformation_text(const MapDeformation& deformation) {
  return fmt::format(
      "the maps are deformed against each other: directions differ by up to {:.1f} deg, lengths by "
      "up to {:.0f} % ({} descriptor matches agree)",
      degrees(deformation.rotation_rad), 100.0 * (deformation.scale_ratio - 1.0),
      deformation.matches);
}

// Makes the single pose of deformed maps the result.
void take_deformed(const PreparedMap& source, const PreparedMap& target,
                   const AlignOptions& options, const Execution& execution,
                   const DeformedPose& pose, Alignment placed, Alignment& alignment) {
  RegistrationResult result =
      held(source, target, options, execution, pose.target_from_source, alignment);
  // Judged was another pose, that of the deformed source.
  const Eigen::Vector3d arm =
      pose.target_from_source.translation() - placed.registration.similarity().translation();
  result.covariance = covariance_at_point(*placed.registration.covariance, arm);
  if (const auto& with_scale = placed.registration.covariance_with_scale) {
    result.covariance_with_scale = covariance_at_point(*with_scale, arm);
  }
  widen(result, pose.spread);
  alignment.registration = std::move(result);
  alignment.reason = fmt::format("{}; as deformed: {}; undeformed: {}",
                                 deformation_text(pose.figures), placed.reason, alignment.reason);
  take_aligned(pose.target_from_source, *placed.probability, alignment);
}

// Maps of free scale, e.g. from images alone, may be deformed. States the deformation, and judges the maps as
// deformed.
// @return whether a single pose may fit
bool judge_deformed(const PreparedMap& source, const PreparedMap& target,
                    const AlignOptions& options, const Execution& execution, Alignment& alignment) {
  if (!alignment.verdict || !options.deformation || !options.scale || options.time_limit_s) {
    return true;
  }
  std::vector<Similarity3> starts;
  for (const PlacementCandidate& candidate : alignment.candidates) {
    starts.push_back(candidate.similarity());
  }
  const DeformablePair pair(source, target);
  const std::optional<DeformedPose> found = pair.fit(starts);
  if (!found || !found->is_clear()) return true;
  if (alignment.verdict == Verdict::kAligned) {
    alignment.deformation = found->figures;
    widen(alignment.registration, found->spread);
    if (found->is_small) {
      alignment.reason += "; " + deformation_text(found->figures);
      return true;
    }
    alignment.verdict = Verdict::kAmbiguous;
    alignment.target_from_source.reset();
    alignment.reason = fmt::format("no single pose fits, because {}; {}",
                                   deformation_text(found->figures), alignment.reason);
    return false;
  }
  Alignment placed = pair.judge(*found, options, execution);
  if (placed.verdict != Verdict::kAligned || !placed.registration.covariance) {
    return found->is_small;
  }
  if (const auto why = forbidden(found->target_from_source, options)) {
    alignment.reason += fmt::format("; {}, but {}", deformation_text(found->figures), *why);
    return found->is_small;
  }
  alignment.deformation = found->figures;
  take_deformed(source, target, options, execution, *found, std::move(placed), alignment);
  return true;
}

// Judges a result by placing the maps' parts separately.
// @param may_align false: the parts' poses are reported, but cannot align the maps
void judge_by_parts(const PreparedMap& source, const PreparedMap& target,
                    const AlignOptions& options, const Execution& execution, bool may_align,
                    Alignment& alignment) {
  if (!alignment.verdict || options.parts == PartsUse::kNever) return;
  const bool refused = alignment.verdict != Verdict::kAligned;
  const bool always = options.parts == PartsUse::kAlways;
  if (!always && (!refused || !may_align || options.time_limit_s)) return;
  PartsAlignment parts = place_by_parts(source, target, options, execution);
  if (parts.parts.empty()) return;
  alignment.parts = std::move(parts);
  const PartsAlignment& found = *alignment.parts;
  if (!may_align) return;
  if (found.consensus && found.covariance && refused) {
    if (const auto why = forbidden(*found.target_from_source, options)) {
      alignment.reason += fmt::format("; {}, but {}", parts_text(found), *why);
      return;
    }
    alignment.parts->confirmed = is_aligned_straightened(found, source, target, options, execution);
    if (*found.confirmed) return take_consensus(source, target, options, execution, alignment);
    alignment.reason +=
        fmt::format("; {}, but the map straightened by them is not aligned", parts_text(found));
    return;
  }
  const auto contradict = [&](std::string_view what) {
    alignment.verdict = Verdict::kAmbiguous;
    alignment.target_from_source.reset();
    alignment.reason =
        fmt::format("{} ({}); as a whole: {}", what, parts_text(found), alignment.reason);
  };
  if (found.contradictory) {
    contradict("the parts of the maps contradict each other");
  } else if (found.consensus && !refused) {
    if (!is_near_a_part(found, *alignment.estimate, source)) {
      contradict("the parts of the maps agree on another pose");
    } else {
      alignment.reason += "; its parts show that " + bend_text(*found.bend, target.length_unit());
    }
  }
}

// For maps that are refused at one scale: finds the scale of the source at which their descriptors decide.
void seek_other_scale(const PreparedMap& source, const PreparedMap& target,
                      const AlignOptions& options, const Execution& execution,
                      Alignment& alignment) {
  constexpr double kOther = 0.05;  // least relative difference of scales that are not one
  const auto described = [](const PreparedMap& map) {
    return map.cloud().landmarks().descriptors.has_value();
  };
  const bool refused = alignment.verdict && alignment.verdict != Verdict::kAligned;
  if (!refused || options.scale || options.time_limit_s || !described(source) ||
      !described(target)) {
    return;
  }
  AlignOptions placement = options;
  placement.search = PoseSearch::kNever;
  placement.scale = ScaleRange();
  const Alignment placed = PreparedPair(source, target, placement, execution).place();
  const double scale = placed.registration.scale;
  if (placed.verdict != Verdict::kAligned || std::abs(std::log(scale)) < kOther) return;
  alignment.other_scale = scale;
  alignment.reason +=
      fmt::format("; the descriptors agree on a pose that scales the source by {:.3g}", scale);
}

// Adds to the reason that many descriptors agree on another pose than the aligned one.
void note_second_pose(Alignment& alignment) {
  constexpr std::size_t kFewest = 20;
  constexpr double kLeastShare = 0.15;  // of those that agree with the pose
  constexpr double kTimesChance = 4.0;
  if (alignment.verdict != Verdict::kAligned || alignment.own != 0U) return;
  const PlacementCandidate& best = alignment.candidates.front();
  for (const PlacementCandidate& other : std::span(alignment.candidates).subspan(1)) {
    const auto& here = best.support.agreement;
    const auto& there = other.support.agreement;
    if (!here || !there || there->agreeing < kFewest) continue;
    const auto agreeing = static_cast<double>(there->agreeing);
    if (agreeing < kLeastShare * static_cast<double>(here->agreeing) ||
        agreeing < kTimesChance * there->expected) {
      continue;
    }
    const double turned = degrees(best.target_from_source.quaternion().angularDistance(
        other.target_from_source.quaternion()));
    alignment.reason += fmt::format(
        "; {} of {} descriptor matches agree on another pose, turned by {:.0f} deg: something "
        "stands in two "
        "places, or a map is folded",
        there->agreeing, there->matches, turned);
    return;
  }
}

std::vector<Eigen::Vector3d> positions_as_given(const PreparedCloud& cloud) {
  std::vector<Eigen::Vector3d> positions(cloud.size());
  for (std::uint32_t i = 0; i < cloud.size(); ++i) {
    positions[cloud.as_given(i)] = cloud.centre() + cloud.landmarks().positions[i];
  }
  return positions;
}

void note_one_map(std::span<const Eigen::Vector3d> source, std::span<const Eigen::Vector3d> target,
                  Alignment& alignment) {
  alignment.one_map = are_one_map(source, target);
  if (alignment.one_map) {
    alignment.reason += "; both maps are one map: that they align shows nothing";
  }
}

// Aligns or judges maps, also up to a deformation and by their parts. Deformation and parts can refuse a given pose,
// but not replace it.
// @param pose pose to judge; std::nullopt: find the pose
Alignment aligned(const PreparedMap& source, const PreparedMap& target, const AlignOptions& given,
                  const Execution& execution, const std::optional<Similarity3>& pose = {}) {
  AlignOptions options = given;
  options.scale = scale_range(options, source.length_unit(), target.length_unit());
  Alignment alignment = pose ? judged_as_a_whole(source, target, *pose, options, execution)
                             : aligned_as_a_whole(source, target, options, execution);
  alignment.centre = source.cloud().centre();
  if (source.cloud().size() == target.cloud().size()) {
    note_one_map(positions_as_given(source.cloud()), positions_as_given(target.cloud()), alignment);
  }
  const bool are_maps = source.parts() && target.parts();
  if (!are_maps || (pose && alignment.verdict != Verdict::kAligned)) return alignment;
  const Execution rest = execution.without_progress();
  const bool may_align = judge_deformed(source, target, options, rest, alignment);
  judge_by_parts(source, target, options, rest, may_align, alignment);
  if (!pose) seek_other_scale(source, target, options, rest, alignment);
  note_second_pose(alignment);
  return alignment;
}

PreparedMap prepared(const LandmarkMap& map, const AlignOptions& options,
                     const Execution& execution) {
  return PreparedMap(map, {.confidence = options.confidence, .points = options.points}, execution);
}

Alignment aligned_by_icp(const LandmarkMap& source, const LandmarkMap& target,
                         const AlignOptions& options, const Execution& execution) {
  const PointSet points = point_set(source, options.confidence, options.points);
  const PointSet of_target = point_set(target, options.confidence, options.points);
  RegistrationResult found = icp(points, of_target, icp_of(options), execution);
  Alignment alignment;
  if (is_final(found, options)) {
    alignment = unjudged(std::move(found));
  } else {
    alignment =
        concluded(prepared(source, options, execution), prepared(target, options, execution),
                  options, execution, std::move(found));
  }
  note_one_map(points.positions, of_target.positions, alignment);
  if (!points.positions.empty()) alignment.centre = central_part(points.positions).centre;
  return alignment;
}

GravityPrior gravity_prior(const std::optional<Eigen::Vector3d>& source,
                           const std::optional<Eigen::Vector3d>& target) {
  GravityPrior gravity;
  gravity.source = source.value_or(gravity.source);
  gravity.target = target.value_or(gravity.target);
  return gravity;
}

}  // namespace

constexpr OptionField kAlignFields[] = {
    {"min_probability", option_at<&AlignOptions::min_probability>, kProbability,
     "--min-probability", "Least probability of an aligned pose, at least 0.5 and below 1"},
    {"prior_odds",
     option_at<&AlignOptions::prior_odds>,
     {.least = 1e-6, .most = 1e6, .expected = "from 1e-6 to 1e6"},
     "--prior-odds",
     "Odds that the maps show the same place, before any evidence; 0.01 if one pair in a "
     "hundred does"},
    {"effort",
     option_at<&AlignOptions::effort>,
     {.least = 1.0 / 16.0, .most = 64.0, .expected = "from 1/16 to 64"},
     "--effort",
     "Work of the search, as a multiple of the default's, 1/16 to 64"},
    {"time_limit_s",
     option_at<&AlignOptions::time_limit_s>,
     {.least = 0.0,
      .most = 1e6,
      .expected = "a positive number of at most 1e6",
      .least_is = OptionRange::End::kExcluded},
     "--time-limit",
     "Stop the search after this many seconds; the result then depends on the machine "
     "(default: no limit)"},
    {"min_observations",
     option_at<&AlignOptions::points, &PointSetOptions::min_observations>,
     {},
     "--min-observations",
     "Leave out landmarks with fewer observations"},
    {"one_to_one",
     option_at<&AlignOptions::one_to_one>,
     {},
     "--one-to-one",
     "With robust and --initial: match each target landmark at most once"},
    {"scale_where_free",
     option_at<&AlignOptions::scale_where_free>,
     {},
     "!--no-scale",
     "Estimate no scale, although the unit of a map is free"},
    {"deformation",
     option_at<&AlignOptions::deformation>,
     {},
     "!--no-deformation",
     "With --scale: look for no smooth deformation between the maps (default: maps with "
     "descriptors are aligned by one if they fit no other way, and the result states it)"},
    {"judge",
     option_at<&AlignOptions::judge>,
     {},
     "!--no-verdict",
     "Skip the verdict and print the method's pose, which may be wrong"},
    {"overlap_radius", option_at<&AlignOptions::overlap_radius>, kFinitePositive,
     "--overlap-radius",
     "A landmark overlaps if the other map has one within this distance, in the maps' "
     "unit (default: 0.05 for maps in metres; else no overlap is computed)"},
    {"trace",
     option_at<&AlignOptions::trace>,
     {},
     "--trace",
     "Write pose, score and matches of each iteration to the JSON"},
};
constinit const OptionTable AlignOptions::table = {"AlignOptions", kAlignFields};

void AlignOptions::validate() const {
  check_options(*this);
  detail::require(method != AlignMethod::kIcp || !scale, "AlignOptions.scale", "given with ICP",
                  "AlignMethod::kRobust");
  if (prior) {
    const double unit = prior->target_from_source.scale();
    detail::require(scale || std::abs(unit - 1.0) < 1e-9, "AlignOptions.prior.target_from_source",
                    fmt::format("scale {}", unit), "1, or AlignOptions.scale");
    if (prior->covariance) {
      const Matrix6d& covariance = *prior->covariance;
      const bool finite = covariance.allFinite();
      const bool symmetric =
          finite && (covariance - covariance.transpose()).norm() <= 1e-9 * covariance.norm();
      const bool valid =
          symmetric && symmetric_eigenvalues<6>(covariance)[0] >= -1e-9 * covariance.norm();
      detail::require(valid, "AlignOptions.prior.covariance", "no covariance",
                      "a symmetric matrix without negative eigenvalues");
    }
  }
  detail::require(!scale || (scale->least > 0.0 && std::isfinite(scale->least)),
                  "AlignOptions.scale.least", scale ? scale->least : 0.0, "a positive number");
  detail::require(!scale || (scale->most >= scale->least && std::isfinite(scale->most)),
                  "AlignOptions.scale.most", scale ? scale->most : 0.0,
                  "a number not below scale.least");
  if (gravity) {
    for (const Eigen::Vector3d& down : {gravity->source, gravity->target}) {
      detail::require(down.allFinite() && down.norm() > 0.0, "AlignOptions.gravity", "no direction",
                      "a vector downwards");
    }
    detail::require(gravity->max_tilt_rad > 0.0 && gravity->max_tilt_rad <= std::numbers::pi,
                    "AlignOptions.gravity.max_tilt_rad", gravity->max_tilt_rad,
                    "above 0 and at most pi");
  }
  icp_of(*this).validate();
}

std::optional<ScaleRange> scale_range(const AlignOptions& options, LengthUnit source,
                                      LengthUnit target) {
  const bool free = source == LengthUnit::kFree || target == LengthUnit::kFree;
  const bool estimated = free && options.scale_where_free && options.method == AlignMethod::kRobust;
  return !options.scale && estimated ? ScaleRange() : options.scale;
}

Alignment align(const LandmarkMap& source, const LandmarkMap& target, const AlignOptions& options,
                const Execution& execution) {
  options.validate();
  return timed(options, execution, [&] {
    return options.method == AlignMethod::kIcp
               ? aligned_by_icp(source, target, options, execution)
               : aligned(prepared(source, options, execution), prepared(target, options, execution),
                         options, execution);
  });
}

Alignment align(const PreparedMap& source, const PreparedMap& target, const AlignOptions& options,
                const Execution& execution) {
  options.validate();
  detail::require(options.method != AlignMethod::kIcp, "AlignOptions.method", "icp",
                  "kRobust for prepared maps");
  return timed(options, execution, [&] { return aligned(source, target, options, execution); });
}

Alignment judge_pose(const LandmarkMap& source, const LandmarkMap& target,
                     const Similarity3& target_from_source, const AlignOptions& options,
                     const Execution& execution) {
  options.validate();
  return timed(options, execution, [&] {
    return aligned(prepared(source, options, execution), prepared(target, options, execution),
                   options, execution, target_from_source);
  });
}

Alignment judge_pose(const PreparedMap& source, const PreparedMap& target,
                     const Similarity3& target_from_source, const AlignOptions& options,
                     const Execution& execution) {
  options.validate();
  return timed(options, execution,
               [&] { return aligned(source, target, options, execution, target_from_source); });
}

GravityPrior gravity_prior(const LandmarkMap& source, const LandmarkMap& target) {
  return gravity_prior(source.info().gravity, target.info().gravity);
}

GravityPrior gravity_prior(const PreparedMap& source, const PreparedMap& target) {
  return gravity_prior(source.gravity(), target.gravity());
}

void require_one_frame(const LandmarkMap& map, const LandmarkMap& model, const std::string& name) {
  constexpr double kNear = 0.02;  // of the model's radius
  constexpr double kLeastShare = 0.5;
  const std::vector<Eigen::Vector3d>& positions = model.landmarks().positions;
  reject_if(positions.empty(), name, "its model has no landmarks", "a model with landmarks");
  reject_if(splat_columns(model.landmarks().columns).has_value(), name,
            "its model is a Gaussian splat", "the SfM model that the splat was trained on");
  const double limit = kNear * node_extent(positions).radius;
  const BatchTree tree(map.landmarks().positions);
  std::array<Neighbor, 1> nearest;
  const auto near = std::ranges::count_if(positions, [&](const Eigen::Vector3d& x) {
    return tree.nearest(x, nearest, limit * limit) > 0;
  });
  const double share = static_cast<double>(near) / static_cast<double>(positions.size());
  if (share >= kLeastShare) return;
  throw Error(
      ErrorKind::kInput, name,
      fmt::format("{:.0f} % of its model's landmarks are near its own", 100.0 * share),
      fmt::format("at least {:.0f} %: a model in the same frame and unit. Is it the model of "
                  "another map, or does nerfstudio's dataparser_transforms.json beside the "
                  "map move it?",
                  100.0 * kLeastShare));
}

}  // namespace cairn
