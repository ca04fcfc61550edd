// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/adjustment/adjust.hpp"

#include <memory>
#include <numbers>
#include <stop_token>
#include <utility>
#include <vector>

#include <Eigen/Geometry>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/error.hpp"
#include "cairn/map/synthetic.hpp"

#include "support/adjusted_maps.hpp"
#include "support/rig_maps.hpp"

namespace cairn {
namespace {

using testing::disturbed;
using ::testing::HasSubstr;
using testing::largest_error;
using testing::monocular;
using testing::scaled_like;
using testing::small_scene;

AdjustOptions options_with(double pixel_px, double depth) {
  AdjustOptions options;
  MeasurementNoise noise;
  noise.pixel_px = pixel_px;
  noise.depth_floor = 1e-6;
  noise.depth_quadratic = depth;
  options.noise = noise;
  options.covariances = false;
  return options;
}

TEST(Adjust, RecoversAMapFromExactObservations) {
  const LandmarkMap truth = synthetic_map(small_scene(1, 0.0, 0.0));
  const AdjustResult result = adjust(disturbed(truth, 0.02), options_with(1.0, 0.003));
  EXPECT_TRUE(result.converged);
  EXPECT_GT(result.initial_rms_px, 1.0);
  EXPECT_LT(result.final_rms_px, 1e-3);
  EXPECT_LT(largest_error(result.map, truth), 1e-5);
}

TEST(Adjust, RecoversAMonocularMapInTheScaleOfItsFarthestFrame) {
  const LandmarkMap truth = monocular(synthetic_map(small_scene(2, 0.0, 0.0)));
  const LandmarkMap start = disturbed(truth, 0.02);
  AdjustOptions options = options_with(1.0, 0.003);
  options.max_iterations = 200;
  const AdjustResult result = adjust(start, options);
  EXPECT_LT(result.final_rms_px, 1e-2);
  EXPECT_LT(largest_error(result.map, scaled_like(truth, start)), 1e-3);
}

TEST(Adjust, MovesTheImagesOfARigAsOneAndKeepsItsLengths) {
  const LandmarkMap truth = testing::rig_map();
  MapTables tables = disturbed(truth, 0.02).tables();
  // The right image of the second instant observes nothing, and still moves with the left one.
  const ObservationTable all = std::exchange(tables.observations, {});
  tables.observations.offsets.push_back(0);
  for (std::size_t l = 0; l + 1 < all.offsets.size(); ++l) {
    for (std::uint64_t k = all.offsets[l]; k < all.offsets[l + 1]; ++k) {
      if (all.frames[k] == FrameIndex{3}) continue;
      tables.observations.frames.push_back(all.frames[k]);
      tables.observations.pixels.push_back(all.pixels[k]);
    }
    tables.observations.offsets.push_back(tables.observations.frames.size());
  }
  const LandmarkMap start(std::move(tables));
  ASSERT_GT(testing::off_rig(start), 1e-3);
  AdjustOptions options = options_with(1.0, 0.003);
  options.max_iterations = 200;
  for (const bool refines : {false, true}) {
    options.refine_intrinsics = refines;
    const AdjustResult result = adjust(start, options);
    EXPECT_TRUE(result.converged);
    EXPECT_LT(testing::off_rig(result.map), 1e-12);
    EXPECT_EQ(result.map.rigs()[0], truth.rigs()[0]);
    EXPECT_LT(result.final_rms_px, 1e-3);
    EXPECT_LT(largest_error(result.map, truth), 1e-4) << "no depth states the scale, the rig does";
  }
}

TEST(Adjust, IsBetterThanItsStartByNoisyObservations) {
  const LandmarkMap truth = synthetic_map(small_scene(3, 0.7, 0.003));
  AdjustOptions options;
  options.covariances = false;
  const AdjustResult result = adjust(disturbed(truth, 0.02), options);
  EXPECT_NEAR(result.noise.pixel_px, 0.7, 0.07);
  EXPECT_LT(largest_error(result.map, synthetic_map(small_scene(3, 0.0, 0.0))), 0.03);
}

TEST(Adjust, FindsTheFocalLengthIfAsked) {
  const LandmarkMap truth = synthetic_map(small_scene(4, 0.0, 0.0));
  LandmarkMap copy = truth;
  MapTables tables = std::move(copy).tables();
  const double focal = tables.cameras[0].parameters[0];
  tables.cameras[0].parameters[0] *= 1.01;
  const LandmarkMap start(std::move(tables));
  AdjustOptions options = options_with(1.0, 0.003);
  options.max_iterations = 200;
  EXPECT_EQ(adjust(start, options).map.cameras()[0], start.cameras()[0]);
  options.refine_intrinsics = true;
  const AdjustResult result = adjust(start, options);
  EXPECT_NEAR(result.map.cameras()[0].parameters[0], focal, 1e-3 * focal);
  EXPECT_LT(largest_error(result.map, truth), 2e-3);
}

// The same scene seen by cameras that look elsewhere: with another lens, turned about its vertical axis.
LandmarkMap turned(const LandmarkMap& map, const Camera& camera, double turn_deg) {
  LandmarkMap copy = map;
  MapTables tables = std::move(copy).tables();
  tables.cameras = {camera};
  const Eigen::Quaterniond turn(
      Eigen::AngleAxisd(turn_deg * std::numbers::pi / 180.0, Eigen::Vector3d::UnitY()));
  for (std::size_t i = 0; i < tables.frames.ids.size(); ++i) {
    const auto& q = tables.frames.quaternions[i];
    const Eigen::Quaterniond pose = Eigen::Quaterniond(q[0], q[1], q[2], q[3]) * turn;
    tables.frames.quaternions[i] = {pose.w(), pose.x(), pose.y(), pose.z()};
    tables.frames.cameras.set(i, CameraIndex{0});
  }
  tables.observations.depths.clear();
  const LandmarkMap seen{MapTables(tables)};
  for (std::size_t l = 0; l < tables.landmarks.ids.size(); ++l) {
    for (auto k = tables.observations.offsets[l]; k < tables.observations.offsets[l + 1]; ++k) {
      const auto pixel =
          project(camera, seen.world_from_camera(tables.observations.frames[k]).inverse() *
                              tables.landmarks.positions[l]);
      EXPECT_TRUE(pixel.has_value()) << camera.model;
      tables.observations.pixels[k] = pixel.value_or(Pixel{});
    }
  }
  return LandmarkMap(std::move(tables));
}

TEST(Adjust, RecoversMapsThatWideCamerasSeeBesideAndBehindThem) {
  const LandmarkMap scene = synthetic_map(small_scene(2, 0.0, 0.0));
  const std::vector<std::pair<Camera, double>> cameras = {
      {{CameraId{0}, "SIMPLE_FISHEYE", 640, 480, {200, 320, 240}}, 80.0},
      {{CameraId{0}, "EUCM", 640, 480, {200, 200, 320, 240, 0.55, 1.1}}, 70.0},
      {{CameraId{0}, "SIMPLE_DIVISION", 640, 480, {200, 320, 240, -0.3}}, 80.0},
      // The scene lies on both borders of the image.
      {{CameraId{0}, "EQUIRECTANGULAR", 640, 320, {640, 320}}, 180.0}};
  for (const auto& [camera, turn_deg] : cameras) {
    SCOPED_TRACE(camera.model);
    const LandmarkMap truth = turned(scene, camera, turn_deg);
    const LandmarkMap start = disturbed(truth, 0.02);
    AdjustOptions options = options_with(1.0, 0.003);
    options.max_iterations = 200;
    options.refine_intrinsics = camera.model == "EQUIRECTANGULAR";
    const AdjustResult result = adjust(start, options);
    EXPECT_GT(result.initial_rms_px, 1.0);
    EXPECT_LT(result.final_rms_px, 1e-2);
    EXPECT_LT(largest_error(result.map, scaled_like(truth, start)), 1e-3);
    EXPECT_EQ(result.map.cameras()[0], camera) << "a panorama has no unknowns";
  }
}

TEST(Adjust, WrongObservationsHardlyCount) {
  const LandmarkMap truth = synthetic_map(small_scene(5, 0.7, 0.003));
  LandmarkMap copy = truth;
  MapTables tables = std::move(copy).tables();
  for (std::size_t i = 0; i < tables.observations.pixels.size(); i += 20) {
    tables.observations.pixels[i].u += 40.0;
  }
  const LandmarkMap start(std::move(tables));
  AdjustOptions options = options_with(0.7, 0.003);
  const LandmarkMap exact = synthetic_map(small_scene(5, 0.0, 0.0));
  const double by_right_ones = testing::median_error(adjust(truth, options).map, exact);
  EXPECT_LT(testing::median_error(adjust(start, options).map, exact), 1.5 * by_right_ones);
}

TEST(Adjust, KeepsTheFirstFrameAndWhatItDoesNotMove) {
  const LandmarkMap start = disturbed(synthetic_map(small_scene(6, 0.7, 0.003)), 0.01);
  const LandmarkMap map = adjust(start).map;
  EXPECT_EQ(map.frames().translations[0], start.frames().translations[0]);
  EXPECT_EQ(map.frames().quaternions[0], start.frames().quaternions[0]);
  EXPECT_EQ(map.landmarks().ids, start.landmarks().ids);
  EXPECT_EQ(map.observations().pixels, start.observations().pixels);
  EXPECT_FALSE(map.info().uuid);
  EXPECT_TRUE(map.has_covariances());
}

TEST(Adjust, DoesNotDependOnTheNumberOfThreads) {
  const LandmarkMap start = disturbed(synthetic_map(small_scene(7, 0.7, 0.003)), 0.01);
  const AdjustResult one = adjust(start);
  const AdjustResult more = adjust(start, {}, {.executor = Executor(0)});
  EXPECT_EQ(one.map.landmarks().positions, more.map.landmarks().positions);
  EXPECT_EQ(one.map.landmarks().covariances, more.map.landmarks().covariances);
  EXPECT_EQ(one.map.frames().translations, more.map.frames().translations);
}

// Rounding shows the order of the solver's blocks, which must not follow from where the heap puts them.
TEST(Adjust, GivesTheSameCalibrationsOfSeveralCamerasInEveryRun) {
  LandmarkMap map = disturbed(synthetic_map(small_scene(10, 0.7, 0.003)), 0.01);
  MapTables tables = std::move(map).tables();
  for (std::size_t i = 1; i < 3; ++i) {
    tables.cameras.push_back(tables.cameras[0]);
    tables.cameras[i].id = CameraId{100 + i};
  }
  for (std::size_t i = 0; i < tables.frames.ids.size(); ++i) {
    tables.frames.cameras[i] = CameraIndex{static_cast<std::uint32_t>(i % 3)};
  }
  const LandmarkMap start(std::move(tables));
  AdjustOptions options = options_with(0.7, 0.003);
  options.refine_intrinsics = true;
  const LandmarkMap first = adjust(start, options).map;
  for (std::size_t run = 0; run < 6; ++run) {
    // Leaves the heap's free places in another order.
    std::vector<std::unique_ptr<std::vector<double>>> places(64);
    for (auto& place : places) {
      place = std::make_unique<std::vector<double>>(start.cameras()[0].parameters.size());
    }
    for (std::size_t i = 0; i < places.size(); ++i) places[i * (2 * run + 1) % 64].reset();
    const LandmarkMap again = adjust(start, options, {.executor = Executor(run % 2 + 1)}).map;
    for (std::size_t i = 0; i < 3; ++i) {
      EXPECT_EQ(first.cameras()[i].parameters, again.cameras()[i].parameters) << run;
    }
    EXPECT_EQ(first.landmarks().positions, again.landmarks().positions) << run;
    EXPECT_EQ(first.frames().translations, again.frames().translations) << run;
  }
}

// The first frame so often that too many pairs of frames see the same.
LandmarkMap with_repeated_first_frame(const LandmarkMap& map, std::uint32_t times) {
  MapTables tables = LandmarkMap(map).tables();
  FrameTable frames;
  for (std::uint32_t i = 0; i < times; ++i) {
    frames.ids.push_back(FrameId{i});
    frames.translations.push_back(tables.frames.translations[0]);
    frames.quaternions.push_back(tables.frames.quaternions[0]);
    frames.cameras.push_back(CameraIndex{0});
  }
  tables.frames = std::move(frames);
  const ObservationTable all = std::exchange(tables.observations, {});
  ObservationTable& more = tables.observations;
  more.offsets = {0};
  for (std::size_t l = 0; l + 1 < all.offsets.size(); ++l) {
    for (std::uint64_t k = all.offsets[l]; k < all.offsets[l + 1]; ++k) {
      if (all.frames[k] != FrameIndex{0}) continue;
      for (std::uint32_t i = 0; i < times; ++i) {
        more.frames.push_back(FrameIndex{i});
        more.pixels.push_back(all.pixels[k]);
        more.depths.push_back(all.depths[k]);
      }
    }
    more.offsets.push_back(more.frames.size());
  }
  return LandmarkMap(std::move(tables));
}

TEST(Adjust, KeepsTheAdjustedMapIfItsCovariancesAreTooLarge) {
  SyntheticOptions scene = small_scene(11, 0.7, 0.003);
  scene.landmarks = 60;
  scene.frames = 2;
  const LandmarkMap map = with_repeated_first_frame(synthetic_map(scene), 1500);
  AdjustOptions options = options_with(0.7, 0.003);
  options.covariances = true;
  options.min_observations = map.observation_count() + 1;  // nothing moves, which is quick
  const AdjustResult result = adjust(map, options);
  EXPECT_THAT(result.why_no_covariances, HasSubstr("pairs of frames share landmarks"));
  EXPECT_EQ(result.map.landmark_count(), map.landmark_count());
  EXPECT_FALSE(result.map.has_covariances());
  EXPECT_TRUE(result.map.frames().pose_covariances.empty());
}

// As in a fusion with a map that has no observations.
TEST(Adjust, KeepsTheCovariancesOfWhatNobodyObserved) {
  MapTables tables = synthetic_map(small_scene(12, 0.7, 0.003)).tables();
  const Eigen::Matrix3d stated = 0.04 * Eigen::Matrix3d::Identity();
  tables.landmarks.ids.push_back(LandmarkId{5000});
  tables.landmarks.positions.emplace_back(1.0, 2.0, 3.0);
  tables.landmarks.covariances.push_back(stated);
  tables.observations.offsets.push_back(tables.observations.offsets.back());
  const LandmarkMap map(std::move(tables));
  const LandmarkIndex last{static_cast<std::uint32_t>(map.landmark_count() - 1)};
  const LandmarkMap adjusted = adjust(map).map;
  EXPECT_EQ(adjusted.covariance(last), stated);
  EXPECT_EQ(adjusted.landmarks().positions[last.value], map.landmarks().positions[last.value]);
}

TEST(Adjust, NamesWhatIsMissing) {
  const LandmarkMap map = synthetic_map(small_scene(8, 0.7, 0.003));
  LandmarkMap copy = map;
  MapTables tables = std::move(copy).tables();
  tables.frames.cameras.clear();
  const LandmarkMap without_camera(std::move(tables));
  try {
    adjust(without_camera);
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::kInput);
    EXPECT_THAT(error.what(), HasSubstr("has no camera"));
  }
  copy = map;
  tables = std::move(copy).tables();
  tables.observations = {};
  const LandmarkMap points(std::move(tables));
  EXPECT_THROW(adjust(points), Error);
  AdjustOptions options;
  options.max_iterations = 0;
  EXPECT_THROW(adjust(map, options), Error);
}

TEST(Adjust, EndsWhenAsked) {
  std::stop_source stop;
  stop.request_stop();
  const LandmarkMap map = synthetic_map(small_scene(9, 0.7, 0.003));
  EXPECT_THROW(adjust(map, {}, {.stop = stop.get_token()}), Error);
}

}  // namespace
}  // namespace cairn
