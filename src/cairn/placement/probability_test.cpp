// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/placement/probability.hpp"

#include <numeric>
#include <optional>
#include <vector>

#include <gtest/gtest.h>

namespace cairn {
namespace {

// @param close share of 3,000 landmarks that meet closely
PlacementCandidate candidate(double close, double evidence,
                             std::optional<double> contradicted = std::nullopt) {
  const auto close_matches = static_cast<std::size_t>(3000.0 * close);
  return {.target_from_source = {},
          .support = {.matches = 2 * close_matches,
                      .close_matches = close_matches,
                      .evidence = 1.2 * evidence,
                      .spread_evidence = evidence},
          .contradicted = contradicted};
}

double best_of(const std::vector<PlacementCandidate>& candidates) {
  return probabilities(candidates).front();
}

TEST(Probability, LeavesRoomForNone) {
  const std::vector<PlacementCandidate> poses = {candidate(0.2, 30.0, 0.01),
                                                 candidate(0.1, 0.0, 0.1), candidate(0.1, 0.0)};
  const std::vector<double> all = probabilities(poses);
  ASSERT_EQ(all.size(), poses.size());
  for (const double probability : all) EXPECT_GT(probability, 0.0);
  EXPECT_LT(std::accumulate(all.begin(), all.end(), 0.0), 1.0);
  EXPECT_TRUE(probabilities({}).empty());
}

TEST(Probability, GrowsWithWhatSpeaksForAPose) {
  const auto best_beside = [](const PlacementCandidate& best, double other) {
    return best_of({best, candidate(other, 0.0, 0.1)});
  };
  const double middle = best_beside(candidate(0.15, 10.0, 0.03), 0.08);
  EXPECT_GT(best_beside(candidate(0.2, 10.0, 0.03), 0.08), middle);
  EXPECT_GT(best_beside(candidate(0.15, 20.0, 0.03), 0.08), middle);
  EXPECT_GT(best_beside(candidate(0.15, 10.0, 0.01), 0.08), middle);
  EXPECT_GT(best_beside(candidate(0.15, 10.0, 0.03), 0.04), middle);
}

PlacementCandidate looking(PlacementCandidate candidate, double likeness) {
  candidate.support.likeness = Likeness{100, 10};
  candidate.support.spread_likeness = likeness;
  return candidate;
}

TEST(Probability, GrowsWithHowManyMatchesLookAlike) {
  for (const auto sight : {std::optional<double>(0.03), std::optional<double>()}) {
    const PlacementCandidate other = looking(candidate(0.08, 0.0, sight), 0.0);
    double last = 0.0;
    for (const double likeness : {0.0, 5.0, 30.0, 300.0}) {
      const double best = best_of({looking(candidate(0.15, 10.0, sight), likeness), other});
      EXPECT_GT(best, last);
      last = best;
    }
    // A weak pose whose landmarks look alike is believed; a fair one whose landmarks do not, less.
    EXPECT_GT(best_of({looking(candidate(0.15, 10.0, sight), 300.0), other}), 0.95);
    EXPECT_LT(best_of({looking(candidate(0.15, 10.0, sight), 0.0), other}),
              best_of({candidate(0.15, 10.0, sight), candidate(0.08, 0.0, sight)}));
  }
}

TEST(Probability, IsHighForClearPosesAndLowForChance) {
  const PlacementCandidate wrong = candidate(0.09, 0.0, 0.1);
  EXPECT_GT(best_of({candidate(0.4, 200.0, 0.01), wrong, wrong}), 0.99);
  EXPECT_GT(best_of({candidate(0.4, 200.0), candidate(0.1, 0.0)}), 0.99);
  EXPECT_LT(best_of({candidate(0.1, 0.0, 0.1), wrong, wrong}), 0.01);
  EXPECT_LT(best_of({candidate(0.1, 0.0), candidate(0.09, 0.0)}), 0.05);
}

TEST(Probability, IsSharedAmongEquals) {
  const PlacementCandidate right = candidate(0.4, 200.0, 0.01);
  const PlacementCandidate wrong = candidate(0.09, 0.0, 0.1);
  const std::vector<double> all =
      probabilities(std::vector<PlacementCandidate>{right, right, wrong, wrong, wrong});
  EXPECT_DOUBLE_EQ(all[0], all[1]);
  EXPECT_NEAR(all[0], 0.5, 0.02);
  EXPECT_LT(all[2], 0.01);
}

}  // namespace
}  // namespace cairn
