// SPDX-License-Identifier: BSD-3-Clause
// Places parts of mapped sessions on each other, with truth: what the model of the verdict's probability
// is fitted to, and what it is tested with.
//   cairn_placement_sessions_benchmark FOLDER PAIRS PART [THREADS]
// FOLDER: see for_each_session_pair. PAIRS: how many, or FIRST-END. PART: fit (places of odd seed) or test
// (of even seed). One CSV row a candidate to stdout; that of rank -1 is the true pose, refined.
#include <cstdio>
#include <exception>
#include <numbers>
#include <string>
#include <vector>

#include "cairn/core/random.hpp"
#include "cairn/evaluation/pose_error.hpp"
#include "cairn/geometry/angles.hpp"
#include "cairn/geometry/covariance.hpp"
#include "cairn/placement/centred_pair.hpp"
#include "cairn/placement/place.hpp"
#include "cairn/placement/refine.hpp"
#include "cairn/placement/support_counter.hpp"
#include "cairn/registration/neighbors/batch_tree.hpp"

#include "session_pairs.hpp"

namespace {

using namespace cairn;
using benchmarks::SessionPair;

// -1 where the covariance is unknown.
double squared_mahalanobis(const AlignResult& result, const Rigid3& truth) {
  if (!result.covariance) return -1.0;
  return normalised_squared_error(result.target_from_source, *result.covariance, truth);
}

// What the true pose would be as a candidate: tells a failing search from maps that do not say more. All
// landmarks of the source are looked at, where place() looks at 4,096 of the map that extends less.
PlacementCandidate true_candidate(const SessionPair& pair, double radius) {
  RefineOptions refinement;
  refinement.initial = pair.truth;
  refinement.fine = 2.0 * radius;
  refinement.coarse = 4.0 * radius;
  refinement.by_icp_too = false;
  const CentredPair centred(pair.source, pair.target);
  const Rigid3 pose =
      centred.centred(refine(pair.source, pair.target, refinement).target_from_source).rigid();
  const BatchTree source_tree(centred.source().positions);
  const BatchTree target_tree(centred.target().positions);
  PlacementCandidate candidate;
  candidate.target_from_source = centred.uncentred(pose).rigid();
  candidate.support = SupportCounter(centred, source_tree, target_tree, pair.source.size(),
                                     Random(pair.number), Executor())(pose, radius);
  return candidate;
}

void tell(const SessionPair& pair, const Executor& executor) {
  const bool same = pair.same_place();
  PlaceOptions options;
  options.seed = pair.number;
  options.executor = executor;
  const PlacementResult result = place(pair.source, pair.target, options);
  std::vector<PlacementCandidate> candidates = result.candidates;
  if (same) candidates.push_back(true_candidate(pair, result.radius));
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    const PlacementCandidate& candidate = candidates[i];
    const Support& support = candidate.support;
    const PoseError error =
        same ? pose_error(candidate.target_from_source, pair.truth, pair.source.positions)
             : PoseError{std::numbers::pi, 100.0};
    std::printf(
        "%llu,%s,%s,%d,%.6f,%zu,%zu,%s,%.3f,%d,%zu,%zu,%.5f,%.3f,%.3f,"
        "%.3f,%.5f,%.6f,%.3f,%.4f,%.3f\n",
        static_cast<unsigned long long>(pair.number), pair.source_place.c_str(),
        pair.target_place.c_str(), same ? 1 : 0, pair.overlap, pair.source.size(),
        pair.target.size(), std::string(to_string(result.verdict)).c_str(), result.duration_s,
        i < result.candidates.size() ? static_cast<int>(i) : -1, support.matches,
        support.close_matches, support.share, support.evidence, support.spread_evidence,
        support.likeness ? support.spread_likeness : -1.0, candidate.contradicted.value_or(-1.0),
        candidate.probability, degrees(error.rotation_rad), error.translation,
        i == 0 && same ? squared_mahalanobis(result.alignment, pair.truth) : -1.0);
  }
  std::fflush(stdout);
}

}  // namespace

int main(int argc, char** argv) {
  const std::vector<std::string> words(argv + 1, argv + argc);
  if (words.size() < 3 || (words[2] != "fit" && words[2] != "test")) {
    std::fputs("usage: cairn_placement_sessions_benchmark FOLDER PAIRS fit|test [THREADS]\n",
               stderr);
    return 2;
  }
  try {
    const benchmarks::PairNumbers numbers = benchmarks::pair_numbers(words[1]);
    std::puts(
        "pair,source,target,same,overlap,source_landmarks,target_landmarks,verdict,wall_s,rank,"
        "matches,close_matches,support,evidence,spread_evidence,spread_likeness,contradicted,"
        "probability,"
        "rotation_deg,translation_m,mahalanobis");
    const Executor executor(words.size() > 3 ? static_cast<unsigned>(std::stoul(words[3])) : 0);
    benchmarks::for_each_session_pair(words[0], numbers, words[2] == "fit",
                                      [&](const SessionPair& pair) { tell(pair, executor); });
    return 0;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
