// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/placement/detail/descriptor_matches.hpp"

#include <string>

#include <gtest/gtest.h>

#include "cairn/core/random.hpp"

namespace cairn {
namespace {

constexpr std::size_t kBytes = 32;

// `count` landmarks each, of which the first `shared` look alike and stand where the identity puts them.
struct Clouds {
  LandmarkCloud source;
  LandmarkCloud target;
};

Clouds clouds(std::size_t shared, std::size_t count, const std::string& kind) {
  Random random(7);
  Clouds result;
  result.source.descriptors = result.target.descriptors =
      DescriptorColumn{kind, kBytes, std::vector<std::uint8_t>(count, 1), {}};
  for (std::size_t i = 0; i < count; ++i) {
    const auto somewhere = [&random] {
      return Eigen::Vector3d(random.uniform(0, 4), random.uniform(0, 3), random.uniform(0, 2));
    };
    const Eigen::Vector3d place = somewhere();
    result.source.positions.push_back(place);
    result.target.positions.push_back(i < shared ? place : somewhere());
    for (std::size_t j = 0; j < kBytes; ++j) {
      const auto one = static_cast<std::uint8_t>(random.index(256));
      const auto other = static_cast<std::uint8_t>(random.index(256));
      result.source.descriptors->bytes.push_back(one);
      result.target.descriptors->bytes.push_back(
          i < shared ? static_cast<std::uint8_t>(one ^ (j == 3 ? 1U : 0U)) : other);
    }
  }
  return result;
}

Similarity3 identity(const CentredPair& pair) {
  return pair.centred(Similarity3());
}

TEST(DescriptorMatches, AreTheLandmarksThatLookAlike) {
  for (const std::string kind : {"ORB", "SIFT"}) {
    const Clouds pair = clouds(40, 300, kind);
    const CentredPair centred(pair.source, pair.target);
    const DescriptorMatches matches(centred);
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

TEST(DescriptorMatches, AgreeAtTheRightPoseOnly) {
  const Clouds pair = clouds(40, 300, "ORB");
  const CentredPair centred(pair.source, pair.target);
  const DescriptorMatches matches(centred);
  const DescriptorAgreement right = matches.agreement(identity(centred), 0.05);
  EXPECT_EQ(right.agreeing, 40U);
  EXPECT_GE(right.spread, 35U);
  EXPECT_LT(right.expected, 1.0);
  EXPECT_GT(right.evidence(), 50.0);
  const Rigid3 turned(rotation_exp({0.0, 0.0, 1.5}), Eigen::Vector3d::Zero());
  EXPECT_LT(matches.agreement(turned, 0.05).evidence(), 5.0);
}

TEST(DescriptorMatches, ExpectWhatRandomPartnersWouldGive) {
  // With a radius as large as the room all agree, and all would by chance.
  const Clouds pair = clouds(40, 300, "ORB");
  const CentredPair centred(pair.source, pair.target);
  const DescriptorMatches matches(centred);
  const DescriptorAgreement all = matches.agreement(identity(centred), 10.0);
  EXPECT_EQ(all.agreeing, matches.all().size());
  EXPECT_DOUBLE_EQ(all.expected, static_cast<double>(matches.all().size()));
}

TEST(DescriptorMatches, OneThingThatStandsInBothPlacesHasNoSpread) {
  Clouds pair = clouds(40, 300, "ORB");
  // All of it in one corner, closer together than the others are.
  for (std::size_t i = 0; i < 40; ++i) {
    const Eigen::Vector3d corner = 0.01 * pair.source.positions[i];
    pair.source.positions[i] = pair.target.positions[i] = corner;
  }
  for (std::size_t i = 40; i < 300; ++i) {
    for (std::size_t j = 0; j < kBytes; ++j) {
      // So many others match, but nowhere near each other.
      pair.target.descriptors->bytes[i * kBytes + j] =
          pair.source.descriptors->bytes[i * kBytes + j];
    }
  }
  const CentredPair centred(pair.source, pair.target);
  const DescriptorAgreement agreement =
      DescriptorMatches(centred).agreement(identity(centred), 0.02);
  EXPECT_GE(agreement.agreeing, 40U);
  EXPECT_LT(2 * agreement.spread, agreement.agreeing);
}

TEST(DescriptorMatches, AreNoneOfDifferentKinds) {
  Clouds pair = clouds(40, 100, "ORB");
  pair.target.descriptors->kind = "BRISK";
  const CentredPair centred(pair.source, pair.target);
  const DescriptorMatches matches(centred);
  EXPECT_FALSE(matches.possible());
  EXPECT_TRUE(matches.all().empty());
}

}  // namespace
}  // namespace cairn
