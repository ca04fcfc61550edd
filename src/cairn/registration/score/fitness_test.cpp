// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/registration/score/fitness.hpp"

#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/brute_force_search.hpp"

namespace cairn {
namespace {

using testing::BruteForceSearch;
using ::testing::ElementsAre;

TEST(FitnessScore, IsTheMeanOfTheSquaredDistances) {
  const std::vector<Eigen::Vector3d> target = {{0, 0, 0}, {10, 0, 0}};
  const std::vector<Eigen::Vector3d> source = {{1, 0, 0}, {10, 0, 2}, {4, 0, 0}};
  const Rigid3 shift(Eigen::Quaterniond::Identity(), {0, 1, 0});
  const auto distances =
      nearest_squared_distances(source, shift, BruteForceSearch(target), Executor());
  EXPECT_THAT(distances, ElementsAre(2.0, 5.0, 17.0));
  EXPECT_EQ(fitness_score(distances), 8.0);
}

TEST(ShareWithin, CountsTheRadiusItself) {
  const std::vector<double> squared = {0.0, 1.0, 4.0, 9.0};
  EXPECT_EQ(share_within(squared, 2.0), 0.75);
  EXPECT_EQ(share_within(squared, 0.5), 0.25);
}

TEST(Scores, AreUnknownOfNoPoints) {
  EXPECT_EQ(fitness_score({}), std::nullopt);
  EXPECT_EQ(share_within({}, 1.0), std::nullopt);
}

}  // namespace
}  // namespace cairn
