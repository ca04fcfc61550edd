// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/placement/likeness.hpp"

#include <cmath>
#include <string>

#include <gtest/gtest.h>

#include "cairn/core/random.hpp"
#include "cairn/placement/support.hpp"

namespace cairn {
namespace {

constexpr std::size_t kBytes = 32;
constexpr std::size_t kCount = 2000;
constexpr double kChance = 1.0 / (LikenessTest::kOthers + 1);

// Landmarks on a wall of 2 m by 2 m that look like nothing else, but for those that are copied.
LandmarkCloud wall(std::uint64_t seed, const std::string& kind = "ORB") {
  Random random(seed);
  LandmarkCloud cloud;
  cloud.descriptors = DescriptorColumn{kind, kBytes, std::vector<std::uint8_t>(kCount, 1), {}};
  for (std::size_t i = 0; i < kCount; ++i) {
    cloud.positions.emplace_back(random.uniform(0, 2), random.uniform(0, 2), 0.0);
  }
  for (std::size_t i = 0; i < kCount * kBytes; ++i) {
    cloud.descriptors->bytes.push_back(static_cast<std::uint8_t>(random.index(256)));
  }
  return cloud;
}

// As seen another time: one bit in ten differs, or one byte in ten by a little.
LandmarkCloud seen_again(LandmarkCloud cloud) {
  Random random(77);
  const bool binary = cloud.descriptors->kind == "ORB";
  for (std::uint8_t& byte : cloud.descriptors->bytes) {
    if (binary) {
      for (int bit = 0; bit < 8; ++bit) {
        if (random.index(10) == 0) byte = static_cast<std::uint8_t>(byte ^ (1 << bit));
      }
    } else if (random.index(10) == 0) {
      byte = static_cast<std::uint8_t>(byte / 2 + 60);
    }
  }
  return cloud;
}

double share_alike(const LandmarkCloud& source, const LandmarkCloud& target, std::uint32_t shift) {
  const CentredPair pair(source, target);
  const LikenessTest test(pair, source.size());
  EXPECT_TRUE(test.possible());
  Likeness likeness;
  for (std::uint32_t i = 0; i < kCount; ++i) {
    if (const auto alike = test.alike(i, (i + shift) % kCount)) likeness += {1, *alike ? 1U : 0U};
  }
  EXPECT_EQ(likeness.compared, kCount - LikenessTest::kOthers);
  return static_cast<double>(likeness.alike) / static_cast<double>(likeness.compared);
}

TEST(Likeness, LandmarksThatAreOneLookAlikeAndOthersOnlyByChance) {
  for (const std::string kind : {"ORB", "SIFT"}) {
    const LandmarkCloud cloud = wall(1, kind);
    EXPECT_GT(share_alike(cloud, seen_again(cloud), 0), 0.99) << kind;
    // Five standard deviations.
    EXPECT_NEAR(share_alike(cloud, seen_again(cloud), 1), kChance,
                5.0 * std::sqrt(kChance / kCount))
        << kind;
    EXPECT_NEAR(share_alike(cloud, wall(2, kind), 0), kChance, 5.0 * std::sqrt(kChance / kCount))
        << kind;
  }
}

TEST(Likeness, IsUnknownWhereADescriptorIs) {
  LandmarkCloud source = wall(1);
  LandmarkCloud target = seen_again(source);
  source.descriptors->known[100] = 0;
  target.descriptors->known[200] = 0;
  const CentredPair pair(source, target);
  const LikenessTest test(pair, source.size());
  EXPECT_FALSE(test.alike(100, 100));
  EXPECT_FALSE(test.alike(200, 200));
  EXPECT_TRUE(test.alike(300, 300).value());
}

TEST(Likeness, IsPossibleOnlyWhereMostDescriptorsAreKnownAndOfOneKind) {
  const LandmarkCloud cloud = wall(1);
  const auto possible = [&](const LandmarkCloud& other) {
    return LikenessTest(CentredPair(cloud, other), cloud.size()).possible() &&
           LikenessTest(CentredPair(other, cloud), other.size()).possible();
  };
  EXPECT_TRUE(possible(wall(2)));
  EXPECT_FALSE(possible(wall(2, "BRISK")));
  LandmarkCloud without = wall(2);
  without.descriptors.reset();
  EXPECT_FALSE(possible(without));
  LandmarkCloud few = wall(2);
  for (std::size_t i = 0; i < kCount; i += 3) few.descriptors->known[i] = 0;
  EXPECT_TRUE(possible(few));
  for (std::size_t i = 1; i < kCount; i += 3) few.descriptors->known[i] = 0;
  EXPECT_FALSE(possible(few));
}

// Of all shares of alike pairs, the likeliest against that of chance.
TEST(Likeness, EvidenceIsTheLikelihoodRatioOfTheLikeliestShare) {
  for (const Likeness likeness : {Likeness{200, 3}, {200, 20}, {200, 150}, {200, 200}, {7, 2}}) {
    const auto all = static_cast<double>(likeness.compared);
    const auto alike = static_cast<double>(likeness.alike);
    double best = 0.0;
    for (double share = kChance; share < 1.0; share += 1e-5) {
      best = std::max(best, alike * std::log(share / kChance) +
                                (all - alike) * std::log((1.0 - share) / (1.0 - kChance)));
    }
    EXPECT_NEAR(likeness.evidence(), best, 1e-2) << likeness.alike;
  }
  EXPECT_EQ(Likeness().evidence(), 0.0);
  EXPECT_EQ((Likeness{640, 10}).evidence(), 0.0);
}

Support support(const LandmarkCloud& source, const LandmarkCloud& target) {
  const CentredPair pair(source, target);
  const BatchTree source_tree(pair.source().positions);
  const BatchTree target_tree(pair.target().positions);
  return SupportCounter(pair, source_tree, target_tree, source.size(), Executor())(
      pair.centred(Similarity3()), 0.02);
}

TEST(Likeness, OfASupportIsThatOfItsPairs) {
  const LandmarkCloud cloud = wall(1);
  const Support same = support(cloud, seen_again(cloud));
  ASSERT_TRUE(same.likeness);
  EXPECT_EQ(same.likeness->compared, kCount - LikenessTest::kOthers);
  EXPECT_GT(same.spread_likeness, 0.8 * same.likeness->evidence());
  const Support other = support(cloud, wall(2));
  ASSERT_TRUE(other.likeness);
  EXPECT_GT(other.likeness->compared, 50U);
  EXPECT_LT(other.spread_likeness, 3.0);
  LandmarkCloud without = wall(2);
  without.descriptors.reset();
  EXPECT_FALSE(support(cloud, without).likeness);
}

// One poster that hangs in both places.
TEST(Likeness, OfOneThingAloneIsNotSpread) {
  const LandmarkCloud source = wall(1);
  const LandmarkCloud again = seen_again(source);
  LandmarkCloud target = wall(2);
  for (std::size_t i = LikenessTest::kOthers; i < kCount; ++i) {
    if (source.positions[i].norm() > 0.3) continue;
    target.positions[i] = source.positions[i];
    std::copy_n(again.descriptors->bytes.begin() + static_cast<std::ptrdiff_t>(i * kBytes), kBytes,
                target.descriptors->bytes.begin() + static_cast<std::ptrdiff_t>(i * kBytes));
  }
  const Support found = support(source, target);
  ASSERT_TRUE(found.likeness);
  EXPECT_GT(found.likeness->evidence(), 20.0);
  EXPECT_LT(found.spread_likeness, 0.3 * found.likeness->evidence());
}

}  // namespace
}  // namespace cairn
