// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/placement/place.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <functional>
#include <numbers>
#include <numeric>
#include <span>
#include <utility>

#include <fmt/format.h>

#include "cairn/core/alarm.hpp"
#include "cairn/core/error.hpp"
#include "cairn/core/random.hpp"
#include "cairn/geometry/pose_distance.hpp"
#include "cairn/map/operations.hpp"
#include "cairn/placement/descriptor_poses.hpp"
#include "cairn/placement/probability.hpp"
#include "cairn/placement/refine.hpp"
#include "cairn/placement/robust_alignment.hpp"
#include "cairn/placement/rotations.hpp"
#include "cairn/placement/search.hpp"
#include "cairn/placement/sight.hpp"
#include "cairn/placement/support_counter.hpp"

namespace cairn {
namespace {

constexpr std::size_t kFewestLandmarks = 20;  // fewer cannot tell a pose from chance
constexpr std::size_t kSample = 4096;         // landmarks of a map that are looked for in the other
constexpr double kRotations = 4608;           // at effort 1: about 15 degrees apart
constexpr double kTurns = 72;                 // and about a known vertical: 5 degrees apart
constexpr std::size_t kShortPoints = 1000;    // of the source, in the first look at each candidate
constexpr int kShortIterations = 8;
constexpr int kFinalIterations = 60;
constexpr std::size_t kFinalists = 8;
constexpr std::size_t kSightPoints = 1024;  // of a map, looked for from each view of the other
constexpr std::size_t kFewestSights = 200;  // fewer lines of sight say nothing
constexpr std::ptrdiff_t kVariants = 3;     // of a finalist: which is the better shows at the end
constexpr double kLongest = 1e6;            // time limit in seconds
// Shares of the time limit that must see their part of the work done; the last refinement has the rest.
constexpr double kSearchTime = 0.5;
constexpr double kCandidatesTime = 0.85;
// Where the scale is open: neighbours are refined to each other, and beyond the reach about what extents
// and spacings suggest, maps have little in common.
constexpr double kScaleStep = 1.25;
constexpr int kScaleReach = 5;         // steps, to either side
constexpr double kScaleMargin = 0.03;  // of the range's ends: no scale is found exactly
// In units of the fine scale:
constexpr double kSame = 0.35;     // what optima that are one differ by at most
constexpr double kReopened = 3.0;  // kernel at which the last refinement begins
constexpr double kMatched = 0.5;   // radius within which landmarks count as matched
constexpr double kDistinct = 3.0;  // and what poses that people would call different at least

template <class Value>
void require(bool valid, std::string_view field, const Value& value, std::string_view expected) {
  if (valid) return;
  throw Error(ErrorKind::kMisuse, fmt::format("PlaceOptions.{}", field), fmt::format("{}", value),
              expected);
}

// The landmarks in random order, the likelier early the more they weigh (Efraimidis and Spirakis 2006):
// the first n are a sample of all.
LandmarkCloud shuffled(const LandmarkCloud& cloud, Random random) {
  std::vector<std::pair<double, std::size_t>> keys(cloud.size());
  for (std::size_t i = 0; i < keys.size(); ++i) {
    keys[i] = {std::log1p(-random.uniform()) / std::max(cloud.weight(i), 1e-9), i};
  }
  std::sort(keys.begin(), keys.end(), std::greater<>());
  LandmarkCloud result;
  std::vector<std::uint32_t> order;
  std::vector<std::uint32_t> place(cloud.size());
  for (const auto& [key, i] : keys) {
    place[i] = static_cast<std::uint32_t>(order.size());
    order.push_back(static_cast<std::uint32_t>(i));
    result.positions.push_back(cloud.positions[i]);
    if (!cloud.covariances.empty()) result.covariances.push_back(cloud.covariances[i]);
    if (!cloud.weights.empty()) result.weights.push_back(cloud.weights[i]);
  }
  if (cloud.descriptors) result.descriptors = descriptor_rows(*cloud.descriptors, order);
  result.views = cloud.views;
  for (LandmarkView& view : result.views) {
    for (std::uint32_t& landmark : view.landmarks) landmark = place[landmark];
  }
  return result;
}

template <class Value>
std::span<const Value> sample_of(const std::vector<Value>& column) {
  return std::span(column).first(std::min(column.size(), kSample));
}

// Of the sample alone, whose landmarks are farther apart; `all` if it is the whole cloud.
CloudScales sample_scales(const LandmarkCloud& cloud, const CloudScales& all,
                          const Executor& executor) {
  if (cloud.size() <= kSample) return all;
  LandmarkCloud part;
  const auto positions = sample_of(cloud.positions);
  part.positions.assign(positions.begin(), positions.end());
  CloudScales scales = cloud_scales(part, BatchTree(part.positions), executor);
  scales.noise = all.noise;
  return scales;
}

// In random order: the first of them are spread over all.
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
    // Another seed looks from elsewhere.
    Eigen::Quaterniond turn(random.normal(), random.normal(), random.normal(), random.normal());
    turn.normalize();
    all = all_rotations(static_cast<std::size_t>(std::ceil(kRotations * options.effort)));
    for (Eigen::Quaterniond& rotation : all) rotation = turn * rotation;
  }
  if (options.time_limit_s) shuffle(all, random);
  return all;
}

