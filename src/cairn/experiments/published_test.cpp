// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>

#include <gtest/gtest.h>

#include "cairn/experiments/paper.hpp"

namespace cairn {
namespace {

std::size_t count(Experiment experiment) {
  const auto all = published_experiments();
  return static_cast<std::size_t>(std::count_if(
      all.begin(), all.end(), [&](const auto& one) { return one.experiment == experiment; }));
}

TEST(PublishedExperiments, AreTheFortyFiveOfThePaper) {
  EXPECT_EQ(published_experiments().size(), 45U);
  EXPECT_EQ(count(Experiment::kNeighbors), 7U);
  EXPECT_EQ(count(Experiment::kYaw), 8U);
  EXPECT_EQ(count(Experiment::kXy), 14U);
  EXPECT_EQ(count(Experiment::kXyYaw), 16U);
}

// What the paper's text says of its tables holds of these.
TEST(PublishedExperiments, HaveThePapersTableOne) {
  for (const PublishedExperiment& one : published_experiments()) {
    if (one.experiment != Experiment::kNeighbors) continue;
    EXPECT_EQ(one.outcomes[0].score, 0.00534268);  // base ICP has no use for k
    if (one.k == 1) {
      for (const auto& outcome : one.outcomes) EXPECT_EQ(outcome.score, 0.00534268);
    }
    if (one.k == 10) {
      EXPECT_EQ(one.outcomes[1].score, 0.0140339);
    }
  }
  EXPECT_EQ(published_reference_score(), 0.0034319);
}

TEST(PublishedExperiments, FailWhereTheSupplementSaysSo) {
  const auto failed = [](double x, double y, std::size_t strategy) {
    for (const PublishedExperiment& one : published_experiments()) {
      if (one.experiment == Experiment::kXy && one.initial == Displacement{.x_m = x, .y_m = y}) {
        return one.outcomes[strategy].score >= kPublishedSuccessScore;
      }
    }
    ADD_FAILURE() << "no such configuration";
    return false;
  };
  EXPECT_TRUE(failed(-0.25, 0.25, 0));
  EXPECT_FALSE(failed(-0.5, 0.5, 0));
  EXPECT_TRUE(failed(0.57, 0.57, 0));
  EXPECT_TRUE(failed(0.57, 0.57, 3));
  EXPECT_TRUE(failed(-0.9, 0.9, 2));
  EXPECT_TRUE(failed(3.0, -3.0, 2));
  for (std::size_t strategy = 0; strategy < 4; ++strategy) {
    EXPECT_FALSE(failed(-0.25, -0.25, strategy));
    EXPECT_FALSE(failed(-0.5, -0.5, strategy));
  }
}

TEST(PublishedExperiments, HaveMovedFartherThanTheyScored) {
  for (const PublishedExperiment& one : published_experiments()) {
    for (const auto& outcome : one.outcomes) {
      EXPECT_LT(outcome.score, one.initial_score);
      EXPECT_GT(outcome.iterations, 0);
      EXPECT_LE(outcome.iterations, 150);
      EXPECT_GT(outcome.duration_s, 1.0);
    }
  }
}

TEST(Displacement, TurnsAboutTheFixedAxesAndThenMoves) {
  const Rigid3 pose =
      Displacement{.x_m = 1.0, .z_m = 3.0, .roll_deg = 90.0, .yaw_deg = 90.0}.pose();
  // Roll takes y to z; yaw leaves z.
  EXPECT_TRUE((pose * Eigen::Vector3d(0, 1, 0)).isApprox(Eigen::Vector3d(1, 0, 4), 1e-12));
  // Yaw takes x to y.
  EXPECT_TRUE((pose * Eigen::Vector3d(1, 0, 0)).isApprox(Eigen::Vector3d(1, 1, 3), 1e-12));
}

}  // namespace
}  // namespace cairn
