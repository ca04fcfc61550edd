// SPDX-License-Identifier: BSD-3-Clause
// Places parts of mapped sessions on each other, with truth: what the model of the verdict's probability
// is fitted to, and what it is tested with.
//   cairn_placement_sessions_benchmark FOLDER PAIRS PART [VARIANT,...]
// FOLDER: see for_each_session_pair. PAIRS: how many, or FIRST-END. PART: fit, choose or test, by the
// places' seeds. VARIANT: shipped (default), descriptors (no search), searched (always), undescribed (maps
// without descriptors and colours), coloured_views (without descriptors), bare (positions alone), scaled
// (positions without covariances, the source 1.7 times as large, and a free scale), coloured (with colours alone), one,
// one_descriptors (shipped and descriptors with one descriptor of a landmark) or truth (the true pose, refined). One
// CSV row a candidate to stdout; rank -1 stands for there being none.
//   cairn_placement_sessions_benchmark FOLDER PAIRS PART guesses
// instead refines and judges guesses, from near the true pose to 60 degrees and 2 m off it; one row a guess.
#include <array>
#include <cstdio>
#include <exception>
#include <numbers>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "cairn/alignment/align.hpp"
#include "cairn/alignment/detail/cloud_scales.hpp"
#include "cairn/alignment/detail/evidence/support_counter.hpp"
#include "cairn/alignment/detail/prepared_cloud.hpp"
#include "cairn/alignment/detail/search/descriptor_matches.hpp"
#include "cairn/core/random.hpp"
#include "cairn/evaluation/pose_error.hpp"
#include "cairn/geometry/angles.hpp"
#include "cairn/geometry/covariance.hpp"
#include "cairn/geometry/detail/centroid.hpp"
#include "cairn/geometry/detail/pose_distance.hpp"

#include "session_pairs.hpp"
#include "study_main.hpp"