// The time that a placement may take, if that is limited.
class TimeLimit {
 public:
  TimeLimit(std::chrono::steady_clock::time_point start, const PlaceOptions& options)
      : start_(start), limit_s_(options.time_limit_s), caller_(options.stop) {}

  /// Calls work(stop), which is asked to stop when that share of the time is over.
  /// @return whether it was
  template <class Work>
  bool cuts(double share, const Work& work) const {
    if (!limit_s_) {
      work(caller_);
      return false;
    }
    const Alarm alarm(start_ + std::chrono::duration_cast<std::chrono::steady_clock::duration>(
                                   std::chrono::duration<double>(share * *limit_s_)),
                      caller_);
    work(alarm.token());
    return alarm.token().stop_requested() && !caller_.stop_requested();
  }

 private:
  std::chrono::steady_clock::time_point start_;
  std::optional<double> limit_s_;
  std::stop_token caller_;
};

// What lengths a pair of clouds gives where the source is scaled.
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

struct Candidates {
  std::vector<PlacementCandidate> poses;  // likeliest first
  bool cut_short = false;
};

// The search on samples of both maps, for a source that is no larger than the target, as far as that can
// be told: most of it has its place there, if they overlap.
class Placement {
 public:
  /// @param scales of the source at which poses are searched for
  Placement(const LandmarkCloud& source, const LandmarkCloud& target, std::vector<double> scales,
            const PlaceOptions& options)
      : options_(options),
        scales_(std::move(scales)),
        pair_(shuffled(source, Random(options.seed).fork(1)),
              shuffled(target, Random(options.seed).fork(2))),
        source_tree_(pair_.source().positions),
        target_tree_(pair_.target().positions),
        support_(pair_, source_tree_, target_tree_, kSample, Random(options.seed).fork(5),
                 options.executor),
        sight_(pair_, kSightPoints) {
    all_ = {cloud_scales(pair_.source(), source_tree_, options.executor),
            cloud_scales(pair_.target(), target_tree_, options.executor)};
    sample_ = {sample_scales(pair_.source(), all_.source, options.executor),
               sample_scales(pair_.target(), all_.target, options.executor)};
    distance_ = PoseDistance::of(pair_.source().positions);
  }

  /// Of the kernel, for a source of the scale.
  double fine(double scale) const { return all_.at(scale).fine; }
  /// Of the smaller cloud.
  std::size_t landmarks() const { return std::min(pair_.source().size(), pair_.target().size()); }

  Candidates candidates(const TimeLimit& time) const {
    const auto accept = [&](const Rigid3& pose) {
      if (!options_.gravity) return true;
      const Eigen::Vector3d down = pose.quaternion() * options_.gravity->source.normalized();
      return down.dot(options_.gravity->target.normalized()) >=
             std::cos(options_.gravity->max_tilt_rad);
    };
    Candidates result;
    std::vector<PlacementCandidate>& poses = result.poses;
    const auto turns = rotations(options_, Random(options_.seed).fork(3));
    for (std::size_t i = 0; i < scales_.size(); ++i) {
      // Each scale has its share of the time.
      const double done = static_cast<double>(i) / static_cast<double>(scales_.size());
      const double share = kSearchTime * (done + 1.0 / static_cast<double>(scales_.size()));
      const bool cut = time.cuts(share, [&](const std::stop_token& stop) {
        search(scales_[i], done, turns, accept, stop, poses);
      });
      result.cut_short = result.cut_short || cut;
    }
    if (!options_.scale) {
      DescriptorPoseOptions descriptors;
      descriptors.tolerance = fine(1.0);
      descriptors.executor = options_.executor;
      for (const Rigid3& pose :
           descriptor_poses(pair_, Random(options_.seed).fork(4), descriptors)) {
        if (accept(pose)) poses.push_back({.target_from_source = pose});
      }
    }
    const bool unrefined = time.cuts(kCandidatesTime, [&](const std::stop_token& stop) {
      refine_all(poses, sample_, kShortPoints, kShortIterations, stop);
      poses = distinct(std::move(poses), sample_, kVariants);
      refine_all(poses, all_, kSample, kFinalIterations, stop);
    });
    result.cut_short = result.cut_short || unrefined;
    if (options_.scale) {
      const auto [least, most] = *options_.scale;
      std::erase_if(poses, [&](const PlacementCandidate& pose) {
        return pose.scale < least * (1.0 - kScaleMargin) ||
               pose.scale > most * (1.0 + kScaleMargin);
      });
    }
    poses = distinct(std::move(poses), all_, 1);
    for (PlacementCandidate& pose : poses) {
      const SightCounts sight = sight_(pose.similarity());
      if (sight.total() >= kFewestSights) {
        pose.contradicted =
            static_cast<double>(sight.in_front) / static_cast<double>(sight.total());
      }
      set_similarity(pose, pair_.uncentred(pose.similarity()));
    }
    const std::vector<double> likely = probabilities(poses);
    for (std::size_t i = 0; i < poses.size(); ++i) poses[i].probability = likely[i];
    std::stable_sort(poses.begin(), poses.end(),
                     [](const PlacementCandidate& a, const PlacementCandidate& b) {
                       return a.probability > b.probability;
                     });
    return result;
  }

