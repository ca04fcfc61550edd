// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/experiments/paper.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/error.hpp"
#include "cairn/experiments/run.hpp"
#include "cairn/map/operations.hpp"
#include "cairn/map/synthetic.hpp"

namespace cairn {
namespace {

// Both in the target's frame, as the paper's maps are.
MapPair paper_pair(bool with_truth = true) {
  SyntheticPair synthetic =
      synthetic_pair({.seed = 6, .landmarks = 250, .frames = 12, .overlap = 0.9});
  MapPair pair{"small",
               transformed(synthetic.source, synthetic.target_from_source),
               std::move(synthetic.target),
               {}};
  if (with_truth) pair.truth = Rigid3();
  return pair;
}

TEST(PaperExperiments, RunEveryConfigurationByEveryStrategy) {
  const MapPair pair = paper_pair();
  const PaperResults results = run_paper_experiments(pair);
  ASSERT_EQ(results.runs.size(), 180U);
  const auto published = published_experiments();
  for (std::size_t i = 0; i < results.runs.size(); ++i) {
    const TrialResult& run = results.runs[i];
    const PublishedExperiment& experiment = published[i / 4];
    EXPECT_EQ(run.trial.pair, "small");
    EXPECT_EQ(run.trial.experiment, experiment_name(experiment.experiment));
    EXPECT_EQ(run.trial.number, i / 4 + 1);
    EXPECT_EQ(run.trial.strategy, kPaperStrategies[i % 4]);
    EXPECT_EQ(run.trial.k, experiment.k);
    EXPECT_EQ(run.trial.initial, experiment.initial);
    EXPECT_LE(run.iterations, 150);
    EXPECT_TRUE(run.error);
  }
  // k = 1 leaves nothing to choose.
  for (std::size_t strategy = 1; strategy < 4; ++strategy) {
    EXPECT_EQ(run_of(results, 0, strategy).score, run_of(results, 0, 0).score);
  }
  EXPECT_TRUE(results.agreement);
  EXPECT_TRUE(results.searches.empty());
}

// Maps in frames of their own, so that as they are read they lie far from each other.
TEST(PaperExperiments, StartFromTheTruthOrElseFromTheMapsAsRead) {
  SyntheticPair synthetic =
      synthetic_pair({.seed = 6, .landmarks = 250, .frames = 12, .overlap = 0.9});
  const MapPair own{"own", synthetic.source, synthetic.target, synthetic.target_from_source};
  MapPair unknown = own;
  unknown.truth.reset();
  const PaperResults from_truth = run_paper_experiments(own);
  const PaperResults as_read = run_paper_experiments(unknown);
  const PaperResults common = run_paper_experiments(paper_pair());
  EXPECT_TRUE(from_truth.has_truth);
  EXPECT_FALSE(as_read.has_truth);
  // The same starts as of the maps in one frame.
  for (std::size_t i = 0; i < from_truth.runs.size(); ++i) {
    EXPECT_NEAR(*from_truth.runs[i].initial_score, *common.runs[i].initial_score, 1e-9) << i;
  }
  EXPECT_GT(*as_read.runs[28].initial_score, 10.0 * *from_truth.runs[28].initial_score);
  const Displacement turn{.yaw_deg = 90};
  EXPECT_TRUE(initial_pose(turn, {}).matrix().isApprox(turn.pose().matrix()));
  EXPECT_TRUE(initial_pose(turn, own.truth).matrix().isApprox((turn.pose() * *own.truth).matrix()));
}

TEST(PaperExperiments, AreTheSameWithAnyNumberOfThreads) {
  const MapPair pair = paper_pair();
  PaperOptions options;
  options.search_xy = true;
  const auto text = [&](unsigned threads) {
    const PaperResults results =
        run_paper_experiments(pair, options, {.executor = Executor(threads)});
    std::string rows;
    for (const TrialResult& run : results.runs) rows += runs_row(run);
    for (const QuadrantSearch& search : results.searches) {
      for (const TrialResult& run : search.runs) rows += runs_row(run);
    }
    return rows;
  };
  EXPECT_EQ(text(1), text(2));
}

TEST(PaperExperiments, ScaleThePapersThresholdToThePair) {
  const MapPair pair = paper_pair(false);
  const PaperResults results = run_paper_experiments(pair);
  const auto published = published_experiments();
  for (std::size_t i = 0; i < published.size(); ++i) {
    if (published[i].initial != Displacement{}) continue;
    EXPECT_NEAR(results.success_score / *run_of(results, i, 0).score, 0.0037 / 0.0034319, 1e-12);
  }
  EXPECT_FALSE(results.runs[0].error);
  PaperOptions options;
  options.success_score = 0.5;
  EXPECT_EQ(run_paper_experiments(pair, options).success_score, 0.5);
}

TEST(PaperExperiments, SearchTheFirstFailureOfEachQuadrant) {
  const MapPair pair = paper_pair();
  PaperOptions options;
  options.search_xy = true;
  options.search_resolution_m = 0.03;
  const PaperResults results = run_paper_experiments(pair, options);
  ASSERT_EQ(results.searches.size(), 4U);
  for (const QuadrantSearch& search : results.searches) {
    std::optional<double> smallest_failure;
    for (std::size_t i = 0; i < search.runs.size(); i += 4) {
      bool all = true;
      for (std::size_t s = 0; s < 4; ++s) {
        const TrialResult& run = search.runs[i + s];
        EXPECT_EQ(run.trial.initial.x_m * search.sign_x, run.trial.initial.y_m * search.sign_y);
        EXPECT_GT(run.trial.initial.x_m * search.sign_x, 0.0);
        all = all && results.score_success(run);
      }
      const double displacement = std::abs(search.runs[i].trial.initial.x_m);
      if (all) {
        EXPECT_LE(displacement, search.last_success_m.value());
      } else {
        smallest_failure = std::min(smallest_failure.value_or(displacement), displacement);
      }
    }
    EXPECT_EQ(smallest_failure, search.first_failure_m);
    if (search.first_failure_m) {
      EXPECT_FALSE(search.failed.empty());
      EXPECT_LE(*search.first_failure_m - search.last_success_m.value_or(0.0), 0.03);
    } else {
      EXPECT_EQ(search.last_success_m, options.search_limit_m);
    }
  }
}

TEST(PaperExperiments, StopWhenAsked) {
  const MapPair pair = paper_pair();
  std::stop_source stop;
  const Execution execution{.stop = stop.get_token(), .progress = [&](double share) {
                              if (share > 0.1) stop.request_stop();
                            }};
  EXPECT_THROW(run_paper_experiments(pair, {}, execution), Error);
}

TEST(PaperExperiments, RefuseOptionsByName) {
  const MapPair pair = paper_pair();
  PaperOptions options;
  options.success_score = -1.0;
  try {
    run_paper_experiments(pair, options);
    FAIL();
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), ::testing::HasSubstr("PaperOptions.success_score"));
  }
}

}  // namespace
}  // namespace cairn
