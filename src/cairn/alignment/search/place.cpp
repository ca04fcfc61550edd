// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/alignment/search/place.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <functional>
#include <numbers>
#include <numeric>
#include <span>
#include <utility>

#include <fmt/format.h>

#include "cairn/alignment/detail/evidence/probability.hpp"
#include "cairn/alignment/detail/refinement/proximity.hpp"
#include "cairn/alignment/detail/refinement/robust_alignment.hpp"
#include "cairn/alignment/detail/search/constellation_poses.hpp"
#include "cairn/alignment/detail/search/descriptor_poses.hpp"
#include "cairn/alignment/detail/search/rotations.hpp"
#include "cairn/alignment/detail/search/search.hpp"
#include "cairn/alignment/detail/search/support_counter.hpp"
#include "cairn/alignment/detail/search/surroundings.hpp"
#include "cairn/alignment/evidence/probability_text.hpp"
#include "cairn/alignment/refinement/refine.hpp"
#include "cairn/alignment/search/descriptor_matches.hpp"
#include "cairn/alignment/search/scales.hpp"
#include "cairn/core/detail/alarm.hpp"
#include "cairn/core/error.hpp"
#include "cairn/core/random.hpp"
#include "cairn/geometry/angles.hpp"
#include "cairn/geometry/detail/pose_distance.hpp"
#include "cairn/geometry/moved_points.hpp"

namespace cairn {
namespace {

constexpr std::size_t kFewestLandmarks = 20;  // with fewer, a right pose looks like chance
constexpr std::size_t kSample = PreparedCloud::kSample;
constexpr double kRotations = 4608;     // at effort 1: about 15 degrees apart
constexpr double kFewRotations = 2304;  // the same if constellations also propose poses
constexpr double kConstellations = 192;
constexpr double kTurns = 72;               // and about a known vertical: 5 degrees apart
constexpr std::size_t kShortPoints = 1000;  // of the source, in the first refinement of candidates
constexpr int kShortIterations = 16;
constexpr int kFinalIterations = 60;
constexpr std::size_t kFinalists = 12;
constexpr std::size_t kCandidatesAScale = 24;  // if several scales are searched
constexpr std::size_t kCandidatesBeside = 48;  // in addition to those from constellations
constexpr std::size_t kSightPoints = 1024;     // of a map, checked from each view of the other
constexpr std::size_t kFewestSights = 200;     // lines of sight for a free-space check
constexpr std::ptrdiff_t kVariants = 3;  // of a finalist, of which the last refinement selects one
constexpr double kLongest = 1e6;         // time limit in seconds
// Shares of the time limit for the stages; the last refinement has the rest.
constexpr double kSearchTime = 0.5;
constexpr double kConstellationTime = 0.65;
constexpr double kCandidatesTime = 0.85;
// With a free scale: refinement bridges one step, and beyond this number of steps from the scale that extents
// and spacings suggest, maps overlap little.
constexpr double kScaleStep = 1.25;
constexpr int kScaleReach = 5;         // steps, to either side
constexpr double kScaleMargin = 0.03;  // of the range's ends, because scales are not exact
// In units of the fine scale:
constexpr double kSame = 0.35;     // largest distance of equal optima
constexpr double kMatched = 0.5;   // radius within which landmarks count as matched
constexpr double kClose = 0.25;    // share of it within which they are probably the same
constexpr double kDistinct = 3.0;  // least distance of poses that a user would call different
constexpr double kReopened = 3.0;  // kernel at the start of the last refinement
// Poses from descriptors are judged before the search if one has this number of agreeing matches;
constexpr std::size_t kFewestAgreeing = 7;
// poses with this share of its matches are its rivals;
constexpr double kRivalShare = 0.4;
// and this probability, with kDecisiveAgreement, makes the search unnecessary. With less agreement, a search
// may find other poses that fit equally well.
constexpr double kDecided = 0.99;
constexpr int kAttempts = 4;  // at the last refinement
// Least share of a candidate's merit after refinement with all landmarks.
constexpr double kKept = 0.95;

template <class Value>
void require(bool valid, std::string_view field, const Value& value, std::string_view expected) {
  if (valid) return;
  throw Error(ErrorKind::kMisuse, fmt::format("PlaceOptions.{}", field), fmt::format("{}", value),
              expected);
}

std::span<const Eigen::Vector3d> sample_of(const LandmarkCloud& cloud) {
  return std::span(cloud.positions).first(std::min(cloud.size(), kSample));
}

// Shuffles them, so that the first ones are spread evenly.
void shuffle(std::vector<Eigen::Quaterniond>& rotations, Random& random) {
  for (std::size_t i = rotations.size(); i > 1; --i) {
    std::swap(rotations[i - 1], rotations[random.index(i)]);
  }
}

std::vector<Eigen::Quaterniond> rotations(const PlaceOptions& options, Random random) {
  std::vector<Eigen::Quaterniond> all;
  if (options.gravity) {
    all = rotations_about(options.gravity->source, options.gravity->target,
                          static_cast<std::size_t>(std::ceil(kTurns * options.effort)));
  } else {
    // A random rotation, so that each seed searches other rotations.
    Eigen::Quaterniond turn(random.normal(), random.normal(), random.normal(), random.normal());
    turn.normalize();
    const double count = options.scale ? kRotations : kFewRotations;
    all = all_rotations(static_cast<std::size_t>(std::ceil(count * options.effort)));
    for (Eigen::Quaterniond& rotation : all) rotation = turn * rotation;
  }
  if (options.time_limit_s) shuffle(all, random);
  return all;
}

// Time limit of a placement, if any.
class TimeLimit {
 public:
  TimeLimit(std::chrono::steady_clock::time_point start, const PlaceOptions& options)
      : start_(start), limit_s_(options.time_limit_s), caller_(options.execution.stop) {}

