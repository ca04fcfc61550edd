// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/registration/correspondence/confident_neighbor.hpp"

#include <limits>
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
using Correspondence = ConfidentNeighborCorrespondence<BruteForceSearch>;

static_assert(CorrespondenceSearch<Correspondence>);

constexpr double kAnywhere = std::numeric_limits<double>::infinity();

std::vector<std::pair<int, int>> pairs(const std::vector<Match>& matches) {
  std::vector<std::pair<int, int>> result;
  for (const Match& match : matches) result.emplace_back(match.source, match.target);
  return result;
}

TEST(MostConfident, IsTheHighestOfTheCandidates) {
  const std::vector<Neighbor> nearest = {{0, 1.0}, {1, 2.0}, {2, 3.0}};
  EXPECT_EQ(most_confident(NeighborList(nearest), std::vector{1.0, 3.0, 2.0}, kAnywhere)->index,
            1U);
}

TEST(MostConfident, TakesTheNearerOfEquals) {
  const std::vector<Neighbor> nearest = {{4, 1.0}, {1, 2.0}, {2, 3.0}};
  EXPECT_EQ(
      most_confident(NeighborList(nearest), std::vector{9.0, 2.0, 2.0, 9.0, 2.0}, kAnywhere)->index,
      4U);
}

TEST(MostConfident, TakesTheLowerIndexOfEqualsAtOnePlace) {
  const std::vector<Neighbor> nearest = {{1, 1.0}, {2, 1.0}};
  EXPECT_EQ(most_confident(NeighborList(nearest), std::vector{0.0, 2.0, 2.0}, kAnywhere)->index,
            1U);
}

TEST(MostConfident, DoesNotCountCandidatesBeyondTheDistance) {
  const std::vector<Neighbor> nearest = {{0, 1.0}, {1, 4.0}};
  const std::vector<double> confidences = {1.0, 3.0};
  EXPECT_EQ(most_confident(NeighborList(nearest), confidences, 4.0)->index, 1U)
      << "the bound itself counts";
  EXPECT_EQ(most_confident(NeighborList(nearest), confidences, 3.9)->index, 0U);
  EXPECT_EQ(most_confident(NeighborList(nearest), confidences, 0.5), std::nullopt);
}

TEST(MostConfident, IsNothingWhereNothingIsTrusted) {
  const std::vector<Neighbor> nearest = {{0, 1.0}, {1, 4.0}};
  EXPECT_EQ(most_confident(NeighborList(nearest), std::vector{0.0, -1.0}, kAnywhere), std::nullopt);
  EXPECT_EQ(most_confident(NeighborList(nearest), std::vector{0.0, 1e-300}, kAnywhere)->index, 1U);
}

TEST(MostConfident, IsTheNearestWithoutConfidences) {
  const std::vector<Neighbor> nearest = {{7, 1.0}, {1, 4.0}};
  EXPECT_EQ(most_confident(NeighborList(nearest), {}, kAnywhere)->index, 7U);
}

TEST(Trimmed, LeavesOutTheFarthestAndKeepsTheOrder) {
  const std::vector<Match> matches = {{0, 0, 5.0}, {1, 1, 2.0}, {2, 2, 4.0}, {3, 3, 1.0}};
  EXPECT_THAT(pairs(trimmed(matches, 0.5)), ElementsAre(std::pair(1, 1), std::pair(3, 3)));
  EXPECT_EQ(trimmed(matches, 0.0), matches);
  EXPECT_EQ(trimmed(matches, 0.2), matches) << "less than one match";
  EXPECT_THAT(pairs(trimmed(matches, 0.25)),
              ElementsAre(std::pair(1, 1), std::pair(2, 2), std::pair(3, 3)));
}

TEST(Trimmed, LeavesOutTheLaterOfEquallyFarMatches) {
  const std::vector<Match> matches = {{0, 0, 1.0}, {1, 1, 2.0}, {2, 2, 2.0}, {3, 3, 2.0}};
  EXPECT_THAT(pairs(trimmed(matches, 0.5)), ElementsAre(std::pair(0, 0), std::pair(1, 1)));
}

