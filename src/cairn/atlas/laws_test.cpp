// SPDX-License-Identifier: BSD-3-Clause
// Laws of many maps, which hold whatever the data: neither the order in which maps are given nor where they are kept
// changes what becomes of them.
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <gtest/gtest.h>

#include "cairn/atlas/atlas.hpp"
#include "cairn/core/random.hpp"
#include "cairn/map/operations.hpp"
#include "cairn/map/synthetic.hpp"
#include "cairn/merging/merge.hpp"

#include "support/seen_places.hpp"
#include "support/temporary_folder.hpp"

namespace cairn {
namespace {

using Order = std::vector<std::size_t>;

Rigid3 random_pose(Random& random) {
  const auto angle = [&] { return random.uniform(-3.0, 3.0); };
  return Rigid3::from_roll_pitch_yaw({angle(), angle(), angle()}, angle(), 0.4 * angle(), angle());
}

constexpr std::size_t kLandmarks = 800;

// A room as it is.
LandmarkMap true_room(std::uint64_t seed) {
  return synthetic_map({.seed = seed,
                        .landmarks = kLandmarks,
                        .frames = 20,
                        .pixel_noise_px = 0.0,
                        .depth_noise_m = 0.0});
}

// Maps of it, each of a random share of its landmarks, which keep their ids, with the noise that their covariances state
// and in a frame of its own; the first map's is the room's. Descriptors, which make the alignments quick, differ in a few
// bits.
// @param at_one_time whether they claim to have the same keyframes, as parts of one recording
std::vector<LandmarkMap> sessions(std::size_t count, std::uint64_t seed, double share = 0.67,
                                  bool at_one_time = false) {
  const LandmarkMap room = true_room(seed);
  const LandmarkMap mapped = synthetic_map({.seed = seed, .landmarks = kLandmarks, .frames = 20});
  const std::vector<std::uint8_t> looks = testing::place(seed, room.landmark_count());
  Random random(seed);
  std::vector<LandmarkMap> maps;
  for (std::size_t m = 0; m < count; ++m) {
    std::vector<LandmarkIndex> kept;
    for (std::uint32_t i = 0; i < room.landmark_count(); ++i) {
      if (random.chance(share)) kept.push_back(LandmarkIndex{i});
    }
    MapTables tables = with_landmarks(mapped, kept).tables();
    for (std::size_t i = 0; i < kept.size(); ++i) {
      const Eigen::Matrix3d root = tables.landmarks.covariances[i].llt().matrixL();
      tables.landmarks.positions[i] =
          room.landmarks().positions[kept[i].value] +
          root * Eigen::Vector3d(random.normal(), random.normal(), random.normal());
    }
    DescriptorColumn column{"ORB", testing::kDescriptorBytes, {}, {}};
    for (const LandmarkIndex landmark : kept) {
      column.known.push_back(1);
      for (std::size_t k = 0; k < testing::kDescriptorBytes; ++k) {
        const std::uint8_t byte = looks[landmark.value * testing::kDescriptorBytes + k];
        const bool flips = random.chance(0.3);
        column.bytes.push_back(static_cast<std::uint8_t>(byte ^ (flips ? 1 << (k % 8) : 0)));
      }
    }
    tables.landmarks.descriptors = std::move(column);
    tables.frames.timestamps_s.resize(tables.frames.ids.size());
    for (std::size_t i = 0; i < tables.frames.ids.size() && !at_one_time; ++i) {
      tables.frames.timestamps_s.set(i, 1000.0 * static_cast<double>(m) + static_cast<double>(i));
    }
    const Similarity3 frame(m == 0 ? Rigid3() : random_pose(random));
    maps.push_back(transformed(LandmarkMap(std::move(tables)), frame));
  }
  return maps;
}

std::string name_of(std::size_t map) {
  return "map " + std::to_string(map);
}

Order ascending(std::size_t count) {
  Order order(count);
  std::iota(order.begin(), order.end(), std::size_t{0});
  return order;
}

std::vector<Order> some_orders(std::size_t count) {
  Order reversed = ascending(count);
  std::reverse(reversed.begin(), reversed.end());
  Order turned = ascending(count);
  std::rotate(turned.begin(), turned.begin() + 1, turned.end());
  std::swap(turned.front(), turned[count / 2]);
  return {reversed, turned};
}

// What became of maps, in the frame of map 0.
struct Merged {
  std::vector<Similarity3> poses;  // by map
  LandmarkMap map;
};

Merged merged_in_memory(const std::vector<LandmarkMap>& maps, const Order& order) {
  std::vector<MergeInput> inputs;
  for (const std::size_t m : order) inputs.push_back({name_of(m), &maps[m]});
  const MergeResult result = merge(inputs);
  EXPECT_EQ(result.placed(), maps.size());
  Merged merged;
  merged.poses.resize(maps.size());
  for (std::size_t i = 0; i < order.size(); ++i) {
    merged.poses[order[i]] = result.maps[i].world_from_map.value();
  }
  const Similarity3 first_from_world = merged.poses[0].inverse();
  for (Similarity3& pose : merged.poses) pose = first_from_world * pose;
  merged.map = transformed(result.map.value(), first_from_world);
  return merged;
}

class AtlasOfMaps {
 public:
  AtlasOfMaps() : atlas_(created(folder_ / "a.atlas")) {}

