// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/map/synthetic.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/LU>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/error.hpp"
#include "cairn/map/camera.hpp"

namespace cairn {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using ::testing::HasSubstr;

// Where all landmarks and observations are, bit by bit.
auto measured(const LandmarkMap& map) {
  std::vector<double> numbers;
  for (const Vector3d& position : map.landmarks().positions)
    numbers.insert(numbers.end(), position.begin(), position.end());
  for (const Pixel& pixel : map.observations().pixels)
    numbers.insert(numbers.end(), {pixel.u, pixel.v});
  return numbers;
}

const Vector3d& position(const LandmarkMap& map, std::size_t landmark) {
  return map.landmarks().positions[landmark];
}

double normalised_squared(const Vector3d& error, const Matrix3d& covariance) {
  return error.dot(covariance.inverse() * error);
}

// Mean of a chi-square of 3 degrees over a sample: 3, give or take four standard deviations.
void expect_calibrated(double sum, double largest, std::size_t count) {
  const double tolerance = 4.0 * std::sqrt(6.0 / static_cast<double>(count));
  EXPECT_NEAR(sum / static_cast<double>(count), 3.0, tolerance);
  EXPECT_LT(largest, 40.0);  // exceeded by one in 10^8
}

SyntheticOptions noiseless() {
  SyntheticOptions options;
  options.pixel_noise_px = 0.0;
  options.depth_noise_m = 0.0;
  return options;
}

TEST(Synthetic, SameSeedGivesSameBytes) {
  const SyntheticOptions one = {.seed = 7};
  const SyntheticOptions other = {.seed = 8};
  const auto numbers = measured(synthetic_map(one));
  EXPECT_EQ(measured(synthetic_map(one)), numbers);
  EXPECT_NE(measured(synthetic_map(other)), numbers);

  const SyntheticPair pair = synthetic_pair(one);
  const SyntheticPair again = synthetic_pair(one);
  EXPECT_EQ(measured(again.source), measured(pair.source));
  EXPECT_EQ(measured(again.target), measured(pair.target));
  EXPECT_EQ(again.shared, pair.shared);
  EXPECT_EQ(again.target_from_source.matrix(), pair.target_from_source.matrix());
}

TEST(Synthetic, MapSaysWhatItIs) {
  const LandmarkMap map = synthetic_map();
  EXPECT_EQ(map.info().length_unit, LengthUnit::kMetres);
  EXPECT_EQ(map.info().world_frame, "synthetic_desk");
  EXPECT_EQ(map.info().gravity, Vector3d(0.0, 0.0, -1.0));
  ASSERT_EQ(map.info().provenance.size(), 1U);
  EXPECT_THAT(map.info().provenance.front(), HasSubstr("seed 1, landmarks 3000, frames 60"));
  EXPECT_EQ(map.landmark_count(), SyntheticOptions{}.landmarks);
  EXPECT_EQ(map.frame_count(), SyntheticOptions{}.frames);
  EXPECT_TRUE(map.has_covariances());
  EXPECT_EQ(map.observations().depths.size(), map.observation_count());
  EXPECT_TRUE(map.observations().octaves.empty());
  EXPECT_TRUE(map.observations().keypoints.empty());
  for (std::size_t i = 0; i < map.landmark_count(); ++i) {
    ASSERT_EQ(map.landmarks().ids[i], LandmarkId{i});
  }
}

TEST(Synthetic, EveryMapHasAUuidOfItsOwn) {
  SyntheticOptions noisier;
  noisier.pixel_noise_px = 2.0;
  const SyntheticPair pair = synthetic_pair();
  std::set<std::string> uuids;
  for (const LandmarkMap& map :
       {synthetic_map(), synthetic_map(noisier), pair.source, pair.target}) {
    ASSERT_TRUE(map.info().uuid);
    EXPECT_THAT(*map.info().uuid,
                ::testing::MatchesRegex("[0-9a-f]{8}-[0-9a-f]{4}-8[0-9a-f]{3}-[89ab][0-9a-f]{3}-"
                                        "[0-9a-f]{12}"));
    uuids.insert(*map.info().uuid);
  }
  EXPECT_EQ(uuids.size(), 4U);
}

TEST(Synthetic, NoiseAndOutliersLeaveTheRestAlone) {
  SyntheticOptions options;
  const LandmarkMap map = synthetic_map(options);
  options.pixel_noise_px = 3.0;
  options.depth_noise_m = 0.01;
  options.outlier_fraction = 0.2;
  const LandmarkMap other = synthetic_map(options);
  EXPECT_EQ(other.frames().translations, map.frames().translations);
  EXPECT_EQ(other.frames().quaternions, map.frames().quaternions);
  EXPECT_EQ(other.observations().offsets, map.observations().offsets);
  EXPECT_EQ(other.observations().frames, map.observations().frames);
}

TEST(Synthetic, TruthMapsSharedLandmarksOntoEachOther) {
  for (const std::uint64_t seed : {1U, 2U, 3U}) {
    const SyntheticPair pair = synthetic_pair({.seed = seed});
    const Matrix3d rotation = pair.target_from_source.rotation();
    double sum = 0.0;
    double largest = 0.0;
    for (const auto& [source, target] : pair.shared) {
      const Vector3d error = pair.target_from_source * position(pair.source, source.value) -
                             position(pair.target, target.value);
      const Matrix3d covariance =
          rotation * *pair.source.covariance(source) * rotation.transpose() +
          *pair.target.covariance(target);
      const double squared = normalised_squared(error, covariance);
      sum += squared;
      largest = std::max(largest, squared);
    }
    expect_calibrated(sum, largest, pair.shared.size());
  }
}

TEST(Synthetic, TruthMapsGravityOntoGravity) {
  const SyntheticPair pair = synthetic_pair();
  const Matrix3d rotation = pair.target_from_source.rotation();
  EXPECT_LT((rotation * *pair.source.info().gravity - *pair.target.info().gravity).norm(), 1e-12);
  EXPECT_NE(pair.source.info().world_frame, pair.target.info().world_frame);
  EXPECT_LE(pair.target_from_source.translation().norm(), 3.0);
}

TEST(Synthetic, SessionsTakeDifferentPaths) {
  const SyntheticPair pair = synthetic_pair();
  double apart = 0.0;
  for (std::size_t i = 0; i < pair.source.frame_count(); ++i) {
    apart += (pair.target_from_source * pair.source.frames().translations[i] -
              pair.target.frames().translations[i])
                 .norm();
  }
  EXPECT_GT(apart / static_cast<double>(pair.source.frame_count()), 0.1);
}

TEST(Synthetic, CovariancesAreCalibratedAgainstTheTruth) {
  for (const double depth_noise_m : {0.003, 0.02}) {
    SyntheticOptions options;
    options.depth_noise_m = depth_noise_m;
    const LandmarkMap map = synthetic_map(options);
    const LandmarkMap truth = synthetic_map(noiseless());
    ASSERT_EQ(map.landmark_count(), truth.landmark_count());
    double sum = 0.0;
    double largest = 0.0;
    Vector3d bias = Vector3d::Zero();
    for (std::uint32_t i = 0; i < map.landmark_count(); ++i) {
      const Vector3d error = position(map, i) - position(truth, i);
      const double squared = normalised_squared(error, *map.covariance(LandmarkIndex{i}));
      sum += squared;
      largest = std::max(largest, squared);
      bias += error / static_cast<double>(map.landmark_count());
    }
    expect_calibrated(sum, largest, map.landmark_count());
    EXPECT_LT(bias.norm(), 0.1 * depth_noise_m);
  }
}

TEST(Synthetic, NoiseInDepthOrPixelAloneIsCalibratedToo) {
  for (const bool pixel_only : {true, false}) {
    SyntheticOptions options = noiseless();
    (pixel_only ? options.pixel_noise_px : options.depth_noise_m) = pixel_only ? 0.7 : 0.003;
    const LandmarkMap map = synthetic_map(options);
    const LandmarkMap truth = synthetic_map(noiseless());
    // The direction without noise adds nothing; with one observation two, or one, are left.
    double sum = 0.0;
    std::size_t count = 0;
    for (std::uint32_t i = 0; i < map.landmark_count(); ++i) {
      if (map.observation_count(LandmarkIndex{i}) != 1) continue;
      const Vector3d error = position(map, i) - position(truth, i);
      sum += normalised_squared(error, *map.covariance(LandmarkIndex{i}));
      ++count;
    }
    ASSERT_GT(count, 300U);
    EXPECT_NEAR(sum / static_cast<double>(count), pixel_only ? 2.0 : 1.0, 0.4);
  }
}

TEST(Synthetic, NoNoiseGivesExactPositions) {
  const LandmarkMap map = synthetic_map(noiseless());
  const Camera& camera = map.cameras().front();
  for (std::uint32_t i = 0; i < map.landmark_count(); ++i) {
    const LandmarkIndex landmark{i};
    ASSERT_EQ(*map.covariance(landmark), Matrix3d::Zero());
    for (std::size_t j = 0; j < map.observation_count(landmark); ++j) {
      const Rigid3 pose = map.world_from_camera(map.observing_frames(landmark)[j]);
      const Vector3d x_in_camera = pose.inverse() * position(map, i);
      const Pixel observed = map.observed_pixels(landmark)[j];
      const auto pixel = project(camera, x_in_camera);
      ASSERT_TRUE(pixel);
      ASSERT_NEAR(pixel->u, observed.u, 1e-9);
      ASSERT_NEAR(pixel->v, observed.v, 1e-9);
      const auto row = map.observations().offsets[i] + j;
      ASSERT_NEAR(*map.observations().depths[row], x_in_camera.z(), 1e-12);
    }
  }
  const SyntheticPair pair = synthetic_pair(noiseless());
  for (const auto& [source, target] : pair.shared) {
    ASSERT_LT((pair.target_from_source * position(pair.source, source.value) -
               position(pair.target, target.value))
                  .norm(),
              1e-12);
  }
}

TEST(Synthetic, ObservationsReprojectIntoTheImage) {
  const SyntheticOptions options;
  const SyntheticPair pair = synthetic_pair(options);
  for (const LandmarkMap& map : {pair.source, pair.target}) {
    const Camera& camera = map.cameras().front();
    double squared_px2 = 0.0;
    for (std::uint32_t i = 0; i < map.landmark_count(); ++i) {
      const LandmarkIndex landmark{i};
      ASSERT_GE(map.observation_count(landmark), 1U);
      for (std::size_t j = 0; j < map.observation_count(landmark); ++j) {
        const FrameIndex frame = map.observing_frames(landmark)[j];
        ASSERT_TRUE(j == 0 || map.observing_frames(landmark)[j - 1] < frame);
        const auto pixel =
            project(camera, map.world_from_camera(frame).inverse() * position(map, i));
        ASSERT_TRUE(pixel) << "landmark " << i << " is behind frame " << frame.value;
        const Pixel observed = map.observed_pixels(landmark)[j];
        const double error = std::hypot(pixel->u - observed.u, pixel->v - observed.v);
        ASSERT_LT(error, 10.0 * options.pixel_noise_px);
        squared_px2 += error * error;
        ASSERT_GT(observed.u, 0.0);
        ASSERT_GT(observed.v, 0.0);
        ASSERT_LT(observed.u, camera.width - 1.0);
        ASSERT_LT(observed.v, camera.height - 1.0);
        const double depth = *map.observations().depths[map.observations().offsets[i] + j];
        ASSERT_GT(depth, 0.3);
        ASSERT_LT(depth, 4.0);
      }
    }
    const double rms = std::sqrt(squared_px2 / static_cast<double>(map.observation_count()));
    EXPECT_LT(rms, 1.5 * options.pixel_noise_px);
    EXPECT_GT(rms, 0.5 * options.pixel_noise_px);
  }
}

TEST(Synthetic, CountsLookLikeARealMaps) {
  for (const std::uint64_t seed : {1U, 2U, 3U, 4U, 5U}) {
    const LandmarkMap map = synthetic_map({.seed = seed});
    std::size_t twice = 0;
    std::size_t observations_of_twice = 0;
    std::size_t up_to_three = 0;
    std::size_t most = 0;
    for (std::uint32_t i = 0; i < map.landmark_count(); ++i) {
      const std::size_t count = map.observation_count(LandmarkIndex{i});
      twice += count >= 2 ? 1 : 0;
      observations_of_twice += count >= 2 ? count : 0;
      up_to_three += count <= 3 ? 1 : 0;
      most = std::max(most, count);
    }
    const auto total = static_cast<double>(map.landmark_count());
    EXPECT_GT(static_cast<double>(twice) / total, 0.6);
    EXPECT_LT(static_cast<double>(twice) / total, 0.9);
    EXPECT_GT(static_cast<double>(up_to_three) / total, 0.35);
    const double mean = static_cast<double>(observations_of_twice) / static_cast<double>(twice);
    EXPECT_GT(mean, 4.0);
    EXPECT_LT(mean, 6.5);
    EXPECT_GE(most, 15U);
    EXPECT_LE(most, 60U);
  }
}

// Spreads over desk and surroundings, and the camera keeps its distance.
TEST(Synthetic, SceneHasTheSizeOfADesk) {
  for (const std::uint64_t seed : {1U, 2U, 3U, 4U, 5U}) {
    const LandmarkMap map = synthetic_map({.seed = seed});
    std::vector<double> x;
    std::vector<double> depths;
    for (const Vector3d& p : map.landmarks().positions) x.push_back(p.x());
    for (const auto& depth : map.observations().depths) depths.push_back(*depth);
    std::sort(x.begin(), x.end());
    std::sort(depths.begin(), depths.end());
    const double width = x[x.size() * 95 / 100] - x[x.size() * 5 / 100];
    EXPECT_GT(width, 0.7);
    EXPECT_LT(width, 2.0);
    EXPECT_GT(depths[depths.size() / 2], 0.6);
    EXPECT_LT(depths[depths.size() / 2], 1.6);
    for (const Vector3d& centre : map.frames().translations) {
      double nearest = std::numeric_limits<double>::max();
      for (const Vector3d& p : map.landmarks().positions) {
        nearest = std::min(nearest, (p - centre).norm());
      }
      ASSERT_GT(nearest, 0.2);
      ASSERT_LT(nearest, 1.5);
    }
    for (std::size_t i = 1; i < map.frame_count(); ++i) {
      const auto& centres = map.frames().translations;
      ASSERT_LT((centres[i] - centres[i - 1]).norm(), 0.2);
    }
  }
}

// In a small piece of the image there is one surface, but where an edge crosses it.
TEST(Synthetic, NothingIsSeenThroughSomethingElse) {
  SyntheticOptions options = noiseless();
  options.landmarks = 60'000;
  options.frames = 1;
  for (const std::uint64_t seed : {1U, 2U, 3U}) {
    options.seed = seed;
    const LandmarkMap map = synthetic_map(options);
    const ObservationTable& observations = map.observations();
    constexpr double kPiecePixels = 4.0;
    std::map<std::pair<int, int>, double> nearest;
    const auto piece = [&](const Pixel& pixel) {
      return std::pair(static_cast<int>(pixel.u / kPiecePixels),
                       static_cast<int>(pixel.v / kPiecePixels));
    };
    for (std::size_t i = 0; i < map.observation_count(); ++i) {
      const double depth = *observations.depths[i];
      double& least = nearest.try_emplace(piece(observations.pixels[i]), depth).first->second;
      least = std::min(least, depth);
    }
    double behind = 0.0;
    for (std::size_t i = 0; i < map.observation_count(); ++i) {
      if (*observations.depths[i] > nearest.at(piece(observations.pixels[i])) + 0.03) behind += 1.0;
    }
    EXPECT_LT(behind / static_cast<double>(map.observation_count()), 0.05);
  }
}

TEST(Synthetic, OverlapIsTheShareOfCommonPoints) {
  for (const double overlap : {0.0, 0.3, 1.0}) {
    SyntheticOptions options;
    options.overlap = overlap;
    const SyntheticPair pair = synthetic_pair(options);
    const auto wanted = static_cast<double>(options.landmarks);
    EXPECT_NEAR(static_cast<double>(pair.source.landmark_count()), wanted, 1.0);
    EXPECT_NEAR(static_cast<double>(pair.target.landmark_count()), wanted, 1.0);
    EXPECT_NEAR(static_cast<double>(pair.shared.size()), overlap * wanted, 1.0);
    EXPECT_TRUE(std::is_sorted(pair.shared.begin(), pair.shared.end()));
  }
}

TEST(Synthetic, OutliersAreAsManyAsAskedForAndNotShared) {
  SyntheticOptions options;
  options.outlier_fraction = 0.2;
  const LandmarkMap map = synthetic_map(options);
  const LandmarkMap clean = synthetic_map();
  double outliers = 0.0;
  for (std::uint32_t i = 0; i < map.landmark_count(); ++i) {
    ASSERT_EQ(*map.covariance(LandmarkIndex{i}), *clean.covariance(LandmarkIndex{i}));
    if (position(map, i) != position(clean, i)) outliers += 1.0;
  }
  const auto total = static_cast<double>(map.landmark_count());
  EXPECT_NEAR(outliers / total, options.outlier_fraction, 0.03);

  const SyntheticPair pair = synthetic_pair(options);
  const double inliers = 1.0 - options.outlier_fraction;
  EXPECT_NEAR(static_cast<double>(pair.shared.size()) / total, options.overlap * inliers * inliers,
              0.03);
  for (const auto& [source, target] : pair.shared) {
    ASSERT_LT((pair.target_from_source * position(pair.source, source.value) -
               position(pair.target, target.value))
                  .norm(),
              0.1);
  }
}

TEST(Synthetic, OneFrameOrOneLandmarkIsEnough) {
  SyntheticOptions options;
  options.frames = 1;
  const SyntheticPair pair = synthetic_pair(options);
  EXPECT_EQ(pair.source.frame_count(), 1U);
  EXPECT_EQ(pair.target.observation_count(), pair.target.landmark_count());
  options.landmarks = 1;
  EXPECT_EQ(synthetic_map(options).landmark_count(), 1U);
}

TEST(Synthetic, RefusesBadOptionsByName) {
  const auto refused = [](const SyntheticOptions& options) -> std::string {
    try {
      (void)synthetic_pair(options);
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::kMisuse);
      return error.what();
    }
    return "accepted";
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(refused({.landmarks = 0}), HasSubstr("SyntheticOptions.landmarks"));
  EXPECT_THAT(refused({.landmarks = std::size_t{1} << 33}),
              HasSubstr("SyntheticOptions.landmarks"));
  EXPECT_THAT(refused({.frames = 0}), HasSubstr("SyntheticOptions.frames"));
  EXPECT_THAT(refused({.frames = 1'000'001}), HasSubstr("SyntheticOptions.frames"));
  for (const double bad : {-0.1, nan, 1e9}) {
    EXPECT_THAT(refused({.pixel_noise_px = bad}), HasSubstr("SyntheticOptions.pixel_noise_px"));
    EXPECT_THAT(refused({.depth_noise_m = bad}), HasSubstr("SyntheticOptions.depth_noise_m"));
    EXPECT_THAT(refused({.overlap = bad}), HasSubstr("SyntheticOptions.overlap"));
    EXPECT_THAT(refused({.outlier_fraction = bad}), HasSubstr("SyntheticOptions.outlier_fraction"));
  }
  EXPECT_NO_THROW(SyntheticOptions{}.validate());
}

}  // namespace
}  // namespace cairn
