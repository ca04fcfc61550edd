// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <numeric>
#include <span>
#include <vector>

#include <gtest/gtest.h>

#include "cairn/alignment/align.hpp"
#include "cairn/alignment/detail/prepared_cloud.hpp"
#include "cairn/core/error.hpp"
#include "cairn/core/random.hpp"
#include "cairn/map/operations.hpp"
#include "cairn/map/synthetic.hpp"

namespace cairn {
namespace {

using detail::PreparedCloud;

SyntheticPair two_maps(std::size_t landmarks = 600) {
  return synthetic_pair({.seed = 5, .landmarks = landmarks});
}

TEST(PreparedCloud, HoldsEachLandmarkOnceCentredAndSaysWhichItIs) {
  LandmarkCloud cloud = landmark_cloud(two_maps().source);
  DescriptorColumn& looks = cloud.descriptors.emplace();
  looks = {"SIFT", 3, std::vector<std::uint8_t>(cloud.size(), 1), {}};
  looks.known[5] = 0;
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const auto byte = static_cast<std::uint8_t>(i == 5 ? 0 : i % 251);
    looks.bytes.insert(looks.bytes.end(), {byte, 1, byte});
  }
  const PreparedCloud prepared(cloud);
  std::vector<std::uint32_t> order(prepared.order().begin(), prepared.order().end());
  ASSERT_EQ(order.size(), cloud.size());
  EXPECT_FALSE(std::is_sorted(order.begin(), order.end()));
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < order.size(); ++i) {
    const Eigen::Vector3d& there = prepared.landmarks().positions[i];
    EXPECT_LT((there + prepared.centre() - cloud.positions[order[i]]).norm(), 1e-12);
    EXPECT_EQ(prepared.landmarks().covariances[i], cloud.covariances[order[i]]);
    const DescriptorColumn& theirs = *prepared.landmarks().descriptors;
    EXPECT_EQ(theirs.known[i], looks.known[order[i]]);
    EXPECT_TRUE(std::equal(theirs.bytes.begin() + 3 * i, theirs.bytes.begin() + 3 * (i + 1),
                           looks.bytes.begin() + 3 * order[i]));
    sum += there;
  }
  EXPECT_LT(sum.norm(), 1e-9);
  std::sort(order.begin(), order.end());
  std::vector<std::uint32_t> all(order.size());
  std::iota(all.begin(), all.end(), 0U);
  EXPECT_EQ(order, all);
}

TEST(PreparedCloud, OrdersFurtherDescriptorsWithTheirLandmarks) {
  LandmarkCloud cloud = landmark_cloud(two_maps().source);
  DescriptorColumn column{"ORB", 2, {}, {}};
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const std::vector<std::vector<std::uint8_t>> rows(
        i % 4, {static_cast<std::uint8_t>(i % 256), static_cast<std::uint8_t>(i / 256)});
    append_descriptors(column,
                       std::vector<std::span<const std::uint8_t>>(rows.begin(), rows.end()));
  }
  cloud.descriptors = column;
  const PreparedCloud prepared(cloud);
  const DescriptorColumn& ordered = *prepared.landmarks().descriptors;
  std::size_t moved = 0;
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const std::uint32_t before = prepared.order()[i];
    moved += before != i ? 1 : 0;
    ASSERT_EQ(ordered.count(i), column.count(before));
    for (std::size_t k = 0; k < ordered.count(i); ++k) {
      EXPECT_EQ(ordered.descriptor(i, k)[0], before % 256);
      EXPECT_EQ(ordered.descriptor(i, k)[1], before / 256);
    }
  }
  EXPECT_GT(moved, cloud.size() / 2);
}

TEST(PreparedCloud, PutsWeightyLandmarksFirst) {
  LandmarkCloud cloud = landmark_cloud(two_maps(2000).source);
  cloud.weights.assign(cloud.size(), 0.1);
  for (std::size_t i = 0; i < cloud.size(); i += 2) cloud.weights[i] = 1.9;
  const PreparedCloud prepared(cloud);
  const auto first = prepared.order().first(cloud.size() / 4);
  const auto weighty = std::count_if(first.begin(), first.end(), [](auto i) { return i % 2 == 0; });
  EXPECT_GT(static_cast<double>(weighty), 0.85 * static_cast<double>(first.size()));
}

