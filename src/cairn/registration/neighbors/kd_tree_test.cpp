// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/registration/neighbors/kd_tree.hpp"

#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/random.hpp"

#include "support/brute_force_search.hpp"

namespace cairn {
namespace {

using testing::BruteForceSearch;
using ::testing::ElementsAre;
using Points = std::vector<Eigen::Vector3d>;

struct Cloud {
  std::string name;
  Points points;
};

// Clouds of the shapes that trip a tree up.
std::vector<Cloud> clouds() {
  Random random(11);
  const auto cube = [&](double size) {
    return Eigen::Vector3d(random.uniform(0, size), random.uniform(0, size),
                           random.uniform(0, size));
  };
  std::vector<Cloud> result = {{"uniform", {}},    {"clustered", {}},   {"collinear", {}},
                               {"duplicated", {}}, {"grid", {}},        {"all equal", {}},
                               {"far away", {}},   {"one", {{1, 2, 3}}}};
  for (int i = 0; i < 400; ++i) {
    result[0].points.push_back(cube(1.0));
    result[1].points.push_back(Eigen::Vector3d(i % 3, i % 5, 0) + cube(1e-3));
    result[2].points.push_back(Eigen::Vector3d(1, 2, 3) * random.uniform());
    result[3].points.push_back(result[0].points[static_cast<std::size_t>(i / 4)]);
    result[4].points.emplace_back(i % 7, (i / 7) % 7, i / 49);
    result[5].points.emplace_back(1, 1, 1);
    result[6].points.push_back(Eigen::Vector3d(1e6, -1e6, 1e6) + cube(1.0));
  }
  return result;
}

TEST(KdTree, FindsWhatBruteForceFindsTiesIncluded) {
  Random random(12);
  for (const Cloud& cloud : clouds()) {
    const KdTree tree(cloud.points);
    const BruteForceSearch brute_force(cloud.points);
    for (int i = 0; i < 300; ++i) {
      // Half the queries are points of the set, or lie exactly between two of a grid.
      Eigen::Vector3d query = cloud.points[random.index(cloud.points.size())];
      if (i % 4 == 1) query += Eigen::Vector3d(0.5, 0.5, 0.0);
      if (i % 4 == 2) query += 0.1 * Eigen::Vector3d(random.normal(), random.normal(), 0);
      for (const std::size_t k : {1UL, 2UL, 5UL, 20UL, 1000UL}) {
        std::vector<Neighbor> a(k);
        std::vector<Neighbor> b(k);
        a.resize(tree.nearest(query, a));
        b.resize(brute_force.nearest(query, b));
        ASSERT_EQ(a, b) << cloud.name << ", k = " << k;
      }
    }
  }
}

TEST(BruteForceSearch, OrdersByDistanceThenIndex) {
  const Points points = {{2, 0, 0}, {-1, 0, 0}, {1, 0, 0}, {0, 0, 0}};
  std::vector<Neighbor> found(3);
  EXPECT_EQ(BruteForceSearch(points).nearest({0, 0, 0}, found), 3U);
  EXPECT_THAT(found, ElementsAre(Neighbor{3, 0.0}, Neighbor{1, 1.0}, Neighbor{2, 1.0}));
}

TEST(KdTree, HasNothingToFindInAnEmptySet) {
  std::vector<Neighbor> found(3);
  EXPECT_EQ(KdTree(Points()).nearest({0, 0, 0}, found), 0U);
  EXPECT_EQ(KdTree(Points{{1, 1, 1}}).nearest({0, 0, 0}, std::span<Neighbor>()), 0U);
}

}  // namespace
}  // namespace cairn
