// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/report/detail/map_builder.hpp"

#include <algorithm>
#include <cmath>
#include <string_view>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/confidence/metric.hpp"
#include "cairn/core/error.hpp"
#include "cairn/core/random.hpp"
#include "cairn/geometry/covariance.hpp"
#include "cairn/map/synthetic.hpp"

#include "support/maps.hpp"
#include "support/splats.hpp"

namespace cairn::report::detail {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

std::vector<Eigen::Vector3d> positions_of(const Map& map) {
  return std::visit(
      [&](const auto& stored) {
        std::vector<Eigen::Vector3d> positions(map.count);
        for (std::size_t i = 0; i < 3 * map.count; ++i) {
          positions[i / 3][static_cast<int>(i % 3)] =
              map.origin[i % 3] + map.step[i % 3] * static_cast<double>(stored[i]);
        }
        return positions;
      },
      map.positions);
}

std::vector<double> values_of(const Map& map, std::string_view name) {
  const auto column = std::find_if(map.columns.begin(), map.columns.end(),
                                   [&](const Column& c) { return c.name == name; });
  if (column == map.columns.end()) return {};
  return std::visit(
      [&](const auto& stored) {
        std::vector<double> values;
        for (const auto value : stored) {
          values.push_back(column->offset + column->scale * static_cast<double>(value));
        }
        return values;
      },
      column->values);
}

void expect_within_half_a_step(const Map& map, const std::vector<Eigen::Vector3d>& truth) {
  const auto positions = positions_of(map);
  ASSERT_EQ(positions.size(), truth.size());
  double worst = 0.0;
  for (std::size_t i = 0; i < truth.size(); ++i) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto k = static_cast<int>(axis);
      worst = std::max(worst, std::abs(positions[i][k] - truth[i][k]) / map.step[axis]);
    }
  }
  EXPECT_LE(worst, 0.5 + 1e-4);
}

// A cloud of a room's size without anything else.
MapTables cloud(std::size_t count, double far_away = 0.0) {
  Random random(7);
  MapTables tables;
  for (std::size_t i = 0; i < count; ++i) {
    tables.landmarks.ids.push_back(LandmarkId{i});
    tables.landmarks.positions.emplace_back(random.uniform(-5.0, 5.0), random.uniform(0.0, 8.0),
                                            random.uniform(0.0, 2.5));
  }
  if (far_away > 0.0) tables.landmarks.positions.back().x() = far_away;
  return tables;
}

TEST(MakeMap, PositionsOfASmallMapAreExactToNanometres) {
  const LandmarkMap map = synthetic_map({.landmarks = 500, .frames = 10});
  const Map shown = make_map(map, {.id = "source", .name = "a.map"});
  EXPECT_EQ(shown.id, "source");
  EXPECT_EQ(shown.name, "a.map");
  EXPECT_TRUE(std::holds_alternative<std::vector<std::uint32_t>>(shown.positions));
  expect_within_half_a_step(shown, map.landmarks().positions);
  for (const double step : shown.step) EXPECT_LT(step, 1e-8);
}

TEST(MakeMap, LargeMapIsQuantisedTo16BitsWithinHalfAStep) {
  const LandmarkMap map(cloud(100001));
  const Map shown = make_map(map);
  EXPECT_TRUE(std::holds_alternative<std::vector<std::uint16_t>>(shown.positions));
  expect_within_half_a_step(shown, map.landmarks().positions);
  EXPECT_LT(shown.step[0], 10.0 / 65000);
  EXPECT_TRUE(std::holds_alternative<std::vector<std::uint32_t>>(
      make_map(LandmarkMap(cloud(100000))).positions));
}

TEST(MakeMap, OneOutlierDoesNotCoarsenALargeMap) {
  const LandmarkMap map(cloud(100001, 1e4));
  const Map shown = make_map(map);
  EXPECT_TRUE(std::holds_alternative<std::vector<std::uint32_t>>(shown.positions));
  expect_within_half_a_step(shown, map.landmarks().positions);
}

TEST(MakeMap, HugeExtentsAreHeld) {
  MapTables tables = cloud(3);
  tables.landmarks.positions = {{8e8, 0, 0}, {-8e8, 0, 0}, {0, 0, 0}};
  const auto positions = positions_of(make_map(LandmarkMap(std::move(tables))));
  EXPECT_NEAR(positions[0].x() / 8e8, 1.0, 1e-9);
  EXPECT_NEAR(positions[1].x() / 8e8, -1.0, 1e-9);
  EXPECT_NEAR(positions[2].x() / 8e8, 0.0, 1e-9);
  EXPECT_EQ(positions[0].y(), 0.0);
}

TEST(MakeMap, ColumnsAreWhatTheMetricsSay) {
  const LandmarkMap map = synthetic_map({.landmarks = 300, .frames = 10});
  const Map shown = make_map(map);
  const auto expect = [&](const char* name, const std::vector<double>& expected) {
    const auto values = values_of(shown, name);
    ASSERT_EQ(values.size(), expected.size()) << name;
    for (std::size_t i = 0; i < values.size(); ++i) {
      EXPECT_NEAR(values[i], expected[i], 1e-6 * std::max(1.0, expected[i])) << name;
    }
  };
  expect("observations", observations_metric().evaluate(map));
  expect("observations_confidence", observations_metric().evaluate(map));
  expect("covariance_confidence", covariance_metric().evaluate(map));
  expect("distance_confidence", distance_metric().evaluate(map));
  std::vector<double> sigmas;
  std::vector<double> distances;
  for (const Eigen::Matrix3d& covariance : map.landmarks().covariances) {
    sigmas.push_back(std::sqrt(spectral_norm(covariance)));
  }
  for (const double confidence : distance_metric().evaluate(map)) {
    distances.push_back(1.0 / confidence - 1.0);
  }
  expect("sigma", sigmas);
  expect("distance", distances);
}

