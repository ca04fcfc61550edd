// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/alignment/detail/evidence/look_comparison.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "cairn/alignment/alignment.hpp"
#include "cairn/core/random.hpp"

namespace cairn::detail {
namespace {

constexpr std::size_t kLookBytes = 32;
constexpr std::size_t kCount = 2000;
constexpr std::size_t kOthers = Likeness::kOthers;
constexpr double kChance = Likeness::kChance;

// Landmarks on a wall of 2 m by 2 m that look like nothing else, but for those that are copied.
LandmarkCloud looks_of_wall(std::uint64_t seed, const std::string& kind = "ORB") {
  Random random(seed);
  LandmarkCloud cloud;
  cloud.descriptors = DescriptorColumn{kind, kLookBytes, std::vector<std::uint8_t>(kCount, 1), {}};
  for (std::size_t i = 0; i < kCount; ++i) {
    cloud.positions.emplace_back(random.uniform(0, 2), random.uniform(0, 2), 0.0);
  }
  for (std::size_t i = 0; i < kCount * kLookBytes; ++i) {
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

std::optional<bool> alike(const LookComparison& looks, std::uint32_t source,
                          const std::vector<std::uint32_t>& targets) {
  return looks.alike(source, targets);
}

// Of landmarks and so many of the target's, that `shift` farther on and those after it.
double share_alike(const LandmarkCloud& source, const LandmarkCloud& target, std::uint32_t shift,
                   std::uint32_t partners = 1) {
  const LookComparison looks(source, target, source.size(), Random(1));
  EXPECT_TRUE(looks.possible());
  Likeness likeness;
  for (std::uint32_t i = 0; i < kCount; ++i) {
    std::vector<std::uint32_t> targets;
    for (std::uint32_t j = 0; j < partners; ++j) targets.push_back((i + shift + j) % kCount);
    if (const auto does = looks.alike(i, targets)) likeness += {1, *does ? 1U : 0U};
  }
  EXPECT_EQ(likeness.compared, kCount);
  return static_cast<double>(likeness.alike) / static_cast<double>(likeness.compared);
}

TEST(LookComparison, LandmarksThatAreOneLookAlikeAndOthersOnlyByChance) {
  for (const std::string kind : {"ORB", "SIFT"}) {
    const LandmarkCloud cloud = looks_of_wall(1, kind);
    EXPECT_GT(share_alike(cloud, seen_again(cloud), 0), 0.99) << kind;
    // Five standard deviations.
    EXPECT_NEAR(share_alike(cloud, seen_again(cloud), 1), kChance,
                5.0 * std::sqrt(kChance / kCount))
        << kind;
    EXPECT_NEAR(share_alike(cloud, looks_of_wall(2, kind), 0), kChance,
                5.0 * std::sqrt(kChance / kCount))
        << kind;
  }
}

TEST(LookComparison, OfSeveralPartnersTheOneThatLooksMostAlikeCounts) {
  const LandmarkCloud cloud = looks_of_wall(1);
  const LandmarkCloud again = seen_again(cloud);
  for (const std::uint32_t partners : {2U, 5U, 8U}) {
    EXPECT_GT(share_alike(cloud, again, kCount + 1 - partners, partners), 0.99) << partners;
    // As often by chance as of one: there are as many times the others to be beaten.
    EXPECT_NEAR(share_alike(cloud, again, 1, partners), kChance, 5.0 * std::sqrt(kChance / kCount))
        << partners;
  }
  // More are not looked at.
  EXPECT_NEAR(share_alike(cloud, again, kCount - 8, 9), kChance, 5.0 * std::sqrt(kChance / kCount));
}

// The same landmarks with `count` further descriptors each, of which one in `own` is its own of `cloud`.
LandmarkCloud with_further(LandmarkCloud cloud, std::size_t count, std::size_t own) {
  Random random(count);
  DescriptorColumn& column = *cloud.descriptors;
  column.further_offsets.push_back(0);
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    for (std::size_t k = 0; k < count; ++k) {
      for (std::size_t j = 0; j < kLookBytes; ++j) {
        const auto byte = static_cast<std::uint8_t>(random.index(256));
        column.further.push_back(k == own ? column.bytes[i * kLookBytes + j] : byte);
      }
    }
    column.further_offsets.push_back(column.further.size() / kLookBytes);
  }
  return cloud;
}

TEST(LookComparison, ComparesTheBestPairOfSeveralDescriptors) {
  for (const std::string kind : {"ORB", "SIFT"}) {
    // What represents the source's landmarks shows something else.
    const LandmarkCloud cloud = looks_of_wall(1, kind);
    LandmarkCloud source = with_further(cloud, 3, 1);
    source.descriptors->bytes = looks_of_wall(9, kind).descriptors->bytes;
    const LandmarkCloud target = with_further(seen_again(cloud), 2, 2);
    EXPECT_GT(share_alike(source, target, 0), 0.97) << kind;
    EXPECT_NEAR(share_alike(source, target, 1), kChance, 5.0 * std::sqrt(kChance / kCount)) << kind;
  }
}

TEST(LookComparison, IsUnknownWhereADescriptorIs) {
  LandmarkCloud source = looks_of_wall(1);
  LandmarkCloud target = seen_again(source);
  source.descriptors->known[100] = 0;
  target.descriptors->known[200] = 0;
  const LookComparison looks(source, target, source.size(), Random(1));
  EXPECT_FALSE(alike(looks, 100, {100}));
  EXPECT_FALSE(alike(looks, 200, {200}));
  EXPECT_TRUE(alike(looks, 300, {300}).value());
  EXPECT_TRUE(alike(looks, 300, {200, 300}).value());
  EXPECT_FALSE(alike(looks, 300, {}));
}

TEST(LookComparison, IsPossibleOnlyWhereMostDescriptorsAreKnownAndOfOneKind) {
  const LandmarkCloud cloud = looks_of_wall(1);
  const auto expect_possible = [&](const LandmarkCloud& other, bool expected) {
    for (const bool there : {true, false}) {
      const LookComparison looks(there ? cloud : other, there ? other : cloud, kCount, Random(1));
      EXPECT_EQ(looks.possible(), expected) << there;
    }
  };
  expect_possible(looks_of_wall(2), true);
  expect_possible(looks_of_wall(2, "BRISK"), false);
  LandmarkCloud without = looks_of_wall(2);
  without.descriptors.reset();
  expect_possible(without, false);
  LandmarkCloud few = looks_of_wall(2);
  for (std::size_t i = 0; i < kCount; i += 3) few.descriptors->known[i] = 0;
  expect_possible(few, true);
  for (std::size_t i = 1; i < kCount; i += 3) few.descriptors->known[i] = 0;
  expect_possible(few, false);
  const auto with_known_of_five = [](std::size_t known) {
    LandmarkCloud part = looks_of_wall(2);
    for (std::size_t i = 0; i < kCount; ++i) part.descriptors->known[i] = i % 5 < known ? 1 : 0;
    return part;
  };
  expect_possible(with_known_of_five(3), true);
  expect_possible(with_known_of_five(2), false);
}

// Of small maps too, where many a partner is among the others that its source is compared with.
TEST(LookComparison, NeedsMoreDescriptorsThanItComparesWith) {
  const LandmarkCloud source = looks_of_wall(1);
  const LandmarkCloud again = seen_again(source);
  const auto with_known = [&](std::size_t count) {
    LandmarkCloud target = again;
    target.positions.resize(count);
    target.descriptors->known.resize(count);
    target.descriptors->bytes.resize(count * kLookBytes);
    return target;
  };
  EXPECT_FALSE(LookComparison(source, with_known(kOthers), kCount, Random(1)).possible());
  for (const std::size_t count : {kOthers + 1, kOthers + 2, 2 * kOthers}) {
    const LookComparison looks(source, with_known(count), kCount, Random(1));
    ASSERT_TRUE(looks.possible()) << count;
    for (std::uint32_t i = 0; i < count; ++i) {
      EXPECT_EQ(alike(looks, i, {i}), std::optional(true)) << i << " of " << count;
    }
    std::size_t by_chance = 0;
    for (std::uint32_t i = 0; i < kCount; ++i) {
      // None of these is the other again.
      if (alike(looks, i, {(i + 1) % static_cast<std::uint32_t>(count)}).value()) ++by_chance;
    }
    EXPECT_NEAR(static_cast<double>(by_chance) / kCount, kChance,
                5.0 * std::sqrt(kChance / kCount));
  }
}

// The others are drawn from the whole map, not from landmarks that stand one behind another in it.
TEST(LookComparison, ComparesWithOthersFromTheWholeMap) {
  LandmarkCloud source = looks_of_wall(1);
  LandmarkCloud target = looks_of_wall(2);
  for (std::uint8_t& byte : source.descriptors->bytes) byte &= 0x0f;
  // The first half looks somewhat like the source, the second does not.
  for (std::size_t i = 0; i < kCount * kLookBytes; ++i) {
    std::uint8_t& byte = target.descriptors->bytes[i];
    byte = static_cast<std::uint8_t>(i < kCount * kLookBytes / 2 ? byte & 0x0f : byte | 0xf0);
  }
  const LookComparison looks(source, target, kCount, Random(1));
  Likeness likeness;
  for (std::uint32_t i = 0; i < kCount / 2; ++i) {
    likeness += {1, alike(looks, i, {i}).value() ? 1U : 0U};
  }
  EXPECT_LT(static_cast<double>(likeness.alike) / static_cast<double>(likeness.compared), 0.1);
}

TEST(LookComparison, AnyPartnerMeetsTheSameOthersAndOnlySoMany) {
  // One landmark more than the partner and the others.
  constexpr std::uint32_t kTargets = kOthers + 2;
  LandmarkCloud source = looks_of_wall(1);
  source.positions.resize(1);
  source.descriptors->known.resize(1);
  source.descriptors->bytes.assign(kLookBytes, 0x00);
  LandmarkCloud target = looks_of_wall(2);
  target.positions.resize(kTargets);
  target.descriptors->known.resize(kTargets);
  // A landmark that looks more like the source than the partner does; the partner wins if it does not meet it.
  const auto not_met_by = [&](std::uint32_t partner) {
    std::vector<std::uint32_t> result;
    for (std::uint32_t rival = 0; rival < kTargets; ++rival) {
      if (rival == partner) continue;
      target.descriptors->bytes.assign(kTargets * kLookBytes, 0xff);
      std::fill_n(target.descriptors->bytes.begin() + partner * kLookBytes, kLookBytes, 0x01);
      std::fill_n(target.descriptors->bytes.begin() + rival * kLookBytes, kLookBytes, 0x00);
      const LookComparison looks(source, target, 1, Random(1));
      if (alike(looks, 0, {partner}).value()) result.push_back(rival);
    }
    return result;
  };
  const std::vector<std::uint32_t> not_met = not_met_by(0);
  ASSERT_EQ(not_met.size(), 1U);
  for (std::uint32_t partner = 1; partner < kTargets; ++partner) {
    if (partner == not_met.front()) continue;
    EXPECT_EQ(not_met_by(partner), not_met) << partner;
  }
}

TEST(LookComparison, IsDrawnByItsSeedAlone) {
  const LandmarkCloud one = looks_of_wall(1);
  const LandmarkCloud other = looks_of_wall(2);
  const auto all = [&](std::uint64_t seed) {
    const LookComparison looks(one, other, kCount, Random(seed));
    std::vector<bool> result;
    for (std::uint32_t i = 0; i < kCount; ++i) result.push_back(alike(looks, i, {i}).value());
    return result;
  };
  EXPECT_EQ(all(1), all(1));
  EXPECT_NE(all(1), all(2));
}

}  // namespace
}  // namespace cairn::detail
