// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/report/detail/run_builder.hpp"

#include <algorithm>
#include <cmath>
#include <map>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/error.hpp"
#include "cairn/evaluation/pose_error.hpp"
#include "cairn/geometry/angles.hpp"
#include "cairn/map/synthetic.hpp"
#include "cairn/report/detail/map_builder.hpp"
#include "cairn/report/report.hpp"

#include "support/report_page.hpp"

namespace cairn::report::detail {
namespace {

using ::testing::DoubleEq;
using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::SizeIs;

// Two sessions of one desk, aligned with a trace. Landmarks are shuffled and many of them seen once
// only, so that points are not landmarks in any simple way.
struct Aligned {
  SyntheticPair pair;
  PointSetOptions point_options = {.min_observations = 6};
  IcpOptions options;
  RegistrationResult result;

  static LandmarkMap shuffled(const LandmarkMap& map) {
    MapTables tables = LandmarkMap(map).tables();
    std::vector<LandmarkId>& ids = tables.landmarks.ids;
    const std::size_t count = ids.size();
    for (std::size_t i = 0; i < count; ++i) ids[i] = LandmarkId{(i * 7919 + 13) % count};
    return LandmarkMap(std::move(tables));
  }

  explicit Aligned(bool trace = true)
      : pair(synthetic_pair({.seed = 3, .landmarks = 601, .frames = 20})) {
    pair.source = shuffled(pair.source);
    pair.target = shuffled(pair.target);
    options.trace = trace;
    options.stop_at_repetition = false;
    options.initial =
        Rigid3::from_roll_pitch_yaw({0.1, -0.1, 0.05}, 0.02, -0.03, 0.1) * pair.target_from_source;
    result = icp(pair.source, pair.target, observations_metric(), options, point_options);
  }