// Target points at x = 0, 1, 2 whose confidence grows with x.
struct Line {
  Points target = {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}};
  std::vector<double> confidences = {1, 2, 3};
  BruteForceSearch search{target};
};

TEST(ConfidentNeighborCorrespondence, OfOneCandidateIsTheNearest) {
  const Line line;
  const Points source = {{0.1, 0, 0}, {1.8, 0, 0}};
  const Correspondence find({line.search, line.target, line.confidences}, std::nullopt, {.k = 1});
  EXPECT_THAT(pairs(find(source, Rigid3())), ElementsAre(std::pair(0, 0), std::pair(1, 2)));
}

TEST(ConfidentNeighborCorrespondence, OfSeveralIsTheMostConfident) {
  const Line line;
  const Points source = {{0.1, 0, 0}, {1.8, 0, 0}};
  const Correspondence find({line.search, line.target, line.confidences}, std::nullopt, {.k = 2});
  EXPECT_THAT(pairs(find(source, Rigid3())), ElementsAre(std::pair(0, 1), std::pair(1, 2)));
}

TEST(ConfidentNeighborCorrespondence, TakesTheWholeTargetForAKBeyondIt) {
  const Line line;
  const Points source = {{0.1, 0, 0}};
  const Correspondence find({line.search, line.target, line.confidences}, std::nullopt, {.k = 99});
  EXPECT_THAT(pairs(find(source, Rigid3())), ElementsAre(std::pair(0, 2)));
}

TEST(ConfidentNeighborCorrespondence, KeepsOnlyMutualChoicesIfReciprocal) {
  const Line line;
  // Both choose target 2; it chooses the more confident of its two nearest back.
  const Points source = {{1.6, 0, 0}, {2.2, 0, 0}};
  const BruteForceSearch source_search(source);
  for (const auto& [trust, chosen] :
       {std::pair{std::vector{5.0, 1.0}, 0}, std::pair{std::vector{1.0, 5.0}, 1}}) {
    const Correspondence find({line.search, line.target, line.confidences},
                              ConfidentSet<BruteForceSearch>{source_search, source, trust},
                              {.k = 2});
    EXPECT_THAT(pairs(find(source, Rigid3())), ElementsAre(std::pair(chosen, 2)));
  }
  const Correspondence nearest_back({line.search, line.target, line.confidences},
                                    ConfidentSet<BruteForceSearch>{source_search, source, {}},
                                    {.k = 2});
  EXPECT_THAT(pairs(nearest_back(source, Rigid3())), ElementsAre(std::pair(1, 2)));
}

TEST(ConfidentNeighborCorrespondence, SearchesBackFromTheMovedSource) {
  const Points target = {{10, 0, 0}, {12, 0, 0}};
  const Points source = {{0, 0, 0}, {2, 0, 0}};
  const Rigid3 target_from_source(Eigen::Quaterniond::Identity(), {10, 0, 0});
  const BruteForceSearch target_search(target);
  const BruteForceSearch source_search(source);
  const Correspondence find({target_search, target, {}},
                            ConfidentSet<BruteForceSearch>{source_search, source, {}}, {.k = 1});
  const Points moved = {{10, 0, 0}, {12, 0, 0}};
  EXPECT_THAT(pairs(find(moved, target_from_source)),
              ElementsAre(std::pair(0, 0), std::pair(1, 1)));
}

TEST(ConfidentNeighborCorrespondence, IsTheSameWithAnyNumberOfThreads) {
  Random random(3);
  Points target(2000);
  Points source(3000);
  std::vector<double> confidences(target.size());
  for (auto* points : {&target, &source}) {
    for (auto& p : *points) p = {random.uniform(), random.uniform(), random.uniform()};
  }
  for (double& confidence : confidences) confidence = static_cast<double>(random.index(4));
  const BruteForceSearch search(target);
  const auto run = [&](unsigned threads) {
    return Correspondence({search, target, confidences}, std::nullopt,
                          {.k = 3, .max_distance = 0.1}, Executor(threads))(source, Rigid3());
  };
  const auto one = run(1);
  EXPECT_LT(one.size(), source.size()) << "some have no match";
  EXPECT_EQ(one, run(2));
  EXPECT_EQ(one, run(4));
}

}  // namespace
}  // namespace cairn
