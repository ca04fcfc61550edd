// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/registration/convergence/pcl_criteria.hpp"

#include <gtest/gtest.h>

namespace cairn {
namespace {

IterationState moving() {
  IterationState state;
  state.iteration = 2;
  state.step = Rigid3(Eigen::Quaterniond::Identity(), {0.1, 0, 0});
  state.mean_squared_distance = 1.0;
  state.previous_mean_squared_distance = 2.0;
  return state;
}

TEST(PclCriteria, GoesOnWhileThingsMove) {
  EXPECT_EQ(PclCriteria()(moving()), std::nullopt);
}

TEST(PclCriteria, StopsAtTheLimitBeforeAllElse) {
  IterationState state = moving();
  state.iteration = 150;
  state.previous_mean_squared_distance = state.mean_squared_distance;
  EXPECT_EQ(PclCriteria()(state), StopReason::kIterationLimit);
}

TEST(PclCriteria, StopsWithoutMotion) {
  IterationState state = moving();
  state.step = Rigid3();
  EXPECT_EQ(PclCriteria()(state), StopReason::kNoMotion);
  state.step = Rigid3(Eigen::Quaterniond::Identity(), {1e-30, 0, 0});
  EXPECT_EQ(PclCriteria()(state), std::nullopt) << "any motion is motion";
  state.step = Rigid3(rotation_exp({0, 0, 0.01}), Eigen::Vector3d::Zero());
  EXPECT_EQ(PclCriteria()(state), std::nullopt) << "so is a turn on the spot";
}

TEST(PclCriteria, StopsWhenTheErrorChangesByLessThanTheThreshold) {
  IterationState state = moving();
  state.previous_mean_squared_distance = state.mean_squared_distance + 0.9e-12;
  EXPECT_EQ(PclCriteria()(state), StopReason::kMseChange);
  state.previous_mean_squared_distance = state.mean_squared_distance - 0.9e-12;
  EXPECT_EQ(PclCriteria()(state), StopReason::kMseChange) << "growing counts too";
  state.previous_mean_squared_distance = state.mean_squared_distance + 2e-12;
  EXPECT_EQ(PclCriteria()(state), std::nullopt);
}

TEST(PclCriteria, NeverStopsForTheErrorInTheFirstIteration) {
  IterationState state = moving();
  state.iteration = 1;
  state.mean_squared_distance = 0.0;
  state.previous_mean_squared_distance = IterationState().previous_mean_squared_distance;
  EXPECT_EQ(PclCriteria()(state), std::nullopt);
}

}  // namespace
}  // namespace cairn
