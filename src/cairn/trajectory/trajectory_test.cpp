// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/trajectory/trajectory.hpp"

#include <cmath>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/error.hpp"
#include "cairn/core/random.hpp"

namespace cairn {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::Pair;

Trajectory at(const std::vector<double>& times) {
  std::vector<TimedPose> poses;
  for (const double time : times) {
    poses.push_back({time, Rigid3(Eigen::Quaterniond::Identity(), {time, 0, 0})});
  }
  return Trajectory(std::move(poses));
}

TEST(Trajectory, KnowsItsDurationAndLength) {
  const Trajectory trajectory = at({1.0, 2.5, 4.0});
  EXPECT_EQ(trajectory.duration_s(), 3.0);
  EXPECT_DOUBLE_EQ(trajectory.length(), 3.0);
  EXPECT_EQ(Trajectory().duration_s(), 0.0);
  EXPECT_EQ(Trajectory().length(), 0.0);
}

TEST(Trajectory, RefusesTimesThatDoNotAscend) {
  EXPECT_THROW(at({1.0, 1.0}), Error);
  EXPECT_THROW(at({2.0, 1.0}), Error);
  EXPECT_THROW(at({std::nan("")}), Error);
}

TEST(Associate, PairsTheClosestInTimeFirst) {
  // 1.01 is nearer to 1.012 than 1.0 is; 1.0 then has no partner left.
  EXPECT_THAT(associate(at({1.0, 1.01}), at({1.012}), 0.02), ElementsAre(Pair(1, 0)));
  EXPECT_THAT(associate(at({1.0, 1.01}), at({0.99, 1.012}), 0.02),
              ElementsAre(Pair(0, 0), Pair(1, 1)));
}

TEST(Associate, PairsOnlyWithinTheDifference) {
  EXPECT_THAT(associate(at({1.0}), at({1.5}), 0.5), IsEmpty()) << "less than, not equal";
  EXPECT_THAT(associate(at({1.0}), at({1.5}), 0.51), ElementsAre(Pair(0, 0)));
  EXPECT_THAT(associate(Trajectory(), at({1.0})), IsEmpty());
}

TEST(Associate, AgreesWithTheGreedyDefinition) {
  Random random(1);
  for (int trial = 0; trial < 50; ++trial) {
    const auto times = [&] {
      std::vector<double> result = {random.uniform(0, 0.05)};
      for (int i = 0; i < 40; ++i) result.push_back(result.back() + random.uniform(0.001, 0.05));
      return result;
    };
    const Trajectory a = at(times());
    const Trajectory b = at(times());
    PosePairs expected;
    std::vector<bool> a_taken(a.size());
    std::vector<bool> b_taken(b.size());
    for (;;) {
      double best = 0.03;
      std::pair<std::size_t, std::size_t> pair;
      for (std::size_t i = 0; i < a.size(); ++i) {
        for (std::size_t j = 0; j < b.size(); ++j) {
          const double difference = std::abs(a.poses()[i].timestamp_s - b.poses()[j].timestamp_s);
          if (!a_taken[i] && !b_taken[j] && difference < best) {
            best = difference;
            pair = {i, j};
          }
        }
      }
      if (best == 0.03) break;
      a_taken[pair.first] = b_taken[pair.second] = true;
      expected.push_back(pair);
    }
    std::sort(expected.begin(), expected.end());
    EXPECT_EQ(associate(a, b, 0.03), expected);
  }
}

}  // namespace
}  // namespace cairn