namespace {

using namespace cairn;
using benchmarks::SessionPair;

// -1 where the covariance is unknown.
double squared_mahalanobis(const RegistrationResult& result, const Rigid3& truth) {
  if (!result.covariance) return -1.0;
  return normalised_squared_error(result.target_from_source, *result.covariance, truth);
}

// What the true pose, refined, would be as a candidate: tells a failing search from maps that do not say
// more.
void tell_truth(const SessionPair& pair) {
  if (!pair.same_place()) return;
  const detail::PreparedCloud source(pair.source);
  const detail::PreparedCloud target(pair.target);
  const double fine = detail::kernel_scales(source.scales(), target.scales()).fine;
  RefineOptions refinement;
  refinement.initial = pair.truth;
  refinement.coarse = refinement.fine = 0.5 * fine;
  refinement.finest = fine / 12.0;
  refinement.by_icp_too = false;
  const Rigid3 pose = refine(pair.source, pair.target, refinement).target_from_source;
  const Similarity3 at = detail::centred_pose(source, target, pose);
  const Support support = detail::SupportCounter(source, target, pair.source.size(),
                                                 Random(pair.number))(at, 0.5 * fine);
  const DescriptorAgreement agreement =
      detail::DescriptorMatches(source.landmarks(), target.landmarks()).agreement(at, 0.5 * fine);
  const PoseError error = pose_error(pose, pair.truth, pair.source.positions);
  std::printf(
      "truth,%llu,%s,%s,1,%.6f,%zu,%zu,,0,-1,%zu,%zu,%zu,%zu,%zu,%zu,%.5f,%.3f,%.3f,0,0,0,0,1,"
      "%zu,%zu,%zu,%.4f,%.3f,-1,0,%.3f,%.4f,-1,-1,-1,0,-1\n",
      static_cast<unsigned long long>(pair.number), pair.source_place.c_str(),
      pair.target_place.c_str(), pair.overlap, pair.source.size(), pair.target.size(),
      support.within[0], support.within[1], support.within[2], support.within[3], support.within[4],
      support.within[5], support.share, support.evidence, support.spread_evidence,
      agreement.matches, agreement.agreeing, agreement.spread, agreement.expected,
      support.likeness ? support.spread_likeness : -1.0, degrees(error.rotation_rad),
      error.translation);
}

// Guesses of a pose, refined as align() refines a prior pose and then judged. Between places the "truth"
// that they are drawn about means nothing.
void tell_guesses(const SessionPair& pair, const Executor& executor) {
  constexpr int kGuesses = 20;
  const Execution execution{.executor = executor, .seed = pair.number};
  PreparedPair prepared(PreparedMap(pair.source, "source", execution),
                        PreparedMap(pair.target, "target", execution), {}, execution);
  Random random(pair.number + 77);
  const Eigen::Vector3d middle = pair.truth * centroid(pair.source.positions);
  for (int i = 0; i < kGuesses; ++i) {
    // Every other one is near.
    const double share = i % 2 == 0 ? 0.15 * random.uniform() : random.uniform();
    const double angle = share * radians(60.0);
    const double offset = share * 2.0;
    const auto direction = [&] {
      return Eigen::Vector3d(random.normal(), random.normal(), random.normal()).normalized();
    };
    const Eigen::Quaterniond turn(Eigen::AngleAxisd(angle, direction()));
    const Rigid3 about(turn, middle + offset * direction() - turn * middle);
    RefineOptions refinement;
    refinement.initial = about * pair.truth;
    const RegistrationResult refined = refine(pair.source, pair.target, refinement, execution);
    if (!refined.has_pose()) continue;
    const Alignment result = prepared.settle(refined.similarity());
    const PoseError error = pair.same_place() ? pose_error(result.registration.target_from_source,
                                                           pair.truth, pair.source.positions)
                                              : PoseError{std::numbers::pi, 100.0};
    std::printf("guess,%llu,%s,%s,%.4f,%.2f,%.3f,%s,%.6f,%.3f,%.4f\n",
                static_cast<unsigned long long>(pair.number), pair.source_place.c_str(),
                pair.target_place.c_str(), pair.overlap, degrees(angle), offset,
                std::string(to_string(*result.verdict)).c_str(), *result.probability,
                degrees(error.rotation_rad), error.translation);
  }
  std::fflush(stdout);
}

struct Variant {
  const char* name;
  PoseSearch search;
  bool with_descriptors;
  bool with_views;
  bool with_lightness = true;
  bool with_further = true;   // descriptors of a landmark, beside the one that represents it
  double source_scale = 1.0;  // if not 1, the scale is estimated
};

constexpr std::array<Variant, 10> kVariants = {{
    {"shipped", PoseSearch::kWhereNeeded, true, true},
    {"descriptors", PoseSearch::kNever, true, true},
    {"searched", PoseSearch::kAlways, true, true},
    {"undescribed", PoseSearch::kAlways, false, true, false},
    {"coloured_views", PoseSearch::kAlways, false, true},
    {"bare", PoseSearch::kAlways, false, false, false},
    {"scaled", PoseSearch::kAlways, false, false, false, true, 1.7},
    {"coloured", PoseSearch::kAlways, false, false},
    {"one", PoseSearch::kWhereNeeded, true, true, true, false},
    {"one_descriptors", PoseSearch::kNever, true, true, true, false},
}};

void tell(const SessionPair& pair, const Variant& variant, const Executor& executor) {
  const bool same = pair.same_place();
  AlignOptions options;
  options.search = variant.search;
  LandmarkCloud source = pair.source;
  LandmarkCloud target = pair.target;
  for (LandmarkCloud* const cloud : {&source, &target}) {
    if (!variant.with_descriptors) cloud->descriptors.reset();
    if (!variant.with_further && cloud->descriptors) {
      cloud->descriptors->further_offsets.clear();
      cloud->descriptors->further.clear();
    }
    if (!variant.with_views) cloud->views.clear();
    if (!variant.with_lightness) cloud->lightness.clear();
  }
  if (variant.source_scale != 1.0) {
    options.scale = ScaleRange();
    for (Eigen::Vector3d& position : source.positions) position *= variant.source_scale;
    source.covariances.clear();
    target.covariances.clear();
  }
  const Similarity3 truth =
      Similarity3(pair.truth) * Similarity3(1.0 / variant.source_scale, Rigid3());
  const Alignment result =
      place(source, target, options, {.executor = executor, .seed = pair.number});
  std::vector<PlacementCandidate> candidates = result.candidates;
  const double size = PoseDistance::of(pair.source.positions).radius;
  // A pair of which nothing is known counts, too.
  if (candidates.empty()) candidates.emplace_back();
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    const PlacementCandidate& candidate = candidates[i];
    const Support& support = candidate.support;
    const PoseError error = same ? pose_error(candidate.similarity(), truth, source.positions)
                                 : PoseError{std::numbers::pi, 100.0};
    const DescriptorAgreement agreement = support.agreement.value_or(DescriptorAgreement{});
    std::printf(
        "%s,%llu,%s,%s,%d,%.6f,%zu,%zu,%s,%.3f,%d,%zu,%zu,%zu,%zu,%zu,%zu,%.5f,%.3f,%.3f,"
        "%.3f,%.3f,%.3f,%.3f,%d,%zu,%zu,%zu,%.4f,%.3f,%.5f,%.6f,%.3f,%.4f,%.3f,%.3f,%.3f,%.4f,%."
        "4f\n",
        variant.name, static_cast<unsigned long long>(pair.number), pair.source_place.c_str(),
        pair.target_place.c_str(), same ? 1 : 0, pair.overlap, pair.source.size(),
        pair.target.size(), std::string(to_string(*result.verdict)).c_str(), result.duration_s,
        i < result.candidates.size() ? static_cast<int>(i) : -1, support.within[0],
        support.within[1], support.within[2], support.within[3], support.within[4],
        support.within[5], support.share, support.evidence, support.spread_evidence,
        support.proximity.all, support.proximity.spread, support.proximity.share,
        support.proximity.deviation, support.agreement ? 1 : 0, agreement.matches,
        agreement.agreeing, agreement.spread, agreement.expected,
        support.likeness ? support.spread_likeness : -1.0, candidate.contradicted.value_or(-1.0),
        candidate.probability, degrees(error.rotation_rad), error.translation,
        i == 0 && same && variant.source_scale == 1.0
            ? squared_mahalanobis(result.registration, pair.truth)
            : -1.0,
        support.contrast ? support.contrast->correlation : -1.0,
        support.contrast ? support.contrast->spread : -1.0,
        candidate.scale * variant.source_scale - 1.0, size);
  }
  std::fflush(stdout);
}

