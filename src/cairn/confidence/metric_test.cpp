// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/confidence/metric.hpp"

#include <cmath>
#include <limits>
#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/error.hpp"
#include "cairn/map/operations.hpp"
#include "cairn/map/synthetic.hpp"

#include "support/refusal.hpp"

namespace cairn {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

// Two cameras at x = 0 and x = 2, and three landmarks: seen by both, by the first, by none.
MapTables small_tables() {
  MapTables tables;
  tables.cameras = {{CameraId{0}, "PINHOLE", 640, 480, {500.0, 500.0, 320.0, 240.0}}};
  tables.frames.ids = {FrameId{0}, FrameId{1}};
  tables.frames.translations = {{0, 0, 0}, {2, 0, 0}};
  tables.frames.quaternions = {{1, 0, 0, 0}, {1, 0, 0, 0}};
  tables.frames.cameras = {CameraIndex{0}, CameraIndex{0}};
  tables.landmarks.ids = {LandmarkId{10}, LandmarkId{11}, LandmarkId{12}};
  tables.landmarks.positions = {{1, 0, 1}, {0, 0, 4}, {5, 5, 5}};
  Eigen::Matrix3d covariance = Eigen::Vector3d(3, 4, 0).asDiagonal();
  tables.landmarks.covariances = {
      covariance, Eigen::Matrix3d::Zero(),
      Eigen::Matrix3d::Constant(std::numeric_limits<double>::quiet_NaN())};
  tables.observations.offsets = {0, 2, 3, 3};
  tables.observations.frames = {FrameIndex{0}, FrameIndex{1}, FrameIndex{0}};
  tables.observations.pixels = {{820, 240}, {-180, 243}, {320, 239}};
  return tables;
}

std::string refusal(const Metric& metric, const LandmarkMap& map) {
  return testing::refusal(ErrorKind::kInput, [&] { metric.evaluate(map); });
}

TEST(CovarianceMetric, IsEquationOneWithTheFrobeniusNorm) {
  const LandmarkMap map(small_tables());
  EXPECT_THAT(covariance_metric().evaluate(map), ElementsAre(1.0 / 6.0, 1.0, 0.0));
}

TEST(CovarianceMetric, TakesTheSpectralNormOnDemand) {
  const LandmarkMap map(small_tables());
  EXPECT_THAT(covariance_metric(CovarianceNorm::kSpectral).evaluate(map),
              ElementsAre(1.0 / 5.0, 1.0, 0.0));
}

TEST(ObservationsMetric, IsEquationTwo) {
  EXPECT_THAT(observations_metric().evaluate(LandmarkMap(small_tables())),
              ElementsAre(2.0, 1.0, 0.0));
}

TEST(DistanceMetric, IsEquationsThreeAndFour) {
  const std::vector<double> values = distance_metric().evaluate(LandmarkMap(small_tables()));
  EXPECT_DOUBLE_EQ(values[0], 1.0 / (1.0 + std::numbers::sqrt2));
  EXPECT_DOUBLE_EQ(values[1], 1.0 / 5.0);
  EXPECT_EQ(values[2], 0.0);
}

TEST(ParallaxMetric, IsTheWidestAngleBetweenViewingRays) {
  const std::vector<double> values = parallax_metric().evaluate(LandmarkMap(small_tables()));
  EXPECT_DOUBLE_EQ(values[0], std::numbers::pi / 2);
  EXPECT_EQ(values[1], 0.0);
  EXPECT_EQ(values[2], 0.0);
}

// A landmark that very many frames on a quarter circle observe.
TEST(ParallaxMetric, ComparesSomeOfVeryManyRays) {
  MapTables tables;
  constexpr std::uint32_t kCount = 60'000;
  tables.landmarks.ids = {LandmarkId{1}};
  tables.landmarks.positions = {{0.0, 0.0, 0.0}};
  tables.observations.offsets = {0, kCount};
  for (std::uint32_t i = 0; i < kCount; ++i) {
    const double angle = std::numbers::pi / 2 * i / (kCount - 1);
    tables.frames.ids.push_back(FrameId{i});
    tables.frames.translations.emplace_back(std::cos(angle), std::sin(angle), 0.0);
    tables.frames.quaternions.push_back({1, 0, 0, 0});
    tables.observations.frames.push_back(FrameIndex{i});
    tables.observations.pixels.push_back({0, 0});
  }
  EXPECT_DOUBLE_EQ(parallax_metric().evaluate(LandmarkMap(tables))[0], std::numbers::pi / 2);
}

TEST(ParallaxMetric, IsInRadiansFromAnyDistance) {
  MapTables tables = small_tables();
  tables.landmarks.positions[0] = {2, 0, 2};
  EXPECT_DOUBLE_EQ(parallax_metric().evaluate(LandmarkMap(tables))[0], std::numbers::pi / 4);
}

TEST(ReprojectionMetric, FallsWithTheMeanErrorInPixels) {
  // Errors of 0 and 3 px for the first landmark, 1 px for the second.
  const std::vector<double> values = reprojection_metric().evaluate(LandmarkMap(small_tables()));
  EXPECT_DOUBLE_EQ(values[0], 1.0 / 2.5);
  EXPECT_DOUBLE_EQ(values[1], 0.5);
  EXPECT_EQ(values[2], 0.0);
}

TEST(ReprojectionMetric, TrustsNoLandmarkBehindItsCamera) {
  MapTables tables = small_tables();
  tables.landmarks.positions[1].z() = -4.0;
  EXPECT_EQ(reprojection_metric().evaluate(LandmarkMap(tables))[1], 0.0);
}

TEST(ReprojectionMetric, CountsFramesWithACameraOnly) {
  MapTables tables = small_tables();
  tables.frames.cameras = {CameraIndex{0}, std::nullopt};
  tables.observations.frames = {FrameIndex{0}, FrameIndex{1}, FrameIndex{1}};
  // The first landmark's error in frame 0 is 0 px; no frame with a camera sees the second.
  EXPECT_THAT(reprojection_metric().evaluate(LandmarkMap(tables)), ElementsAre(1.0, 0.0, 0.0));
}

TEST(ColumnMetric, IsTheColumnWithZeroForUnknown) {
  MapTables tables = small_tables();
  tables.landmarks.columns = {{"trust", {0.5, std::nan(""), -1.0}}};
  EXPECT_THAT(column_metric("trust").evaluate(LandmarkMap(tables)), ElementsAre(0.5, 0.0, -1.0));
}

TEST(ProductMetric, MultipliesLandmarkByLandmark) {
  const LandmarkMap map(small_tables());
  const Metric product = metric_named("covariance*observations");
  EXPECT_EQ(product.name, "covariance*observations");
  EXPECT_THAT(product.evaluate(map), ElementsAre(2.0 / 6.0, 1.0, 0.0));
}

TEST(ProductMetric, NeedsAFactor) {
  EXPECT_THROW(product_metric({}), Error);
}

TEST(Metrics, FailByNameWhereTheMapLacksTheirInput) {
  MapTables without_covariances = small_tables();
  without_covariances.landmarks.covariances.clear();
  EXPECT_THAT(refusal(covariance_metric(), LandmarkMap(without_covariances)),
              AllOf(HasSubstr("metric covariance"), HasSubstr("no landmark covariances")));

  MapTables without_cameras = small_tables();
  without_cameras.frames.cameras.clear();
  EXPECT_THAT(refusal(reprojection_metric(), LandmarkMap(without_cameras)),
              AllOf(HasSubstr("metric reprojection"), HasSubstr("no cameras")));

  MapTables without_observations = small_tables();
  without_observations.observations = {};
  for (const Metric& metric :
       {observations_metric(), distance_metric(), parallax_metric(), reprojection_metric()}) {
    EXPECT_THAT(refusal(metric, LandmarkMap(without_observations)),
                AllOf(HasSubstr("metric " + metric.name), HasSubstr("no observations")));
  }
  EXPECT_THAT(refusal(column_metric("trust"), LandmarkMap(small_tables())),
              HasSubstr("no column 'trust'"));
}

TEST(Metrics, FailOfASingleLandmarkToo) {
  MapTables tables = small_tables();
  tables.landmarks = {};
  tables.landmarks.ids = {LandmarkId{10}};
  tables.landmarks.positions = {{1, 0, 1}};
  tables.frames.cameras.clear();
  tables.observations.offsets = {0, 2};
  tables.observations.frames.resize(2);
  tables.observations.pixels.resize(2);
  const LandmarkMap map(tables);
  EXPECT_THAT(refusal(covariance_metric(), map), HasSubstr("no landmark covariances"));
  EXPECT_THAT(refusal(reprojection_metric(), map), HasSubstr("no cameras"));
}

TEST(MetricNamed, KnowsEachMetricByItsName) {
  for (const char* name : {"covariance", "covariance:spectral", "observations", "distance",
                           "parallax", "reprojection", "column:trust"}) {
    EXPECT_EQ(metric_named(name).name, name);
  }
}

TEST(MetricNamed, ListsTheNamesForAWrongOne) {
  for (const char* name : {"", "covariances", "column:", "covariance*", "*"}) {
    try {
      metric_named(name);
      FAIL() << name;
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::kMisuse);
      EXPECT_THAT(error.what(), HasSubstr("covariance, covariance:spectral, observations"));
    }
  }
}

TEST(Metrics, DoNotDependOnTheWorldFrame) {
  const LandmarkMap map = synthetic_map({.seed = 2, .landmarks = 300});
  const LandmarkMap moved =
      transformed(map, Rigid3::from_roll_pitch_yaw({3, -2, 1}, 0.3, -0.5, 2.0));
  for (const char* name : {"covariance", "covariance:spectral", "observations", "distance",
                           "parallax", "reprojection"}) {
    const std::vector<double> a = metric_named(name).evaluate(map);
    const std::vector<double> b = metric_named(name).evaluate(moved);
    for (std::size_t i = 0; i < a.size(); ++i) ASSERT_NEAR(a[i], b[i], 1e-9 * (1.0 + a[i])) << name;
  }
}

TEST(Metrics, TakeAnEmptyMap) {
  for (const char* name : {"covariance", "observations", "distance", "parallax", "reprojection"}) {
    EXPECT_TRUE(metric_named(name).evaluate(LandmarkMap()).empty());
  }
}

}  // namespace
}  // namespace cairn
