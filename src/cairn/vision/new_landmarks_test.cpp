// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cstring>
#include <functional>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>

#include "cairn/core/error.hpp"
#include "cairn/map/operations.hpp"
#include "cairn/vision/map_images.hpp"

#include "support/refusal.hpp"
#include "support/textured_wall.hpp"

namespace cairn {
namespace {

using ::testing::HasSubstr;
using testing::message_of;
using testing::TexturedWall;

// Far enough to the right for lines of sight that differ by 2 degrees.
constexpr int kStep = 24;

Rigid3 pose_at(int right, double unit) {
  return {Eigen::Quaterniond::Identity(),
          unit * TexturedWall::kMetresPerPixel * Eigen::Vector3d(right, 0.0, 0.0)};
}

// A map whose frames see the wall, and which has few landmarks: none, or those of some pixels.
LandmarkMap wall_map(int frames, double unit = 1.0, const std::vector<Pixel>& known = {}) {
  MapTables tables;
  tables.info.length_unit = LengthUnit::kFree;
  tables.cameras = {TexturedWall::camera()};
  DescriptorColumn descriptors{.kind = "ORB", .bytes_each = 32, .known = {}, .bytes = {}};
  for (int k = 0; k < frames; ++k) {
    const Rigid3 pose = pose_at(k * kStep, unit);
    tables.frames.ids.push_back(FrameId{static_cast<std::uint64_t>(k)});
    tables.frames.translations.push_back(pose.translation());
    tables.frames.quaternions.push_back({1.0, 0.0, 0.0, 0.0});
    tables.frames.cameras.push_back(CameraIndex{0});
  }
  tables.observations.offsets = {0};
  for (const Pixel& pixel : known) {
    tables.landmarks.ids.push_back(LandmarkId{tables.landmarks.ids.size() + 7});
    tables.landmarks.positions.push_back(unit * TexturedWall::kDepthM *
                                         *unproject(TexturedWall::camera(), pixel));
    descriptors.known.push_back(1);
    descriptors.bytes.resize(descriptors.bytes.size() + 32, 85);
    tables.observations.frames.push_back(FrameIndex{0});
    tables.observations.pixels.push_back(pixel);
    tables.observations.offsets.push_back(tables.observations.frames.size());
  }
  tables.landmarks.descriptors = std::move(descriptors);
  return LandmarkMap(std::move(tables));
}

struct Images {
  std::vector<FrameIndex> frames;
  std::vector<ColorImage> images;
};

Images images_of(int frames) {
  Images all;
  for (int k = 0; k < frames; ++k) {
    cv::Mat color;
    cv::cvtColor(TexturedWall().gray(k * kStep), color, cv::COLOR_GRAY2BGR);
    ColorImage image(640, 480);
    std::memcpy(image.values.data(), color.data, image.values.size());
    all.frames.push_back(FrameIndex{static_cast<std::uint32_t>(k)});
    all.images.push_back(std::move(image));
  }
  return all;
}

LandmarkMap grown(const LandmarkMap& map, const Images& all, const Execution& execution = {}) {
  return with_new_landmarks(
      map, all.frames, [&](FrameIndex frame) { return all.images[frame.value]; }, {}, execution);
}

TEST(WithNewLandmarks, FindsWhatTheImagesShowOfTheWall) {
  for (const double unit : {1.0, 0.01, 300.0}) {
    const LandmarkMap map = grown(wall_map(5, unit, {{100, 100}}), images_of(5));
    ASSERT_GT(map.landmark_count(), 200U) << unit;
    EXPECT_EQ(map.landmarks().ids[1], LandmarkId{8});
    std::size_t by_three = 0;
    std::size_t right = 0;
    for (std::uint32_t i = 1; i < map.landmark_count(); ++i) {
      const double off = map.landmarks().positions[i].z() / unit - TexturedWall::kDepthM;
      EXPECT_LT(std::abs(off), 0.12 * TexturedWall::kDepthM) << "two degrees, a coarse octave";
      right += std::abs(off) < 0.02 * TexturedWall::kDepthM ? 1 : 0;
      const auto frames = map.observing_frames(LandmarkIndex{i});
      EXPECT_GE(frames.size(), 2U);
      by_three += frames.size() >= 3 ? 1 : 0;
      const auto pixels = map.observed_pixels(LandmarkIndex{i});
      for (std::size_t k = 0; k < frames.size(); ++k) {
        const auto seen =
            project(TexturedWall::camera(),
                    map.world_from_camera(frames[k]).inverse() * map.landmarks().positions[i]);
        ASSERT_TRUE(seen);
        EXPECT_LT(std::hypot(seen->u - pixels[k].u, seen->v - pixels[k].v), 8.0);
      }
      EXPECT_GT(map.landmarks().descriptors->count(i), 0U);
      EXPECT_TRUE(map.landmarks().colors[i]);
    }
    EXPECT_GT(by_three, map.landmark_count() / 3);
    EXPECT_GT(right, map.landmark_count() * 2 / 3);
  }
}

TEST(WithNewLandmarks, KeepsWhatTheMapHas) {
  const Images images = images_of(3);
  const LandmarkMap once = grown(wall_map(3), images);
  const LandmarkMap twice = grown(once, images);
  // A feature that is no landmark's may be found again, at another octave.
  EXPECT_LT(twice.landmark_count() - once.landmark_count(), once.landmark_count() / 20);
  for (std::uint32_t i = 0; i < once.landmark_count(); ++i) {
    EXPECT_EQ(twice.landmarks().ids[i], once.landmarks().ids[i]);
    EXPECT_EQ(twice.landmarks().positions[i], once.landmarks().positions[i]);
  }
  EXPECT_NE(once.info().uuid, wall_map(3).info().uuid);
}

TEST(WithNewLandmarks, FindsNothingInOneImageOrInImagesFromOnePlace) {
  const LandmarkMap map = wall_map(1, 1.0, {{100, 100}});
  EXPECT_EQ(grown(map, images_of(1)).landmark_count(), 1U);
  MapTables tables = wall_map(2, 1.0, {{100, 100}}).tables();
  tables.frames.translations[1] = tables.frames.translations[0];
  const LandmarkMap still(std::move(tables));
  Images images = images_of(2);
  images.images[1] = images.images[0];
  EXPECT_EQ(grown(still, images).landmark_count(), 1U);
}

// The pose of the second image says that it shows other places.
TEST(WithNewLandmarks, FindsHardlyAnythingAtWrongPoses) {
  MapTables tables = wall_map(2, 1.0, {{100, 100}}).tables();
  tables.frames.translations[1] += Eigen::Vector3d(0.0, 0.3, 0.0);
  EXPECT_LT(grown(LandmarkMap(std::move(tables)), images_of(2)).landmark_count(), 5U);
}

TEST(WithNewLandmarks, IsTheSameInAnyOrderOfTheImages) {
  const LandmarkMap map = wall_map(4);
  Images images = images_of(4);
  const LandmarkMap forth = grown(map, images);
  std::ranges::reverse(images.frames);
  const LandmarkMap back = grown(map, images);
  ASSERT_EQ(back.landmark_count(), forth.landmark_count());
  for (const Eigen::Vector3d& x : forth.landmarks().positions) {
    EXPECT_TRUE(std::ranges::any_of(back.landmarks().positions, [&](const Eigen::Vector3d& other) {
      return (other - x).norm() < 1e-9;
    }));
  }
}

TEST(WithNewLandmarks, IsTheSameWithAnyNumberOfThreads) {
  const LandmarkMap map = wall_map(4);
  const auto images = images_of(4);
  const LandmarkMap one = grown(map, images);
  const LandmarkMap two = grown(map, images, {.executor = Executor(2)});
  EXPECT_EQ(one.info().uuid, two.info().uuid);
}

TEST(WithNewLandmarks, RefusesOtherImagesAndDescriptors) {
  const Images small = {{FrameIndex{0}}, {ColorImage(320, 240)}};
  EXPECT_THAT(message_of(ErrorKind::kInput, [&] { grown(wall_map(1), small); }),
              HasSubstr("320 x 240 pixels"));
  MapTables tables = wall_map(1).tables();
  tables.landmarks.descriptors.reset();
  const LandmarkMap bare(std::move(tables));
  EXPECT_THAT(message_of(ErrorKind::kInput, [&] { grown(bare, images_of(1)); }),
              HasSubstr("descriptors"));
  Images twice = images_of(1);
  twice.frames.push_back(FrameIndex{0});
  EXPECT_THAT(message_of(ErrorKind::kMisuse, [&] { grown(wall_map(1), twice); }),
              HasSubstr("each once, below 1"));
  twice.frames = {FrameIndex{7}};
  EXPECT_THAT(message_of(ErrorKind::kMisuse, [&] { grown(wall_map(1), twice); }),
              HasSubstr("frames: 7"));
}

// What one program observed outside the image, another must not trip over.
TEST(WithNewLandmarks, TakesObservationsOutsideTheImage) {
  const LandmarkMap map = wall_map(2, 1.0, {{1e6, 1e6}, {-5e6, 3.0}, {640.0, 480.0}});
  EXPECT_GT(grown(map, images_of(2)).landmark_count(), 50U);
}

TEST(WithNewLandmarks, KnowsHowExactTheyAre) {
  MapTables tables = wall_map(4, 1.0, {{100, 100}}).tables();
  tables.landmarks.covariances = {1e-6 * Eigen::Matrix3d::Identity()};
  const LandmarkMap map = grown(LandmarkMap(std::move(tables)), images_of(4));
  double sum = 0.0;
  for (std::uint32_t i = 1; i < map.landmark_count(); ++i) {
    const double off = map.landmarks().positions[i].z() - TexturedWall::kDepthM;
    sum += off * off / map.landmarks().covariances[i](2, 2);
  }
  const double mean = sum / static_cast<double>(map.landmark_count() - 1);
  EXPECT_LT(mean, 1.5);
  EXPECT_GT(mean, 0.02) << "corners of exact images are better than a pixel";
}

}  // namespace
}  // namespace cairn
