// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/registration/neighbors/batch_tree.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <hwy/tests/hwy_gtest.h>

#include "cairn/core/random.hpp"

#include "support/brute_force_search.hpp"

namespace cairn {
namespace {

using testing::BruteForceSearch;
using ::testing::ElementsAre;
using Points = std::vector<Eigen::Vector3d>;
using Answers = std::vector<std::vector<Neighbor>>;

struct Cloud {
  std::string name;
  Points points;
};

Eigen::Vector3d in_cube(Random& random, double size) {
  return {random.uniform(0, size), random.uniform(0, size), random.uniform(0, size)};
}

// Clouds of the shapes that trip a tree up, and that single precision cannot tell apart.
std::vector<Cloud> clouds(std::size_t size) {
  Random random(11);
  std::vector<Cloud> result = {
      {"uniform", {}},    {"clustered", {}},    {"collinear", {}},   {"duplicated", {}},
      {"grid", {}},       {"all equal", {}},    {"offset 1e6", {}},  {"offset 1e8", {}},
      {"two places", {}}, {"tiny", {}},         {"too tiny", {}},    {"huge", {}},
      {"too huge", {}},   {"nearly equal", {}}, {"one far off", {}}, {"along an axis", {}}};
  for (std::size_t i = 0; i < size; ++i) {
    const auto x = static_cast<double>(i);
    const Eigen::Vector3d at = in_cube(random, 1.0);
    result[0].points.push_back(at);
    result[1].points.push_back(Eigen::Vector3d(std::fmod(x, 3), std::fmod(x, 5), 0) + 1e-3 * at);
    result[2].points.push_back(Eigen::Vector3d(1, 2, 3) * random.uniform());
    result[3].points.push_back(result[0].points[i / 4]);
    result[4].points.emplace_back(std::fmod(x, 7), std::fmod(std::floor(x / 7), 7),
                                  std::floor(x / 49));
    result[5].points.emplace_back(1, 1, 1);
    result[6].points.push_back(Eigen::Vector3d(1e6, -1e6, 1e6) + at);
    result[7].points.push_back(Eigen::Vector3d(-1e8, 1e8, 1e8) + at);
    result[8].points.push_back(at + Eigen::Vector3d(i % 2 == 0 ? 1e7 : -1e7, 0, 0));
    result[9].points.push_back(1e-15 * at);
    result[10].points.push_back(1e-170 * at);
    result[11].points.push_back(1e15 * at);
    result[12].points.push_back(1e30 * at);
    result[13].points.push_back(Eigen::Vector3d(1, 1, 1) + 1e-9 * at);
    result[14].points.push_back(i == 5 ? Eigen::Vector3d(1e9, 0, 0) : at);
    result[15].points.emplace_back(x * 0.1, 0, 0);
  }
  return result;
}

// Points of the set, places between them, near them, and anywhere.
Points queries_for(const Points& points, std::size_t count, Random& random) {
  Points queries;
  for (std::size_t i = 0; i < count; ++i) {
    const Eigen::Vector3d& a = points[random.index(points.size())];
    const Eigen::Vector3d& b = points[random.index(points.size())];
    switch (i % 5) {
      case 0:
        queries.push_back(a);
        break;
      case 1:
        queries.push_back(0.5 * (a + b));
        break;
      case 2:
        queries.push_back(a + 0.1 * (b - a));
        break;
      case 3:
        queries.push_back(a + Eigen::Vector3d(0.5, 0.5, 0.0));
        break;
      default:
        queries.push_back(a + 3.0 * (b - a));
    }
  }
  return queries;
}

Answers brute_force(const Points& points, const Points& queries, std::size_t k) {
  const BruteForceSearch search(points);
  Answers result;
  for (const Eigen::Vector3d& query : queries) {
    std::vector<Neighbor> found(k);
    found.resize(search.nearest(query, found));
    result.push_back(found);
  }
  return result;
}

// The k nearest of more, nearest first.
Answers nearest_of(Answers answers, std::size_t k) {
  for (auto& answer : answers) answer.resize(std::min(k, answer.size()));
  return answers;
}

Answers answers_to(BatchTree::Batch& batch, const Points& queries,
                   const Executor& executor = Executor()) {
  Answers result(queries.size());
  batch.for_each(queries, executor, [&](std::size_t i, const NearestList auto& nearest) {
    EXPECT_TRUE(result[i].empty()) << "visited twice";
    for (std::size_t j = 0; j < nearest.size(); ++j) {
      result[i].push_back({nearest.index(j), nearest.squared_distance(j)});
    }
  });
  return result;
}

// Runs the code for one of the instruction sets that this machine has.
class BatchTreeOnTarget : public hwy::TestWithParamTarget {};

TEST_P(BatchTreeOnTarget, FindsWhatBruteForceFindsTiesIncluded) {
  Random random(12);
  for (const std::size_t size : {1UL, 2UL, 8UL, 9UL, 130UL, 700UL}) {
    for (const Cloud& cloud : clouds(size)) {
      const BatchTree tree(cloud.points);
      ASSERT_EQ(tree.size(), size);
      const Points queries = queries_for(cloud.points, size > 9 ? 100 : 37, random);
      const Answers all = brute_force(cloud.points, queries, size);
      for (const std::size_t k : {1UL, 2UL, 3UL, 5UL, 7UL, 10UL, 15UL, 20UL, 23UL, 24UL, 1000UL}) {
        BatchTree::Batch batch = tree.batch(k);
        EXPECT_EQ(batch.count(), std::min(k, size));
        ASSERT_EQ(answers_to(batch, queries), nearest_of(all, k))
            << size << " points, " << cloud.name << ", k = " << k;
      }
    }
  }
}

TEST_P(BatchTreeOnTarget, FindsTheSameWhateverItRemembers) {
  Random random(13);
  for (const Cloud& cloud : clouds(400)) {
    const BatchTree tree(cloud.points);
    Points queries = queries_for(cloud.points, 200, random);
    const double size = (cloud.points[0] - cloud.points[399]).norm();
    std::vector<BatchTree::Batch> batches = {tree.batch(1), tree.batch(5), tree.batch(20)};
    for (const double motion : {0.0, 1e-12, 1e-6, 1e-3, 1e-2, 0.0, 0.3, 1e-2, 30.0, 1e-3}) {
      for (auto& query : queries) {
        // Some stay, and some move elsewhere than the others.
        if (random.index(10) != 0) query.x() += motion * size;
        if (random.index(10) == 0) query.y() -= motion * size * random.uniform();
      }
      const Answers most = brute_force(cloud.points, queries, 20);
      for (BatchTree::Batch& batch : batches) {
        ASSERT_EQ(answers_to(batch, queries), nearest_of(most, batch.count()))
            << cloud.name << ", k = " << batch.count() << ", motion " << motion;
      }
    }
  }
}

TEST_P(BatchTreeOnTarget, OrdersPointsThatSinglePrecisionCannotTellApart) {
  // Points on a sphere, seen from about its middle: all are almost equally far.
  Random random(19);
  for (const double extent : {1.0, 1e3}) {
    for (const double unequal : {1e-9, 1e-7, 1e-5, 1e-3}) {
      Points points = {Eigen::Vector3d(extent, 0, 0), Eigen::Vector3d(-extent, extent, extent)};
      const Eigen::Vector3d middle(0.3 * extent, -0.1 * extent, 0.2);
      for (int i = 0; i < 200; ++i) {
        const Eigen::Vector3d side(random.normal(), random.normal(), random.normal());
        points.push_back(middle + (1.0 + unequal * extent * random.uniform()) * side.normalized());
      }
      const BatchTree tree(points);
      std::vector<BatchTree::Batch> batches = {tree.batch(1), tree.batch(5), tree.batch(20)};
      Points queries(40, middle);
      for (const double motion : {0.0, 0.3, 0.1, 1.0, 10.0, 0.3}) {
        for (auto& query : queries) {
          query += motion * unequal * extent *
                   Eigen::Vector3d(random.normal(), random.normal(), random.normal());
        }
        const Answers most = brute_force(points, queries, 20);
        for (BatchTree::Batch& batch : batches) {
          ASSERT_EQ(answers_to(batch, queries), nearest_of(most, batch.count()))
              << extent << ", " << unequal << ", k = " << batch.count() << ", motion " << motion;
        }
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(All, BatchTreeOnTarget,
                         ::testing::ValuesIn(hwy::SupportedAndGeneratedTargets()),
                         hwy::TestParamTargetName);

TEST(BatchTree, FindsThePointsWithinALimit) {
  Random random(15);
  for (const Cloud& cloud : clouds(300)) {
    const BatchTree tree(cloud.points);
    for (const Eigen::Vector3d& query : queries_for(cloud.points, 20, random)) {
      for (const std::size_t k : {1UL, 6UL}) {
        std::vector<Neighbor> all(k);
        BruteForceSearch(cloud.points).nearest(query, all);
        for (const double limit : {0.5 * all[0].squared_distance, all[k - 1].squared_distance,
                                   4.0 * all[k / 2].squared_distance}) {
          std::vector<Neighbor> expected = all;
          std::erase_if(expected, [&](const Neighbor& n) { return n.squared_distance > limit; });
          std::vector<Neighbor> found(k);
          found.resize(tree.nearest(query, found, limit));
          EXPECT_EQ(found, expected) << cloud.name << ", limit " << limit;
        }
      }
    }
  }
}

TEST(BatchTree, FindsWhatBruteForceFindsForOneQuery) {
  Random random(14);
  for (const Cloud& cloud : clouds(400)) {
    const BatchTree tree(cloud.points);
    const Points queries = queries_for(cloud.points, 300, random);
    const Answers all = brute_force(cloud.points, queries, 400);
    for (const std::size_t k : {1UL, 5UL, 1000UL}) {
      const Answers expected = nearest_of(all, k);
      for (std::size_t i = 0; i < queries.size(); ++i) {
        std::vector<Neighbor> found(k);
        found.resize(tree.nearest(queries[i], found));
        ASSERT_EQ(found, expected[i]) << cloud.name << ", k = " << k;
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

TEST(BatchTree, FindsInALargeSetWhatSingleQueriesAndBruteForceFind) {
  Random random(15);
  Points points(70000);
  for (auto& point : points) point = in_cube(random, 10.0);
  Points queries(10000);
  for (auto& query : queries) query = in_cube(random, 12.0);
  const BatchTree tree(points);
  const BruteForceSearch brute_force(points);
  constexpr std::size_t kStride = 100;  // brute force takes long
  for (const std::size_t k : {1UL, 5UL}) {
    BatchTree::Batch batch = tree.batch(k);
    for (int step = 0; step < 3; ++step) {
      const Answers answers = answers_to(batch, queries, Executor(2));
      for (std::size_t i = 0; i < queries.size(); ++i) {
        std::vector<Neighbor> expected(k);
        tree.nearest(queries[i], expected);
        ASSERT_EQ(answers[i], expected);
        if (i % kStride != 0) continue;
        brute_force.nearest(queries[i], expected);
        ASSERT_EQ(answers[i], expected);
      }
      for (auto& query : queries) query.z() += 0.01;
    }
  }
}

TEST(BatchTree, FindsTheSameWithAnyNumberOfThreads) {
  Random random(16);
  Points points(3000);
  for (auto& point : points) point = in_cube(random, 1.0);
  Points queries(5000);
  for (auto& query : queries) query = in_cube(random, 1.0);
  const BatchTree tree(points);
  BatchTree::Batch one = tree.batch(5);
  BatchTree::Batch several = tree.batch(5);
  for (int step = 0; step < 3; ++step) {
    ASSERT_EQ(answers_to(one, queries, Executor(1)), answers_to(several, queries, Executor(4)));
    for (auto& query : queries) query.x() += 0.003;
  }
}

TEST(BatchTree, HasNothingToFindInAnEmptySet) {
  const BatchTree tree{Points()};
  std::vector<Neighbor> found(3);
  EXPECT_EQ(tree.nearest({0, 0, 0}, found), 0U);
  EXPECT_EQ(BatchTree(Points{{1, 1, 1}}).nearest({0, 0, 0}, std::span<Neighbor>()), 0U);
  BatchTree::Batch batch = tree.batch(3);
  EXPECT_EQ(batch.count(), 0U);
  EXPECT_THAT(answers_to(batch, {{1, 2, 3}}), ElementsAre(std::vector<Neighbor>()));
}

TEST(BatchTree, LooksAtAllPointsWhereSomeAreBeyondSinglePrecision) {
  Random random(20);
  Points points = {{1e30, 0, 0}, {-1e30, 0, 0}};
  for (int i = 0; i < 50; ++i) points.push_back(in_cube(random, 1.0));
  const BatchTree tree(points);
  const Points queries = {{0.1, 0.2, 0.3}, {0.0, 0.0, 0.0}, {1e29, 0.0, 0.0}};
  for (const std::size_t k : {1UL, 5UL}) {
    const Answers expected = brute_force(points, queries, k);
    BatchTree::Batch batch = tree.batch(k);
    EXPECT_EQ(answers_to(batch, queries), expected);
    for (std::size_t i = 0; i < queries.size(); ++i) {
      std::vector<Neighbor> found(k);
      tree.nearest(queries[i], found);
      EXPECT_EQ(found, expected[i]);
    }
  }
}

TEST(BatchTree, HasNoAnswersWithoutQueries) {
  const BatchTree tree(Points{{1, 1, 1}});
  BatchTree::Batch batch = tree.batch(1);
  EXPECT_TRUE(answers_to(batch, {}).empty());
  EXPECT_EQ(tree.nearest({0, 0, 0}, std::span<Neighbor>()), 0U);
}

TEST(BatchTree, TakesOtherQueriesNextTime) {
  Random random(17);
  Points points(300);
  for (auto& point : points) point = in_cube(random, 1.0);
  const BatchTree tree(points);
  BatchTree::Batch batch = tree.batch(2);
  for (const std::size_t count : {100UL, 100UL, 37UL, 300UL, 0UL, 5UL}) {
    Points queries(count);
    for (auto& query : queries) query = in_cube(random, 1.0);
    ASSERT_EQ(answers_to(batch, queries), brute_force(points, queries, 2));
  }
}

TEST(BatchTree, FindsTheSameInAnOrderThatIsGiven) {
  Random random(18);
  Points points(700);
  for (auto& point : points) point = in_cube(random, 1.0);
  const BatchTree tree(points);
  std::vector<std::uint32_t> order(tree.order().begin(), tree.order().end());
  BatchTree::Batch batch = tree.batch(2, order);
  std::sort(order.begin(), order.end());
  for (std::uint32_t i = 0; i < order.size(); ++i) ASSERT_EQ(order[i], i);
  for (const std::size_t count : {700UL, 700UL, 37UL, 700UL}) {
    Points queries(count);
    for (auto& query : queries) query = in_cube(random, 1.0);
    ASSERT_EQ(answers_to(batch, queries), brute_force(points, queries, 2));
  }
}

TEST(BatchTree, SurvivesQueriesThatAreNoPlaces) {
  // What is nearest to them is undefined, but it is points of the set.
  Random random(18);
  Points points(300);
  for (auto& point : points) point = in_cube(random, 1.0);
  const BatchTree tree(points);
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  const Points queries = {
      {kNan, 0, 0}, {0.5, 0.5, 0.5}, {0, kInfinity, 0}, {1e300, 0, 0}, {kNan, kNan, kNan}};
  for (const std::size_t k : {1UL, 5UL, 100UL}) {
    BatchTree::Batch batch = tree.batch(k);
    for (int i = 0; i < 2; ++i) {
      const Answers answers = answers_to(batch, queries);
      for (const auto& answer : answers) {
        ASSERT_EQ(answer.size(), k);
        for (const Neighbor& neighbor : answer) EXPECT_LT(neighbor.index, points.size());
      }
      EXPECT_EQ(answers[1], brute_force(points, {queries[1]}, k)[0]);
    }
  }
}

}  // namespace
}  // namespace cairn