 private:
  // Adds the poses that a search at the scale finds.
  void search(double scale, double progress, std::span<const Eigen::Quaterniond> turns,
              const std::function<bool(const Rigid3&)>& accept, const std::stop_token& stop,
              std::vector<PlacementCandidate>& poses) const {
    const KernelScales kernel = all_.at(scale);
    SearchOptions options{
        .coarse = kernel.coarse, .fine = kernel.fine, .executor = options_.executor, .stop = stop};
    if (options_.progress) {
      options.progress = [&](double share) {
        options_.progress(progress + share / static_cast<double>(scales_.size()));
      };
    }
    std::vector<Eigen::Vector3d> source = pair_.source().positions;
    for (Eigen::Vector3d& position : source) position *= scale;
    for (const SearchCandidate& found :
         search_poses(source, pair_.source().weights, pair_.target().positions,
                      pair_.target().weights, turns, accept, options)) {
      poses.push_back({.target_from_source = found.target_from_source, .scale = scale});
    }
  }

  // Moves each pose to the optimum near it, at the fine scale of the lengths, and counts its support
  // there.
  void refine_all(std::vector<PlacementCandidate>& poses, const PairScales& lengths,
                  std::size_t points, int iterations, const std::stop_token& stop) const {
    // The candidates run beside each other, each on one thread.
    const RobustAlignment alignment(pair_, target_tree_, options_.use_covariances, false,
                                    Executor());
    options_.executor.for_blocks(poses.size(), 1, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        const double fine = lengths.at(poses[i].scale).fine;
        const Similarity3 pose = alignment
                                     .run(poses[i].similarity(),
                                          {.coarse = sample_.at(poses[i].scale).fine,
                                           .fine = fine,
                                           .max_iterations = iterations,
                                           .points = points,
                                           .free_scale = options_.scale.has_value()},
                                          stop)
                                     .target_from_source;
        poses[i].support = support_(pose, kMatched * fine);
        set_similarity(poses[i], pose);
      }
    });
  }

  // By which poses go on: evidence of positions and of looks. Most wrong ones have none of either; a few
  // landmarks that happen to meet must not outweigh a tenth of all.
  static double merit(const PlacementCandidate& pose) {
    constexpr double kSupport = 50.0;
    const Support& support = pose.support;
    return support.spread_evidence + support.spread_likeness + kSupport * support.share;
  }

  // The best of the poses, with at most so many variants of what people would call one.
  std::vector<PlacementCandidate> distinct(std::vector<PlacementCandidate> poses,
                                           const PairScales& lengths,
                                           std::ptrdiff_t variants) const {
    std::stable_sort(poses.begin(), poses.end(),
                     [](const PlacementCandidate& a, const PlacementCandidate& b) {
                       return merit(a) > merit(b);
                     });
    std::vector<PlacementCandidate> kept;
    for (const PlacementCandidate& pose : poses) {
      const double fine = lengths.at(pose.scale).fine;
      const auto within = [&](double radii) {
        return std::count_if(kept.begin(), kept.end(), [&](const PlacementCandidate& other) {
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
  CentredPair pair_;
  BatchTree source_tree_;
  BatchTree target_tree_;
  SupportCounter support_;
  SightChecker sight_;
  PairScales all_;     // of all landmarks
  PairScales sample_;  // of those that the search sees
  PoseDistance distance_;
};

struct Found {
  Candidates candidates;
  double fine = 0.0;          // scale of the kernel for the likeliest
  std::size_t landmarks = 0;  // of the smaller cloud
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

// For a source and a target of one scale, or, with PlaceOptions::scale, of nearly one.
Found find_candidates(const LandmarkCloud& source, const LandmarkCloud& target,
                      PlaceOptions options, const TimeLimit& time) {
  // Which is the larger cannot be seen where the scale is open; the one with fewer landmarks is likely
  // to be part of the other.
  const bool inverted =
      options.scale ? source.size() > target.size() : cloud_extent(source) > cloud_extent(target);
  if (inverted && options.gravity) std::swap(options.gravity->source, options.gravity->target);
  if (inverted && options.scale) {
    options.scale = ScaleRange{1.0 / options.scale->most, 1.0 / options.scale->least};
  }
  const Placement placement(
      inverted ? target : source, inverted ? source : target,
      options.scale ? scales_about_one(*options.scale) : std::vector<double>{1.0}, options);
  Found found{.candidates = placement.candidates(time), .landmarks = placement.landmarks()};
  std::vector<PlacementCandidate>& poses = found.candidates.poses;
  const double best = poses.empty() ? 1.0 : poses.front().scale;
  // In the unit of the caller's target.
  found.fine = placement.fine(best) / (inverted ? best : 1.0);
  if (inverted) {
    for (PlacementCandidate& pose : poses) set_similarity(pose, pose.similarity().inverse());
  }
  return found;
}

// By which the source is to be scaled for both clouds to have extents and spacings as alike as can be.
double likely_scale(const LandmarkCloud& source, const LandmarkCloud& target,
                    const Executor& executor) {
  const CloudScales from = cloud_scales(source, BatchTree(source.positions), executor);
  const CloudScales to = cloud_scales(target, BatchTree(target.positions), executor);
  const double square = to.extent * to.spacing / (from.extent * from.spacing);
  return std::isfinite(square) && square > 0.0 ? std::sqrt(square) : 1.0;
}

// Refines the likeliest candidate with all landmarks.
void refine_best(const LandmarkCloud& source, const LandmarkCloud& target,
                 const PlaceOptions& options, double fine, const TimeLimit& time,
                 PlacementResult& result) {
  const PlacementCandidate& best = result.candidates.front();
  result.probability = best.probability;
  RefineOptions refinement;
  refinement.initial = best.target_from_source;
  if (options.scale) refinement.scale = best.scale;
  refinement.by_icp_too = false;
  refinement.coarse = kReopened * fine;
  refinement.fine = fine;
  refinement.use_covariances = options.use_covariances;
  refinement.overlap_radius = options.overlap_radius.value_or(result.radius);
  refinement.executor = options.executor;
  refinement.trace = options.trace;
  const bool unfinished = time.cuts(1.0, [&](const std::stop_token& stop) {
    refinement.stop = stop;
    result.alignment = refine(source, target, refinement);
  });
  if (unfinished && result.alignment.status == AlignStatus::kCancelled) {
    result.cut_short = true;
    result.alignment.stop_reason = StopReason::kTimeLimit;
    result.alignment.status = status_of(StopReason::kTimeLimit);
    result.alignment.reason = fmt::format("stopped at the limit of time after {} iterations",
                                          result.alignment.iterations);
  }
  if (result.alignment.status != AlignStatus::kAligned) {
    result.verdict = Verdict::kRejected;
    result.reason = result.alignment.reason;
  }
}

}  // namespace

void PlaceOptions::validate() const {
  require(effort >= 1.0 / 16.0 && effort <= 64.0, "effort", effort, "from 1/16 to 64");
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

PlacementResult place(const LandmarkCloud& source, const LandmarkCloud& target,
                      const PlaceOptions& options) {
  const auto start = std::chrono::steady_clock::now();
  options.validate();
  source.validate("source");
  target.validate("target");
  PlacementResult result;
  result.time_limited = options.time_limit_s.has_value();
  if (std::min(source.size(), target.size()) < kFewestLandmarks) {
    result.reason =
        fmt::format("{} source and {} target landmarks: a pose is told from chance by at least {}",
                    source.size(), target.size(), kFewestLandmarks);
    result.alignment.reason = result.reason;
  } else {
    const TimeLimit time(start, options);
    Found found;
    if (options.scale) {
      const double scale = std::clamp(likely_scale(source, target, options.executor),
                                      options.scale->least, options.scale->most);
      PlaceOptions about_one = options;
      about_one.scale = {options.scale->least / scale, options.scale->most / scale};
      found = find_candidates(scaled(source, scale), target, std::move(about_one), time);
      for (PlacementCandidate& pose : found.candidates.poses) pose.scale *= scale;
    } else {
      found = find_candidates(source, target, options, time);
    }
    result.candidates = std::move(found.candidates.poses);
    result.cut_short = found.candidates.cut_short;
    result.radius = kMatched * found.fine;
    Judgement judgement = judge(result.candidates, found.landmarks, result.radius, options.unit);
    result.verdict = judgement.verdict;
    result.reason = std::move(judgement.reason);
    if (result.candidates.empty()) {
      result.alignment.reason = result.reason;
    } else {
      refine_best(source, target, options, found.fine, time, result);
    }
    if (result.cut_short) result.reason += "; the time limit cut the work short";
  }
  result.duration_s =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return result;
}

}  // namespace cairn
