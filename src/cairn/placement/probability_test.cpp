// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/placement/probability.hpp"

#include <numeric>
#include <optional>
#include <vector>

#include <gtest/gtest.h>

namespace cairn {
namespace {

PlacementCandidate candidate(double support, double evidence,
                             std::optional<double> contradicted = std::nullopt) {
  return {.target_from_source = {},
          .support = 2.0 * support,
          .close_support = support,
          .evidence = 1.2 * evidence,
          .spread_evidence = evidence,
          .contradicted = contradicted};
}

double best_of(const std::vector<PlacementCandidate>& candidates, std::size_t landmarks = 3000) {
  return probabilities(candidates, landmarks).front();
}

TEST(Probability, LeavesRoomForNone) {
  const std::vector<PlacementCandidate> poses = {candidate(0.2, 30.0, 0.01),
                                                 candidate(0.1, 0.0, 0.1), candidate(0.1, 0.0)};
  const std::vector<double> all = probabilities(poses, 2000);
  ASSERT_EQ(all.size(), poses.size());
  for (const double probability : all) EXPECT_GT(probability, 0.0);
  EXPECT_LT(std::accumulate(all.begin(), all.end(), 0.0), 1.0);
  EXPECT_TRUE(probabilities({}, 1000).empty());
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
      probabilities(std::vector<PlacementCandidate>{right, right, wrong, wrong, wrong}, 3000);
  EXPECT_DOUBLE_EQ(all[0], all[1]);
  EXPECT_NEAR(all[0], 0.5, 0.02);
  EXPECT_LT(all[2], 0.01);
}

}  // namespace
}  // namespace cairn
