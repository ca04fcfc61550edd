// SPDX-License-Identifier: BSD-3-Clause
#include <numeric>
#include <utility>
#include <vector>

#include <Eigen/Cholesky>
#include <gtest/gtest.h>

#include "cairn/adjustment/adjust.hpp"
#include "cairn/core/error.hpp"
#include "cairn/geometry/covariance.hpp"
#include "cairn/map/operations.hpp"
#include "cairn/map/synthetic.hpp"

#include "support/adjusted_maps.hpp"
#include "support/rig_maps.hpp"

namespace cairn {
namespace {

using testing::monocular;
using testing::scaled_like;
using testing::small_scene;

constexpr double kPixel = 0.7;
constexpr double kDepth = 0.003;

MeasurementNoise true_noise() {
  MeasurementNoise noise;
  noise.pixel_px = kPixel;
  noise.depth_floor = 1e-6;
  noise.depth_quadratic = kDepth;
  return noise;
}

struct Consistency {
  double nees = 0.0;       ///< mean; 3 of calibrated covariances
  double inside = 0.0;     ///< share within the 95 % ellipsoid
  double pose_nees = 0.0;  ///< mean of the frames but the first; 6 of calibrated covariances
};

// Of landmarks with two or more observations, over several simulated maps that were adjusted from the truth.
Consistency consistency(bool is_monocular, const CovarianceOptions& options) {
  Consistency result;
  std::size_t count = 0;
  std::size_t poses = 0;
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    LandmarkMap map = synthetic_map(small_scene(seed, kPixel, kDepth));
    LandmarkMap truth = synthetic_map(small_scene(seed, 0.0, 0.0));
    if (is_monocular) map = monocular(std::move(map));
    AdjustOptions how;
    how.noise = true_noise();
    how.covariances = false;
    map = adjust(map, how).map;
    if (is_monocular) truth = scaled_like(std::move(truth), map);
    const LandmarkMap estimated = estimate_covariances(map, options).map;
    for (std::uint32_t i = 1; i < map.frame_count() && !is_monocular; ++i) {
      const FrameIndex frame{i};
      result.pose_nees += normalised_squared_error(map.world_from_camera(frame),
                                                   *estimated.frames().pose_covariances[i],
                                                   truth.world_from_camera(frame));
      ++poses;
    }
    for (std::uint32_t i = 0; i < map.landmark_count(); ++i) {
      if (map.observation_count(LandmarkIndex{i}) < 2) continue;
      const auto covariance = estimated.covariance(LandmarkIndex{i});
      if (!covariance) continue;
      const Eigen::Vector3d error = map.landmarks().positions[i] - truth.landmarks().positions[i];
      const double squared = error.dot(covariance->llt().solve(error));
      result.nees += squared;
      result.inside += squared < 7.815 ? 1.0 : 0.0;
      ++count;
    }
  }
  result.nees /= static_cast<double>(count);
  if (poses > 0) result.pose_nees /= static_cast<double>(poses);
  result.inside /= static_cast<double>(count);
  return result;
}

TEST(EstimateCovariances, SayHowFarOffLandmarksOfRgbdMapsAre) {
  CovarianceOptions options;
  options.noise = true_noise();
  options.widen_misfits = false;
  const Consistency known = consistency(false, options);
  EXPECT_NEAR(known.nees, 3.0, 0.3);
  EXPECT_NEAR(known.inside, 0.95, 0.03);
  EXPECT_NEAR(known.pose_nees, 6.0, 1.0);
  const Consistency estimated = consistency(false, {});
  EXPECT_NEAR(estimated.nees, 3.0, 0.5);
}

TEST(EstimateCovariances, SayHowFarOffLandmarksOfMonocularMapsAre) {
  CovarianceOptions options;
  options.noise = true_noise();
  options.widen_misfits = false;
  const Consistency known = consistency(true, options);
  EXPECT_NEAR(known.nees, 3.0, 0.4);
  EXPECT_NEAR(known.inside, 0.95, 0.03);
  const Consistency estimated = consistency(true, {});
  EXPECT_NEAR(estimated.nees, 3.0, 0.5);
}

// The rig's baseline is the scale, and its poses count as exact.
TEST(EstimateCovariances, SayHowFarOffImagesOfARigAre) {
  AdjustOptions how;
  how.noise = true_noise();
  double poses = 0.0;
  double count = 0.0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const LandmarkMap truth = testing::rig_map({.seed = seed});
    const LandmarkMap map =
        adjust(testing::rig_map({.seed = seed, .pixel_noise_px = kPixel}), how).map;
    const auto& covariances = map.frames().pose_covariances;
    ASSERT_EQ(covariances.size(), truth.frame_count());
    // Both of the first instant are where the gauge has them.
    EXPECT_EQ(*covariances[0], Matrix6d::Zero());
    EXPECT_EQ(*covariances[1], Matrix6d::Zero());
    for (std::uint32_t i = 2; i < map.frame_count(); ++i) {
      const FrameIndex frame{i};
      poses += normalised_squared_error(map.world_from_camera(frame), *covariances[i],
                                        truth.world_from_camera(frame));
      count += 1.0;
    }
  }
  EXPECT_NEAR(poses / count, 6.0, 1.0);
}

