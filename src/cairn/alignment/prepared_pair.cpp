// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "cairn/alignment/align.hpp"
#include "cairn/alignment/detail/evidence/verdict.hpp"
#include "cairn/alignment/detail/refinement/refine.hpp"
#include "cairn/alignment/detail/search/placement.hpp"
#include "cairn/core/detail/require.hpp"
#include "cairn/core/error.hpp"
#include "cairn/geometry/angles.hpp"
#include "cairn/map/common_images.hpp"

namespace cairn {
namespace {

using namespace detail;

constexpr std::size_t kFewestLandmarks = 20;  // with fewer, a right pose looks like chance

// Scale of the source at which both clouds have the most similar extents and spacings.
double likely_scale(const CloudScales& from, const CloudScales& to) {
  const double square = to.extent * to.spacing / (from.extent * from.spacing);
  return std::isfinite(square) && square > 0.0 ? std::sqrt(square) : 1.0;
}

constexpr double kClear = 20.0;  // least evidence

// Whether descriptors show that landmarks are the same ones.
bool are_told_by_descriptors(const Finalist& pose) {
  return agreement_evidence(pose.support) > kClear;
}

// How closely the maps agree at a candidate, in fine scales; 1 if unknown. A much finer kernel would fit the errors
// of single landmarks.
double precision(const Finalist& pose) {
  constexpr double kPerDeviation = 2.0;
  const Support& support = pose.support;
  if (support.proximity.spread > kClear) {
    return std::max(kPerDeviation * support.proximity.deviation / kSmoothSpacings, kFinest);
  }
  // Descriptors also identify the same landmarks, but not their distances.
  return are_told_by_descriptors(pose)
             ? kPerDeviation * ProximityEvidence::kWidest / kSmoothSpacings
             : 1.0;
}

}  // namespace

// A placement of the caller's clouds, with the source scaled or the two exchanged if necessary.
class PreparedPair::Work {
 public:
  // @param even whether evenly spread landmarks represent dense clouds in the search and for the verdict
  Work(const PreparedMap& source, const PreparedMap& target, const AlignOptions& options,
       const Execution& execution, bool even)
      : Work(source, target, options, execution,
             even && source.even() ? *source.even() : source.cloud(),
             even && target.even() ? *target.even() : target.cloud()) {}

  // The same with all landmarks.
  std::unique_ptr<Work> with_all() const {
    return std::make_unique<Work>(source_, target_, callers_, execution_, false);
  }

  Alignment place() {
    return timed(
        [&](const TimeLimit& time, Alignment& result) { conclude(searched(time), time, result); });
  }
  Alignment judge(const Similarity3& pose);
  Alignment settle(const Similarity3& pose);

 private:
  struct Placed {
    Candidates found;
    std::size_t own = 0;  // index of the placed pose among them
  };

  Work(const PreparedMap& source, const PreparedMap& target, const AlignOptions& options,
       const Execution& execution, const PreparedCloud& source_cloud,
       const PreparedCloud& target_cloud)
      : source_(source),
        target_(target),
        callers_(options),
        options_(options),
        execution_(execution),
        unit_(options.scale ? std::clamp(likely_scale(source_cloud.scales(), target_cloud.scales()),
                                         options.scale->least, options.scale->most)
                            : 1.0),
        // With a free scale, sizes are not comparable; the cloud with fewer landmarks is probably part of the
        // other.
        inverted_(options.scale ? source_cloud.size() > target_cloud.size()
                                : source_cloud.scales().extent > target_cloud.scales().extent) {
    if (std::min(source_cloud.size(), target_cloud.size()) < kFewestLandmarks) return;
    if (inverted_ && options_.gravity) {
      std::swap(options_.gravity->source, options_.gravity->target);
    }
    std::vector<double> scales = {1.0};
    std::optional<double> equal = 1.0;
    if (options_.scale) {
      const double least = options_.scale->least / unit_;
      const double most = options_.scale->most / unit_;
      options_.scale = inverted_ ? ScaleRange{1.0 / most, 1.0 / least} : ScaleRange{least, most};
      // Free units are often equal, as of two maps that one program made.
      equal = inverted_ ? unit_ : 1.0 / unit_;
      if (*equal < options_.scale->least || *equal > options_.scale->most) equal.reset();
      if (equal && *equal != 1.0) scales.push_back(*equal);
    }
    const PreparedCloud moving = source_cloud.scaled(unit_, execution.executor);
    CommonImages common;
    if (source.images() && target.images()) {
      common = cairn::common_images(*source.images(), *target.images());
    }
    common_images_ = common.same.size();
    std::vector<DescriptorMatch> identities;
    for (const auto& [here, there] : common.landmarks) {
      identities.push_back({here.value, there.value, 0});
    }
    if (inverted_) {
      for (DescriptorMatch& match : identities) std::swap(match.source, match.target);
      placement_.emplace(target_cloud, moving, std::move(scales), equal, options_, execution_,
                         identities);
    } else {
      placement_.emplace(moving, target_cloud, std::move(scales), equal, options_, execution_,
                         identities);
    }
  }