  /// Calls work(stop) and requests a stop when this share of the time is over.
  /// @return whether a stop was requested
  template <class Work>
  bool cuts(double share, const Work& work) const {
    if (!limit_s_) {
      work(caller_);
      return false;
    }
    const auto end = start_ + std::chrono::duration_cast<std::chrono::steady_clock::duration>(
                                  std::chrono::duration<double>(share * *limit_s_));
    // Starts no thread if the time is already over.
    if (std::chrono::steady_clock::now() >= end) {
      std::stop_source over;
      over.request_stop();
      work(over.get_token());
      return !caller_.stop_requested();
    }
    const Alarm alarm(end, caller_);
    work(alarm.token());
    return alarm.token().stop_requested() && !caller_.stop_requested();
  }

 private:
  std::chrono::steady_clock::time_point start_;
  std::optional<double> limit_s_;
  std::stop_token caller_;
};

// Kernel scales of a pair of clouds, as a function of the source's scale.
struct PairScales {
  CloudScales source;
  CloudScales target;

  KernelScales at(double scale) const {
    return kernel_scales({scale * source.extent, scale * source.spacing, scale * source.noise},
                         target);
  }
};

void set_similarity(PlacementCandidate& candidate, const Similarity3& pose) {
  candidate.target_from_source = pose.rigid();
  candidate.scale = pose.scale();
}

// Angle between both downward directions.
double tilt(const Rigid3& pose, const GravityPrior& gravity) {
  const Eigen::Vector3d down = pose.quaternion() * gravity.source;
  return std::atan2(down.cross(gravity.target).norm(), down.dot(gravity.target));
}

bool is_tilted(const Rigid3& pose, const PlaceOptions& options) {
  return options.gravity && tilt(pose, *options.gravity) > options.gravity->max_tilt_rad;
}

// Whether a scale is outside the requested range. Its inverse is outside the inverse range then.
bool has_other_scale(double scale, const PlaceOptions& options) {
  if (!options.scale) return false;
  const auto [least, most] = *options.scale;
  return scale * (1.0 + kScaleMargin) < least || scale > most * (1.0 + kScaleMargin);
}

// A centred pose that may become a candidate.
struct Finalist : PlacementCandidate {
  Proximity proximity = {};
};

struct Candidates {
  std::vector<Finalist> poses;  // likeliest first
  bool cut_short = false;
};

// Search on samples of both maps. The source should be the smaller one, so that most of it is in the target
// if they overlap.
class Placement {
 public:
  /// @param scales of the source at which poses are searched for
  /// @param equal  the one at which both clouds have the same unit; std::nullopt if it is not allowed
  Placement(const PreparedCloud& source, const PreparedCloud& target, std::vector<double> scales,
            std::optional<double> equal, const PlaceOptions& options)
      : options_(options),
        scales_(std::move(scales)),
        equal_(equal),
        source_(source),
        target_(target),
        pair_(source.centred(), target.centred()),
        support_(source, target, kSample, Random(options.seed).fork(5)),
        matches_(pair_),
        all_{source.scales(), target.scales()},
        sample_{source.sample_scales(), target.sample_scales()},
        distance_(PoseDistance::of(pair_.source().positions)) {}

  /// Fine kernel scale for a source of this scale.
  double fine(double scale) const { return all_.at(scale).fine; }
  // The support of a pose.
  // @param partners number of random partners per descriptor match, to estimate chance agreements
  Finalist assessed(const Similarity3& pose,
                    std::size_t partners = DescriptorMatches::kPartners) const {
    Finalist result;
    set_similarity(result, pose);
    const double radius = kMatched * fine(pose.scale());
    result.support = support_(pose, radius, &result.proximity);
    if (matches_.possible()) result.support.agreement = matches_.agreement(pose, radius, partners);
    return result;
  }

