// SPDX-License-Identifier: BSD-3-Clause
// What BatchTree's answers cannot show, because it settles in double precision whatever is uncertain here.
#include "cairn/registration/detail/batch_kernel.hpp"

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <gtest/gtest.h>
#include <hwy/tests/hwy_gtest.h>

#include "cairn/core/random.hpp"

namespace cairn::batch_kernel {
namespace {

struct Sizes {
  std::size_t capacity;
  std::size_t k;
};

constexpr std::size_t kQueries = 100;  // does not fill the last vector

std::vector<Eigen::Vector3f> in_cube(std::size_t count, Random& random) {
  std::vector<Eigen::Vector3f> points;
  for (std::size_t i = 0; i < count; ++i) {
    const Eigen::Vector3d at = {random.uniform(), random.uniform(), random.uniform()};
    points.push_back(at.cast<float>());
  }
  return points;
}

// Of boxes that each hold `each` of those below.
template <class Low, class High>
Level level_of(std::size_t count, std::size_t each, const Low& low, const High& high) {
  Level level;
  const std::size_t boxes = (count + each - 1) / each;
  const std::size_t padded = (boxes + kFanOut - 1) / kFanOut * kFanOut;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    level.low[axis].assign(padded, std::numeric_limits<float>::infinity());
    level.high[axis].assign(padded, -std::numeric_limits<float>::infinity());
    for (std::size_t i = 0; i < count; ++i) {
      level.low[axis][i / each] = std::min(level.low[axis][i / each], low(axis, i));
      level.high[axis][i / each] = std::max(level.high[axis][i / each], high(axis, i));
    }
  }
  return level;
}

// Two levels, of points in the order of the leaves.
Tree tree_of(const std::vector<Eigen::Vector3f>& points) {
  Tree tree;
  const std::size_t leaves = (points.size() + kLeafSize - 1) / kLeafSize;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    tree.points[axis].assign((leaves + 1) * kLeafSize, kFarAway);
    for (std::size_t i = 0; i < points.size(); ++i) {
      tree.points[axis][i] = points[i][static_cast<Eigen::Index>(axis)];
    }
  }
  const auto of_point = [&](std::size_t axis, std::size_t i) { return tree.points[axis][i]; };
  tree.levels.push_back(level_of(points.size(), kLeafSize, of_point, of_point));
  const Level& boxes = tree.levels.front();
  Level above = level_of(
      leaves, kFanOut, [&](std::size_t axis, std::size_t i) { return boxes.low[axis][i]; },
      [&](std::size_t axis, std::size_t i) { return boxes.high[axis][i]; });
  tree.levels.push_back(std::move(above));
  return tree;
}

// A block of queries, and what is known of them.
class Block {
 public:
  Block(const Tree& tree, std::size_t capacity, std::size_t k)
      : tree_(tree),
        capacity_(capacity),
        k_(k),
        candidates_(kBlock * (capacity + 1), kOutOfBounds) {
    for (auto& coordinates : place_) coordinates.assign(kBlock, 0.0F);
    outside_.assign(kBlock, -1.0F);
    std::fill_n(candidates_.begin(), kBlock * capacity, 0U);
  }

  void ask(const std::vector<Eigen::Vector3f>& places) {
    queries_.count = places.size();
    queries_.rounding = 1e-6F;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      queries_.position[axis].fill(0.0F);
      for (std::size_t i = 0; i < places.size(); ++i) {
        queries_.position[axis][i] = places[i][static_cast<Eigen::Index>(axis)];
      }
    }
    Known known{{place_[0].data(), place_[1].data(), place_[2].data()},
                outside_.data(),
                candidates_.data()};
    update(tree_, capacity_, k_, queries_, known);
    for (const std::uint32_t behind : std::span(candidates_).last(kBlock)) {
      ASSERT_EQ(behind, kOutOfBounds);
    }
  }

  bool certain(std::size_t i) const { return queries_.certain[i] != 0; }
  Eigen::Vector3f place(std::size_t i) const { return {place_[0][i], place_[1][i], place_[2][i]}; }
  double outside(std::size_t i) const { return outside_[i]; }
  std::vector<std::uint32_t> candidates(std::size_t i) const {
    std::vector<std::uint32_t> result;
    for (std::size_t j = 0; j < capacity_; ++j) result.push_back(candidates_[j * kBlock + i]);
    return result;
  }

 private:
  static constexpr std::uint32_t kOutOfBounds = 123456789;  // behind the candidates

  const Tree& tree_;
  std::size_t capacity_;
  std::size_t k_;
  Queries queries_ = {};
  std::array<std::vector<float>, 3> place_;
  std::vector<float> outside_;
  std::vector<std::uint32_t> candidates_;
};

