// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/alignment/detail/search/placement.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <ranges>

#include <fmt/format.h>

#include "cairn/alignment/detail/evidence/verdict.hpp"
#include "cairn/alignment/detail/refinement/robust_alignment.hpp"
#include "cairn/geometry/angles.hpp"
#include "cairn/geometry/similarity3.hpp"

namespace cairn::detail {
namespace {

constexpr int kFinalIterations = 60;
// Shares of the time limit for the stages; the last refinement has the rest.
constexpr double kQuadTime = 0.1;
constexpr double kSearchTime = 0.5;
constexpr double kConstellationTime = 0.65;
constexpr double kCandidatesTime = 0.85;
// In units of the fine scale:
constexpr double kEqual = 0.35;    // largest distance of equal optima
constexpr double kDistinct = 3.0;  // least distance of poses that a user would call different

// Shuffles the rotations, so that the first ones are spread evenly.
void shuffle(std::vector<Eigen::Quaterniond>& rotations, Random& random) {
  for (std::size_t i = rotations.size(); i > 1; --i) {
    std::swap(rotations[i - 1], rotations[random.index(i)]);
  }
}

std::vector<Eigen::Quaterniond> rotations(const AlignOptions& options, Random random) {
  constexpr double kRotations = 2304;  // at effort 1: about 19 degrees apart
  constexpr double kTurns = 72;        // and about a known vertical: 5 degrees apart
  std::vector<Eigen::Quaterniond> all;
  if (options.gravity) {
    all = rotations_about(options.gravity->source, options.gravity->target,
                          static_cast<std::size_t>(std::ceil(kTurns * options.effort)));
  } else {
    // A random rotation, so that each seed searches other rotations.
    // Drawn one by one: compilers differ in the order of arguments.
    std::array<double, 4> wxyz;
    for (double& number : wxyz | std::views::reverse) number = random.normal();
    Eigen::Quaterniond turn(wxyz[0], wxyz[1], wxyz[2], wxyz[3]);
    turn.normalize();
    all = all_rotations(static_cast<std::size_t>(std::ceil(kRotations * options.effort)));
    for (Eigen::Quaterniond& rotation : all) rotation = turn * rotation;
  }
  if (options.time_limit_s) shuffle(all, random);
  return all;
}

// Angle between both downward directions.
double tilt(const Rigid3& pose, const GravityPrior& gravity) {
  const Eigen::Vector3d down = pose.quaternion() * gravity.source;
  return std::atan2(down.cross(gravity.target).norm(), down.dot(gravity.target));
}

bool is_tilted(const Rigid3& pose, const AlignOptions& options) {
  return options.gravity && tilt(pose, *options.gravity) > options.gravity->max_tilt_rad;
}

// Whether a scale is outside the requested range. Its inverse is outside the inverse range then.
bool has_other_scale(double scale, const AlignOptions& options) {
  constexpr double kScaleMargin = 0.03;  // of the range's ends, because scales are not exact
  if (!options.scale) return false;
  const auto [least, most] = *options.scale;
  return scale * (1.0 + kScaleMargin) < least || scale > most * (1.0 + kScaleMargin);
}

}  // namespace

std::optional<std::string> forbidden(const Similarity3& target_from_source,
                                     const AlignOptions& options) {
  if (is_tilted(target_from_source.rigid(), options)) {
    return fmt::format(
        "the pose tilts the source's gravity by {:.1f} deg against the target's: at most {:.1f} "
        "deg are allowed",
        degrees(tilt(target_from_source.rigid(), *options.gravity)),
        degrees(options.gravity->max_tilt_rad));
  }
  if (has_other_scale(target_from_source.scale(), options)) {
    return fmt::format("the pose has a scale of {:.4g}: from {:.4g} to {:.4g} is allowed",
                       target_from_source.scale(), options.scale->least, options.scale->most);
  }
  return std::nullopt;
}

void set_similarity(PlacementCandidate& candidate, const Similarity3& pose) {
  candidate.target_from_source = pose.rigid();
  candidate.scale = pose.scale();
}

Placement::Placement(const PreparedCloud& source, const PreparedCloud& target,
                     std::vector<double> scales, std::optional<double> equal,
                     const AlignOptions& options, const Execution& execution,
                     std::span<const DescriptorMatch> identities)
    : options_(options),
      execution_(execution),
      scales_(std::move(scales)),
      equal_(equal),
      source_(source),
      target_(target),
      support_(source, target, PreparedCloud::kSample, Random(execution.seed).fork(5)),
      matches_(source.landmarks(), target.landmarks(), identities),
      all_{source.scales(), target.scales()},
      sample_{source.sample_scales(), target.sample_scales()},
      distance_(PoseDistance::of(source_.landmarks().positions)) {}

Finalist Placement::assessed(const Similarity3& pose, std::size_t partners) const {
  Finalist result;
  set_similarity(result, pose);
  const double radius = kMatched * fine(pose.scale());
  result.support = support_(pose, radius, &result.proximity);
  if (matches_.possible()) result.support.agreement = matches_.agreement(pose, radius, partners);
  return result;
}

double Placement::merit(const PlacementCandidate& pose) {
  constexpr double kSupport = 50.0;
  const Support& support = pose.support;
  return support.spread_evidence + support.spread_likeness + agreement_evidence(support) +
         contrast_evidence(support) + kSupport * support.share;
}

std::vector<Finalist> Placement::with_probabilities(std::vector<Finalist> poses) const {
  constexpr std::size_t kFewestSights = 200;  // lines of sight for a free-space check
  for (Finalist& pose : poses) {
    std::vector<const Proximity*> others;
    for (const Finalist& other : poses) {
      if (&other != &pose) others.push_back(&other.proximity);
    }
    pose.support.proximity = proximity_evidence(pose.proximity, others);
    const SightCounts sight = sights(pose.similarity());
    if (sight.total() >= kFewestSights) {
      pose.contradicted = static_cast<double>(sight.in_front) / static_cast<double>(sight.total());
    }
  }
  const std::vector<PlacementCandidate> candidates(poses.begin(), poses.end());
  const std::vector<double> likely = probabilities(candidates, options_.prior_odds);
  for (std::size_t i = 0; i < poses.size(); ++i) poses[i].probability = likely[i];
  std::stable_sort(poses.begin(), poses.end(), [](const Finalist& a, const Finalist& b) {
    return a.probability > b.probability;
  });
  return poses;
}

bool Placement::allows(const Finalist& pose) const {
  return !is_tilted(pose.target_from_source, options_) && !has_other_scale(pose.scale, options_);
}

Finalist Placement::settled(const Similarity3& pose, const std::stop_token& stop) const {
  std::vector<Finalist> one(1);
  set_similarity(one.front(), pose);
  refine_all(one, all_, PreparedCloud::kSample, kFinalIterations, stop);
  return one.front();
}

bool Placement::near(const Finalist& a, const Finalist& b) const {
  return distance_(a.similarity(), b.similarity()) < kDistinct * fine(b.scale);
}

std::pair<std::optional<Finalist>, double> Placement::better_near(
    const std::vector<Finalist>& poses, const Finalist& pose) const {
  std::pair<std::optional<Finalist>, double> better = {std::nullopt, 0.0};
  for (const Finalist& other : poses) {
    const double off = distance_(other.similarity(), pose.similarity());
    if (!near(other, pose) || off < kEqual * fine(pose.scale)) continue;
    if (merit(pose) >= kKeptMerit * merit(other)) continue;
    if (!better.first || merit(other) > merit(*better.first)) better = {other, off};
  }
  return better;
}

std::optional<Finalist> Placement::of_mirror_image(const std::stop_token& stop) const {
  AlignOptions options = options_;
  options.gravity.reset();
  const Placement mirror(source_.mirrored(), target_, scales_, equal_, options, execution_);
  constexpr std::size_t kMost = 6;
  std::vector<Finalist> poses;
  for (const QuadPose& quad : mirror.quads(stop)) {
    if (poses.size() == kMost) break;
    poses.emplace_back();
    set_similarity(poses.back(), quad.target_from_source);
  }
  mirror.refine_all(poses, mirror.all_, PreparedCloud::kSample, kFinalIterations, stop);
  const auto close = [](const Finalist& pose) { return pose.support.within[Support::kFine]; };
  const auto best = std::max_element(poses.begin(), poses.end(), [&](const auto& a, const auto& b) {
    return close(a) < close(b);
  });
  return best == poses.end() ? std::nullopt : std::optional(*best);
}

std::vector<Match> Placement::agreeing(const Similarity3& pose, double radii) const {
  const double radius = radii * kMatched * fine(pose.scale());
  const std::vector<Eigen::Vector3d> moved = moved_points(matches_.source_places(), pose);
  std::vector<Match> result;
  for (std::size_t i = 0; i < moved.size(); ++i) {
    const double squared = (moved[i] - matches_.target_places()[i]).squaredNorm();
    if (squared > radius * radius) continue;
    result.push_back({matches_.all()[i].source, matches_.all()[i].target, squared});
  }
  return result;
}

std::optional<std::pair<Finalist, std::vector<Match>>> Placement::fitted_to_identities(
    const Finalist& pose) const {
  constexpr double kMuchCloser = 0.5;  // root mean square distance
  constexpr int kFits = 3;
  const auto identities_near = [&](const Similarity3& at) {
    std::vector<Match> near = agreeing(at, 1.0);
    std::erase_if(near, [&](const Match& match) { return !matches_.is_identity(match.source); });
    return near;
  };
  const auto mean_square = [&](std::span<const Match> matches, const Similarity3& at) {
    double sum = 0.0;
    for (const Match& match : matches) {
      sum += (at * source_.landmarks().positions[match.source] -
              target_.landmarks().positions[match.target])
                 .squaredNorm();
    }
    return sum / static_cast<double>(matches.size());
  };
  if (!is_proven(pose.support)) return std::nullopt;
  Similarity3 fit = pose.similarity();
  std::vector<Match> near;
  for (int i = 0; i < kFits; ++i) {
    near = identities_near(fit);
    std::vector<Eigen::Vector3d> from;
    std::vector<Eigen::Vector3d> to;
    for (const Match& match : near) {
      from.push_back(source_.landmarks().positions[match.source]);
      to.push_back(target_.landmarks().positions[match.target]);
    }
    if (from.size() < 4) return std::nullopt;
    fit = fitted_pose(from, to, options_.scale.has_value());
  }
  if (mean_square(near, fit) > kMuchCloser * kMuchCloser * mean_square(near, pose.similarity())) {
    return std::nullopt;
  }
  Finalist fitted = assessed(fit);
  if (!is_proven(fitted.support) || !allows(fitted)) return std::nullopt;
  return std::pair(std::move(fitted), std::move(near));
}

Surroundings Placement::around(const Similarity3& pose) const {
  return surroundings(source_, target_, pose, kMatched * fine(pose.scale()));
}

PlaneMatches Placement::lattice_matches_in_plane(const Similarity3& pose) const {
  if (!source_.is_lattice() || !target_.is_lattice()) return {};
  return matches_in_plane(source_, target_, pose, kMatched * fine(pose.scale()));
}

Candidates Placement::candidates(const TimeLimit& time) const {
  // From this probability on, with kDecisiveAgreement, poses from descriptors make the search unnecessary. With less
  // agreement, a search may find other poses that fit equally well.
  constexpr double kDecided = 0.99;
  std::vector<Finalist> proposed;
  for (const DescriptorPose& proposal : proposals()) {
    if (is_tilted(proposal.pose.rigid(), options_)) continue;
    proposed.emplace_back();
    set_similarity(proposed.back(), proposal.pose);
    proposed.back().support.agreement = DescriptorAgreement{.agreeing = proposal.agreeing};
  }
  Candidates result;
  if (options_.search != PoseSearch::kAlways) {
    std::vector<Finalist> rivals = rivals_of(proposed);
    result.cut_short = time.cuts(kCandidatesTime, [&](const std::stop_token& stop) {
      refine_all(rivals, all_, PreparedCloud::kSample, kFinalIterations, stop);
    });
    result.poses = judged(std::move(rivals));
    const bool decided =
        !result.poses.empty() &&
        result.poses.front().probability >= std::max(kDecided, options_.min_probability) &&
        is_decisive(result.poses.front().support);
    if (decided || options_.search == PoseSearch::kNever) return result;
  }
  search_widely(std::move(proposed), time, result);
  return result;
}

void Placement::search_widely(std::vector<Finalist> proposed, const TimeLimit& time,
                              Candidates& result) const {
  std::vector<QuadPose> from_quads;
  result.cut_short =
      time.cuts(kQuadTime, [&](const std::stop_token& stop) { from_quads = quads(stop); }) ||
      result.cut_short;
  std::vector<Finalist> poses;
  for (const QuadPose& quad : from_quads) {
    poses.emplace_back();
    set_similarity(poses.back(), quad.target_from_source);
  }
  poses.insert(poses.end(), proposed.begin(), proposed.end());
  std::vector<double> scales = scales_to_search(from_quads);
  double done = 0.0;
  if (is_clear(from_quads)) {
    done = 0.9;  // because the rest is hardly ever needed
    search_at({scales.front()}, 0.0, done, false, time, poses, result);
    const bool found =
        !result.poses.empty() && result.poses.front().probability >= options_.min_probability;
    if (found) return;
    // A pose may look clear and yet be wrong.
    scales.erase(scales.begin());
  }
  search_at(scales, done, 1.0, equal_.has_value(), time, poses, result);
}

void Placement::search_at(const std::vector<double>& scales, double begin, double end,
                          bool with_constellations, const TimeLimit& time,
                          std::vector<Finalist>& poses, Candidates& result) const {
  constexpr std::size_t kCandidatesAScale = 24;  // if several scales are searched
  constexpr std::size_t kCandidatesBeside =
      48;                                     // in addition to those from quads and constellations
  constexpr std::size_t kShortPoints = 1000;  // of the source, in the first refinement
  constexpr int kShortIterations = 16;
  // Largest number of variants of a finalist; the last refinement selects one.
  constexpr std::ptrdiff_t kVariants = 3;
  const std::size_t candidates = scales.size() > 1 ? kCandidatesAScale : kCandidatesBeside;
  const auto turns = rotations(options_, Random(execution_.seed).fork(3));
  for (std::size_t i = 0; i < scales.size(); ++i) {
    // Each scale has an equal share of the time.
    const auto progress_at = [&](std::size_t k) {
      return std::lerp(begin, end, static_cast<double>(k) / static_cast<double>(scales.size()));
    };
    const double share = std::lerp(kQuadTime, kSearchTime, progress_at(i + 1));
    const bool cut = time.cuts(share, [&](const std::stop_token& stop) {
      Execution execution = execution_.stage(progress_at(i), progress_at(i + 1));
      execution.stop = stop;
      search(scales[i], candidates, turns, execution, poses);
    });
    result.cut_short = result.cut_short || cut;
  }
  if (with_constellations) {
    const bool cut = time.cuts(kConstellationTime, [&](const std::stop_token& stop) {
      for (const ConstellationPose& found : constellations(stop)) {
        if (is_tilted(found.target_from_source, options_)) continue;
        poses.emplace_back();
        set_similarity(poses.back(), Similarity3(*equal_, found.target_from_source));
      }
    });
    result.cut_short = result.cut_short || cut;
  }
  const bool unrefined = time.cuts(kCandidatesTime, [&](const std::stop_token& stop) {
    refine_all(poses, sample_, kShortPoints, kShortIterations, stop);
    poses = distinct(std::move(poses), sample_, kVariants);
    refine_all(poses, all_, PreparedCloud::kSample, kFinalIterations, stop);
  });
  result.cut_short = result.cut_short || unrefined;
  result.poses = judged(poses);
}

SightCounts Placement::sights(const Similarity3& pose) const {
  const auto some = [](const LandmarkCloud& cloud) {
    constexpr std::size_t kSightPoints = 1024;  // of a map, checked from each view of the other
    return std::span(cloud.positions).first(std::min(kSightPoints, cloud.size()));
  };
  SightCounts counts = target_.views().count(moved_points(some(source_.landmarks()), pose));
  counts += source_.views().count(moved_points(some(target_.landmarks()), pose.inverse()));
  return counts;
}

std::vector<DescriptorPose> Placement::proposals() const {
  // With a free scale, only the target's lengths are known.
  const double tolerance =
      kMatched * (options_.scale ? kernel_scales(all_.target, all_.target).fine : fine(1.0));
  return descriptor_poses(matches_, Random(execution_.seed).fork(4), tolerance, options_.scale);
}

std::vector<ConstellationPose> Placement::constellations(const std::stop_token& stop) const {
  constexpr double kConstellations = 192;  // at effort 1
  const auto draws = static_cast<std::size_t>(std::ceil(kConstellations * options_.effort));
  const auto sample = source_.sample();
  std::vector<Eigen::Vector3d> source(sample.begin(), sample.end());
  for (Eigen::Vector3d& position : source) position *= *equal_;
  return constellation_poses(source, target_.sample(), Random(execution_.seed).fork(6),
                             sample_.at(*equal_).fine, draws,
                             {.executor = execution_.executor, .stop = stop});
}

std::vector<QuadPose> Placement::quads(const std::stop_token& stop) const {
  // A quad's scale is less certain than a pose's.
  constexpr double kQuadScale = 1.03;
  const ScaleRange range = options_.scale.value_or(ScaleRange{1.0 / kQuadScale, kQuadScale});
  std::vector<QuadPose> found =
      quad_poses(source_, target_, range, kernel_scales(all_.target, all_.target).fine,
                 {.executor = execution_.executor, .stop = stop});
  // A pose that gravity forbids must not end the search.
  std::erase_if(found, [&](const QuadPose& pose) {
    return is_tilted(pose.target_from_source.rigid(), options_);
  });
  if (!options_.scale) {
    for (QuadPose& pose : found) pose.target_from_source = pose.target_from_source.rigid();
  }
  return found;
}

// Whether the first pose leaves no doubt, so that the search need only look for rivals.
bool Placement::is_clear(const std::vector<QuadPose>& quads) {
  constexpr double kClear = 40.0;         // evidence
  constexpr double kRivalEvidence = 0.5;  // of the first pose's
  return !quads.empty() && quads.front().evidence >= kClear &&
         (quads.size() == 1 || quads[1].evidence < kRivalEvidence * quads.front().evidence);
}

std::vector<double> Placement::scales_to_search(const std::vector<QuadPose>& quads) const {
  constexpr double kApart = 1.12;   // ratio of scales that one search reaches
  constexpr std::size_t kMost = 3;  // from quads
  if (!options_.scale) return scales_;
  std::vector<double> scales;
  const auto add = [&](double scale) {
    const bool known = std::any_of(scales.begin(), scales.end(), [&](double other) {
      return std::abs(std::log(scale / other)) < std::log(kApart);
    });
    if (!known) scales.push_back(scale);
  };
  for (const QuadPose& quad : quads) {
    if (scales.size() < kMost) add(quad.target_from_source.scale());
  }
  for (const double scale : scales_) add(scale);
  return scales;
}

std::vector<Finalist> Placement::rivals_of(const std::vector<Finalist>& proposed) {
  // Matches that must agree with the first pose for a decision without a search.
  constexpr std::size_t kFewestAgreeing = 7;
  constexpr double kRivalShare = 0.4;  // of the first pose's matches
  constexpr std::size_t kMost = 4;
  std::vector<Finalist> rivals;
  if (proposed.empty() || proposed.front().support.agreement->agreeing < kFewestAgreeing) {
    return rivals;
  }
  const auto most = static_cast<double>(proposed.front().support.agreement->agreeing);
  for (const Finalist& one : proposed) {
    const auto agreeing = static_cast<double>(one.support.agreement->agreeing);
    if (agreeing >= kRivalShare * most && rivals.size() < kMost) rivals.push_back(one);
  }
  return rivals;
}

std::vector<Finalist> Placement::judged(std::vector<Finalist> poses) const {
  std::erase_if(poses, [&](const Finalist& pose) { return !allows(pose); });
  return with_probabilities(distinct(std::move(poses), all_, 1));
}

void Placement::search(double scale, std::size_t candidates,
                       std::span<const Eigen::Quaterniond> turns, const Execution& execution,
                       std::vector<Finalist>& poses) const {
  const auto accept = [&](const Rigid3& pose) { return !is_tilted(pose, options_); };
  std::vector<Eigen::Vector3d> source = source_.landmarks().positions;
  for (Eigen::Vector3d& position : source) position *= scale;
  for (const SearchCandidate& found : search_poses(
           source, source_.landmarks().weights, target_.landmarks().positions,
           target_.landmarks().weights, turns, accept, all_.at(scale), candidates, execution)) {
    poses.emplace_back();
    set_similarity(poses.back(), {scale, found.target_from_source});
  }
}

void Placement::refine_all(std::vector<Finalist>& poses, const PairScales& lengths,
                           std::size_t points, int iterations, const std::stop_token& stop) const {
  // Roughly for many poses, accurately for the remaining few.
  const std::size_t partners = points == PreparedCloud::kSample ? DescriptorMatches::kPartners : 32;
  // The candidates run in parallel, each on one thread.
  const RobustAlignment alignment(source_, target_, false, Executor());
  execution_.executor.for_blocks(poses.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const double fine = lengths.at(poses[i].scale).fine;
      const Similarity3 pose = alignment
                                   .run(poses[i].similarity(),
                                        {.coarse = sample_.at(poses[i].scale).fine,
                                         .fine = fine,
                                         .finest = kFinest * fine,
                                         .max_iterations = iterations,
                                         .points = points,
                                         .free_scale = options_.scale.has_value()},
                                        stop)
                                   .target_from_source;
      poses[i] = assessed(pose, partners);
    }
  });
}

std::vector<Finalist> Placement::distinct(std::vector<Finalist> poses, const PairScales& lengths,
                                          std::ptrdiff_t variants) const {
  constexpr std::size_t kFinalists = 12;
  std::stable_sort(poses.begin(), poses.end(),
                   [](const Finalist& a, const Finalist& b) { return merit(a) > merit(b); });
  std::vector<Finalist> kept;
  for (const Finalist& pose : poses) {
    const double fine = lengths.at(pose.scale).fine;
    const auto within = [&](double radii) {
      return std::count_if(kept.begin(), kept.end(), [&](const Finalist& other) {
        return distance_(pose.similarity(), other.similarity()) < radii * fine;
      });
    };
    if (within(kEqual) == 0 && within(kDistinct) < variants) kept.push_back(pose);
    if (kept.size() == kFinalists) break;
  }
  return kept;
}

}  // namespace cairn::detail