  RunOptions run_options() const {
    return {.name = "observations",
            .initial = options.initial,
            .k = 5,
            .truth = pair.target_from_source};
  }
};

Points points_of(const LandmarkMap& map, const PointSetOptions& options) {
  return point_set(map, std::nullopt, options).positions;
}

std::vector<std::int32_t> current_matches(const Matches& matches, std::size_t iteration) {
  std::vector<std::int32_t> current = matches.first;
  std::size_t next = 0;
  for (std::size_t i = 0; i < iteration; ++i) {
    for (std::uint32_t k = 0; k < matches.change_counts[i]; ++k, ++next) {
      current[matches.changed[next]] = matches.targets[next];
    }
  }
  return current;
}

TEST(MakeRun, PosesBeginWithTheInitialOne) {
  const Aligned aligned;
  const auto source = points_of(aligned.pair.source, aligned.point_options);
  const auto target = points_of(aligned.pair.target, aligned.point_options);
  const AlignmentRun run = make_run(aligned.result, source, target, aligned.run_options());
  const std::size_t count = aligned.result.history.size() + 1;
  ASSERT_GT(count, 3U);
  ASSERT_THAT(run.target_from_source, SizeIs(count));
  EXPECT_EQ(run.target_from_source.front().matrix(), aligned.options.initial.matrix());
  EXPECT_EQ(run.target_from_source.back().matrix(), aligned.result.target_from_source.matrix());
  ASSERT_THAT(run.mean_squared_distance, SizeIs(count));
  EXPECT_TRUE(std::isnan(run.mean_squared_distance[0]));
  EXPECT_EQ(run.mean_squared_distance[1], aligned.result.history[0].mean_squared_distance);
  ASSERT_THAT(run.scores, SizeIs(count));
  EXPECT_EQ(run.scores.front(), aligned.result.initial_score);
  EXPECT_EQ(run.scores[1], aligned.result.history[0].score);
  EXPECT_EQ(run.scores.back(), aligned.result.score);
  ASSERT_THAT(run.rotation_error_deg, SizeIs(count));
  EXPECT_GT(run.rotation_error_deg.front(), 5.0);
  EXPECT_LT(run.scores.back(), run.scores.front());
  const PoseError error =
      pose_error(aligned.result.target_from_source, aligned.pair.target_from_source, source);
  EXPECT_EQ(run.translation_error.back(), error.translation);
}

TEST(MakeRun, KeepsScales) {
  Aligned aligned;
  const auto source = points_of(aligned.pair.source, aligned.point_options);
  const auto target = points_of(aligned.pair.target, aligned.point_options);
  aligned.result.history.front().scale = 1.25;
  aligned.result.scale = aligned.result.history.back().scale = 1.5;
  const AlignmentRun run = make_run(aligned.result, source, target, aligned.run_options());
  EXPECT_EQ(run.target_from_source.front().scale(), 1.25);
  EXPECT_EQ(run.target_from_source[2].scale(), 1.0);
  EXPECT_EQ(run.target_from_source.back().scale(), 1.5);
  const PoseError error = pose_error(Similarity3(1.5, aligned.result.target_from_source),
                                     aligned.pair.target_from_source, source);
  EXPECT_EQ(run.translation_error.back(), error.translation);
}

TEST(MakeRun, APoseTakenFromACycleComesLast) {
  Aligned aligned;
  aligned.options.stop_at_repetition = true;
  aligned.result = icp(aligned.pair.source, aligned.pair.target, observations_metric(),
                       aligned.options, aligned.point_options);
  ASSERT_EQ(aligned.result.stop_reason, StopReason::kCycle) << "or this shows nothing";
  const auto source = points_of(aligned.pair.source, aligned.point_options);
  const auto target = points_of(aligned.pair.target, aligned.point_options);
  const AlignmentRun run = make_run(aligned.result, source, target, aligned.run_options());
  ASSERT_THAT(run.target_from_source, SizeIs(aligned.result.history.size() + 2));
  EXPECT_EQ(run.target_from_source.back().matrix(), aligned.result.target_from_source.matrix());
  EXPECT_EQ(run.scores.back(), aligned.result.score);
  EXPECT_THAT(run.matches->change_counts, SizeIs(aligned.result.history.size()));
}

std::map<std::string, Scalar> summary_of(const AlignmentRun& run) {
  return {run.summary.begin(), run.summary.end()};
}

// As saved without a trace.
TEST(MakeRun, AResultWithoutAHistoryEndsAtItsPose) {
  Aligned aligned;
  aligned.result.history.clear();
  const auto source = points_of(aligned.pair.source, aligned.point_options);
  const auto target = points_of(aligned.pair.target, aligned.point_options);
  const AlignmentRun run = make_run(aligned.result, source, target, aligned.run_options());
  ASSERT_THAT(run.target_from_source, SizeIs(2));
  EXPECT_EQ(run.target_from_source.front().matrix(), aligned.options.initial.matrix());
  EXPECT_EQ(run.target_from_source.back().matrix(), aligned.result.target_from_source.matrix());
  EXPECT_THAT(run.scores, ElementsAre(*aligned.result.initial_score, *aligned.result.score));
  EXPECT_FALSE(run.matches.has_value());
  const PoseError error =
      pose_error(aligned.result.target_from_source, aligned.pair.target_from_source, source);
  EXPECT_EQ(summary_of(run).at("rotation_error_deg"), Scalar(degrees(error.rotation_rad)));
  EXPECT_EQ(summary_of(run).at("translation_error_m"), Scalar(error.translation));
}

// As the pose that the parts of the maps agree on.
TEST(MakeRun, APoseThatNoIterationReachedComesLast) {
  Aligned aligned;
  const Similarity3 estimate(1.5, aligned.pair.target_from_source);
  ASSERT_NE(estimate.matrix(), aligned.result.similarity().matrix());
  aligned.result.target_from_source = estimate.rigid();
  aligned.result.scale = estimate.scale();
  const auto source = points_of(aligned.pair.source, aligned.point_options);
  const auto target = points_of(aligned.pair.target, aligned.point_options);
  RunOptions options = aligned.run_options();
  options.truth = estimate;
  const AlignmentRun run = make_run(aligned.result, source, target, options);
  ASSERT_THAT(run.target_from_source, SizeIs(aligned.result.history.size() + 2));
  EXPECT_EQ(run.target_from_source.back().matrix(), estimate.matrix());
  EXPECT_EQ(summary_of(run).at("rotation_error_deg"), Scalar(0.0));
  EXPECT_EQ(summary_of(run).at("translation_error_m"), Scalar(0.0));
  EXPECT_THAT(run.matches->change_counts, SizeIs(aligned.result.history.size()));
}

TEST(MakeRun, ARejectedPoseIsShownWithoutErrors) {
  Aligned aligned;
  aligned.result.history.clear();
  const auto source = points_of(aligned.pair.source, aligned.point_options);
  const auto target = points_of(aligned.pair.target, aligned.point_options);
  RunOptions options = aligned.run_options();
  options.rejected = true;
  const AlignmentRun run = make_run(aligned.result, source, target, options);
  EXPECT_EQ(run.target_from_source.back().matrix(), aligned.result.target_from_source.matrix());
  EXPECT_EQ(summary_of(run).at("rotation_error_deg"), Scalar());
}

TEST(MakeRun, MapsOfWhatIsAlignedAloneHaveItsOrder) {
  const Aligned aligned;
  const auto source = points_of(aligned.pair.source, aligned.point_options);
  const auto target = points_of(aligned.pair.target, aligned.point_options);
  const AlignmentRun run = make_run(aligned.result, source, target, aligned.run_options());
  const PointSet points = point_set(aligned.pair.source, std::nullopt, aligned.point_options);
  EXPECT_EQ(source, points.positions);
  const Map map =
      make_map(aligned.pair.source,
               {.landmarks = landmarks_to_align(aligned.pair.source, aligned.point_options)});
  ASSERT_EQ(map.count, points.positions.size());
  const auto& stored = std::get<std::vector<std::uint32_t>>(map.positions);
  for (std::size_t i = 0; i < map.count; ++i) {
    EXPECT_NEAR(map.origin[0] + map.step[0] * stored[3 * i], points.positions[i].x(), 1e-6);
  }
  for (std::size_t i = 0; i < aligned.result.history.size(); ++i) {
    const auto current = current_matches(*run.matches, i);
    const auto& matches = aligned.result.history[i].matches;
    EXPECT_EQ(static_cast<std::size_t>(
                  std::count_if(current.begin(), current.end(), [](int t) { return t >= 0; })),
              matches.size());
    for (const Match& match : matches) {
      ASSERT_EQ(current[match.source], static_cast<std::int32_t>(match.target));
    }
  }
}

TEST(MakeRun, WithoutATraceThereAreNoMatches) {
  const Aligned aligned(false);
  const auto source = points_of(aligned.pair.source, aligned.point_options);
  const auto target = points_of(aligned.pair.target, aligned.point_options);
  const AlignmentRun run = make_run(aligned.result, source, target, aligned.run_options());
  EXPECT_FALSE(run.matches.has_value());
  EXPECT_EQ(run.scores.front(), aligned.result.initial_score);
  EXPECT_TRUE(std::isnan(run.scores[1]));
  EXPECT_EQ(run.scores.back(), aligned.result.score);
  const std::vector<AlignmentRun> runs = {run};
  EXPECT_EQ(convergence_chart(runs, LengthUnit::kMetres).y_label,
            "Mean squared distance of the matches (m²)");
}

TEST(MakeRun, AFailedAlignmentHasItsInitialPoseOnly) {
  RegistrationResult result;
  result.reason = "the source has no landmarks to align";
  const AlignmentRun run = make_run(result, {}, {}, {.name = "base", .truth = Rigid3()});
  EXPECT_THAT(run.target_from_source, SizeIs(1));
  EXPECT_THAT(run.scores, IsEmpty());
  EXPECT_FALSE(run.matches.has_value());
  EXPECT_EQ(summary_of(run).at("status"), Scalar("failed"));
  EXPECT_EQ(summary_of(run).at("score"), Scalar());
  EXPECT_EQ(summary_of(run).at("rotation_error_deg"), Scalar());
}

TEST(MakeRun, AMatchOfAPointThatIsNotThereIsRefused) {
  RegistrationResult result;
  result.history.emplace_back().matches = {Match{0, 5, 0.0}};
  const Points one = {Eigen::Vector3d::Zero()};
  EXPECT_THROW(make_run(result, one, one, {}), Error);
}

TEST(DeltaCoded, HoldsOnlyWhatChanges) {
  const Points points(4);
  const auto iteration = [](std::vector<Match> matches) {
    IterationRecord record;
    record.matches = std::move(matches);
    return record;
  };
  const std::vector<IterationRecord> history = {iteration({{0, 0, 0.0}, {2, 1, 0.0}}),
                                                iteration({{0, 0, 0.0}, {2, 1, 0.0}}),
                                                iteration({{0, 2, 0.0}, {3, 3, 0.0}})};
  const Matches matches = delta_coded(history, points, points);
  EXPECT_THAT(matches.first, ElementsAre(0, -1, 1, -1));
  EXPECT_THAT(matches.change_counts, ElementsAre(0U, 3U));
  EXPECT_THAT(matches.changed, ElementsAre(0U, 2U, 3U));
  EXPECT_THAT(matches.targets, ElementsAre(2, -1, 3));
}

TEST(RunTable, HasTheColumnsThatSomeRunKnows) {
  AlignmentRun base;
  base.name = "base";
  base.summary = {{"status", "aligned"}, {"score", 0.25}};
  AlignmentRun other = base;
  other.name = "distance";
  other.summary = {{"status", "failed"}};
  const std::vector<AlignmentRun> runs = {base, other};
  const Table table = run_table(runs, LengthUnit::kFree);
  ASSERT_THAT(table.columns, SizeIs(3));
  EXPECT_EQ(table.columns[2].name, "Score after");
  EXPECT_EQ(table.columns[2].unit, "map units²");
  EXPECT_THAT(table.rows[0], ElementsAre(Scalar("base"), Scalar("aligned"), Scalar(0.25)));
  EXPECT_THAT(table.rows[1], ElementsAre(Scalar("distance"), Scalar("failed"), Scalar()));
  EXPECT_THAT(table.best, ElementsAre(Best::kNone, Best::kNone, Best::kLow));
}

TEST(Charts, SkipWhatIsUnknownAndAvoidTheLogarithmOfZero) {
  AlignmentRun run;
  run.name = "base";
  run.scores = {0.5, 0.25, 0.0};
  run.mean_squared_distance = {std::nan(""), 0.1, 0.05};
  const std::vector<AlignmentRun> runs = {run};
  const LinesChart chart = convergence_chart(runs, LengthUnit::kMetres);
  EXPECT_EQ(chart.y_scale, AxisScale::kLinear);
  EXPECT_THAT(chart.series.at(0).x, ElementsAre(0.0, 1.0, 2.0));
  EXPECT_THAT(error_chart(runs, LengthUnit::kMetres, true).series, IsEmpty());
  run.scores.clear();
  const std::vector<AlignmentRun> unscored = {run};
  const LinesChart distances = convergence_chart(unscored, LengthUnit::kMetres);
  EXPECT_EQ(distances.y_scale, AxisScale::kLog);
  EXPECT_THAT(distances.series.at(0).x, ElementsAre(1.0, 2.0));
  EXPECT_THAT(distances.series.at(0).y, ElementsAre(DoubleEq(0.1), DoubleEq(0.05)));
}

// The promise of docs/report_format.md, against the worst case: every match changes every time.
TEST(ReportSize, FourRunsOf150IterationsStayUnder15Megabytes) {
  constexpr std::uint32_t kLandmarks = 6000;
  const auto truth = synthetic_pair({.landmarks = kLandmarks});
  const auto source = points_of(truth.source, {.min_observations = 0});
  const auto target = points_of(truth.target, {.min_observations = 0});
  Report report;
  report.title = "largest";
  report.maps = {make_map(truth.source, {.id = "source"}),
                 make_map(truth.target, {.id = "target"})};
  Scene scene{.source = "source", .target = "target", .truth = {}, .up = {}, .runs = {}};
  std::uint32_t state = 1;
  for (const char* const name : {"base", "covariance", "observations", "distance"}) {
    RegistrationResult result;
    for (int i = 0; i < 150; ++i) {
      IterationRecord record;
      record.score = 1.0 / (i + 1.1);
      record.mean_squared_distance = 1.0 / (i + 1.3);
      for (std::uint32_t k = 0; k < source.size(); ++k) {
        state = state * 1664525U + 1013904223U;
        record.matches.push_back(
            {k, (state >> 8U) % static_cast<std::uint32_t>(target.size()), 0.0});
      }
      result.history.push_back(std::move(record));
    }
    scene.runs.push_back(make_run(result, source, target, {.name = name, .truth = Rigid3()}));
  }
  report.sections = {{.id = "scene", .title = "Scene", .text = {}, .content = std::move(scene)}};
  std::size_t bytes = 0;
  write_report(report, testing::kStubPage, [&](std::string_view part) { bytes += part.size(); });
  EXPECT_LT(bytes, 15'000'000U - 2'000'000U) << "beside a viewer of two megabytes";
  RecordProperty("bytes", std::to_string(bytes));
}

}  // namespace
}  // namespace cairn::report::detail