TEST(MakeMap, WhatTheMapLacksIsAbsent) {
  const Map shown = make_map(LandmarkMap(cloud(10)));
  EXPECT_THAT(shown.columns, IsEmpty());
  EXPECT_THAT(shown.ids, IsEmpty());
  EXPECT_THAT(shown.colors, IsEmpty());
  EXPECT_FALSE(shown.frames.has_value());
}

TEST(MakeMap, WhatIsUnknownOfALandmarkIsNotInvented) {
  const Map shown = make_map(testing::full_map());
  EXPECT_EQ(shown.length_unit, LengthUnit::kFree);
  EXPECT_THAT(shown.ids, ElementsAre(30U, 10U, 9223372036854775808U, 20U));
  EXPECT_THAT(shown.colors, ElementsAre(200, 180, 40, 128, 128, 128, 0, 0, 0, 255, 255, 255));
  EXPECT_TRUE(std::isnan(values_of(shown, "sigma")[1]));
  EXPECT_EQ(values_of(shown, "sigma")[2], 0.0);
  EXPECT_THAT(values_of(shown, "observations"), ElementsAre(2.0, 1.0, 0.0, 2.0));
  EXPECT_TRUE(std::isnan(values_of(shown, "distance")[2]));
}

TEST(MakeMap, SplatsKeepTheirShapes) {
  const LandmarkMap map = testing::random_splats(200, 1, 5);
  const Map shown = make_map(map);
  ASSERT_TRUE(shown.ellipsoids);
  const Ellipsoids& shapes = *shown.ellipsoids;
  ASSERT_EQ(shapes.covariances.size(), 6U * 200U);
  for (std::uint32_t i = 0; i < 200; ++i) {
    const auto at = [&](std::size_t k) { return shapes.covariances[6 * i + k] / 127.0; };
    const double sigma = std::exp2(shapes.offset + shapes.scale * shapes.sigmas[i]);
    Eigen::Matrix3d restored;
    restored << at(0), at(3), at(4), at(3), at(1), at(5), at(4), at(5), at(2);
    const Eigen::Matrix3d truth = *map.covariance(LandmarkIndex{i});
    const double largest = spectral_norm(truth);
    EXPECT_LT(std::abs(std::log2(sigma * sigma / largest)), 1.01 * shapes.scale) << i;
    EXPECT_LT((restored - truth / largest).cwiseAbs().maxCoeff(), 0.51 / 127.0) << i;
  }
  EXPECT_FALSE(make_map(testing::full_map()).ellipsoids) << "only splats have shapes";
}

TEST(MakeMap, FramesKeepPosesIdsTimesAndTheView) {
  const LandmarkMap map = testing::full_map();
  const Map shown = make_map(map);
  ASSERT_TRUE(shown.frames.has_value());
  ASSERT_EQ(shown.frames->world_from_camera.size(), 3U);
  EXPECT_EQ(shown.frames->world_from_camera[1].translation(), map.frames().translations[1]);
  EXPECT_THAT(shown.frames->ids, ElementsAre(7U, 18446744073709551615U, 3U));
  ASSERT_EQ(shown.frames->timestamps_s.size(), 3U);
  EXPECT_TRUE(std::isnan(shown.frames->timestamps_s[0]));
  EXPECT_EQ(shown.frames->timestamps_s[1], 1305031453.374112);
  // The first frame that knows its camera has the fisheye.
  ASSERT_TRUE(shown.frames->frustum.has_value());
  EXPECT_DOUBLE_EQ(shown.frames->frustum->half_width, 160.0 / 190.0);
  EXPECT_DOUBLE_EQ(shown.frames->frustum->half_height, 120.0 / 191.0);
}

TEST(MakeMap, ShowsTheLandmarksAskedForInThatOrder) {
  const LandmarkMap map = testing::full_map();
  const Map shown =
      make_map(map, {.landmarks = std::vector<LandmarkIndex>{LandmarkIndex{3}, LandmarkIndex{0}}});
  EXPECT_EQ(shown.count, 2U);
  EXPECT_THAT(shown.ids, ElementsAre(20U, 30U));
  EXPECT_THAT(values_of(shown, "observations"), ElementsAre(2.0, 2.0));
  EXPECT_THAT(shown.colors, ElementsAre(255, 255, 255, 200, 180, 40));
  EXPECT_THROW(make_map(map, {.landmarks = std::vector<LandmarkIndex>{LandmarkIndex{4}}}), Error);
}

TEST(MakeMap, EmptyMapIsAMapWithoutLandmarks) {
  const Map shown = make_map(LandmarkMap());
  EXPECT_EQ(shown.count, 0U);
  EXPECT_THAT(positions_of(shown), IsEmpty());
  EXPECT_FALSE(shown.frames.has_value());
}

TEST(UpOf, IsAgainstGravity) {
  EXPECT_EQ(up_of(testing::full_map()), Eigen::Vector3d(0.0, -0.6, -0.8));
  EXPECT_FALSE(up_of(LandmarkMap()).has_value());
}

}  // namespace
}  // namespace cairn::report::detail