  template <class Stages>
  Alignment timed(const Stages& stages);
  Similarity3 for_caller(const Similarity3& centred) const {
    const Similarity3 pose = placement_->uncentred(centred);
    const Similarity3 direct = inverted_ ? pose.inverse() : pose;
    return {direct.scale() * unit_, direct.rigid()};
  }
  Similarity3 centred(const Similarity3& callers) const {
    const Similarity3 direct(callers.scale() / unit_, callers.rigid());
    return placement_->centred(inverted_ ? direct.inverse() : direct);
  }
  // Scale of the kernel for a centred pose, in the unit of the caller's target.
  double fine(const Finalist& pose) const {
    return placement_->fine(pose.scale) / (inverted_ ? pose.scale : 1.0);
  }
  RegistrationResult refined(const Finalist& best, bool hold, const TimeLimit& time,
                             Alignment& result, KnownMatches known = {}) const;
  KnownMatches known_matches(const Finalist& best) const;
  // The matches with source and target in the caller's order.
  std::vector<Match> turned(std::vector<Match> matches) const {
    if (inverted_) {
      for (Match& match : matches) std::swap(match.source, match.target);
    }
    return matches;
  }
  const Candidates& searched(const TimeLimit& time);
  void conclude(Candidates found, const TimeLimit& time, Alignment& result) const;
  void conclude_held(const Placed& placed, const Finalist& held, std::optional<double> better,
                     const TimeLimit& time, Alignment& result) const;
  void judge_best(const Finalist& best, Alignment& result) const;
  std::optional<std::string> fits_mirrored(const Finalist& best) const;
  std::optional<std::string> fits_in_plane(const Finalist& best) const;
  Placed beside(Candidates found, const Finalist& pose) const;
  void report(const std::vector<Finalist>& poses, Alignment& result) const;
  void require_scale(const Similarity3& pose) const;