TEST(EstimateCovariances, AreTheSameWhicheverImageOfARigComesFirst) {
  const LandmarkMap map = testing::rig_map({.pixel_noise_px = kPixel});
  std::vector<std::uint32_t> frames(map.frame_count());
  std::iota(frames.begin(), frames.end(), 0U);
  for (std::size_t i = 0; i + 2 < frames.size(); i += 2) std::swap(frames[i], frames[i + 1]);
  std::vector<std::uint32_t> landmarks(map.landmark_count());
  std::iota(landmarks.begin(), landmarks.end(), 0U);
  MapTables tables = LandmarkMap(map).tables();
  reorder(tables, frames, landmarks);
  CovarianceOptions options;
  options.noise = true_noise();
  const LandmarkMap left = estimate_covariances(map, options).map;
  const LandmarkMap right = estimate_covariances(LandmarkMap(std::move(tables)), options).map;
  for (const std::uint32_t l : landmarks) {
    const auto one = left.covariance(LandmarkIndex{l});
    const auto other = right.covariance(LandmarkIndex{l});
    ASSERT_EQ(one.has_value(), other.has_value());
    if (one) {
      EXPECT_LT((*one - *other).norm(), 1e-6 * one->norm());
    }
  }
  for (std::size_t i = 2; i < frames.size(); ++i) {
    const Matrix6d one = *left.frames().pose_covariances[frames[i]];
    EXPECT_LT((one - *right.frames().pose_covariances[i]).norm(), 1e-6 * one.norm());
  }
}

TEST(EstimateCovariances, AreZeroForTheFrameThatCountsAsExact) {
  const LandmarkMap map = synthetic_map(small_scene(1, kPixel, kDepth));
  const LandmarkMap estimated = estimate_covariances(map).map;
  const auto& poses = estimated.frames().pose_covariances;
  ASSERT_EQ(poses.size(), map.frame_count());
  EXPECT_TRUE(poses[0]->isZero(0.0));
  EXPECT_EQ(estimate_covariances(map).references[1], FrameIndex{0});
  EXPECT_GT(poses[1]->diagonal().minCoeff(), 0.0);
  AdjustOptions how;
  how.covariances = false;
  EXPECT_TRUE(adjust(estimated, how).map.frames().pose_covariances.empty())
      << "of the poses before";
}

TEST(EstimateCovariances, AreUnknownWhereTheyOverflowWhateverWasStated) {
  const LandmarkMap map = synthetic_map(small_scene(1, kPixel, kDepth));
  LandmarkMap before = estimate_covariances(map).map;
  ASSERT_TRUE(before.frames().pose_covariances[1].has_value());
  MapTables tables = std::move(before).tables();
  // In a unit in which the square of a focal length divided by a distance is infinite.
  constexpr double kTiny = 1e-160;
  for (Eigen::Vector3d& position : tables.landmarks.positions) position *= kTiny;
  for (Eigen::Vector3d& translation : tables.frames.translations) translation *= kTiny;
  const LandmarkMap estimated = estimate_covariances(LandmarkMap(std::move(tables))).map;
  for (std::size_t i = 1; i < estimated.frame_count(); ++i) {
    EXPECT_FALSE(estimated.frames().pose_covariances[i].has_value()) << i;
  }
}

TEST(EstimateCovariances, AreInTheUnitOfTheMap) {
  const LandmarkMap map = monocular(synthetic_map(small_scene(1, kPixel, kDepth)));
  const LandmarkMap larger = transformed(map, Similarity3(1000.0, Rigid3()));
  const LandmarkMap small = estimate_covariances(map).map;
  const LandmarkMap large = estimate_covariances(larger).map;
  for (std::uint32_t i = 0; i < map.landmark_count(); ++i) {
    const auto a = small.covariance(LandmarkIndex{i});
    const auto b = large.covariance(LandmarkIndex{i});
    ASSERT_EQ(a.has_value(), b.has_value());
    if (a) {
      ASSERT_NEAR((*b / 1e6 - *a).norm() / a->norm(), 0.0, 1e-3);
    }
  }
}

