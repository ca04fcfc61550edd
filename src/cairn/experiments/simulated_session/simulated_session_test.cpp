// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/experiments/simulated_session/simulated_session.hpp"

#include <gtest/gtest.h>

#include "cairn/core/error.hpp"
#include "cairn/evaluation/pose_error.hpp"

namespace cairn {
namespace {

const MapSequenceOptions kMapping;

TEST(SimulatedSession, BeginsAtTheTruePoseOfItsFirstCamera) {
  const auto session_from = [](SessionStart start) {
    return map_simulated_session({.seed = 3}, {.frames = 12, .rate_hz = 10.0}, start, kMapping);
  };
  const SimulatedSession session = session_from(SessionStart::kTruePose);
  EXPECT_EQ(session.truth.size(), 12U);
  EXPECT_LT(session.world_from_map().angle(), 1e-9);
  EXPECT_LT(session.world_from_map().translation().norm(), 1e-9);
  const SimulatedSession own = session_from(SessionStart::kOwnFrame);
  const Rigid3 first = own.mapped.trajectory.poses().front().world_from_camera;
  EXPECT_LT(first.angle() + first.translation().norm(), 1e-9);
  EXPECT_TRUE(own.world_from_map().matrix().isApprox(
      session.truth.poses().front().world_from_camera.matrix(), 1e-9));
}

TEST(SimulatedPair, IsOfOnePlaceWhoseTruthItKnows) {
  const StudyPair pair{"desk", PairSimulation{.environment = "desk", .seed = 2, .frames = 40}};
  const MapPair maps = simulated_pair(pair, kMapping);
  EXPECT_EQ(maps.name, "desk");
  ASSERT_TRUE(maps.truth);
  const PairPoints points = pair_points(maps, strategy_named("base"));
  const TrialResult run =
      run_trial({.strategy = "base"}, points, *maps.truth, maps.truth, {.max_distance = 0.05});
  ASSERT_TRUE(run.error);
  EXPECT_TRUE(PoseTolerance{}.holds(*run.error));
}

TEST(SimulatedPair, RefusesAnUnknownPlace) {
  EXPECT_THROW(simulated_pair({"x", PairSimulation{.environment = "moon"}}, kMapping), Error);
}

}  // namespace
}  // namespace cairn