  const PreparedMap source_;
  const PreparedMap target_;
  const AlignOptions callers_;
  AlignOptions options_;  // in the placement's unit
  const Execution execution_;
  double unit_;  // factor of the source
  bool inverted_;
  std::size_t common_images_ = 0;
  std::optional<Placement> placement_;  // std::nullopt if there are too few landmarks
  std::optional<Candidates> searched_;
};

// The pose of a candidate at the scale where its refinement ended, with all landmarks.
RegistrationResult PreparedPair::Work::refined(const Finalist& best, bool hold,
                                               const TimeLimit& time, Alignment& result,
                                               KnownMatches known) const {
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
  constexpr double kReopened = 3.0;
  refinement.coarse = refinement.one_to_one ? kernel : kReopened * kernel;
  refinement.fine = refinement.finest = kernel;
  refinement.error_scale = std::min(kErrorScale * kernel, fine(best));
  refinement.overlap_radius = callers_.overlap_radius.value_or(result.radius);
  refinement.trace = callers_.trace;
  RegistrationResult alignment;
  const bool unfinished = time.cuts(1.0, [&](const std::stop_token& stop) {
    alignment = refine_with_known(source_, target_, refinement, known,
                                  {.executor = execution_.executor, .stop = stop});
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

// The landmarks that descriptors show to be the same, if descriptors decide alone. None if the maps are deformed
// against each other: only landmarks that happen to fit then agree, and many more agree nearly.
KnownMatches PreparedPair::Work::known_matches(const Finalist& best) const {
  constexpr double kMostBeside = 0.2;  // of those that agree, beside chance
  if (!is_decisive(best.support)) return {};
  std::vector<Match> known = placement_->agreeing(best.similarity(), 1.0);
  const auto count = static_cast<double>(known.size());
  // Chance grows with the area.
  const auto beside = static_cast<double>(placement_->agreeing(best.similarity(), 2.0).size());
  if (beside > (1.0 + kMostBeside) * count + 4.0 * best.support.agreement->expected) return {};
  return {.pairs = turned(std::move(known))};
}

// Candidates of the search; the same for every judged pose.
const Candidates& PreparedPair::Work::searched(const TimeLimit& time) {
  if (!searched_) searched_ = placement_->candidates(time);
  return *searched_;
}

void PreparedPair::Work::report(const std::vector<Finalist>& poses, Alignment& result) const {
  for (const Finalist& pose : poses) {
    set_similarity(result.candidates.emplace_back(pose), for_caller(pose.similarity()));
  }
}

// Refines the likeliest pose with all landmarks and judges the result like the candidates. If another pose is
// then likelier, also refines that one. Keeps a candidate unchanged if it has more evidence than its
// refinement.
void PreparedPair::Work::conclude(Candidates found, const TimeLimit& time,
                                  Alignment& result) const {
  constexpr int kAttempts = 4;  // at the last refinement
  result.cut_short = found.cut_short;
  if (found.poses.empty()) {
    result.radius = kMatched * placement_->fine(1.0);
    result.verdict = Verdict::kRejected;
    result.reason = detail::judge({}, {}, placement_->landmarks()).reason;
    result.registration.reason = result.reason;
    return;
  }
  for (int attempt = 0; attempt < kAttempts; ++attempt) {
    const Finalist best = found.poses.front();
    result.radius = kMatched * fine(best);
    if (auto fitted = placement_->fitted_to_identities(best)) {
      result.registration = refined(fitted->first, true, time, result,
                                    {.pairs = turned(std::move(fitted->second)), .decide = true});
      found.poses.front() = std::move(fitted->first);
      found.poses = placement_->with_probabilities(std::move(found.poses));
      break;
    }
    result.registration = refined(best, false, time, result, known_matches(best));
    if (result.registration.status == RegistrationStatus::kCancelled) break;
    const bool failed = result.registration.status == RegistrationStatus::kFailed;
    Finalist after = placement_->assessed(centred(result.registration.similarity()));
    // Evidence at the finer scales can only be lost if there is some.
    const bool worse =
        precision(best) < 1.0 && Placement::merit(after) < kKeptMerit * Placement::merit(best);
    const bool settled = !failed && !worse && placement_->allows(after);
    if (!settled || attempt + 1 == kAttempts) {
      result.registration = refined(best, true, time, result);
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
void PreparedPair::Work::judge_best(const Finalist& best, Alignment& result) const {
  result.around = placement_->around(best.similarity());
  Judgement judgement =
      detail::judge(result.candidates, result.registration, placement_->landmarks(),
                    callers_.min_probability, result.around);
  result.verdict = judgement.verdict;
  result.reason = std::move(judgement.reason);
  if (result.verdict != Verdict::kAligned) return;
  if (const auto why = fits_mirrored(best)) {
    result.verdict = Verdict::kRejected;
    result.reason = fmt::format("{}; {}", *why, result.reason);
  } else if (const auto plane = fits_in_plane(best)) {
    result.verdict = Verdict::kAmbiguous;
    result.reason = fmt::format("{}; {}", *plane, result.reason);
  }
}

// Why the maps may show different things on one floor; std::nullopt if they do not.
std::optional<std::string> PreparedPair::Work::fits_in_plane(const Finalist& best) const {
  // docs/evidence.md explains the choice.
  constexpr double kMost = 0.8;       // of the matches
  constexpr double kElsewhere = 0.5;  // of the matched share in the plane
  const detail::PlaneMatches plane = placement_->lattice_matches_in_plane(best.similarity());
  if (plane.share < kMost || plane.elsewhere >= kElsewhere) return std::nullopt;
  return fmt::format(
      "{:.0f} % of the matches lie in one plane, and both maps were sampled on a lattice, as by a "
      "depth camera: two sensors at one height sample a floor alike, whatever stands on it",
      100.0 * plane.share);
}

// Why the mirror image of the source fits better than the source; std::nullopt if it does not. Positions alone do not
// distinguish a nearly symmetric thing from its mirror image; descriptors do, because an image has no mirrored
// corners.
std::optional<std::string> PreparedPair::Work::fits_mirrored(const Finalist& best) const {
  constexpr double kClearlyMore = 1.5;
  constexpr double kBeyondChance = 20.0;  // matches
  if (are_told_by_descriptors(best) || is_proven(best.support)) return std::nullopt;
  const auto image = placement_->of_mirror_image(execution_.stop);
  if (!image) return std::nullopt;
  // A given pose may lie beside its optimum, where few matches are close; the image's pose does not.
  const Finalist settled = placement_->settled(best.similarity(), execution_.stop);
  for (std::size_t i = Support::kFine; i < Support::kRadii; ++i) {
    const std::size_t here = std::max(best.support.within[i], settled.support.within[i]);
    const std::size_t there = image->support.within[i];
    if (static_cast<double>(there) < kClearlyMore * static_cast<double>(here) + kBeyondChance) {
      continue;
    }
    return fmt::format(
        "the mirror image of the source fits better ({} close matches instead of {}), as where one "
        "map has left-handed axes",
        there, here);
  }
  return std::nullopt;
}

// Adds a given pose to the poses found. It replaces the poses that a user would consider the same.
PreparedPair::Work::Placed PreparedPair::Work::beside(Candidates found,
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
void PreparedPair::Work::conclude_held(const Placed& placed, const Finalist& held,
                                       std::optional<double> better, const TimeLimit& time,
                                       Alignment& result) const {
  const auto& [found, own] = placed;
  result.cut_short = found.cut_short;
  result.radius = kMatched * fine(held);
  result.registration = refined(held, true, time, result);
  // A stopped search may have missed likelier poses.
  if (execution_.stop.stop_requested()) {
    result.registration.status = RegistrationStatus::kCancelled;
    result.registration.stop_reason = StopReason::kCancelled;
    result.registration.reason = result.reason = "cancelled before the pose was judged";
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
        probability_text(found.poses.front().probability), probability_text(*result.probability));
    return;
  }
  // Beside an optimum, directions can look open that are determined.
  std::optional<double> off;
  if (!result.registration.unobservable.empty()) {
    const RegistrationResult optimum = refined(held, false, time, result, known_matches(held));
    if (optimum.covariance) {
      off = placement_->apart(held.similarity(), centred(optimum.similarity()));
      result.registration.unobservable.clear();
      result.registration.covariance = optimum.covariance;
    }
  }
  judge_best(found.poses.front(), result);
  if (off) result.registration.covariance.reset();
  if (off && result.verdict != Verdict::kRejected) {
    result.verdict = Verdict::kAmbiguous;
    result.reason = fmt::format(
        "the pose has no covariance, because it is {:.2g} matching radii (root mean square over "
        "the landmarks) beside an optimum; {}",
        radii(*off), result.reason);
  }
}

void PreparedPair::Work::require_scale(const Similarity3& pose) const {
  constexpr double kOne = 1e-9;
  if (callers_.scale || std::abs(pose.scale() - 1.0) <= kOne) return;
  throw Error(ErrorKind::kMisuse, "target_from_source", fmt::format("scale {}", pose.scale()),
              "1, or AlignOptions.scale");
}

template <class Stages>
Alignment PreparedPair::Work::timed(const Stages& stages) {
  const auto start = std::chrono::steady_clock::now();
  Alignment result;
  result.verdict = Verdict::kRejected;
  result.probability = 0.0;
  result.deterministic = !callers_.time_limit_s;
  if (!placement_) {
    result.reason = fmt::format("{} source and {} target landmarks: at least {} of each are needed",
                                source_.cloud().size(), target_.cloud().size(), kFewestLandmarks);
    result.registration.reason = result.reason;
  } else {
    stages(TimeLimit(start, callers_.time_limit_s, execution_.stop), result);
    result.common_images = common_images_;
    if (common_images_ > 0) {
      result.reason += fmt::format(
          "; {} in both maps",
          common_images_ == 1 ? "1 image is" : fmt::format("{} images are", common_images_));
    }
    if (result.cut_short) result.reason += "; the time limit cut the work short";
    for (const auto& [map, name] : {std::pair(&source_, "source"), std::pair(&target_, "target")}) {
      if (!map->cloud().ignores_covariances()) continue;
      result.reason += fmt::format(
          "; the covariances of the {} are not used, because they exceed a tenth of its extent",
          name);
    }
  }
  take_pose(result);
  result.duration_s =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return result;
}

Alignment PreparedPair::Work::judge(const Similarity3& pose) {
  require_scale(pose);
  return timed([&](const TimeLimit& time, Alignment& result) {
    const Candidates& found = searched(time);
    const Finalist held = placement_->assessed(centred(pose));
    const auto [better, off] = placement_->better_near(found.poses, held);
    // A better pose nearby is compared with the others instead.
    const Placed placed = beside(found, better.value_or(held));
    conclude_held(placed, better ? held : placed.found.poses[placed.own],
                  better ? std::optional(off) : std::nullopt, time, result);
  });
}

Alignment PreparedPair::Work::settle(const Similarity3& pose) {
  require_scale(pose);
  return timed([&](const TimeLimit& time, Alignment& result) {
    const Candidates& found = searched(time);
    Finalist settled = placement_->settled(centred(pose), execution_.stop);
    if (const auto better = placement_->better_near(found.poses, settled).first) settled = *better;
    Placed placed = beside(found, settled);
    if (placed.own == 0 && placement_->allows(settled)) {
      return conclude(std::move(placed.found), time, result);
    }
    conclude_held(placed, placed.found.poses[placed.own], std::nullopt, time, result);
  });
}

PreparedPair::PreparedPair(const PreparedMap& source, const PreparedMap& target,
                           const AlignOptions& options, const Execution& execution) {
  options.validate();
  AlignOptions each = options;
  if (source.even() || target.even()) {
    if (each.time_limit_s) *each.time_limit_s *= 0.5;
    even_ = std::make_unique<Work>(source, target, each, execution, true);
  } else {
    work_ = std::make_unique<Work>(source, target, each, execution, false);
  }
}
PreparedPair::~PreparedPair() = default;
PreparedPair::PreparedPair(PreparedPair&&) noexcept = default;
PreparedPair& PreparedPair::operator=(PreparedPair&&) noexcept = default;

template <class Judge>
Alignment PreparedPair::likeliest(const Judge& judge) {
  if (!even_) return judge(*work_);
  Alignment evenly = judge(*even_);
  if (evenly.verdict == Verdict::kAligned) return evenly;
  if (!work_) work_ = even_->with_all();
  Alignment all = judge(*work_);
  const bool is_likelier =
      all.verdict == Verdict::kAligned || all.probability >= evenly.probability;
  return is_likelier ? all : evenly;
}

Alignment PreparedPair::place() {
  return likeliest([](Work& work) { return work.place(); });
}

Alignment PreparedPair::judge(const Similarity3& target_from_source) {
  return likeliest([&](Work& work) { return work.judge(target_from_source); });
}

Alignment PreparedPair::settle(const Similarity3& target_from_source) {
  return likeliest([&](Work& work) { return work.settle(target_from_source); });
}

Alignment place(const LandmarkCloud& source, const LandmarkCloud& target,
                const AlignOptions& options, const Execution& execution) {
  const auto start = std::chrono::steady_clock::now();
  options.validate();
  Alignment result = PreparedPair(PreparedMap(source, "source", execution),
                                  PreparedMap(target, "target", execution), options, execution)
                         .place();
  result.duration_s =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return result;
}

}  // namespace cairn
