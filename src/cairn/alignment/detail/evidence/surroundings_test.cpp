// SPDX-License-Identifier: BSD-3-Clause
#include <numeric>

#include <gtest/gtest.h>

#include "cairn/alignment/align.hpp"
#include "cairn/alignment/detail/evidence/support_counter.hpp"
#include "cairn/core/random.hpp"

namespace cairn::detail {
namespace {

constexpr double kMatchRadius = 0.04;

// What a camera at the origin sees: a box of landmarks two metres before it, which is the same in every
// place, and a wall farther back, with landmarks of its own.
LandmarkCloud place_with_box(double wall, std::uint64_t seed) {
  LandmarkCloud cloud;
  Random box(1);
  for (int i = 0; i < 400; ++i) {
    cloud.positions.emplace_back(box.uniform(1.8, 2.2), box.uniform(-0.2, 0.2),
                                 box.uniform(-0.2, 0.2));
  }
  Random random(seed);
  for (int i = 0; i < 3000; ++i) {
    cloud.positions.emplace_back(wall, random.uniform(-2.0, 2.0), random.uniform(-2.0, 2.0));
  }
  LandmarkView& view = cloud.views.emplace_back();
  view.landmarks.resize(cloud.size());
  std::iota(view.landmarks.begin(), view.landmarks.end(), 0U);
  return cloud;
}

// The centred pose that puts what both have in common together.
Surroundings at_truth(const LandmarkCloud& source, const LandmarkCloud& target) {
  const PreparedCloud a(source);
  const PreparedCloud b(target);
  const Similarity3 pose(1.0, Rigid3(Eigen::Quaterniond::Identity(), a.centre() - b.centre()));
  return surroundings(a, b, pose, kMatchRadius);
}

TEST(Surroundings, OfOnePlaceAgree) {
  const SightCounts counts = at_truth(place_with_box(3.0, 2), place_with_box(3.0, 3)).landmarks;
  EXPECT_GT(counts.agree, 200U);
  EXPECT_EQ(counts.in_front, 0U);
}

TEST(Surroundings, OfOneThingInTwoPlacesAreContradicted) {
  const SightCounts counts = at_truth(place_with_box(3.0, 2), place_with_box(5.0, 3)).landmarks;
  EXPECT_GT(counts.in_front, 200U);
  EXPECT_GT(counts.in_front, 10 * counts.agree);
  const SightCounts exchanged = at_truth(place_with_box(5.0, 3), place_with_box(3.0, 2)).landmarks;
  EXPECT_GT(exchanged.in_front, 200U);
  EXPECT_GT(exchanged.in_front, 10 * exchanged.agree);
}

// What matches is no witness for what surrounds it.
TEST(Surroundings, AreOutsideOfWhatMatches) {
  LandmarkCloud thing = place_with_box(3.0, 2);
  thing.positions.resize(400);
  thing.views.front().landmarks.resize(400);
  LandmarkCloud other = thing;
  const SightCounts counts = at_truth(thing, other).landmarks;
  EXPECT_LT(counts.total(), 100U);
  other.views.clear();
  EXPECT_LT(at_truth(thing, other).landmarks.total(), 50U);
  EXPECT_LT(at_truth(thing, other).share, 0.1);
  // Half the box's diagonal, of which a few corners stand out.
  EXPECT_NEAR(kMatchRadius * at_truth(thing, other).extent, 0.33, 0.05);
}

// The box hides what is behind it, in either place.
TEST(Surroundings, AreNotSoughtBehindTheMatches) {
  const auto box_before_wall = [](double wall) {
    LandmarkCloud cloud;
    Random random(5);
    for (int i = 0; i < 4000; ++i) {
      cloud.positions.emplace_back(random.uniform(1.8, 2.2), random.uniform(-0.2, 0.2),
                                   random.uniform(-0.2, 0.2));
    }
    for (int i = 0; i < 1000; ++i) {
      cloud.positions.emplace_back(wall, 0.05 * wall * random.uniform(-1.0, 1.0),
                                   0.05 * wall * random.uniform(-1.0, 1.0));
    }
    LandmarkView& view = cloud.views.emplace_back();
    view.landmarks.resize(cloud.size());
    std::iota(view.landmarks.begin(), view.landmarks.end(), 0U);
    return cloud;
  };
  EXPECT_LT(at_truth(box_before_wall(3.0), box_before_wall(5.0)).landmarks.total(), 50U);
}

TEST(Surroundings, SayNothingWithoutMatchesOrViews) {
  LandmarkCloud source = place_with_box(3.0, 2);
  LandmarkCloud target = place_with_box(5.0, 3);
  const PreparedCloud a(source);
  const PreparedCloud b(target);
  const Similarity3 away(1.0, Rigid3(Eigen::Quaterniond::Identity(), {50.0, 0.0, 0.0}));
  EXPECT_EQ(surroundings(a, b, away, kMatchRadius).landmarks.total(), 0U);
  source.views.clear();
  target.views.clear();
  EXPECT_EQ(at_truth(source, target).landmarks.total(), 0U);
}

// What a camera at the origin sees: a box of landmarks that is the same in every place, and others behind it anywhere.
LandmarkCloud scattered_place(std::uint64_t seed, std::uint64_t session) {
  LandmarkCloud cloud;
  Random noise(session);
  const auto seen = [&](const Eigen::Vector3d& there) {
    cloud.positions.emplace_back(
        there + 0.002 * Eigen::Vector3d(noise.normal(), noise.normal(), noise.normal()));
  };
  Random box(1);
  for (int i = 0; i < 700; ++i) {
    seen({box.uniform(1.7, 2.3), box.uniform(-0.3, 0.3), box.uniform(-0.3, 0.3)});
  }
  Random random(seed);
  for (int i = 0; i < 1500; ++i) {
    const double depth = random.uniform(3.0, 6.0);
    seen(depth * Eigen::Vector3d(1.0, random.uniform(-0.6, 0.6), random.uniform(-0.6, 0.6)));
  }
  LandmarkView& view = cloud.views.emplace_back();
  view.landmarks.resize(cloud.size());
  std::iota(view.landmarks.begin(), view.landmarks.end(), 0U);
  return cloud;
}

TEST(Surroundings, KeepPlacesThatShareOneThingFromBeingAligned) {
  const Alignment other = place(scattered_place(2, 11), scattered_place(3, 12));
  EXPECT_GE(other.probability, 0.99) << "or this tests nothing: " << other.reason;
  EXPECT_EQ(other.verdict, Verdict::kAmbiguous) << other.reason;
  EXPECT_GT(other.around.landmarks.in_front, 100U);
  const Alignment same = place(scattered_place(2, 11), scattered_place(2, 12));
  EXPECT_EQ(same.verdict, Verdict::kAligned) << same.reason;
}

}  // namespace
}  // namespace cairn::detail
