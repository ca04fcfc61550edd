// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/core/detail/time_association.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/random.hpp"

namespace cairn::detail {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::Pair;

using Times = std::vector<double>;

constexpr double kInfinite = std::numeric_limits<double>::infinity();

// The definition, word by word: again and again the closest of all pairs that are left.
IndexPairs by_definition(const Times& a, const Times& b, double max_difference_s) {
  IndexPairs pairs;
  std::vector<bool> a_taken(a.size());
  std::vector<bool> b_taken(b.size());
  for (;;) {
    double best = max_difference_s;
    std::pair<std::size_t, std::size_t> pair;
    for (std::size_t i = 0; i < a.size(); ++i) {
      for (std::size_t j = 0; j < b.size(); ++j) {
        const double difference = std::abs(a[i] - b[j]);
        if (!a_taken[i] && !b_taken[j] && difference < best) {
          best = difference;
          pair = {i, j};
        }
      }
    }
    if (best == max_difference_s) break;
    a_taken[pair.first] = b_taken[pair.second] = true;
    pairs.push_back(pair);
  }
  std::sort(pairs.begin(), pairs.end());
  return pairs;
}

TEST(AssociateTimes, PairsTheClosestFirstAndEachOnce) {
  EXPECT_THAT(associate_times(Times{1.0, 1.01}, Times{1.012}, 0.02), ElementsAre(Pair(1, 0)));
  EXPECT_THAT(associate_times(Times{1.012}, Times{1.0, 1.01}, 0.02), ElementsAre(Pair(0, 1)));
  EXPECT_THAT(associate_times(Times{1.0, 1.01}, Times{0.99, 1.012}, 0.02),
              ElementsAre(Pair(0, 0), Pair(1, 1)));
}

TEST(AssociateTimes, PairsWhatAClosestPairLeavesBehind) {
  // 2 and 2.1 leave first; then 1 and 4 are neighbours.
  EXPECT_THAT(associate_times(Times{1.0, 2.0}, Times{2.1, 4.0}, 10.0),
              ElementsAre(Pair(0, 1), Pair(1, 0)));
  EXPECT_THAT(associate_times(Times{1.0, 2.0}, Times{2.1, 4.0}, 3.0), ElementsAre(Pair(1, 0)));
}

TEST(AssociateTimes, TakesOnlyDifferencesBelowTheLimit) {
  EXPECT_THAT(associate_times(Times{1.0}, Times{1.5}, 0.5), IsEmpty()) << "less than, not equal";
  EXPECT_THAT(associate_times(Times{1.0}, Times{1.5}, 0.51), ElementsAre(Pair(0, 0)));
  EXPECT_THAT(associate_times(Times{1.0}, Times{9.0}, kInfinite), ElementsAre(Pair(0, 0)));
  EXPECT_THAT(associate_times(Times{1.0}, Times{1.0}, 0.0), IsEmpty());
  EXPECT_THAT(associate_times({}, Times{1.0}, 1.0), IsEmpty());
  EXPECT_THAT(associate_times(Times{1.0}, {}, 1.0), IsEmpty());
}

TEST(AssociateTimes, AgreesWithTheDefinitionTiesIncluded) {
  Random random(1);
  for (int trial = 0; trial < 200; ++trial) {
    // On a grid that doubles hold exactly, so that equal differences abound.
    const double grid = trial % 2 == 0 ? 0.25 : 1e-6;
    const auto times = [&] {
      Times result = {grid * static_cast<double>(random.index(8))};
      for (int i = 0; i < 25; ++i) {
        result.push_back(result.back() + grid * static_cast<double>(1 + random.index(8)));
      }
      return result;
    };
    const Times a = times();
    const Times b = times();
    for (const double limit : {1.1 * grid, 4.5 * grid, 1e3}) {
      EXPECT_EQ(associate_times(a, b, limit), by_definition(a, b, limit)) << trial << ' ' << limit;
    }
  }
}

TEST(AssociateTimes, TakesNoTimeForALimitThatAllPairsMeet) {
  // A hundred thousand times each: all pairs would be ten thousand million.
  Times a;
  Times b;
  for (int i = 0; i < 100000; ++i) {
    a.push_back(i);
    b.push_back(i + 0.25);
  }
  const IndexPairs pairs = associate_times(a, b, 1e9);
  ASSERT_EQ(pairs.size(), a.size());
  for (std::size_t i = 0; i < pairs.size(); ++i) ASSERT_THAT(pairs[i], Pair(i, i));
}

}  // namespace
}  // namespace cairn::detail
