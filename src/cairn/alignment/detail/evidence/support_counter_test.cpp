// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/alignment/detail/evidence/support_counter.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <vector>

#include <Eigen/Geometry>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/alignment/align.hpp"
#include "cairn/core/random.hpp"

namespace cairn::detail {
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
  const PreparedCloud from(source);
  const PreparedCloud to(target);
  return SupportCounter(from, to, sample, Random(1))(centred_pose(from, to, pose), kRadius);
}

TEST(SupportCounter, OfACloudAndItselfIsWhole) {
  const LandmarkCloud cloud = wall(1000, 1);
  const Support all = support(cloud, cloud);
  EXPECT_DOUBLE_EQ(all.share, 1.0);
  EXPECT_GT(all.evidence, 1000.0);
  EXPECT_GT(all.spread_evidence, 0.8 * all.evidence);
  // No more than if all were certain to be the same, for the least probability of a distance that counts.
  EXPECT_LT(all.evidence, 1000.0 * std::log(0.5 / std::sqrt(1e-6)));
}

TEST(SupportCounter, IsAtMostWholeIfTheSampleMatchesMoreThanTheRest) {
  const LandmarkCloud target = wall(1000, 1);
  LandmarkCloud source = wall(4000, 2);
  for (Eigen::Vector3d& position : source.positions) position.z() += 50.0;
  source.positions.insert(source.positions.end(), target.positions.begin(), target.positions.end());
  source.weights.assign(5000, 1e-3);
  std::fill(source.weights.begin() + 4000, source.weights.end(), 4.996);
  EXPECT_EQ(support(source, target, {}, 500).share, 1.0);
}

TEST(SupportCounter, IsTheSameWhateverTheSourcesUnit) {
  const LandmarkCloud target = wall(1000, 1);
  const LandmarkCloud source = with_shared(wall(1000, 2), target, 0, 300);
  const Support one = support(source, target);
  const Support other = support(scaled(source, 0.125), target, Similarity3(8.0, Rigid3()));
  EXPECT_EQ(other.share, one.share);
  EXPECT_NEAR(other.evidence, one.evidence, 1e-6 * one.evidence);
}

TEST(SupportCounter, ThereIsNoEvidenceWhereOnlySurfacesMeet) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    const Support chance = support(wall(1500, 2 * seed), wall(1500, 2 * seed + 1));
    EXPECT_GT(chance.share, 0.1);
    EXPECT_LT(chance.evidence, kOfChance);
  }
}

TEST(SupportCounter, FewLandmarksThatAreOneAreEvidenceThatGrowsWithTheirNumber) {
  const LandmarkCloud source = wall(1500, 1);
  double last = kOfChance;
  for (const std::size_t shared : {150, 300, 600}) {
    const double evidence = support(source, with_shared(wall(1500, 2), source, 0, shared)).evidence;
    EXPECT_GT(evidence, last);
    last = evidence;
  }
}

TEST(SupportCounter, EvidenceIsGoneBesideThePose) {
  const LandmarkCloud source = wall(1500, 1);
  const LandmarkCloud target = with_shared(wall(1500, 2), source, 0, 400);
  EXPECT_LT(support(source, target,
                    Rigid3(Eigen::Quaterniond::Identity(), Eigen::Vector3d(0.1, 0.0, 0.0)))
                .evidence,
            kOfChance);
}