double distance(const Eigen::Vector3f& a, const Eigen::Vector3f& b) {
  return (a.cast<double>() - b.cast<double>()).norm();
}

// All points, nearest first.
std::vector<std::uint32_t> by_distance(const std::vector<Eigen::Vector3f>& points,
                                       const Eigen::Vector3f& query) {
  std::vector<std::uint32_t> order(points.size());
  for (std::uint32_t i = 0; i < order.size(); ++i) order[i] = i;
  std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    return distance(points[a], query) < distance(points[b], query);
  });
  return order;
}

// Runs the code for one of the instruction sets that this machine has.
class BatchKernelOnTarget : public hwy::TestWithParamTarget {};

INSTANTIATE_TEST_SUITE_P(All, BatchKernelOnTarget,
                         ::testing::ValuesIn(hwy::SupportedAndGeneratedTargets()),
                         hwy::TestParamTargetName);

TEST_P(BatchKernelOnTarget, IsCertainOfTheNearestAndBoundsTheOthers) {
  Random random(1);
  const auto points = in_cube(300, random);
  const Tree tree = tree_of(points);
  for (const auto& [capacity, k] : std::vector<Sizes>{{2, 1}, {4, 2}, {6, 5}, {12, 9}, {24, 20}}) {
    Block block(tree, capacity, k);
    for (int jump = 0; jump < 2; ++jump) {
      const auto queries = in_cube(kQueries, random);
      block.ask(queries);
      int uncertain = 0;
      for (std::size_t i = 0; i < kQueries; ++i) {
        const auto order = by_distance(points, queries[i]);
        const auto found = block.candidates(i);
        EXPECT_LE(block.outside(i), distance(points[order[capacity]], queries[i]));
        EXPECT_GT(block.outside(i), 0.999 * distance(points[order[capacity - 1]], queries[i]));
        EXPECT_EQ(block.place(i), queries[i]);
        if (!block.certain(i)) {
          ++uncertain;
          continue;
        }
        EXPECT_TRUE(std::ranges::equal(std::span(found).first(k), std::span(order).first(k))) << i;
      }
      EXPECT_LT(uncertain, 5) << "k = " << k;
    }
  }
}

TEST_P(BatchKernelOnTarget, RanksItsCandidatesAgainAfterASmallMotion) {
  Random random(2);
  const auto points = in_cube(300, random);
  const Tree tree = tree_of(points);
  for (const auto& [capacity, k] : std::vector<Sizes>{{8, 1}, {16, 3}, {24, 5}}) {
    Block block(tree, capacity, k);
    const auto start = in_cube(kQueries, random);
    block.ask(start);
    auto queries = start;
    for (auto& query : queries) {
      query += 0.03F * Eigen::Vector3f::Unit(static_cast<Eigen::Index>(random.index(3)));
    }
    block.ask(queries);
    int searched = 0;
    int reordered = 0;
    for (std::size_t i = 0; i < kQueries; ++i) {
      const auto order = by_distance(points, queries[i]);
      const auto found = block.candidates(i);
      EXPECT_TRUE(block.certain(i)) << i;
      EXPECT_TRUE(std::ranges::equal(std::span(found).first(k), std::span(order).first(k))) << i;
      searched += block.place(i) != start[i] ? 1 : 0;
      reordered += order[0] != by_distance(points, start[i])[0] ? 1 : 0;
    }
    EXPECT_LT(searched, 10) << "k = " << k;
    EXPECT_GT(reordered, 5) << "k = " << k;
  }
}

}  // namespace
}  // namespace cairn::batch_kernel
