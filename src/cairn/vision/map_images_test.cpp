// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/map_images.hpp"

#include <cstring>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/error.hpp"
#include "cairn/vision/detail/described_image.hpp"

#include "support/textured_wall.hpp"

namespace cairn {
namespace {

using ::testing::HasSubstr;
using testing::TexturedWall;

GrayImage wall_image(int right) {
  const cv::Mat gray = TexturedWall().gray(right);
  GrayImage image(640, 480);
  std::memcpy(image.values.data(), gray.data, image.values.size());
  return image;
}

Rigid3 wall_pose(int right) {
  return {Eigen::Quaterniond::Identity(),
          Eigen::Vector3d(right * TexturedWall::kMetresPerPixel, 0.0, 0.0)};
}

// Two frames of the wall, and where both see the same of its features; without descriptors.
MapTables seen_wall() {
  constexpr int kWay = 30;
  const detail::SiftFeatures features = detail::sift_features(TexturedWall().gray(0), 1500, true);
  const Camera camera = TexturedWall::camera();
  MapTables tables;
  tables.cameras = {camera};
  for (const int right : {0, kWay}) {
    tables.frames.ids.push_back(FrameId{10 + tables.frames.ids.size()});
    tables.frames.translations.push_back(wall_pose(right).translation());
    tables.frames.quaternions.push_back({1.0, 0.0, 0.0, 0.0});
    tables.frames.image_names.push_back(right == 0 ? "left.png" : "right.png");
  }
  tables.frames.cameras.resize(2);
  tables.frames.cameras[0] = CameraIndex{0};
  tables.frames.cameras[1] = CameraIndex{0};
  ObservationTable& observations = tables.observations;
  observations.offsets = {0};
  for (const cv::KeyPoint& keypoint : features.keypoints) {
    const Pixel pixel{keypoint.pt.x, keypoint.pt.y};
    if (pixel.u < kWay) continue;
    tables.landmarks.ids.push_back(LandmarkId{tables.landmarks.ids.size()});
    const Eigen::Vector3d ray = *unproject(camera, pixel);
    tables.landmarks.positions.emplace_back(TexturedWall::kDepthM / ray.z() * ray);
    for (const std::uint32_t frame : {0U, 1U}) {
      observations.frames.push_back(FrameIndex{frame});
      observations.pixels.push_back({pixel.u - frame * kWay, pixel.v});
    }
    observations.offsets.push_back(observations.frames.size());
  }
  observations.depths.resize(observations.frames.size());
  observations.octaves.resize(observations.frames.size());
  observations.octaves[0] = 0;
  observations.depths[0] = TexturedWall::kDepthM;
  return tables;
}

std::string message_of(const auto& call) {
  try {
    call();
  } catch (const Error& error) {
    return error.what();
  }
  return "no error";
}

TEST(WithFrames, KeepsHowImagesSawTheLandmarks) {
  MapTables tables;
  tables.cameras = {TexturedWall::camera()};
  for (std::uint64_t i = 0; i < 3; ++i) {
    tables.landmarks.ids.push_back(LandmarkId{i});
    tables.landmarks.positions.emplace_back(0.1 * static_cast<double>(i), 0.0, 2.0);
  }
  tables.landmarks.descriptors = DescriptorColumn{
      .kind = "SIFT", .bytes_each = 2, .known = {1, 1, 0}, .bytes = {1, 2, 3, 4, 0, 0}};
  ImageLocation seen;
  seen.located = true;
  seen.world_from_camera = Rigid3();
  seen.camera = TexturedWall::camera();
  seen.matches = {{{10, 10}, LandmarkIndex{1}}, {{20, 10}, LandmarkIndex{2}}};
  seen.descriptors = {9, 9, 7, 7};
  const auto views_of = [](const LandmarkMap& map, std::size_t landmark) {
    std::vector<std::vector<int>> views;
    const DescriptorColumn& column = *map.landmarks().descriptors;
    for (std::size_t k = 0; k < column.count(landmark); ++k) {
      const auto bytes = column.descriptor(landmark, k);
      views.emplace_back(bytes.begin(), bytes.end());
    }
    return views;
  };
  using ::testing::ElementsAre;
  const LandmarkMap map = with_frames(LandmarkMap(tables), {{{"new.png", seen}}});
  EXPECT_THAT(views_of(map, 0), ElementsAre(ElementsAre(1, 2)));
  EXPECT_THAT(views_of(map, 1), ElementsAre(ElementsAre(3, 4), ElementsAre(9, 9)));
  EXPECT_THAT(views_of(map, 2), ElementsAre(ElementsAre(7, 7)));
  // An image without descriptors, as of a caller's own search.
  seen.descriptors.clear();
  const LandmarkMap without = with_frames(LandmarkMap(tables), {{{"new.png", seen}}});
  EXPECT_THAT(views_of(without, 1), ElementsAre(ElementsAre(3, 4)));
}

TEST(WithImageDescriptors, LetImagesBeLocatedInAMapThatHadNone) {
  const LandmarkMap bare(seen_wall());
  const auto image_of = [](FrameIndex frame) -> std::optional<GrayImage> {
    return wall_image(frame.value == 0 ? 0 : 30);
  };
  const LandmarkMap map = with_image_descriptors(bare, image_of);
  const DescriptorColumn& column = *map.landmarks().descriptors;
  EXPECT_EQ(column.kind, "SIFT");
  const auto known = std::count(column.known.begin(), column.known.end(), 1);
  EXPECT_GT(known, static_cast<std::ptrdiff_t>(0.95 * static_cast<double>(bare.landmark_count())));
  EXPECT_EQ(map.landmarks().positions, bare.landmarks().positions);
  const ImageLocation found = ImageLocator(map, TexturedWall::camera()).locate(wall_image(80));
  ASSERT_TRUE(found.located) << found.reason;
  EXPECT_LT(found.world_from_camera->difference_to(wall_pose(80)).head<3>().norm(), 0.004);
}

TEST(WithImageDescriptors, AreTheSameForAnyNumberOfThreads) {
  const LandmarkMap bare(seen_wall());
  const auto image_of = [](FrameIndex frame) -> std::optional<GrayImage> {
    return wall_image(frame.value == 0 ? 0 : 30);
  };
  const LandmarkMap one = with_image_descriptors(bare, image_of);
  const LandmarkMap two = with_image_descriptors(bare, image_of, {Executor(2), {}, {}});
  EXPECT_EQ(one.landmarks().descriptors->bytes, two.landmarks().descriptors->bytes);
  EXPECT_EQ(one.landmarks().descriptors->further, two.landmarks().descriptors->further);
}

TEST(WithImageDescriptors, KnowNothingOfFramesWithoutImagesAndRefuseOtherSizes) {
  const LandmarkMap bare(seen_wall());
  const LandmarkMap none =
      with_image_descriptors(bare, [](FrameIndex) { return std::optional<GrayImage>(); });
  EXPECT_THAT(none.landmarks().descriptors->known, ::testing::Each(0));
  EXPECT_THAT(message_of([&] {
                with_image_descriptors(
                    bare, [](FrameIndex) { return std::optional(GrayImage(320, 240, 90)); });
              }),
              HasSubstr("'left.png': 320 x 240 pixels"));
}

TEST(WithFrames, HaveTheImagesPosesAndMatches) {
  MapTables tables = seen_wall();
  const LandmarkMap map = with_image_descriptors(
      LandmarkMap(std::move(tables)),
      [](FrameIndex frame) { return std::optional(wall_image(frame.value == 0 ? 0 : 30)); });
  const ImageLocator locator(map, TexturedWall::camera());
  Camera other = TexturedWall::camera();
  other.model = "SIMPLE_PINHOLE";
  other.parameters = {TexturedWall::kFocal, 319.5, 239.5};
  const std::vector<LocatedImage> images = {
      {"new.png", locator.locate(wall_image(60))},
      {"other.png", locator.with_camera(other).locate(wall_image(90))}};
  const LandmarkMap bigger = with_frames(map, images);
  ASSERT_EQ(bigger.frame_count(), 4U);
  EXPECT_EQ(bigger.frames().ids[2], FrameId{12});
  EXPECT_EQ(bigger.frames().ids[3], FrameId{13});
  EXPECT_EQ(bigger.frames().image_names[3], "other.png");
  ASSERT_EQ(bigger.cameras().size(), 2U);
  EXPECT_EQ(bigger.frames().cameras[2]->value, 0U);
  EXPECT_EQ(bigger.frames().cameras[3]->value, 1U);
  EXPECT_NE(bigger.cameras()[0].id, bigger.cameras()[1].id);
  EXPECT_EQ(bigger.world_from_camera(FrameIndex{2}).matrix(),
            images[0].location.world_from_camera->matrix());
  EXPECT_EQ(bigger.landmarks().positions, map.landmarks().positions);
  EXPECT_EQ(bigger.observation_count(), map.observation_count() +
                                            images[0].location.matches.size() +
                                            images[1].location.matches.size());
  EXPECT_EQ(bigger.observations().depths[0], TexturedWall::kDepthM);
  for (const ImageMatch& match : images[1].location.matches) {
    EXPECT_EQ(bigger.observing_frames(match.landmark).back().value, 3U);
    EXPECT_EQ(bigger.observed_pixels(match.landmark).back().u, match.pixel.u);
    const std::size_t row = bigger.observations().offsets[match.landmark.value + 1] - 1;
    EXPECT_EQ(bigger.observations().octaves[row], match.octave);
    EXPECT_EQ(bigger.observations().depths[row], match.depth_m);
  }
}

TEST(WithFrames, RefuseImagesWithoutAPoseAndNamesThatAreTaken) {
  const LandmarkMap map(seen_wall());
  LocatedImage elsewhere{"new.png", {}};
  elsewhere.location.world_from_camera = wall_pose(0);
  elsewhere.location.camera = TexturedWall::camera();
  elsewhere.location.matches = {
      {{1.0, 2.0}, LandmarkIndex{static_cast<std::uint32_t>(map.landmark_count())}}};
  EXPECT_THAT(message_of([&] { with_frames(map, std::vector{elsewhere}); }),
              HasSubstr("expected an image that was located in this map"));
  EXPECT_THAT(message_of([&] {
                with_frames(map, std::vector{LocatedImage{"new.png", {}}});
              }),
              HasSubstr("'new.png': is not located"));
  LocatedImage known{"left.png", {}};
  known.location.world_from_camera = wall_pose(0);
  known.location.camera = TexturedWall::camera();
  EXPECT_THAT(message_of([&] { with_frames(map, std::vector{known}); }),
              HasSubstr("'left.png': is the name of an image of the map, or given twice; expected "
                        "each image once; an image of another session under another name"));
}

}  // namespace
}  // namespace cairn