  void add(const std::vector<LandmarkMap>& maps, const Order& order) {
    for (const std::size_t m : order) {
      const NodeId node = atlas_.add(maps[m], name_of(m)).node;
      nodes_.resize(std::max(nodes_.size(), m + 1));
      nodes_[m] = node;
    }
    atlas_.link();
    atlas_.optimize();
  }
  void remove(std::size_t map) {
    atlas_.remove(nodes_[map]);
    nodes_.resize(map);
    atlas_.optimize();
  }
  Merged merged() {
    const AtlasState state = atlas_.state();
    Merged merged;
    for (const NodeId node : nodes_) merged.poses.push_back(state.poses.at(node).frame_from_node);
    const Similarity3 first_from_frame = merged.poses[0].inverse();
    for (Similarity3& pose : merged.poses) pose = first_from_frame * pose;
    merged.map = transformed(*atlas_.merge().map, first_from_frame);
    return merged;
  }

 private:
  static Atlas created(const std::filesystem::path& path) {
    Atlas::create(path.string());
    return Atlas::open(path.string());
  }

  testing::TemporaryFolder folder_;
  Atlas atlas_;
  std::vector<NodeId> nodes_;  // by map
};

// Alike but for rounding. Landmarks have one order whatever that of the maps.
void expect_alike(const Merged& one, const Merged& other, const std::string& what) {
  SCOPED_TRACE(what);
  constexpr double kRounding = 1e-7;
  ASSERT_EQ(one.poses.size(), other.poses.size());
  for (std::size_t m = 0; m < one.poses.size(); ++m) {
    EXPECT_LT((one.poses[m].matrix() - other.poses[m].matrix()).norm(), kRounding) << m;
  }
  ASSERT_EQ(one.map.landmark_count(), other.map.landmark_count());
  ASSERT_EQ(one.map.frame_count(), other.map.frame_count());
  const auto& positions = one.map.landmarks().positions;
  double most = 0.0;
  for (std::size_t i = 0; i < positions.size(); ++i) {
    most = std::max(most, (positions[i] - other.map.landmarks().positions[i]).norm());
  }
  EXPECT_LT(most, kRounding);
}

TEST(LawsOfManyMaps, TheOrderOfMapsThatShareKeyframesDoesNotMatter) {
  const std::vector<LandmarkMap> maps = sessions(5, 15, 0.67, true);
  const Merged given = merged_in_memory(maps, ascending(5));
  EXPECT_EQ(given.map.frame_count(), maps.front().frame_count());
  for (const Order& order : some_orders(5)) {
    expect_alike(given, merged_in_memory(maps, order), "five maps");
  }
}

TEST(LawsOfManyMaps, TheOrderOfTheMapsDoesNotMatter) {
  for (const std::size_t count : {2U, 5U, 10U}) {
    const std::vector<LandmarkMap> maps = sessions(count, 10 + count);
    const Merged given = merged_in_memory(maps, ascending(count));
    EXPECT_LT(given.map.landmark_count(), kLandmarks * 12 / 10);  // most landmarks were recognised
    std::vector<Order> orders = some_orders(count);
    if (count > 5) orders.resize(1);
    for (const Order& order : orders) {
      expect_alike(given, merged_in_memory(maps, order), std::to_string(count) + " maps");
    }
  }
}

TEST(LawsOfManyMaps, AnAtlasMergesAsMemoryDoes) {
  const std::vector<LandmarkMap> maps = sessions(4, 7);
  const Merged in_memory = merged_in_memory(maps, ascending(4));
  std::vector<Order> orders = some_orders(4);
  orders.push_back(ascending(4));
  for (const Order& order : orders) {
    AtlasOfMaps atlas;
    atlas.add(maps, order);
    expect_alike(in_memory, atlas.merged(), "first " + name_of(order.front()));
  }
}

TEST(LawsOfManyMaps, AnAtlasThatGrewIsAsIfAllMapsHadComeAtOnce) {
  const std::vector<LandmarkMap> maps = sessions(4, 8);
  AtlasOfMaps at_once;
  at_once.add(maps, {2, 0, 3, 1});
  AtlasOfMaps grown;
  for (const std::size_t m : {0U, 1U, 2U, 3U}) grown.add(maps, {m});
  expect_alike(at_once.merged(), grown.merged(), "grown");
}

TEST(LawsOfManyMaps, ARemovedMapLeavesWhatWouldHaveBeenWithoutIt) {
  const std::vector<LandmarkMap> maps = sessions(4, 9);
  AtlasOfMaps without;
  without.add({maps.begin(), maps.begin() + 3}, ascending(3));
  AtlasOfMaps with;
  with.add(maps, {3, 1, 0, 2});
  with.remove(3);
  expect_alike(without.merged(), with.merged(), "removed");
}

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

TEST(LawsOfManyMaps, EightSessionsAreAsMuchBetterThanOneAsTheySay) {
  const LandmarkMap room = true_room(12);
  const std::vector<LandmarkMap> maps = sessions(8, 12, 1.0);
  const Merged merged = merged_in_memory(maps, ascending(8));
  std::vector<double> of_one;
  for (std::uint32_t i = 0; i < kLandmarks; ++i) {
    of_one.push_back((maps[0].landmarks().positions[i] - room.landmarks().positions[i]).norm());
  }
  std::vector<double> of_all;
  double nees = 0.0;
  const auto& fused = merged.map.column(kFusedColumn)->values;
  const auto& from = merged.map.column(kFromLandmarkColumn)->values;
  for (std::uint32_t i = 0; i < merged.map.landmark_count(); ++i) {
    if (fused[i] < 8.0) continue;
    const Eigen::Vector3d error = merged.map.landmarks().positions[i] -
                                  room.landmarks().positions[static_cast<std::size_t>(from[i])];
    of_all.push_back(error.norm());
    nees += error.dot(merged.map.covariance(LandmarkIndex{i})->inverse() * error);
  }
  ASSERT_GT(of_all.size(), kLandmarks * 8 / 10);
  const double better = median(of_all) / median(of_one);
  nees /= static_cast<double>(of_all.size());
  RecordProperty("error_of_eight_by_that_of_one", std::to_string(better));
  RecordProperty("nees", std::to_string(nees));
  EXPECT_LT(better, 0.45);
  EXPECT_GT(nees, 2.5);
  EXPECT_LT(nees, 3.5);
}

// Refinement ends where a step no longer helps, which is not the same to the last digit from another frame.
TEST(LawsOfManyMaps, TheFramesOfTheMapsDoNotMatter) {
  const std::vector<LandmarkMap> maps = sessions(3, 11);
  const Merged before = merged_in_memory(maps, ascending(3));
  Random random(5);
  std::vector<LandmarkMap> moved = maps;
  for (std::size_t m = 1; m < moved.size(); ++m) {
    moved[m] = transformed(maps[m], Similarity3(random_pose(random)));
  }
  const Merged after = merged_in_memory(moved, ascending(3));
  std::vector<double> apart;
  ASSERT_NEAR(static_cast<double>(before.map.landmark_count()),
              static_cast<double>(after.map.landmark_count()), 10.0);
  const auto& theirs = after.map.landmarks().positions;
  for (const Eigen::Vector3d& position : before.map.landmarks().positions) {
    double nearest = 1.0;
    for (const Eigen::Vector3d& other : theirs) {
      nearest = std::min(nearest, (position - other).norm());
    }
    apart.push_back(nearest);
  }
  std::sort(apart.begin(), apart.end());
  EXPECT_LT(apart[apart.size() * 98 / 100], 1e-4);
}

}  // namespace
}  // namespace cairn