TEST(PreparedCloud, ScalesAllLengths) {
  const PreparedCloud one(landmark_cloud(two_maps().source));
  const PreparedCloud twice = one.scaled(2.0, Executor());
  EXPECT_NEAR(twice.scales().extent, 2.0 * one.scales().extent, 1e-12);
  EXPECT_NEAR(twice.spacings()[7], 2.0 * one.spacings()[7], 1e-12);
  EXPECT_LT((twice.centre() - 2.0 * one.centre()).norm(), 1e-12);
  EXPECT_EQ(twice.order()[3], one.order()[3]);
}

TEST(PreparedCloud, RefusesAnInvalidCloud) {
  LandmarkCloud cloud = landmark_cloud(two_maps().source);
  cloud.weights.assign(3, 1.0);
  EXPECT_THROW(PreparedCloud{cloud}, Error);
}

TEST(PreparedCloud, RefinesToWhereTheCloudsThemselvesLead) {
  const SyntheticPair pair = two_maps();
  const LandmarkCloud source = landmark_cloud(pair.source);
  const LandmarkCloud target = landmark_cloud(pair.target);
  RefineOptions options;
  options.initial = pair.target_from_source;
  options.overlap_radius = 0.1;
  const RegistrationResult plain = refine(source, target, options);
  const RegistrationResult prepared = refine(PreparedMap(source), PreparedMap(target), options);
  EXPECT_LT((plain.target_from_source.matrix() - prepared.target_from_source.matrix()).norm(),
            1e-6);
  ASSERT_EQ(plain.matches.size(), prepared.matches.size());
  for (std::size_t i = 0; i < plain.matches.size(); ++i) {
    EXPECT_EQ(plain.matches[i].source, prepared.matches[i].source);
    EXPECT_EQ(plain.matches[i].target, prepared.matches[i].target);
  }
  EXPECT_NEAR(plain.score.value(), prepared.score.value(), 1e-9);
}

TEST(PreparedMap, GivesThePlacementThatTheMapGives) {
  const SyntheticPair pair = two_maps();
  const PreparedMap source(pair.source);
  const PreparedMap target(pair.target);
  const Alignment plain = place(landmark_cloud(pair.source), landmark_cloud(pair.target));
  const Alignment prepared = PreparedPair(source, target).place();
  EXPECT_EQ(prepared.verdict, Verdict::kAligned);
  EXPECT_EQ(plain.probability, prepared.probability);
  EXPECT_EQ(plain.registration.target_from_source.matrix(),
            prepared.registration.target_from_source.matrix());
}

// Points on a floor with boxes, drawn anew for each seed, with noise of 5 mm. The near half of the floor's length is drawn
// nine times as densely, as a camera there would.
LandmarkCloud scanned_floor(std::size_t count, std::uint64_t seed) {
  struct Box {
    Eigen::Vector3d least;
    Eigen::Vector3d size;
  };
  Random scene(3);  // one scene for all seeds
  std::vector<Box> boxes = {{{0.0, 0.0, -0.1}, {4.0, 3.0, 0.1}}};
  for (int i = 0; i < 40; ++i) {
    boxes.push_back({{scene.uniform(0.0, 3.5), scene.uniform(0.0, 2.5), 0.0},
                     {scene.uniform(0.1, 0.8), scene.uniform(0.1, 0.8), scene.uniform(0.1, 1.5)}});
  }
  Random random(seed);
  LandmarkCloud cloud;
  while (cloud.size() < count) {
    // Boxes by their surface; of a box, a point on its top or on a side.
    const Box& box = boxes[random.uniform() < 0.2 ? 0 : random.index(boxes.size())];
    // Drawn one by one: compilers differ in the order of arguments.
    const auto drawn = [](const auto& draw) {
      const double z = draw();
      const double y = draw();
      return Eigen::Vector3d(draw(), y, z);
    };
    Eigen::Vector3d at = drawn([&] { return random.uniform(); });
    const std::size_t face = random.index(3);
    if (face == 2 || &box == &boxes.front()) {
      at.z() = 1.0;
    } else {
      at[static_cast<Eigen::Index>(face)] = random.uniform() < 0.5 ? 0.0 : 1.0;
    }
    const Eigen::Vector3d point = box.least + box.size.cwiseProduct(at);
    if (point.x() > 2.0 && random.uniform() > 1.0 / 9.0) continue;
    cloud.positions.push_back(point + 0.005 * drawn([&] { return random.normal(); }));
  }
  return cloud;
}

