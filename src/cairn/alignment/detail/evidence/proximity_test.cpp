// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/alignment/detail/evidence/proximity.hpp"

#include <cmath>
#include <numeric>
#include <vector>

#include <gtest/gtest.h>

#include "cairn/core/random.hpp"

namespace cairn::detail {
namespace {

// Mutual nearest neighbours of independent points on a surface, in spacings.
double by_chance(Random& random) {
  return std::sqrt(-std::log1p(-random.uniform()) / (1.609 * 8.0));
}

double of_one_landmark(Random& random, double deviation) {
  return deviation * std::hypot(random.normal(), random.normal(), random.normal());
}

Proximity pairs(std::size_t same, std::size_t others, double deviation, Random& random,
                std::size_t groups = Proximity::kGroups) {
  Proximity result;
  for (std::size_t i = 0; i < same; ++i) {
    result.add(of_one_landmark(random, deviation), i % groups);
  }
  for (std::size_t i = 0; i < others; ++i) result.add(by_chance(random), i % Proximity::kGroups);
  return result;
}

TEST(Proximity, CountsEachPairInItsGroup) {
  Proximity proximity;
  for (const double ratio : {0.0, 1e-4, 0.1, 0.1, 0.3, 5.0, 1e9}) proximity.add(ratio, 3);
  const auto all = proximity.counts();
  EXPECT_EQ(std::accumulate(all.begin(), all.end(), 0.0), 7.0);
  EXPECT_EQ(proximity.counts(3), all);
  EXPECT_EQ(all.front(), 2.0);
  EXPECT_EQ(all.back(), 2.0);
  const auto none = proximity.counts(4);
  EXPECT_EQ(std::accumulate(none.begin(), none.end(), 0.0), 0.0);
}

TEST(Proximity, SameLandmarksAreEvidenceAndTheirShareAndErrorAreTold) {
  Random random(1);
  const Proximity wrong = pairs(0, 1500, 0.04, random);
  const Proximity other = pairs(0, 1500, 0.04, random);
  const Proximity right = pairs(150, 850, 0.04, random);
  const std::vector<const Proximity*> others = {&wrong, &other};
  const ProximityEvidence evidence = proximity_evidence(right, others);
  EXPECT_GT(evidence.all, 40.0);
  EXPECT_GT(evidence.spread, 0.85 * evidence.all);
  EXPECT_NEAR(evidence.share, 0.15, 0.051);
  EXPECT_NEAR(evidence.deviation, 0.04, 0.016);
  const std::vector<const Proximity*> but_this = {&right, &other};
  EXPECT_LT(proximity_evidence(wrong, but_this).all, 5.0);
}

TEST(Proximity, ChanceIsWhatTheOtherPosesHave) {
  // Corners gather many landmarks in both maps: wrong poses have close pairs, too.
  Random random(2);
  const Proximity right = pairs(150, 850, 0.04, random);
  const Proximity wrong = pairs(150, 850, 0.04, random);
  const std::vector<const Proximity*> others = {&wrong};
  EXPECT_LT(proximity_evidence(right, others).all, 10.0);
  EXPECT_GT(proximity_evidence(right, {}).all, 40.0);
}

TEST(Proximity, WithoutOtherPosesChanceIsThatOfPointsOnASurface) {
  Random random(4);
  EXPECT_LT(proximity_evidence(pairs(0, 1000, 0.04, random), {}).all, 5.0);
}

TEST(Proximity, OneThingInBothPlacesIsNoSpreadEvidence) {
  Random random(3);
  const Proximity wrong = pairs(0, 2000, 0.04, random);
  const Proximity one_thing = pairs(100, 900, 0.04, random, 1);
  const std::vector<const Proximity*> others = {&wrong};
  const ProximityEvidence evidence = proximity_evidence(one_thing, others);
  EXPECT_GT(evidence.all, 30.0);
  EXPECT_LT(evidence.spread, 0.2 * evidence.all);
}

TEST(Proximity, NoPairsAreNoEvidence) {
  EXPECT_EQ(proximity_evidence(Proximity(), {}).all, 0.0);
  EXPECT_EQ(proximity_evidence(Proximity(), {}).spread, 0.0);
}

}  // namespace
}  // namespace cairn::detail