  // Rank of a pose: evidence of positions and descriptors. Most wrong poses have neither; a few landmarks
  // that match by chance must not outweigh a tenth of all.
  static double merit(const PlacementCandidate& pose) {
    constexpr double kSupport = 50.0;
    const Support& support = pose.support;
    const double agreement = support.agreement ? support.agreement->evidence() : 0.0;
    return support.spread_evidence + support.spread_likeness + agreement + kSupport * support.share;
  }

  // Probability of each pose versus the others; likeliest first.
  std::vector<Finalist> with_probabilities(std::vector<Finalist> poses) const {
    for (Finalist& pose : poses) {
      std::vector<const Proximity*> others;
      for (const Finalist& other : poses) {
        if (&other != &pose) others.push_back(&other.proximity);
      }
      pose.support.proximity = proximity_evidence(pose.proximity, others);
      const SightCounts sight = sights(pose.similarity());
      if (sight.total() >= kFewestSights) {
        pose.contradicted =
            static_cast<double>(sight.in_front) / static_cast<double>(sight.total());
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

  /// Whether the requested gravity and scale allow it.
  bool allows(const Finalist& pose) const {
    return !is_tilted(pose.target_from_source, options_) && !has_other_scale(pose.scale, options_);
  }

  /// The optimum near a pose.
  Finalist settled(const Similarity3& pose, const std::stop_token& stop) const {
    std::vector<Finalist> one(1);
    set_similarity(one.front(), pose);
    refine_all(one, all_, kSample, kFinalIterations, stop);
    return one.front();
  }

  /// Whether a user would call both the same.
  bool near(const Finalist& a, const Finalist& b) const {
    return distance_(a.similarity(), b.similarity()) < kDistinct * fine(b.scale);
  }

  /// The best-fitting of the poses near this one, excluding equal ones, if it fits clearly better; and its
  /// distance.
  std::pair<std::optional<Finalist>, double> better_near(const std::vector<Finalist>& poses,
                                                         const Finalist& pose) const {
    std::pair<std::optional<Finalist>, double> better = {std::nullopt, 0.0};
    for (const Finalist& other : poses) {
      const double off = distance_(other.similarity(), pose.similarity());
      if (!near(other, pose) || off < kSame * fine(pose.scale)) continue;
      if (merit(pose) >= kKept * merit(other)) continue;
      if (!better.first || merit(other) > merit(*better.first)) better = {other, off};
    }
    return better;
  }

  /// How far two poses are apart: root mean square over the source's landmarks.
  double apart(const Similarity3& a, const Similarity3& b) const { return distance_(a, b); }

  /// Free-space check of the surroundings of the matches.
  SightCounts around(const Similarity3& pose) const {
    return surrounding_sights(source_, target_, pose, kClose * kMatched * fine(pose.scale()));
  }

  const CentredPair& pair() const { return pair_; }

  /// Number of landmarks of the smaller cloud.
  std::size_t landmarks() const { return std::min(pair_.source().size(), pair_.target().size()); }

  Candidates candidates(const TimeLimit& time) const {
    const auto accept = [&](const Rigid3& pose) { return !is_tilted(pose, options_); };
    std::vector<Finalist> proposed;
    for (const DescriptorPose& proposal : proposals()) {
      if (!accept(proposal.pose.rigid())) continue;
      proposed.emplace_back();
      set_similarity(proposed.back(), proposal.pose);
      proposed.back().support.agreement = DescriptorAgreement{.agreeing = proposal.agreeing};
    }
    Candidates result;
    if (options_.search != PoseSearch::kAlways) {
      std::vector<Finalist> rivals = rivals_of(proposed);
      result.cut_short = time.cuts(kCandidatesTime, [&](const std::stop_token& stop) {
        refine_all(rivals, all_, kSample, kFinalIterations, stop);
      });
      result.poses = judged(std::move(rivals));
      const bool decided =
          !result.poses.empty() &&
          result.poses.front().probability >= std::max(kDecided, options_.min_probability) &&
          result.poses.front().support.agreement->spread >= kDecisiveAgreement;
      if (decided || options_.search == PoseSearch::kNever) return result;
    }
    std::vector<Finalist> poses;
    const auto turns = rotations(options_, Random(options_.seed).fork(3));
    for (std::size_t i = 0; i < scales_.size(); ++i) {
      // Each scale has an equal share of the time.
      const double done = static_cast<double>(i) / static_cast<double>(scales_.size());
      const double share = kSearchTime * (done + 1.0 / static_cast<double>(scales_.size()));
      const bool cut = time.cuts(share, [&](const std::stop_token& stop) {
        search(scales_[i], done, turns, accept, stop, poses);
      });
      result.cut_short = result.cut_short || cut;
    }
    poses.insert(poses.end(), proposed.begin(), proposed.end());
    if (equal_) {
      const bool cut = time.cuts(kConstellationTime, [&](const std::stop_token& stop) {
        for (const ConstellationPose& found : constellations(stop)) {
          if (!accept(found.target_from_source)) continue;
          poses.emplace_back();
          set_similarity(poses.back(), Similarity3(*equal_, found.target_from_source));
        }
      });
      result.cut_short = result.cut_short || cut;
    }
    const bool unrefined = time.cuts(kCandidatesTime, [&](const std::stop_token& stop) {
      refine_all(poses, sample_, kShortPoints, kShortIterations, stop);
      poses = distinct(std::move(poses), sample_, kVariants);
      refine_all(poses, all_, kSample, kFinalIterations, stop);
    });
    result.cut_short = result.cut_short || unrefined;
    result.poses = judged(std::move(poses));
    return result;
  }

 private:
  // Free-space check in both directions; all zeros if the clouds have no views.
  SightCounts sights(const Similarity3& pose) const {
    const auto some = [](const LandmarkCloud& cloud) {
      return std::span(cloud.positions).first(std::min(kSightPoints, cloud.size()));
    };
    SightCounts counts = target_.views().count(moved_points(some(pair_.source()), pose));
    counts += source_.views().count(moved_points(some(pair_.target()), pose.inverse()));
    return counts;
  }

  // Poses from descriptor matches.
  std::vector<DescriptorPose> proposals() const {
    DescriptorPoseOptions options;
    options.free_scale = options_.scale.has_value();
    // With a free scale, only the target's lengths are known.
    options.tolerance =
        kMatched * (options.free_scale ? kernel_scales(all_.target, all_.target).fine : fine(1.0));
    if (options_.scale) {
      options.least_scale = options_.scale->least;
      options.most_scale = options_.scale->most;
    }
    return descriptor_poses(matches_, Random(options_.seed).fork(4), options);
  }

  // Poses that align a constellation and its surroundings. They need distances, hence one unit.
  std::vector<ConstellationPose> constellations(const std::stop_token& stop) const {
    const ConstellationOptions options{
        .fine = sample_.at(*equal_).fine,
        .draws = static_cast<std::size_t>(std::ceil(kConstellations * options_.effort)),
        .execution = {.executor = options_.execution.executor, .stop = stop}};
    const auto sample = sample_of(pair_.source());
    std::vector<Eigen::Vector3d> source(sample.begin(), sample.end());
    for (Eigen::Vector3d& position : source) position *= *equal_;
    return constellation_poses(source, sample_of(pair_.target()), Random(options_.seed).fork(6),
                               options);
  }

  // The first pose and those that may be right instead; empty if too few matches agree with the first.
  static std::vector<Finalist> rivals_of(const std::vector<Finalist>& proposed) {
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

  // The distinct poses with their probabilities, likeliest first.
  std::vector<Finalist> judged(std::vector<Finalist> poses) const {
    std::erase_if(poses, [&](const Finalist& pose) { return !allows(pose); });
    return with_probabilities(distinct(std::move(poses), all_, 1));
  }

  // Adds the poses that a search at the scale finds.
  void search(double scale, double progress, std::span<const Eigen::Quaterniond> turns,
              const std::function<bool(const Rigid3&)>& accept, const std::stop_token& stop,
              std::vector<Finalist>& poses) const {
    const KernelScales kernel = all_.at(scale);
    SearchOptions options{.coarse = kernel.coarse,
                          .fine = kernel.fine,
                          .execution = {.executor = options_.execution.executor, .stop = stop}};
    if (scales_.size() > 1) options.candidates = kCandidatesAScale;
    if (!options_.scale) options.candidates = kCandidatesBeside;
    if (options_.execution.progress) {
      options.execution.progress = [&](double share) {
        options_.execution.progress(progress + share / static_cast<double>(scales_.size()));
      };
    }
    std::vector<Eigen::Vector3d> source = pair_.source().positions;
    for (Eigen::Vector3d& position : source) position *= scale;
    for (const SearchCandidate& found :
         search_poses(source, pair_.source().weights, pair_.target().positions,
                      pair_.target().weights, turns, accept, options)) {
      poses.emplace_back();
      set_similarity(poses.back(), {scale, found.target_from_source});
    }
  }

  // Moves each pose to the optimum near it, at the fine scale of the lengths, and counts its support
  // there.
  void refine_all(std::vector<Finalist>& poses, const PairScales& lengths, std::size_t points,
                  int iterations, const std::stop_token& stop) const {
    // Roughly for many poses, accurately for the remaining few.
    const std::size_t partners = points == kSample ? DescriptorMatches::kPartners : 32;
    // The candidates run in parallel, each on one thread.
    const RobustAlignment alignment(pair_, target_.tree(), options_.use_covariances, false,
                                    Executor());
    options_.execution.executor.for_blocks(
        poses.size(), 1, [&](std::size_t begin, std::size_t end) {
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

  // The best poses, with at most `variants` that a user would call the same.
  std::vector<Finalist> distinct(std::vector<Finalist> poses, const PairScales& lengths,
                                 std::ptrdiff_t variants) const {
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
      if (within(kSame) == 0 && within(kDistinct) < variants) kept.push_back(pose);
      if (kept.size() == kFinalists) break;
    }
    return kept;
  }

  const PlaceOptions& options_;
  std::vector<double> scales_;
  std::optional<double> equal_;
  PreparedCloud source_;
  PreparedCloud target_;
  CentredPair pair_;
  SupportCounter support_;
  DescriptorMatches matches_;
  PairScales all_;     // of all landmarks
  PairScales sample_;  // of those that the search sees
  PoseDistance distance_;
};

// From the nearest to 1 outwards.
std::vector<double> scales_about_one(const ScaleRange& range) {
  std::vector<double> scales = {1.0};
  for (int i = 1; i <= kScaleReach; ++i) {
    scales.push_back(std::pow(kScaleStep, i));
    scales.push_back(std::pow(kScaleStep, -i));
  }
  // Refinement goes half a step farther.
  const double margin = std::sqrt(kScaleStep);
  std::erase_if(scales, [&](double scale) {
    return scale < range.least / margin || scale > range.most * margin;
  });
  return scales;
}

// Scale of the source at which both clouds have the most similar extents and spacings.
double likely_scale(const CloudScales& from, const CloudScales& to) {
  const double square = to.extent * to.spacing / (from.extent * from.spacing);
  return std::isfinite(square) && square > 0.0 ? std::sqrt(square) : 1.0;
}

}  // namespace

// A placement of the caller's clouds, with the source scaled or the two exchanged if necessary.
class PreparedPair::Parts {
 public:
  Parts(const PreparedCloud& source, const PreparedCloud& target, const PlaceOptions& options)
      : source_(source),
        target_(target),
        callers_(options),
        options_(options),
        unit_(options.scale ? std::clamp(likely_scale(source.scales(), target.scales()),
                                         options.scale->least, options.scale->most)
                            : 1.0),
        // With a free scale, sizes are not comparable; the cloud with fewer landmarks is probably part of the
        // other.
        inverted_(options.scale ? source.size() > target.size()
                                : source.scales().extent > target.scales().extent) {
    if (std::min(source.size(), target.size()) < kFewestLandmarks) return;
    if (inverted_ && options_.gravity) {
      std::swap(options_.gravity->source, options_.gravity->target);
    }
    std::vector<double> scales = {1.0};
    std::optional<double> equal = 1.0;
    if (options_.scale) {
      const double least = options_.scale->least / unit_;
      const double most = options_.scale->most / unit_;
      options_.scale = inverted_ ? ScaleRange{1.0 / most, 1.0 / least} : ScaleRange{least, most};
      scales = scales_about_one(*options_.scale);
      // Free units are often equal, as of two maps that one program made.
      equal = inverted_ ? unit_ : 1.0 / unit_;
      if (*equal < options_.scale->least || *equal > options_.scale->most) equal.reset();
      if (equal && *equal != 1.0) scales.push_back(*equal);
    }
    const PreparedCloud moving = source.scaled(unit_, options.execution.executor);
    if (inverted_) {
      placement_.emplace(target, moving, std::move(scales), equal, options_);
    } else {
      placement_.emplace(moving, target, std::move(scales), equal, options_);
    }
  }

  PlacementResult place() {
    return timed([&](const TimeLimit& time, PlacementResult& result) {
      conclude(searched(time), time, result);
    });
  }
  PlacementResult judge(const Similarity3& pose);
  PlacementResult settle(const Similarity3& pose);

 private:
  struct Placed {
    Candidates found;
    std::size_t own = 0;  // index of the placed pose among them
  };

  template <class Work>
  PlacementResult timed(const Work& work);
  Similarity3 for_caller(const Similarity3& centred) const {
    const Similarity3 pose = placement_->pair().uncentred(centred);
    const Similarity3 direct = inverted_ ? pose.inverse() : pose;
    return {direct.scale() * unit_, direct.rigid()};
  }
  Similarity3 centred(const Similarity3& callers) const {
    const Similarity3 direct(callers.scale() / unit_, callers.rigid());
    return placement_->pair().centred(inverted_ ? direct.inverse() : direct);
  }
  // Scale of the kernel for a centred pose, in the unit of the caller's target.
  double fine(const Finalist& pose) const {
    return placement_->fine(pose.scale) / (inverted_ ? pose.scale : 1.0);
  }
  RegistrationResult refined(const Finalist& best, bool hold, const TimeLimit& time,
                             PlacementResult& result) const;
  const Candidates& searched(const TimeLimit& time);
  void conclude(Candidates found, const TimeLimit& time, PlacementResult& result) const;
  void conclude_held(const Placed& placed, const Finalist& held, std::optional<double> better,
                     const TimeLimit& time, PlacementResult& result) const;
  void judge_best(const Finalist& best, PlacementResult& result) const;
  Placed beside(Candidates found, const Finalist& pose) const;
  void report(const std::vector<Finalist>& poses, PlacementResult& result) const;
  void require_scale(const Similarity3& pose) const;

  const PreparedCloud source_;
  const PreparedCloud target_;
  const PlaceOptions callers_;
  PlaceOptions options_;  // in the placement's unit
  double unit_;           // factor of the source
  bool inverted_;
  std::optional<Placement> placement_;  // nothing where landmarks are too few
  std::optional<Candidates> searched_;
};

namespace {

// How closely the maps agree at a candidate, in fine scales, if known. A much finer kernel would fit the
// errors of single landmarks.
double precision(const Finalist& pose) {
  constexpr double kPerDeviation = 2.0;
  constexpr double kClear = 20.0;  // least evidence
  const Support& support = pose.support;
  if (support.proximity.spread > kClear) {
    return std::max(kPerDeviation * support.proximity.deviation / kSmoothSpacings, kFinest);
  }
  // Descriptors also identify the same landmarks, but not their distances.
  const bool same = support.agreement && support.agreement->evidence() > kClear;
  return same ? kPerDeviation * ProximityEvidence::kWidest / kSmoothSpacings : 1.0;
}

}  // namespace

// The pose of a candidate at the scale where its refinement ended, with all landmarks.
RegistrationResult PreparedPair::Parts::refined(const Finalist& best, bool hold,
                                                const TimeLimit& time,
                                                PlacementResult& result) const {
  const Similarity3 pose = for_caller(best.similarity());
  RefineOptions refinement;
  refinement.initial = pose.rigid();
  if (callers_.scale) refinement.scale = pose.scale();
  refinement.by_icp_too = false;
  refinement.hold = hold;
  refinement.one_to_one = precision(best) < 1.0;
  const double kernel = precision(best) * fine(best);
  // If it is unknown how closely the maps agree, starts at a wider kernel, which undoes the choice at finer
  // scales.
  refinement.coarse = refinement.one_to_one ? kernel : kReopened * kernel;
  refinement.fine = refinement.finest = kernel;
  refinement.error_scale = std::min(kErrorScale * kernel, fine(best));
  refinement.use_covariances = callers_.use_covariances;
  refinement.overlap_radius = callers_.overlap_radius.value_or(result.radius);
  refinement.execution.executor = callers_.execution.executor;
  refinement.trace = callers_.trace;
  RegistrationResult alignment;
  const bool unfinished = time.cuts(1.0, [&](const std::stop_token& stop) {
    refinement.execution.stop = stop;
    alignment = refine(source_, target_, refinement);
  });
  if (unfinished && alignment.status == RegistrationStatus::kCancelled) {
    result.cut_short = true;
    alignment.stop_reason = StopReason::kTimeLimit;
    alignment.status = status_of(StopReason::kTimeLimit);
    alignment.reason =
        fmt::format("stopped at the time limit after {} iterations", alignment.iterations);
  }
  return alignment;
}

// Candidates of the search; the same for every judged pose.
const Candidates& PreparedPair::Parts::searched(const TimeLimit& time) {
  if (!searched_) searched_ = placement_->candidates(time);
  return *searched_;
}

void PreparedPair::Parts::report(const std::vector<Finalist>& poses,
                                 PlacementResult& result) const {
  for (const Finalist& pose : poses) {
    set_similarity(result.candidates.emplace_back(pose), for_caller(pose.similarity()));
  }
}

// Refines the likeliest pose with all landmarks and judges the result like the candidates. If another pose is
// then likelier, also refines that one. Keeps a candidate unchanged if it has more evidence than its
// refinement.
void PreparedPair::Parts::conclude(Candidates found, const TimeLimit& time,
                                   PlacementResult& result) const {
  result.cut_short = found.cut_short;
  if (found.poses.empty()) {
    result.radius = kMatched * placement_->fine(1.0);
    result.verdict = Verdict::kRejected;
    result.reason = cairn::judge({}, {}, placement_->landmarks()).reason;
    result.alignment.reason = result.reason;
    return;
  }
  for (int attempt = 0; attempt < kAttempts; ++attempt) {
    const Finalist best = found.poses.front();
    result.radius = kMatched * fine(best);
    result.alignment = refined(best, false, time, result);
    if (result.alignment.status == RegistrationStatus::kCancelled) break;
    const bool failed = result.alignment.status == RegistrationStatus::kFailed;
    Finalist after = placement_->assessed(centred(result.alignment.similarity()));
    // Evidence at the finer scales can only be lost if there is some.
    const bool worse =
        precision(best) < 1.0 && Placement::merit(after) < kKept * Placement::merit(best);
    const bool settled = !failed && !worse && placement_->allows(after);
    if (!settled || attempt + 1 == kAttempts) {
      result.alignment = refined(best, true, time, result);
      break;
    }
    const Similarity3 pose = after.similarity();
    found.poses.front() = std::move(after);
    found.poses = placement_->with_probabilities(std::move(found.poses));
    if (found.poses.front().similarity().matrix() == pose.matrix()) break;
  }
  report(found.poses, result);
  result.own = 0;
  result.probability = result.candidates.front().probability;
  judge_best(found.poses.front(), result);
}

// The verdict on the likeliest candidate.
void PreparedPair::Parts::judge_best(const Finalist& best, PlacementResult& result) const {
  result.around = placement_->around(best.similarity());
  Judgement judgement = cairn::judge(result.candidates, result.alignment, placement_->landmarks(),
                                     callers_.min_probability, result.around);
  result.verdict = judgement.verdict;
  result.reason = std::move(judgement.reason);
}

// Places a given pose among the poses found; it replaces those that a user would call the same.
PreparedPair::Parts::Placed PreparedPair::Parts::beside(Candidates found,
                                                        const Finalist& pose) const {
  std::erase_if(found.poses, [&](const Finalist& other) { return placement_->near(other, pose); });
  found.poses.push_back(pose);
  found.poses = placement_->with_probabilities(std::move(found.poses));
  const Matrix4d matrix = pose.similarity().matrix();
  const auto own = std::find_if(found.poses.begin(), found.poses.end(), [&](const Finalist& one) {
    return one.similarity().matrix() == matrix;
  });
  const auto index = static_cast<std::size_t>(own - found.poses.begin());
  return {std::move(found), index};
}

// @param held   the pose to judge, unchanged
// @param better distance to the placed pose, if that is a better one nearby
void PreparedPair::Parts::conclude_held(const Placed& placed, const Finalist& held,
                                        std::optional<double> better, const TimeLimit& time,
                                        PlacementResult& result) const {
  const auto& [found, own] = placed;
  result.cut_short = found.cut_short;
  result.radius = kMatched * fine(held);
  result.alignment = refined(held, true, time, result);
  // A stopped search may have missed likelier poses.
  if (callers_.execution.stop.stop_requested()) {
    result.alignment.status = RegistrationStatus::kCancelled;
    result.alignment.stop_reason = StopReason::kCancelled;
    result.alignment.reason = result.reason = "cancelled before the pose was judged";
    return;
  }
  report(found.poses, result);
  if (auto why = forbidden(for_caller(held.similarity()), callers_)) {
    result.reason = *std::move(why);
    return;
  }
  // A distance of poses, in matching radii.
  const auto radii = [&](double apart) {
    return (inverted_ ? apart / held.scale : apart) / result.radius;
  };
  if (better) {
    result.reason = fmt::format(
        "another pose, {:.2g} matching radii away (root mean square over the landmarks), fits "
        "better: its probability is {}",
        radii(*better), probability_text(found.poses[own].probability));
    return;
  }
  result.own = own;
  result.probability = found.poses[own].probability;
  if (own > 0) {
    result.reason = fmt::format(
        "another pose is likelier: its probability is {}, that of this pose {}",
        probability_text(found.poses.front().probability), probability_text(result.probability));
    return;
  }
  // Beside an optimum, directions can look open that are determined.
  std::optional<double> off;
  if (!result.alignment.unobservable.empty()) {
    const RegistrationResult optimum = refined(held, false, time, result);
    if (optimum.covariance) {
      off = placement_->apart(held.similarity(), centred(optimum.similarity()));
      result.alignment.unobservable.clear();
      result.alignment.covariance = optimum.covariance;
    }
  }
  judge_best(found.poses.front(), result);
  if (off) result.alignment.covariance.reset();
  if (off && result.verdict != Verdict::kRejected) {
    result.verdict = Verdict::kAmbiguous;
    result.reason = fmt::format(
        "the pose has no covariance, because it is {:.2g} matching radii (root mean square over "
        "the landmarks) beside an optimum; {}",
        radii(*off), result.reason);
  }
}

void PreparedPair::Parts::require_scale(const Similarity3& pose) const {
  constexpr double kOne = 1e-9;
  if (callers_.scale || std::abs(pose.scale() - 1.0) <= kOne) return;
  throw Error(ErrorKind::kMisuse, "target_from_source", fmt::format("scale {}", pose.scale()),
              "1, or PlaceOptions.scale");
}

template <class Work>
PlacementResult PreparedPair::Parts::timed(const Work& work) {
  const auto start = std::chrono::steady_clock::now();
  PlacementResult result;
  result.time_limited = callers_.time_limit_s.has_value();
  if (!placement_) {
    result.reason = fmt::format("{} source and {} target landmarks: at least {} of each are needed",
                                source_.size(), target_.size(), kFewestLandmarks);
    result.alignment.reason = result.reason;
  } else {
    work(TimeLimit(start, callers_), result);
    if (result.cut_short) result.reason += "; the time limit cut the work short";
    for (const auto& [cloud, name] :
         {std::pair(&source_, "source"), std::pair(&target_, "target")}) {
      if (!callers_.use_covariances || !cloud->ignores_covariances()) continue;
      result.reason += fmt::format(
          "; the covariances of the {} are not used, because they exceed a tenth of its extent",
          name);
    }
  }
  result.duration_s =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return result;
}

PlacementResult PreparedPair::Parts::judge(const Similarity3& pose) {
  require_scale(pose);
  return timed([&](const TimeLimit& time, PlacementResult& result) {
    const Candidates& found = searched(time);
    const Finalist held = placement_->assessed(centred(pose));
    const auto [better, off] = placement_->better_near(found.poses, held);
    // A better pose nearby is compared with the others instead.
    const Placed placed = beside(found, better.value_or(held));
    conclude_held(placed, better ? held : placed.found.poses[placed.own],
                  better ? std::optional(off) : std::nullopt, time, result);
  });
}

PlacementResult PreparedPair::Parts::settle(const Similarity3& pose) {
  require_scale(pose);
  return timed([&](const TimeLimit& time, PlacementResult& result) {
    const Candidates& found = searched(time);
    Finalist settled = placement_->settled(centred(pose), callers_.execution.stop);
    if (const auto better = placement_->better_near(found.poses, settled).first) settled = *better;
    Placed placed = beside(found, settled);
    if (placed.own == 0 && placement_->allows(settled)) {
      return conclude(std::move(placed.found), time, result);
    }
    conclude_held(placed, placed.found.poses[placed.own], std::nullopt, time, result);
  });
}

std::optional<std::string> forbidden(const Similarity3& target_from_source,
                                     const PlaceOptions& options) {
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

void PlaceOptions::validate() const {
  require(effort >= 1.0 / 16.0 && effort <= 64.0, "effort", effort, "from 1/16 to 64");
  require(prior_odds >= 1e-6 && prior_odds <= 1e6, "prior_odds", prior_odds, "from 1e-6 to 1e6");
  require(min_probability >= 0.5 && min_probability < 1.0, "min_probability", min_probability,
          "at least 0.5 and below 1");
  require(!time_limit_s || (*time_limit_s > 0.0 && *time_limit_s <= kLongest), "time_limit_s",
          time_limit_s.value_or(0.0), "a positive number of at most 1e6");
  require(!overlap_radius || (*overlap_radius > 0.0 && std::isfinite(*overlap_radius)),
          "overlap_radius", overlap_radius.value_or(0.0), "a positive number");
  require(!scale || (scale->least > 0.0 && std::isfinite(scale->least)), "scale.least",
          scale ? scale->least : 0.0, "a positive number");
  require(!scale || (scale->most >= scale->least && std::isfinite(scale->most)), "scale.most",
          scale ? scale->most : 0.0, "a number not below scale.least");
  if (!gravity) return;
  for (const Eigen::Vector3d& down : {gravity->source, gravity->target}) {
    require(down.allFinite() && down.norm() > 0.0, "gravity", "no direction", "a vector downwards");
  }
  require(gravity->max_tilt_rad > 0.0 && gravity->max_tilt_rad <= std::numbers::pi,
          "gravity.max_tilt_rad", gravity->max_tilt_rad, "above 0 and at most pi");
}

PreparedPair::PreparedPair(const PreparedCloud& source, const PreparedCloud& target,
                           const PlaceOptions& options) {
  options.validate();
  parts_ = std::make_unique<Parts>(source, target, options);
}
PreparedPair::PreparedPair(const LandmarkCloud& source, const LandmarkCloud& target,
                           const PlaceOptions& options) {
  options.validate();
  const auto prepared = [&](const LandmarkCloud& cloud, std::string_view name) {
    return PreparedCloud(cloud, options.seed, options.execution.executor, name);
  };
  parts_ = std::make_unique<Parts>(prepared(source, "source"), prepared(target, "target"), options);
}
PreparedPair::~PreparedPair() = default;
PreparedPair::PreparedPair(PreparedPair&&) noexcept = default;
PreparedPair& PreparedPair::operator=(PreparedPair&&) noexcept = default;

PlacementResult PreparedPair::place() {
  return parts_->place();
}

PlacementResult PreparedPair::judge(const Similarity3& target_from_source) {
  return parts_->judge(target_from_source);
}

PlacementResult PreparedPair::settle(const Similarity3& target_from_source) {
  return parts_->settle(target_from_source);
}

PlacementResult place(const LandmarkCloud& source, const LandmarkCloud& target,
                      const PlaceOptions& options) {
  const auto start = std::chrono::steady_clock::now();
  PlacementResult result = PreparedPair(source, target, options).place();
  result.duration_s =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return result;
}

}  // namespace cairn
