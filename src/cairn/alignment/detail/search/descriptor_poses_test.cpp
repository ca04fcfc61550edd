// SPDX-License-Identifier: BSD-3-Clause
#include <array>
#include <cstdint>
#include <string>

#include <gtest/gtest.h>

#include "cairn/alignment/detail/search/poses.hpp"

namespace cairn::detail {
namespace {

constexpr std::size_t kPosedBytes = 32;

struct PosedClouds {
  LandmarkCloud source;
  LandmarkCloud target;
  Rigid3 target_from_source;
};

// Landmarks anywhere in a room; the first `shared` of both maps are one, and look alike but for some
// bits. All others look like nothing else.
PosedClouds posed_clouds(std::size_t shared, std::size_t count, const std::string& kind = "ORB") {
  Random random(3);
  PosedClouds result;
  result.target_from_source =
      Rigid3(rotation_exp({0.3, -1.2, 2.0}), Eigen::Vector3d(1.0, -2.0, 0.5));
  result.source.descriptors = result.target.descriptors =
      DescriptorColumn{kind, kPosedBytes, std::vector<std::uint8_t>(count, 1), {}};
  const auto anywhere = [&random] {
    return Eigen::Vector3d(random.uniform(-2, 2), random.uniform(-2, 2), random.uniform(0, 2));
  };
  const auto look = [](LandmarkCloud& cloud, const std::array<std::uint8_t, kPosedBytes>& bytes) {
    cloud.descriptors->bytes.insert(cloud.descriptors->bytes.end(), bytes.begin(), bytes.end());
  };
  for (std::size_t i = 0; i < count; ++i) {
    std::array<std::uint8_t, kPosedBytes> one{};
    std::array<std::uint8_t, kPosedBytes> other{};
    for (std::size_t j = 0; j < kPosedBytes; ++j) {
      one[j] = static_cast<std::uint8_t>(random.index(256));
      other[j] = static_cast<std::uint8_t>(random.index(256));
    }
    const Eigen::Vector3d place = anywhere();
    result.source.positions.push_back(place);
    look(result.source, one);
    if (i < shared) {
      one[random.index(kPosedBytes)] ^= 0x05;
      result.target.positions.push_back(result.target_from_source * place);
      look(result.target, one);
    } else {
      result.target.positions.push_back(result.target_from_source * anywhere());
      look(result.target, other);
    }
  }
  return result;
}

std::vector<Similarity3> poses(const PosedClouds& clouds, bool free_scale = false) {
  constexpr double kTolerance = 0.03;
  const auto scale =
      free_scale ? std::optional(ScaleRange{1.0 / 400.0, 400.0}) : std::optional<ScaleRange>();
  std::vector<Similarity3> found;
  for (const DescriptorPose& one : descriptor_poses(DescriptorMatches(clouds.source, clouds.target),
                                                    Random(1), kTolerance, scale)) {
    found.push_back(one.pose);
  }
  return found;
}

TEST(DescriptorPoses, AreTheTruthForFewLandmarksThatAreOne) {
  for (const std::string kind : {"ORB", "SIFT"}) {
    const PosedClouds pair = posed_clouds(15, 400, kind);
    const std::vector<Similarity3> found = poses(pair);
    ASSERT_FALSE(found.empty()) << kind;
    EXPECT_LT((found.front().rigid().inverse() * pair.target_from_source).angle(), 1e-6) << kind;
    EXPECT_EQ(found.front().scale(), 1.0);
  }
}

TEST(DescriptorPoses, FindAFreeScale) {
  for (const double scale : {0.02, 1.0, 7.0}) {
    PosedClouds pair = posed_clouds(15, 400, "SIFT");
    for (Eigen::Vector3d& position : pair.source.positions) position /= scale;
    const std::vector<Similarity3> found = poses(pair, true);
    ASSERT_FALSE(found.empty()) << scale;
    EXPECT_NEAR(found.front().scale() / scale, 1.0, 1e-9);
    EXPECT_LT((found.front().rigid().inverse() * pair.target_from_source).angle(), 1e-6);
  }
}

TEST(DescriptorPoses, TellSeveralConsensusSetsApart) {
  // The first half of the shared landmarks stands elsewhere in the target, as one.
  PosedClouds pair = posed_clouds(40, 400);
  const Rigid3 moved(rotation_exp({0.0, 0.0, 1.0}), Eigen::Vector3d(0.5, 0.5, 0.0));
  for (std::size_t i = 0; i < 18; ++i) {
    pair.target.positions[i] = moved * pair.target.positions[i];
  }
  const std::vector<Similarity3> found = poses(pair);
  ASSERT_GE(found.size(), 2U);
  EXPECT_LT((found[0].rigid().inverse() * pair.target_from_source).angle(), 1e-6);
  EXPECT_LT((found[1].rigid().inverse() * (moved * pair.target_from_source)).angle(), 1e-6);
}

TEST(DescriptorPoses, AreDistinctAndFew) {
  const std::vector<Similarity3> found = poses(posed_clouds(40, 400));
  EXPECT_LE(found.size(), kMostDescriptorPoses);
  for (std::size_t i = 0; i < found.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      EXPECT_FALSE(found[i].matrix().isApprox(found[j].matrix(), 1e-6));
    }
  }
}

TEST(DescriptorPoses, AreNoneWhereFewerThanFourMatchesAgree) {
  EXPECT_TRUE(poses(posed_clouds(3, 400)).empty());
}

TEST(DescriptorPoses, AreNoneWhereNothingCanBeCompared) {
  PosedClouds pair = posed_clouds(15, 100);
  pair.target.descriptors->kind = "BRISK";
  EXPECT_TRUE(poses(pair).empty());
  pair.target.descriptors.reset();
  EXPECT_TRUE(poses(pair).empty());
  pair = posed_clouds(15, 100);
  pair.target.descriptors->known.assign(100, 0);
  EXPECT_TRUE(poses(pair).empty());
}

}  // namespace
}  // namespace cairn::detail