TEST(SupportCounter, OneThingInBothPlacesGivesNoSpreadEvidence) {
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

// Landmarks of a wall at least 0.15 from each other, so that each meets its own; not on a grid.
LandmarkCloud far_apart() {
  Random random(5);
  LandmarkCloud cloud;
  for (int i = 0; i < 100; ++i) {
    cloud.positions.emplace_back(0.2 * (i % 10) + random.uniform(0.0, 0.05),
                                 0.2 * (i / 10) + random.uniform(0.0, 0.05), 0.0);
  }
  return cloud;
}

TEST(SupportCounter, CountsAsCloseWhatIsWithinHalfTheRadius) {
  const LandmarkCloud cloud = far_apart();
  const auto beside = [&](double radii) {
    LandmarkCloud other = cloud;
    for (Eigen::Vector3d& position : other.positions) position.z() += radii * kRadius;
    return support(cloud, other);
  };
  EXPECT_EQ(beside(0.4).within[1], 100U);
  EXPECT_EQ(beside(0.6).within[1], 0U);
  EXPECT_EQ(beside(0.6).matches(), 100U);
  EXPECT_EQ(beside(1.1).matches(), 0U);
}

TEST(SupportCounter, TellsTheDistanceOfEachPairInSpacings) {
  const LandmarkCloud cloud = far_apart();
  const auto counts = [&](double shift) {
    LandmarkCloud other = cloud;
    for (Eigen::Vector3d& position : other.positions) position.z() += shift;
    const PreparedCloud from(cloud);
    const PreparedCloud to(other);
    Proximity proximity;
    SupportCounter(from, to, 1000, Random(1))(centred_pose(from, to, Similarity3()), kRadius,
                                              &proximity);
    return proximity.counts();
  };
  // The eighth neighbour is 0.25 away or more.
  const auto close = counts(0.002);
  EXPECT_EQ(close.front(), 100.0);
  // Beyond the radius, too.
  const auto far = counts(0.1);
  EXPECT_EQ(std::accumulate(far.begin(), far.end(), 0.0), 100.0);
  EXPECT_EQ(far.front(), 0.0);
}

// The probability is of evidence a match: both have to be of the landmarks looked at.
TEST(SupportCounter, CountsWhatItLooksAtAndSharesWhatAllHave) {
  const LandmarkCloud source = wall(4000, 1);
  LandmarkCloud target = wall(2000, 2);
  for (std::size_t i = 0; i < 2000; i += 2) target.positions[i] = source.positions[2 * i];
  const Support all = support(source, target);
  const Support half = support(source, target, {}, 2000);
  EXPECT_DOUBLE_EQ(all.share, static_cast<double>(all.matches()) / 2000.0);
  EXPECT_DOUBLE_EQ(half.share, 2.0 * static_cast<double>(half.matches()) / 2000.0);
  EXPECT_NEAR(half.share, all.share, 0.1 * all.share);
}

constexpr std::size_t kBytes = 32;

LandmarkCloud with_looks(LandmarkCloud cloud, std::uint64_t seed) {
  Random random(seed);
  cloud.descriptors =
      DescriptorColumn{"ORB", kBytes, std::vector<std::uint8_t>(cloud.size(), 1), {}};
  for (std::size_t i = 0; i < cloud.size() * kBytes; ++i) {
    cloud.descriptors->bytes.push_back(static_cast<std::uint8_t>(random.index(256)));
  }
  return cloud;
}

TEST(SupportCounter, TellsHowManyOfTheMatchesLookAlike) {
  const LandmarkCloud cloud = with_looks(wall(2000, 1), 1);
  const Support same = support(cloud, cloud);
  ASSERT_TRUE(same.likeness);
  EXPECT_EQ(same.likeness->compared, same.matches());
  EXPECT_EQ(same.likeness->alike, same.matches());
  EXPECT_GT(same.spread_likeness, 0.8 * same.likeness->evidence());
  const Support other = support(cloud, with_looks(wall(2000, 2), 2));
  ASSERT_TRUE(other.likeness);
  EXPECT_EQ(other.likeness->compared, other.matches());
  EXPECT_GT(other.matches(), 50U);
  EXPECT_LT(other.spread_likeness, 3.0);
  EXPECT_FALSE(support(cloud, wall(2000, 2)).likeness);
}

// As in dense maps, where a corner has several landmarks.
TEST(SupportCounter, OfTheLandmarksWithinTheRadiusTheOneThatLooksMostAlikeCounts) {
  const LandmarkCloud source = with_looks(wall(500, 1), 1);
  const auto share_alike = [&](double beside) {
    // First those that are nearest and look like nothing there, then those that are the same.
    LandmarkCloud target = with_looks(wall(1000, 2), 2);
    for (std::size_t i = 0; i < 500; ++i) {
      target.positions[i] = source.positions[i] + Eigen::Vector3d(0.0, 0.0, 0.001);
      target.positions[500 + i] = source.positions[i] + Eigen::Vector3d(0.0, 0.0, beside);
    }
    std::copy(source.descriptors->bytes.begin(), source.descriptors->bytes.end(),
              target.descriptors->bytes.begin() + static_cast<std::ptrdiff_t>(500 * kBytes));
    const Support found = support(source, target);
    EXPECT_GT(found.matches(), 450U);
    return static_cast<double>(found.likeness->alike) /
           static_cast<double>(found.likeness->compared);
  };
  EXPECT_GT(share_alike(0.9 * kRadius), 0.99);
  EXPECT_LT(share_alike(1.5 * kRadius), 0.1);
}

// One poster that hangs in both places.
TEST(SupportCounter, LikenessOfOneThingAloneIsNotSpread) {
  const LandmarkCloud source = with_looks(wall(2000, 1), 1);
  LandmarkCloud target = with_looks(wall(2000, 2), 2);
  for (std::size_t i = 0; i < source.size(); ++i) {
    if (source.positions[i].norm() > 0.3) continue;
    target.positions[i] = source.positions[i];
    const auto first = static_cast<std::ptrdiff_t>(i * kBytes);
    std::copy_n(source.descriptors->bytes.begin() + first, kBytes,
                target.descriptors->bytes.begin() + first);
  }
  const Support found = support(source, target);
  ASSERT_TRUE(found.likeness);
  EXPECT_GT(found.likeness->evidence(), 20.0);
  EXPECT_LT(found.spread_likeness, 0.3 * found.likeness->evidence());
}

TEST(SupportCounter, HasNothingAgainstLandmarksThatCoincide) {
  LandmarkCloud cloud;
  cloud.positions.assign(100, Eigen::Vector3d(1.0, 2.0, 3.0));
  EXPECT_GE(support(cloud, cloud).evidence, 0.0);
}

// What a depth camera sees that looks down on a floor with boxes from a height of 1.2 m: a point a pixel, with rounded
// disparities.
LandmarkCloud seen_floor(std::uint64_t boxes_seed) {
  Random random(boxes_seed);
  std::vector<Eigen::AlignedBox3d> boxes;
  for (int i = 0; i < 12; ++i) {
    const Eigen::Vector3d at(random.uniform(-1.5, 1.5), random.uniform(1.0, 4.0), 0.0);
    boxes.emplace_back(
        at, Eigen::Vector3d(at + Eigen::Vector3d(random.uniform(0.1, 0.4), random.uniform(0.1, 0.4),
                                                 random.uniform(0.1, 0.6))));
  }
  const Eigen::Vector3d eye(0.0, 0.0, 1.2);
  LandmarkCloud cloud;
  for (int u = -30; u < 30; ++u) {
    for (int v = 0; v < 40; ++v) {
      const Eigen::Vector3d ray(u / 45.0, 1.0, -0.2 - v / 45.0);
      double nearest = -eye.z() / ray.z();
      for (const Eigen::AlignedBox3d& box : boxes) {
        const Eigen::Array3d low = (box.min() - eye).array() / ray.array();
        const Eigen::Array3d high = (box.max() - eye).array() / ray.array();
        const double enters = low.min(high).maxCoeff();
        if (enters < low.max(high).minCoeff()) nearest = std::min(nearest, enters);
      }
      constexpr double kDisparity = 300.0;  // at 1 m, in the steps of the sensor
      cloud.positions.emplace_back(eye + kDisparity / std::round(kDisparity / nearest) * ray);
    }
  }
  return cloud;
}

TEST(Lattice, IsWhereASensorOrAGridPutsPoints) {
  EXPECT_TRUE(PreparedCloud(seen_floor(1)).is_lattice());
  EXPECT_TRUE(PreparedCloud(seen_floor(1)).even(Executor()).is_lattice());
  LandmarkCloud random = wall(2000, 1);
  EXPECT_FALSE(PreparedCloud(random).is_lattice());
  for (Eigen::Vector3d& position : random.positions) position.z() = position.x() * position.y();
  EXPECT_FALSE(PreparedCloud(random).is_lattice());
  // What has descriptors are landmarks.
  LandmarkCloud described = seen_floor(1);
  described.descriptors = DescriptorColumn{"ORB", 1, std::vector<std::uint8_t>(described.size(), 1),
                                           std::vector<std::uint8_t>(described.size())};
  EXPECT_FALSE(PreparedCloud(described).is_lattice());
}

TEST(Lattice, OfOneFloorUnderOtherThingsIsNoProofOfOnePlace) {
  for (const std::uint64_t seed : {2, 4}) {
    const Alignment placed = place(seen_floor(1), seen_floor(seed));
    EXPECT_EQ(placed.verdict, Verdict::kAmbiguous) << seed;
    EXPECT_THAT(placed.reason, ::testing::HasSubstr("of the matches lie in one plane")) << seed;
  }
}

TEST(MatchesInPlane, AreAllWhereOnlyTheFloorIsTheSame) {
  const auto found = [](const LandmarkCloud& a, const LandmarkCloud& b, const Similarity3& pose) {
    const PreparedCloud from(a);
    const PreparedCloud to(b);
    return matches_in_plane(from, to, centred_pose(from, to, pose), kRadius);
  };
  const PlaneMatches others = found(seen_floor(1), seen_floor(2), {});
  EXPECT_GT(others.share, 0.9);
  EXPECT_LT(others.elsewhere, 0.3);
  const PlaneMatches same = found(seen_floor(1), seen_floor(1), {});
  EXPECT_NEAR(same.elsewhere, 1.0, 0.05);
  const Similarity3 away(Rigid3(Eigen::Quaterniond::Identity(), Eigen::Vector3d(50.0, 0.0, 0.0)));
  EXPECT_EQ(found(seen_floor(1), seen_floor(2), away).share, 0.0);
}

}  // namespace
}  // namespace cairn::detail