void run(const std::vector<std::string>& words) {
  const benchmarks::PairNumbers numbers = benchmarks::pair_numbers(words[1]);
  const Executor executor(1);
  if (words.size() > 3 && words[3] == "guesses") {
    std::puts(
        "variant,pair,source,target,overlap,guess_deg,guess_m,verdict,probability,rotation_deg,"
        "translation_m");
    benchmarks::for_each_session_pair(
        words[0], numbers, benchmarks::session_part(words[2]),
        [&](const SessionPair& pair) { tell_guesses(pair, executor); });
    return;
  }
  std::puts(
      "variant,pair,source,target,same,overlap,source_landmarks,target_landmarks,verdict,wall_s,"
      "rank,"
      "within_0,within_1,within_2,within_3,within_4,within_5,support,evidence,spread_evidence,"
      "proximity,spread_proximity,same_share,same_deviation,described,descriptor_matches,"
      "agreeing,spread_agreeing,expected_agreeing,spread_likeness,contradicted,probability,"
      "rotation_deg,translation_m,mahalanobis,contrast,spread_contrast,"
      "scale_error,source_radius_m");
  const std::string wanted = fmt::format(",{},", words.size() > 3 ? words[3] : "shipped");
  benchmarks::for_each_session_pair(
      words[0], numbers, benchmarks::session_part(words[2]), [&](const SessionPair& pair) {
        for (const Variant& variant : kVariants) {
          if (wanted.find(fmt::format(",{},", variant.name)) == std::string::npos) continue;
          tell(pair, variant, executor);
        }
        if (wanted.find(",truth,") != std::string::npos) tell_truth(pair);
      });
}

}  // namespace

int main(int argc, char** argv) {
  return benchmarks::study_main(argc, argv, 3, "FOLDER PAIRS fit|choose|test [VARIANT,...]", run);
}