TEST(EstimateCovariances, AreUnknownWhereOneFrameSawAPointWithoutDepth) {
  LandmarkMap copy = monocular(synthetic_map(small_scene(1, kPixel, kDepth)));
  MapTables tables = std::move(copy).tables();
  // The last landmark keeps its first observation only.
  auto& observations = tables.observations;
  const std::size_t keep = observations.offsets[observations.offsets.size() - 2] + 1;
  observations.frames.resize(keep);
  observations.pixels.resize(keep);
  observations.offsets.back() = keep;
  const LandmarkMap map(std::move(tables));
  const EstimatedCovariances estimated = estimate_covariances(map);
  const auto last = static_cast<std::uint32_t>(map.landmark_count() - 1);
  EXPECT_FALSE(estimated.map.covariance(LandmarkIndex{last}));
  std::size_t seen_twice = 0;
  for (std::uint32_t i = 0; i < map.landmark_count(); ++i) {
    if (map.observation_count(LandmarkIndex{i}) >= 2) ++seen_twice;
  }
  EXPECT_EQ(estimated.known, seen_twice);
}

TEST(EstimateCovariances, RelativeToTheObserverAreSmallerFarFromTheFirstFrame) {
  const LandmarkMap map = synthetic_map(small_scene(2, kPixel, kDepth));
  CovarianceOptions options;
  double first = 0.0;
  double observer = 0.0;
  for (const auto gauge : {CovarianceGauge::kFirstFrame, CovarianceGauge::kFirstObserver}) {
    options.gauge = gauge;
    const LandmarkMap estimated = estimate_covariances(map, options).map;
    double& sum = gauge == CovarianceGauge::kFirstFrame ? first : observer;
    for (std::uint32_t i = 0; i < map.landmark_count(); ++i) {
      sum += estimated.covariance(LandmarkIndex{i})->trace();
    }
  }
  EXPECT_LT(observer, first);
}

TEST(EstimateCovariances, GrowWhereResidualsDoNotFit) {
  LandmarkMap copy = synthetic_map(small_scene(3, kPixel, kDepth));
  MapTables tables = std::move(copy).tables();
  const std::size_t end = tables.observations.offsets[1];
  for (std::size_t i = 0; i < end; ++i) tables.observations.pixels[i].u += i % 2 == 0 ? 5.0 : -5.0;
  const LandmarkMap map(std::move(tables));
  CovarianceOptions options;
  options.noise = true_noise();
  const Eigen::Matrix3d wide = *estimate_covariances(map, options).map.covariance(LandmarkIndex{0});
  options.widen_misfits = false;
  const Eigen::Matrix3d stated =
      *estimate_covariances(map, options).map.covariance(LandmarkIndex{0});
  EXPECT_GT(wide.trace(), 5.0 * stated.trace());
}

TEST(EstimatedNoise, FindsPixelAndDepthNoise) {
  SyntheticOptions scene = small_scene(4, 1.5, 0.006);
  scene.landmarks = 1000;
  const LandmarkMap map = synthetic_map(scene);
  MeasurementNoise start;
  start.depth_floor = 1e-6;
  const MeasurementNoise noise = estimated_noise(map, start);
  EXPECT_NEAR(noise.pixel_px, 1.5, 0.1);
  EXPECT_NEAR(noise.depth_quadratic, 0.006, 0.0006);
}

TEST(EstimatedNoise, OfFewObservationsIsWhatIsStated) {
  SyntheticOptions scene = small_scene(4, 1.5, 0.006);
  scene.landmarks = 4;
  const LandmarkMap map = synthetic_map(scene);
  ASSERT_LT(map.observation_count(), 4 * map.frame_count());
  MeasurementNoise start;
  start.pixel_px = 0.75;
  const MeasurementNoise noise = estimated_noise(map, start);
  EXPECT_EQ(noise.pixel_px, start.pixel_px);
  EXPECT_EQ(noise.depth_quadratic, start.depth_quadratic);
}

TEST(EstimateCovariances, RefuseNoiseThatIsNone) {
  CovarianceOptions options;
  options.noise.emplace().pixel_px = -1.0;
  EXPECT_THROW(estimate_covariances(LandmarkMap(), options), Error);
}

TEST(MeasurementNoise, NamesTheFieldThatIsWrong) {
  MeasurementNoise noise;
  noise.pixel_px = 0.0;
  EXPECT_THROW(noise.validate(), Error);
  noise = {};
  noise.octave_scale = 0.5;
  EXPECT_THROW(noise.validate(), Error);
}

}  // namespace
}  // namespace cairn
