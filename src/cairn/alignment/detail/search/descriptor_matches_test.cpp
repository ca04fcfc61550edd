// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/alignment/detail/search/descriptor_matches.hpp"

#include <algorithm>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "cairn/core/random.hpp"
#include "cairn/map/operations.hpp"

namespace cairn::detail {
namespace {

constexpr std::size_t kLookalikeBytes = 32;

// `count` landmarks each, of which the first `shared` look alike and stand where the identity puts them.
struct LookalikeClouds {
  LandmarkCloud source;
  LandmarkCloud target;
};

LookalikeClouds lookalikes(std::size_t shared, std::size_t count, const std::string& kind) {
  Random random(7);
  LookalikeClouds result;
  result.source.descriptors = result.target.descriptors =
      DescriptorColumn{kind, kLookalikeBytes, std::vector<std::uint8_t>(count, 1), {}};
  for (std::size_t i = 0; i < count; ++i) {
    const auto somewhere = [&random] {
      return Eigen::Vector3d(random.uniform(0, 4), random.uniform(0, 3), random.uniform(0, 2));
    };
    const Eigen::Vector3d place = somewhere();
    result.source.positions.push_back(place);
    result.target.positions.push_back(i < shared ? place : somewhere());
    for (std::size_t j = 0; j < kLookalikeBytes; ++j) {
      const auto one = static_cast<std::uint8_t>(random.index(256));
      const auto other = static_cast<std::uint8_t>(random.index(256));
      result.source.descriptors->bytes.push_back(one);
      result.target.descriptors->bytes.push_back(
          i < shared ? static_cast<std::uint8_t>(one ^ (j == 3 ? 1U : 0U)) : other);
    }
  }
  return result;
}

TEST(DescriptorMatches, AreTheLandmarksThatLookAlike) {
  for (const std::string kind : {"ORB", "SIFT"}) {
    const LookalikeClouds pair = lookalikes(40, 300, kind);
    const DescriptorMatches matches(pair.source, pair.target);
    EXPECT_TRUE(matches.possible());
    std::size_t right = 0;
    for (const DescriptorMatch& match : matches.all()) {
      if (match.source < 40 && match.source == match.target) ++right;
    }
    EXPECT_EQ(right, 40U) << kind;
    // Random descriptors differ in half of their bits, and no one clearly least.
    EXPECT_LE(matches.all().size(), 44U) << kind;
    for (std::size_t i = 1; i < matches.all().size(); ++i) {
      EXPECT_LE(matches.all()[i - 1].difference, matches.all()[i].difference);
    }
  }
}

// A map often holds one thing as several landmarks.
TEST(DescriptorMatches, OfBytesMayHaveARivalOnTheSameSpotOnly) {
  const auto matches_with_copies = [](const Eigen::Vector3d& off) {
    LookalikeClouds pair = lookalikes(40, 300, "SIFT");
    DescriptorColumn& column = *pair.target.descriptors;
    for (std::size_t i = 0; i < 40; ++i) {
      pair.target.positions.emplace_back(pair.target.positions[i] + off);
      column.known.push_back(1);
      const auto bytes = column.descriptor(i, 0);
      const std::vector<std::uint8_t> copy(bytes.begin(), bytes.end());
      column.bytes.insert(column.bytes.end(), copy.begin(), copy.end());
    }
    return DescriptorMatches(pair.source, pair.target).all().size();
  };
  EXPECT_GE(matches_with_copies({0.005, 0.0, 0.0}), 40U);
  EXPECT_LE(matches_with_copies({0.5, 0.0, 0.0}), 4U);
}

TEST(DescriptorMatches, AgreeAtTheRightPoseOnly) {
  const LookalikeClouds pair = lookalikes(40, 300, "ORB");
  const DescriptorMatches matches(pair.source, pair.target);
  const DescriptorAgreement right = matches.agreement(Similarity3(), 0.05);
  EXPECT_EQ(right.agreeing, 40U);
  EXPECT_GE(right.spread, 35U);
  EXPECT_LT(right.expected, 1.0);
  EXPECT_GT(right.evidence(), 50.0);
  const Rigid3 turned(rotation_exp({0.0, 0.0, 1.5}), Eigen::Vector3d::Zero());
  EXPECT_LT(matches.agreement(turned, 0.05).evidence(), 5.0);
}

TEST(DescriptorMatches, ExpectWhatRandomPartnersWouldGive) {
  // With a radius as large as the room all agree, and all would by chance.
  const LookalikeClouds pair = lookalikes(40, 300, "ORB");
  const DescriptorMatches matches(pair.source, pair.target);
  const DescriptorAgreement all = matches.agreement(Similarity3(), 10.0);
  EXPECT_EQ(all.agreeing, matches.all().size());
  EXPECT_DOUBLE_EQ(all.expected, static_cast<double>(matches.all().size()));
}

TEST(DescriptorMatches, OneThingThatStandsInBothPlacesHasNoSpread) {
  LookalikeClouds pair = lookalikes(40, 300, "ORB");
  // All of it in one corner, closer together than the others are.
  for (std::size_t i = 0; i < 40; ++i) {
    const Eigen::Vector3d corner = 0.01 * pair.source.positions[i];
    pair.source.positions[i] = pair.target.positions[i] = corner;
  }
  for (std::size_t i = 40; i < 300; ++i) {
    for (std::size_t j = 0; j < kLookalikeBytes; ++j) {
      // So many others match, but nowhere near each other.
      pair.target.descriptors->bytes[i * kLookalikeBytes + j] =
          pair.source.descriptors->bytes[i * kLookalikeBytes + j];
    }
  }
  const DescriptorAgreement agreement =
      DescriptorMatches(pair.source, pair.target).agreement(Similarity3(), 0.02);
  EXPECT_GE(agreement.agreeing, 40U);
  EXPECT_LT(2 * agreement.spread, agreement.agreeing);
}

TEST(DescriptorMatches, AreNoneOfDifferentKinds) {
  LookalikeClouds pair = lookalikes(40, 100, "ORB");
  pair.target.descriptors->kind = "BRISK";
  const DescriptorMatches matches(pair.source, pair.target);
  EXPECT_FALSE(matches.possible());
  EXPECT_TRUE(matches.all().empty());
}

// ---- several descriptors of a landmark

// 1 to 4 of each landmark, of few values, so that many are near and equal ones are frequent.
LandmarkCloud described_cloud(std::size_t count, const std::string& kind, std::uint64_t seed) {
  Random random(seed);
  LandmarkCloud cloud;
  cloud.descriptors = DescriptorColumn{kind, 4, {}, {}};
  for (std::size_t i = 0; i < count; ++i) {
    cloud.positions.emplace_back(random.uniform(0, 4), random.uniform(0, 3), random.uniform(0, 2));
    std::vector<std::vector<std::uint8_t>> rows(random.index(5));
    for (auto& row : rows) {
      for (int j = 0; j < 4; ++j) row.push_back(static_cast<std::uint8_t>(40 * random.index(6)));
    }
    append_descriptors(*cloud.descriptors,
                       std::vector<std::span<const std::uint8_t>>(rows.begin(), rows.end()));
  }
  return cloud;
}

// The difference of the best pair, by looking at all.
std::uint32_t least_of_all(const LandmarkCloud& a, std::uint32_t i, const LandmarkCloud& b,
                           std::uint32_t j, DescriptorNorm norm) {
  auto least = std::numeric_limits<std::uint32_t>::max();
  for (std::size_t p = 0; p < a.descriptors->count(i); ++p) {
    for (std::size_t q = 0; q < b.descriptors->count(j); ++q) {
      least = std::min(
          least, static_cast<std::uint32_t>(descriptor_difference(
                     a.descriptors->descriptor(i, p), b.descriptors->descriptor(j, q), norm)));
    }
  }
  return least;
}

TEST(DescriptorMatches, AreByTheBestPairOfSeveralDescriptors) {
  constexpr auto kNone = std::numeric_limits<std::uint32_t>::max();
  for (const std::string kind : {"ORB", "SIFT"}) {
    const bool binary = kind == "ORB";
    const auto norm = binary ? DescriptorNorm::kHamming : DescriptorNorm::kSquared;
    std::size_t found = 0;
    for (std::uint64_t seed = 1; seed <= 20; ++seed) {
      const LandmarkCloud a = described_cloud(60, kind, seed);
      const LandmarkCloud b = described_cloud(50, kind, 100 + seed);
      const DescriptorMatches matches(a, b);
      found += matches.all().size();
      for (const DescriptorMatch& match : matches.all()) {
        const std::uint32_t least = least_of_all(a, match.source, b, match.target, norm);
        EXPECT_EQ(match.difference, least);
        std::uint32_t second = kNone;
        for (std::uint32_t j = 0; j < b.size(); ++j) {
          if (j != match.target) {
            second = std::min(second, least_of_all(a, match.source, b, j, norm));
          }
        }
        for (std::uint32_t i = 0; i < a.size(); ++i) {
          EXPECT_GE(least_of_all(a, i, b, match.target, norm), least);
        }
        EXPECT_GE(second, least);
        if (binary) {
          EXPECT_LE(4 * least, 32U);
        } else {
          EXPECT_LE(least, 0.85 * 0.85 * second);
        }
      }
      // None is missing whose partners are each other's nearest, with no equal.
      for (std::uint32_t i = 0; i < a.size(); ++i) {
        for (std::uint32_t j = 0; j < b.size(); ++j) {
          const std::uint32_t least = least_of_all(a, i, b, j, norm);
          std::uint32_t other = kNone;
          std::uint32_t back = kNone;
          for (std::uint32_t k = 0; k < b.size(); ++k) {
            if (k != j) other = std::min(other, least_of_all(a, i, b, k, norm));
          }
          for (std::uint32_t k = 0; k < a.size(); ++k) {
            if (k != i) back = std::min(back, least_of_all(a, k, b, j, norm));
          }
          const bool distinct = binary ? 4 * least <= 32 : least <= 0.85 * 0.85 * other;
          if (least == kNone || least >= other || least >= back || !distinct) continue;
          EXPECT_TRUE(std::any_of(
              matches.all().begin(), matches.all().end(),
              [&](const DescriptorMatch& m) { return m.source == i && m.target == j; }));
        }
      }
    }
    EXPECT_GT(found, 20U) << kind;
  }
}

TEST(DescriptorMatches, AreTheSameIfTheFurtherDescriptorsRepeatTheFirst) {
  for (const std::string kind : {"ORB", "SIFT"}) {
    const LookalikeClouds pair = lookalikes(40, 300, kind);
    LookalikeClouds twice = pair;
    for (LandmarkCloud* const cloud : {&twice.source, &twice.target}) {
      DescriptorColumn& column = *cloud->descriptors;
      column.further = column.bytes;
      for (std::uint64_t i = 0; i <= cloud->size(); ++i) column.further_offsets.push_back(i);
    }
    const DescriptorMatches once(pair.source, pair.target);
    const DescriptorMatches again(twice.source, twice.target);
    ASSERT_EQ(once.all().size(), again.all().size()) << kind;
    for (std::size_t i = 0; i < once.all().size(); ++i) {
      EXPECT_EQ(once.all()[i].source, again.all()[i].source);
      EXPECT_EQ(once.all()[i].target, again.all()[i].target);
    }
  }
}

}  // namespace
}  // namespace cairn::detail
