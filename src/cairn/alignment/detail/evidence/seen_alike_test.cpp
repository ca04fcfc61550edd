// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/alignment/detail/evidence/seen_alike.hpp"

#include <cstddef>
#include <cstdint>
#include <numeric>
#include <vector>

#include <gtest/gtest.h>

#include "cairn/alignment/detail/evidence/support_counter.hpp"
#include "cairn/core/random.hpp"

namespace cairn::detail {
namespace {

constexpr std::size_t kLandmarks = 300;
constexpr double kRadius = 0.02;
const Eigen::Vector3d kCamera(2.0, 2.0, -3.0);

using Descriptor = std::vector<std::uint8_t>;

Descriptor random_descriptor(Random& random) {
  Descriptor descriptor(32);
  for (std::uint8_t& byte : descriptor) byte = static_cast<std::uint8_t>(random.index(256));
  return descriptor;
}

// A wall that one camera sees.
// @param descriptor_of the look of a landmark
template <class DescriptorOf>
LandmarkCloud wall(const Eigen::Vector3d& camera, const DescriptorOf& descriptor_of) {
  LandmarkCloud cloud;
  Random places(1);
  DescriptorColumn column;
  column.kind = "ORB";
  column.bytes_each = 32;
  for (std::size_t i = 0; i < kLandmarks; ++i) {
    const double x = places.uniform(0.0, 4.0);
    const double y = places.uniform(0.0, 4.0);
    cloud.positions.emplace_back(x, y, 0.0);
    const Descriptor descriptor = descriptor_of(i);
    column.bytes.insert(column.bytes.end(), descriptor.begin(), descriptor.end());
    column.known.push_back(1);
  }
  cloud.descriptors = std::move(column);
  LandmarkView& view = cloud.views.emplace_back();
  view.centre = camera;
  view.landmarks.resize(kLandmarks);
  std::iota(view.landmarks.begin(), view.landmarks.end(), 0U);
  return cloud;
}

// Landmarks that all look different, by the seed.
LandmarkCloud painted(std::uint64_t seed, const Eigen::Vector3d& camera = kCamera) {
  Random random(seed);
  return wall(camera, [&](std::size_t) { return random_descriptor(random); });
}

// The same, where every third landmark is one of a few equal things.
LandmarkCloud with_equal_things(std::uint64_t seed) {
  Random random(seed);
  Random things(99);
  std::vector<Descriptor> looks;
  for (int i = 0; i < 5; ++i) looks.push_back(random_descriptor(things));
  return wall(kCamera, [&](std::size_t i) {
    return i % 3 == 0 ? looks[i / 3 % looks.size()] : random_descriptor(random);
  });
}

// At the pose that puts the walls together.
SeenAlike at_truth(const LandmarkCloud& source, const LandmarkCloud& target,
                   const Similarity3& moved = Similarity3()) {
  LandmarkCloud there = target;
  for (Eigen::Vector3d& position : there.positions) position = moved * position;
  for (LandmarkView& view : there.views) view.centre = moved * view.centre;
  const PreparedCloud a(source);
  const PreparedCloud b(there);
  return seen_alike(a, b, centred_pose(a, b, moved), moved.scale() * kRadius);
}

TEST(SeenAlike, LandmarksOfOnePlaceAreDistinctive) {
  const SeenAlike counts = at_truth(painted(2), painted(2));
  EXPECT_EQ(counts.landmarks, kLandmarks);
  EXPECT_EQ(counts.distinctive, kLandmarks);
}

TEST(SeenAlike, AreCountedUntilEnoughAreDistinctive) {
  const PreparedCloud cloud(painted(2));
  const SeenAlike counts = seen_alike(cloud, cloud, Similarity3(), kRadius, 0.1);
  EXPECT_EQ(counts.landmarks, kLandmarks);
  EXPECT_EQ(counts.distinctive, kLandmarks / 10);
}

TEST(SeenAlike, LandmarksOfAnotherPlaceAreNot) {
  const SeenAlike counts = at_truth(painted(2), painted(3));
  EXPECT_EQ(counts.landmarks, kLandmarks);
  EXPECT_EQ(counts.distinctive, 0U);
}

TEST(SeenAlike, APartOfALargeMapIsCountedToo) {
  LandmarkCloud building = painted(2);
  Random random(7);
  for (int i = 0; i < 9000; ++i) {
    building.positions.emplace_back(random.uniform(9.0, 99.0), random.uniform(9.0, 99.0), 0.0);
    const Descriptor descriptor = random_descriptor(random);
    DescriptorColumn& column = *building.descriptors;
    column.bytes.insert(column.bytes.end(), descriptor.begin(), descriptor.end());
    column.known.push_back(1);
  }
  EXPECT_EQ(at_truth(painted(2), building).distinctive, kLandmarks);
  const SeenAlike elsewhere = at_truth(painted(3), building);
  EXPECT_EQ(elsewhere.landmarks, kLandmarks);
  EXPECT_EQ(elsewhere.distinctive, 0U);
}

// Equal handles show that two kitchens are by one manufacturer.
TEST(SeenAlike, EqualThingsAreNotDistinctive) {
  const SeenAlike elsewhere = at_truth(with_equal_things(2), with_equal_things(3));
  EXPECT_EQ(elsewhere.distinctive, 0U);
  const SeenAlike here = at_truth(with_equal_things(2), with_equal_things(2));
  EXPECT_EQ(here.distinctive, kLandmarks - kLandmarks / 3);
}

Descriptor with_flipped(Descriptor descriptor, std::size_t first, std::size_t bits) {
  for (std::size_t bit = first; bit < first + bits; ++bit) {
    descriptor[bit / 8] = static_cast<std::uint8_t>(descriptor[bit / 8] ^ (1U << bit % 8));
  }
  return descriptor;
}

// A part of a kitchen has one handle, the other map all of them.
TEST(SeenAlike, AThingThatIsEqualToOthersInEitherMapIsNotDistinctive) {
  const auto with_handles = [](std::size_t count) {
    Random random(2);
    Descriptor handle;
    return wall(kCamera, [&](std::size_t i) {
      const Descriptor own = random_descriptor(random);
      if (i == 0) handle = own;
      return i < count ? handle : own;
    });
  };
  EXPECT_EQ(at_truth(with_handles(1), with_handles(2)).distinctive, kLandmarks - 2);
  EXPECT_EQ(at_truth(with_handles(2), with_handles(1)).distinctive, kLandmarks - 2);
}

TEST(SeenAlike, ADistinctiveLandmarkIsAtLeastTwiceAsFarFromOthersAsFromItself) {
  const auto with_another = [](std::size_t bits_of_itself, std::size_t bits_of_another) {
    Random random(2);
    Descriptor first;
    return wall(kCamera, [&](std::size_t i) {
      const Descriptor own = random_descriptor(random);
      if (i == 0) first = own;
      if (i == 0) return with_flipped(own, 0, bits_of_itself);
      return i == 1 && bits_of_another > 0 ? with_flipped(first, 100, bits_of_another) : own;
    });
  };
  EXPECT_EQ(at_truth(with_another(0, 41), with_another(20, 0)).distinctive, kLandmarks - 1);
  EXPECT_EQ(at_truth(with_another(0, 40), with_another(20, 0)).distinctive, kLandmarks - 2);
}

// A map may have several landmarks of one corner.
TEST(SeenAlike, CopiesOfALandmarkNearbyDoNotCount) {
  LandmarkCloud twice = painted(2);
  const LandmarkCloud once = painted(2);
  for (std::size_t i = 0; i < kLandmarks; ++i) {
    twice.positions.emplace_back(once.positions[i] + Eigen::Vector3d(0.0, 0.0, kRadius / 4.0));
    twice.views[0].landmarks.push_back(static_cast<std::uint32_t>(kLandmarks + i));
  }
  auto& column = *twice.descriptors;
  column.bytes.insert(column.bytes.end(), once.descriptors->bytes.begin(),
                      once.descriptors->bytes.end());
  column.known.resize(2 * kLandmarks, 1);
  const SeenAlike counts = at_truth(once, twice);
  EXPECT_EQ(counts.distinctive, counts.landmarks);
}

TEST(SeenAlike, LandmarksSeenFromElsewhereAreNotCompared) {
  for (const Eigen::Vector3d& camera :
       {Eigen::Vector3d(2.0, 2.0, 3.0), Eigen::Vector3d(2.0, 2.0, -9.0),
        Eigen::Vector3d(9.0, 2.0, -3.0)}) {
    EXPECT_EQ(at_truth(painted(2), painted(2, camera)).landmarks, 0U) << camera.transpose();
  }
}

TEST(SeenAlike, NeitherPoseNorUnitMatters) {
  const Similarity3 moved(
      7.0, Rigid3(Eigen::Quaterniond(Eigen::AngleAxisd(1.0, Eigen::Vector3d(1, 2, 3).normalized())),
                  Eigen::Vector3d(100.0, -50.0, 3.0)));
  const SeenAlike here = at_truth(with_equal_things(2), with_equal_things(2));
  const SeenAlike there = at_truth(with_equal_things(2), with_equal_things(2), moved);
  EXPECT_EQ(here.landmarks, there.landmarks);
  EXPECT_EQ(here.distinctive, there.distinctive);
}

TEST(SeenAlike, NothingIsKnownWithoutViewsOrDescriptors) {
  LandmarkCloud bare = painted(2);
  bare.descriptors.reset();
  EXPECT_EQ(at_truth(bare, painted(2)).landmarks, 0U);
  LandmarkCloud unseen = painted(2);
  unseen.views.clear();
  EXPECT_EQ(at_truth(painted(2), unseen).landmarks, 0U);
  // An unknown descriptor is no evidence against a place.
  LandmarkCloud half = painted(2);
  for (std::size_t i = 0; i < kLandmarks; i += 2) half.descriptors->known[i] = 0;
  const SeenAlike of_source = at_truth(half, painted(2));
  EXPECT_EQ(of_source.landmarks, kLandmarks / 2);
  EXPECT_EQ(of_source.distinctive, kLandmarks / 2);
  // A few of the others lie by chance beside a known one.
  const SeenAlike of_target = at_truth(painted(2), half);
  EXPECT_NEAR(static_cast<double>(of_target.landmarks), kLandmarks / 2.0, 5.0);
  EXPECT_EQ(of_target.distinctive, kLandmarks / 2);
}

TEST(SeenAlike, IsPartOfTheSurroundings) {
  const PreparedCloud cloud(painted(2));
  const SeenAlike counts = surroundings(cloud, cloud, Similarity3(), kRadius).seen_alike;
  EXPECT_EQ(counts.landmarks, kLandmarks);
  EXPECT_EQ(counts.distinctive, kLandmarks / 20);
}

}  // namespace
}  // namespace cairn::detail
