// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/placement/support_counter.hpp"

#include <gtest/gtest.h>

#include "cairn/core/random.hpp"

namespace cairn {
namespace {

constexpr double kRadius = 0.02;
// More evidence than landmarks that are independent of each other give here.
constexpr double kOfChance = 15.0;

// Landmarks anywhere on a wall of 2 m by 2 m.
LandmarkCloud wall(std::size_t count, std::uint64_t seed) {
  Random random(seed);
  LandmarkCloud cloud;
  for (std::size_t i = 0; i < count; ++i) {
    cloud.positions.emplace_back(random.uniform(0, 2), random.uniform(0, 2), 0.0);
  }
  return cloud;
}

// The first of one cloud are put where those of another are, give or take.
LandmarkCloud with_shared(LandmarkCloud cloud, const LandmarkCloud& other, std::size_t begin,
                          std::size_t end) {
  Random random(9);
  for (std::size_t i = begin; i < end; ++i) {
    cloud.positions[i] = other.positions[i] +
                         0.002 * Eigen::Vector3d(random.normal(), random.normal(), random.normal());
  }
  return cloud;
}

Support support(const LandmarkCloud& source, const LandmarkCloud& target,
                const Similarity3& pose = {}, std::size_t sample = 10'000) {
  const CentredPair pair(source, target);
  const BatchTree source_tree(pair.source().positions);
  const BatchTree target_tree(pair.target().positions);
  return SupportCounter(pair, source_tree, target_tree, sample, Random(1), Executor())(
      pair.centred(pose), kRadius);
}

TEST(Support, OfACloudAndItselfIsWhole) {
  const LandmarkCloud cloud = wall(1000, 1);
  const Support all = support(cloud, cloud);
  EXPECT_DOUBLE_EQ(all.share, 1.0);
  EXPECT_GT(all.evidence, 1000.0);
  EXPECT_GT(all.spread_evidence, 0.8 * all.evidence);
}

TEST(Support, IsTheSameWhateverTheSourcesUnit) {
  const LandmarkCloud target = wall(1000, 1);
  const LandmarkCloud source = with_shared(wall(1000, 2), target, 0, 300);
  const Support one = support(source, target);
  const Support other = support(scaled(source, 0.125), target, Similarity3(8.0, Rigid3()));
  EXPECT_EQ(other.share, one.share);
  EXPECT_NEAR(other.evidence, one.evidence, 1e-6 * one.evidence);
}

TEST(Support, ThereIsNoEvidenceWhereOnlySurfacesMeet) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    const Support chance = support(wall(1500, 2 * seed), wall(1500, 2 * seed + 1));
    EXPECT_GT(chance.share, 0.1);
    EXPECT_LT(chance.evidence, kOfChance);
  }
}

TEST(Support, FewLandmarksThatAreOneAreEvidenceThatGrowsWithTheirNumber) {
  const LandmarkCloud source = wall(1500, 1);
  double last = kOfChance;
  for (const std::size_t shared : {150, 300, 600}) {
    const double evidence = support(source, with_shared(wall(1500, 2), source, 0, shared)).evidence;
    EXPECT_GT(evidence, last);
    last = evidence;
  }
}

TEST(Support, EvidenceIsGoneBesideThePose) {
  const LandmarkCloud source = wall(1500, 1);
  const LandmarkCloud target = with_shared(wall(1500, 2), source, 0, 400);
  EXPECT_LT(support(source, target,
                    Rigid3(Eigen::Quaterniond::Identity(), Eigen::Vector3d(0.1, 0.0, 0.0)))
                .evidence,
            kOfChance);
}

TEST(Support, OneThingInBothPlacesGivesNoSpreadEvidence) {
  const LandmarkCloud source = wall(3000, 1);
  LandmarkCloud target = wall(3000, 2);
  for (std::size_t i = 0; i < source.size(); ++i) {
    const Eigen::Vector3d& place = source.positions[i];
    if (place.x() < 0.25 && place.y() < 0.25) target.positions[i] = place;
  }
  const Support thing = support(source, target);
  EXPECT_GT(thing.evidence, 50.0);
  EXPECT_LT(thing.spread_evidence, 0.2 * thing.evidence);
}

// Else what is known a match would depend on how many are looked at.
TEST(Support, OfASampleCountsWhatItLookedAtAndSharesWhatAllHave) {
  const LandmarkCloud source = wall(4000, 1);
  const LandmarkCloud target = with_shared(wall(2000, 2), source, 0, 1000);
  const Support all = support(source, target);
  const Support half = support(source, target, {}, 2000);
  EXPECT_EQ(all.share, static_cast<double>(all.matches) / 2000.0);
  EXPECT_GT(all.matches, all.close_matches);
  EXPECT_LT(half.matches, all.matches);
  EXPECT_EQ(half.share, 2.0 * static_cast<double>(half.matches) / 2000.0);
}

TEST(Support, HasNothingAgainstLandmarksThatCoincide) {
  LandmarkCloud cloud;
  cloud.positions.assign(100, Eigen::Vector3d(1.0, 2.0, 3.0));
  EXPECT_GE(support(cloud, cloud).evidence, 0.0);
}

}  // namespace
}  // namespace cairn
