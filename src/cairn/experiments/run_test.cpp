// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/experiments/run.hpp"

#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/error.hpp"
#include "cairn/map/synthetic.hpp"

namespace cairn {
namespace {

MapPair small_pair() {
  SyntheticPair synthetic =
      synthetic_pair({.seed = 4, .landmarks = 300, .frames = 12, .overlap = 0.8});
  return {"desk", std::move(synthetic.source), std::move(synthetic.target),
          synthetic.target_from_source};
}

TEST(Strategy, BaseHasNoMetric) {
  EXPECT_FALSE(strategy_named("base").metric);
  EXPECT_EQ(strategy_named("covariance").metric->name, "covariance");
  EXPECT_THROW(strategy_named("none such"), Error);
}

TEST(RunTrial, FromTheTruthEndsNearIt) {
  const MapPair pair = small_pair();
  const Trial trial{.pair = "desk", .experiment = "e", .number = 3, .strategy = "observations"};
  const TrialResult run = run_trial(trial, pair_points(pair, strategy_named("observations")),
                                    *pair.truth, pair.truth, {.max_distance = 0.1});
  EXPECT_EQ(run.trial, trial);
  EXPECT_EQ(run.status, RegistrationStatus::kConverged);
  ASSERT_TRUE(run.error);
  EXPECT_TRUE(PoseTolerance{}.holds(*run.error));
  EXPECT_GT(run.iterations, 0);
}

TEST(RunTrial, FindsThePoseByEachMethod) {
  const MapPair pair = small_pair();
  const PairPoints points = pair_points(pair, strategy_named("base"), {}, true);
  const Rigid3 near =
      pair.truth->perturbed((Vector6d() << 0.02, -0.01, 0.01, 0.01, 0.0, 0.02).finished());
  for (const Method method : kMethods) {
    const TrialResult run = run_trial({.number = 1, .method = method, .strategy = "base"}, points,
                                      near, pair.truth, {.max_distance = 0.1});
    EXPECT_EQ(run.trial.method, method);
    ASSERT_TRUE(run.error) << to_string(method);
    EXPECT_TRUE(PoseTolerance{}.holds(*run.error)) << to_string(method);
  }
  // From this far off, placement finds it for sure, ICP does not, and robust refinement may by luck.
  const Rigid3 far = Rigid3(rotation_exp({0.0, 2.0, 0.0}), {5.0, 0.0, 0.0}) * *pair.truth;
  for (const Method method : kMethods) {
    if (method == Method::kRobust) continue;
    const TrialResult run = run_trial({.number = 1, .method = method, .strategy = "base"}, points,
                                      far, pair.truth, {.max_distance = 0.1});
    EXPECT_EQ(run.error && PoseTolerance{}.holds(*run.error), method == Method::kAnywhere)
        << to_string(method);
  }
}

TEST(RunTrial, WithoutAPoseHasNoError) {
  const MapPair pair = small_pair();
  const Rigid3 far(Eigen::Quaterniond::Identity(), {1000.0, 0.0, 0.0});
  const TrialResult run = run_trial({.strategy = "base"}, pair_points(pair, strategy_named("base")),
                                    far, pair.truth, {.max_distance = 0.1});
  EXPECT_EQ(run.status, RegistrationStatus::kFailed);
  EXPECT_FALSE(run.target_from_source);
  EXPECT_FALSE(run.error);
}

TEST(RunTrial, IsCancelledByItsToken) {
  const MapPair pair = small_pair();
  std::stop_source stop;
  stop.request_stop();
  EXPECT_THROW(run_trial({.strategy = "base"}, pair_points(pair, strategy_named("base")), {}, {},
                         {}, {.stop = stop.get_token()}),
               Error);
}

TEST(PoseTolerance, HoldsWithBothPartsInside) {
  const PoseTolerance tolerance{.rotation_deg = 5.0, .translation_m = 0.05};
  const double degree = std::numbers::pi / 180.0;
  EXPECT_TRUE(tolerance.holds({4.9 * degree, 0.049}));
  EXPECT_FALSE(tolerance.holds({5.1 * degree, 0.0}));
  EXPECT_FALSE(tolerance.holds({0.0, 0.051}));
}

TEST(Agreement, IsWithThePoseThatMostAreNear) {
  const auto at = [](double x) {
    return std::optional(Rigid3(Eigen::Quaterniond::Identity(), {x, 0.0, 0.0}));
  };
  // 0.00, 0.04 and 0.08: the middle one has both others within 5 cm.
  const std::vector<std::optional<Rigid3>> poses = {at(1.0),  at(0.0),  std::nullopt,
                                                    at(0.04), at(0.08), at(1.01)};
  const std::vector<Eigen::Vector3d> source = {{0, 0, 0}, {1, 0, 0}};
  const auto agreement = find_agreement(poses, source);
  ASSERT_TRUE(agreement);
  EXPECT_EQ(agreement->pose, 3U);
  EXPECT_THAT(agreement->agrees, ::testing::ElementsAre(false, true, false, true, true, false));
}

TEST(Agreement, IsJudgedAtTheLandmarks) {
  // A turn about the landmarks' centroid moves it nowhere, however far the origin is.
  const Eigen::Vector3d centre(100.0, 0.0, 0.0);
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(0.05, Eigen::Vector3d::UnitZ()));
  const std::vector<std::optional<Rigid3>> poses = {Rigid3(), Rigid3(turn, centre - turn * centre),
                                                    Rigid3(turn, {0, 0, 0})};
  const auto agreement = find_agreement(poses, {&centre, 1});
  ASSERT_TRUE(agreement);
  EXPECT_THAT(agreement->agrees, ::testing::ElementsAre(true, true, false));
}

TEST(Agreement, NeedsAPose) {
  const std::vector<std::optional<Rigid3>> none(3);
  EXPECT_FALSE(find_agreement(none, {}));
  EXPECT_FALSE(find_agreement({}, {}));
}

}  // namespace
}  // namespace cairn