TEST(PreparedMap, SpreadsADenseCloudEvenly) {
  const LandmarkCloud cloud = scanned_floor(60000, 1);
  const PreparedMap map(cloud);
  ASSERT_TRUE(map.even());
  const PreparedCloud& even = *map.even();
  EXPECT_LE(even.size(), PreparedCloud::kSample);
  EXPECT_GE(even.size(), PreparedCloud::kSample * 9 / 10);
  // Of the floor beside boxes, both halves have one density.
  double near = 0.0;
  double far = 0.0;
  for (std::uint32_t i = 0; i < even.size(); ++i) {
    const Eigen::Vector3d at = even.landmarks().positions[i] + even.centre();
    EXPECT_LT((at - cloud.positions[even.as_given(i)]).norm(), 1e-12);
    (at.x() < 2.0 ? near : far) += 1.0;
  }
  EXPECT_GT(far, 0.6 * near);
}

TEST(PreparedMap, HasNoEvenLandmarksWhereEachCounts) {
  LandmarkCloud cloud = scanned_floor(10000, 1);
  EXPECT_TRUE(PreparedMap(cloud).even());
  LandmarkCloud seen = cloud;
  seen.views.push_back({Eigen::Vector3d(0.0, 0.0, 5.0), {1, 2, 3}});
  EXPECT_FALSE(PreparedMap(seen).even());
  cloud.descriptors = {"user", 1, std::vector<std::uint8_t>(cloud.size(), 7),
                       std::vector<std::uint8_t>(cloud.size(), 1)};
  EXPECT_FALSE(PreparedMap(cloud).even());
  EXPECT_FALSE(PreparedMap(scanned_floor(8000, 1)).even());
}

// What a surface shows does not depend on how densely it was sampled.
TEST(PreparedMap, PlacesOneSurfaceHoweverDenselyItWasSampled) {
  const Rigid3 truth(
      Eigen::Quaterniond(Eigen::AngleAxisd(2.0, Eigen::Vector3d(1, 2, 3).normalized())),
      Eigen::Vector3d(0.5, -2.0, 1.0));
  for (const std::size_t count : {10000, 20000}) {
    LandmarkCloud source = scanned_floor(count, 11);
    for (Eigen::Vector3d& position : source.positions) position = truth.inverse() * position;
    const Alignment placed = place(source, scanned_floor(count, 12));
    EXPECT_EQ(placed.verdict, Verdict::kAligned) << count << ": " << placed.reason;
    ASSERT_TRUE(placed.registration.has_pose());
    const Rigid3& found = placed.registration.target_from_source;
    double largest = 0.0;
    for (const Eigen::Vector3d& position : source.positions) {
      largest = std::max(largest, (found * position - truth * position).norm());
    }
    EXPECT_LT(largest, 0.02) << count;
  }
}

TEST(PreparedMap, AsksForTheInputOfItsConfidence) {
  const LandmarkMap map = two_maps().source;
  EXPECT_TRUE(PreparedMap(map).cloud().landmarks().weights.empty());
  const PreparedMap weighted(map, {.confidence = observations_metric()});
  EXPECT_EQ(weighted.cloud().landmarks().weights.size(), weighted.cloud().size());
  EXPECT_THROW(PreparedMap(map, {.confidence = column_metric("quality")}), Error);
}

}  // namespace
}  // namespace cairn
