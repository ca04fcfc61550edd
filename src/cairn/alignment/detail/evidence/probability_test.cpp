// SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <numeric>
#include <optional>
#include <vector>

#include <gtest/gtest.h>

#include "cairn/alignment/detail/evidence/verdict.hpp"

namespace cairn::detail {
namespace {

// @param close share of 3,000 landmarks that meet closely
PlacementCandidate candidate(double close, double evidence,
                             std::optional<double> contradicted = std::nullopt) {
  const auto close_matches = static_cast<std::size_t>(3000.0 * close);
  return {.target_from_source = {},
          .support = {.within = {2 * close_matches, close_matches, close_matches / 2,
                                 close_matches / 4, close_matches / 8, 0},
                      .evidence = 1.2 * evidence,
                      .spread_evidence = evidence,
                      .proximity = {.all = 1.2 * evidence, .spread = evidence}},
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

PlacementCandidate looking(PlacementCandidate candidate, double likeness, std::size_t agreeing) {
  candidate.support.likeness = Likeness{100, 10};
  candidate.support.spread_likeness = likeness;
  candidate.support.agreement = DescriptorAgreement{200, agreeing, agreeing, 0.5};
  return candidate;
}

TEST(Probability, GrowsWithHowManyMatchesLookAlikeAndHowManyDescriptorMatchesAgree) {
  for (const auto sight : {std::optional<double>(0.03), std::optional<double>()}) {
    const PlacementCandidate other = looking(candidate(0.08, 0.0, sight), 0.0, 0);
    const auto best_with = [&](double likeness, std::size_t agreeing) {
      return best_of({looking(candidate(0.05, 10.0, sight), likeness, agreeing), other});
    };
    EXPECT_LT(best_with(0.0, 0), best_with(5.0, 0));
    EXPECT_LT(best_with(5.0, 0), best_with(30.0, 0));
    EXPECT_LT(best_with(0.0, 1), best_with(0.0, 5));
    EXPECT_LT(best_with(0.0, 5), best_with(0.0, 20));
    // A weak pose whose landmarks look alike is believed; one whose landmarks do not is not.
    EXPECT_GT(best_with(300.0, 0), 0.95);
    EXPECT_GT(best_with(0.0, 80), 0.95);
    EXPECT_LT(best_with(0.0, 0), 0.3);
  }
}

TEST(Probability, OfAPoseThatDescriptorsShowIsHighHoweverManyOtherLandmarksMatch) {
  PlacementCandidate best = looking(candidate(0.3, 10.0, 0.02), 80.0, 45);
  const PlacementCandidate other = looking(candidate(0.15, 0.0, 0.05), 0.0, 0);
  EXPECT_GT(best_of({best, other}), 0.99);
  // Unless descriptors also agree with another pose.
  EXPECT_LT(best_of({best, looking(candidate(0.15, 0.0, 0.05), 0.0, 44)}), best_of({best, other}));
  best.support.agreement = DescriptorAgreement{200, 3, 3, 0.5};
  EXPECT_LT(best_of({best, other}), 0.99);
}

double log_odds_of(double probability) {
  return std::log(probability / (1.0 - probability));
}

TEST(Probability, OfALonePoseIsAsIfAnotherMatchedHalfAsManyClosely) {
  const PlacementCandidate lone = candidate(0.12, 10.0);
  PlacementCandidate other = candidate(0.0, 0.0);
  other.support.within = lone.support.within;
  for (std::size_t& matches : other.support.within) matches /= 2;
  const double beside = best_of({lone, other});
  ASSERT_GT(beside, 0.01);
  ASSERT_LT(beside, 0.9);
  EXPECT_NEAR(log_odds_of(best_of({lone})), log_odds_of(beside), 0.02);
}

TEST(Probability, IsComparedWithTheBestOfAllOtherPoses) {
  const PlacementCandidate best = candidate(0.15, 10.0);
  const PlacementCandidate close = candidate(0.12, 0.0);
  const PlacementCandidate far = candidate(0.03, 0.0);
  const double beside_close = best_of({best, close});
  EXPECT_LT(log_odds_of(beside_close), log_odds_of(best_of({best, far})) - 0.5);
  EXPECT_NEAR(log_odds_of(best_of({best, far, close})), log_odds_of(beside_close), 0.02);
  EXPECT_NEAR(log_odds_of(best_of({best, close, far})), log_odds_of(beside_close), 0.02);
}

TEST(Probability, WithoutDescriptorsCountsHowSurelyMoreLandmarksMatchThanAtAnyOtherPose) {
  for (const auto sight : {std::optional<double>(0.03), std::optional<double>()}) {
    const auto gain = [&](std::size_t own, std::size_t other) {
      const auto with = [&](std::size_t matches, double evidence) {
        PlacementCandidate pose = candidate(0.1, evidence, sight);
        pose.support.within[Support::kFine] = matches;
        return pose;
      };
      return log_odds_of(best_of({with(own, 10.0), with(other, 0.0)})) -
             log_odds_of(best_of({with(other, 10.0), with(other, 0.0)}));
    };
    EXPECT_NEAR(gain(40, 40), 0.0, 1e-3);
    EXPECT_GT(gain(40, 20), 0.0);
    // The same ratio of more matches is less likely by chance,
    EXPECT_GT(gain(80, 40), 1.7 * gain(40, 20));
    // but matches of dense clouds are not independent.
    EXPECT_NEAR(gain(2000, 1000), gain(200, 100), 0.02);
    EXPECT_LT(gain(20, 40), 0.0);
  }
}

TEST(Probability, FollowsThePriorOdds) {
  const std::vector<PlacementCandidate> poses = {candidate(0.15, 100.0, 0.03),
                                                 candidate(0.08, 0.0, 0.1)};
  const double even = best_of(poses);
  const double rare = probabilities(poses, 0.01).front();
  EXPECT_NEAR(std::log(rare / (1.0 - rare)), std::log(even / (1.0 - even)) + std::log(0.01), 1e-3);
}

TEST(Probability, IsHighForClearPosesAndLowForChance) {
  const PlacementCandidate wrong = candidate(0.09, 0.0, 0.1);
  EXPECT_GT(best_of({candidate(0.4, 3000.0, 0.01), wrong, wrong}), 0.99);
  EXPECT_GT(best_of({candidate(0.4, 3000.0), candidate(0.1, 0.0)}), 0.99);
  EXPECT_LT(best_of({candidate(0.1, 0.0, 0.1), wrong, wrong}), 0.01);
  EXPECT_LT(best_of({candidate(0.1, 0.0), candidate(0.09, 0.0)}), 0.05);
}

TEST(Probability, IsSharedAmongEquals) {
  const PlacementCandidate right = candidate(0.4, 3000.0, 0.01);
  const PlacementCandidate wrong = candidate(0.09, 0.0, 0.1);
  const std::vector<double> all =
      probabilities(std::vector<PlacementCandidate>{right, right, wrong, wrong, wrong});
  EXPECT_DOUBLE_EQ(all[0], all[1]);
  EXPECT_NEAR(all[0], 0.5, 0.02);
  EXPECT_LT(all[2], 0.01);
}

}  // namespace
}  // namespace cairn::detail
