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
#include <gtest/gtest.h>

#include "cairn/atlas/atlas.hpp"
#include "cairn/core/random.hpp"
#include "cairn/map/operations.hpp"
#include "cairn/map/synthetic.hpp"
#include "cairn/merging/merge.hpp"

#include "support/temporary_folder.hpp"

namespace cairn {
namespace {

using Order = std::vector<std::size_t>;

Rigid3 random_pose(Random& random) {
  const auto angle = [&] { return random.uniform(-3.0, 3.0); };
  return Rigid3::from_roll_pitch_yaw({angle(), angle(), angle()}, angle(), 0.4 * angle(), angle());
}

// Maps of one room, each of a random two thirds of its landmarks, with noise of its own and in a frame of its own.
std::vector<LandmarkMap> sessions(std::size_t count, std::uint64_t seed) {
  const LandmarkMap room = synthetic_map({.seed = seed, .landmarks = 800, .frames = 20});
  Random random(seed);
  std::vector<LandmarkMap> maps;
  for (std::size_t m = 0; m < count; ++m) {
    std::vector<LandmarkIndex> kept;
    for (std::uint32_t i = 0; i < room.landmark_count(); ++i) {
      if (random.chance(0.67)) kept.push_back(LandmarkIndex{i});
    }
    MapTables tables = with_landmarks(room, kept).tables();
    for (std::size_t i = 0; i < kept.size(); ++i) {
      const Eigen::Matrix3d root = tables.landmarks.covariances[i].llt().matrixL();
      tables.landmarks.positions[i] +=
          root * Eigen::Vector3d(random.normal(), random.normal(), random.normal());
    }
    maps.push_back(transformed(LandmarkMap(std::move(tables)), Similarity3(random_pose(random))));
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
    merged.map = transformed(atlas_.merge().merged.map, first_from_frame);
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

TEST(LawsOfManyMaps, TheOrderOfTheMapsDoesNotMatter) {
  for (const std::size_t count : {2U, 5U}) {
    const std::vector<LandmarkMap> maps = sessions(count, 10 + count);
    const Merged given = merged_in_memory(maps, ascending(count));
    EXPECT_LT(given.map.landmark_count(), 800U * 12 / 10);  // most landmarks were recognised
    for (const Order& order : some_orders(count)) {
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
