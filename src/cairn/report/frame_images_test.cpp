// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/report/frame_images.hpp"

#include <cmath>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/error.hpp"
#include "cairn/map/camera.hpp"
#include "cairn/report/detail/map_builder.hpp"
#include "cairn/vision/image.hpp"
#include "cairn/vision/sequence.hpp"

#include "support/temporary_folder.hpp"

namespace cairn::report {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using testing::TemporaryFolder;

// Frames at these times, of one camera if there is one.
LandmarkMap map_at(const std::vector<std::optional<double>>& times,
                   const std::optional<Camera>& camera = std::nullopt) {
  MapTables tables;
  if (camera) tables.cameras = {*camera};
  for (const auto& time : times) {
    tables.frames.ids.push_back(FrameId{tables.frames.ids.size()});
    tables.frames.translations.emplace_back(0.0, 0.0, 0.0);
    tables.frames.quaternions.push_back({1.0, 0.0, 0.0, 0.0});
    tables.frames.timestamps_s.push_back(time);
    if (camera) tables.frames.cameras.push_back(CameraIndex{0});
  }
  return LandmarkMap(std::move(tables));
}

// An image at each of these times, all of one grey that tells the time: 10 times it.
void write_sequence(const std::filesystem::path& folder, const std::vector<double>& times) {
  SequenceWriter writer(folder);
  for (const double time : times) {
    writer.add(time, ColorImage(64, 48, static_cast<std::uint8_t>(10.0 * time)),
               DepthImage(64, 48, 1.0F));
  }
  writer.finish();
}

ColorImage decoded(const TemporaryFolder& folder, const FrameImage& image) {
  EXPECT_EQ(image.type, ImageType::kJpeg);
  return read_color_image(
      folder.write("decoded.jpg", std::string(image.bytes.begin(), image.bytes.end())));
}

std::vector<std::size_t> frames_of_images(const std::vector<FrameImage>& images) {
  std::vector<std::size_t> frames;
  for (const FrameImage& image : images) frames.push_back(image.frame);
  return frames;
}

TEST(FrameImages, AreThoseNearestInTimeWithinHalfAnInterval) {
  const TemporaryFolder folder;
  write_sequence(folder / "s", {1, 2, 3, 4, 9, 10});
  const auto images =
      frame_images(map_at({0.4, 0.6, std::nullopt, 2.4, 2.6, 6.5, 8.9, 10.4, 10.6}), folder / "s");
  EXPECT_THAT(frames_of_images(images), ElementsAre(1, 3, 4, 6, 7));
  const int greys[] = {10, 20, 30, 90, 100};
  for (std::size_t i = 0; i < images.size(); ++i) {
    EXPECT_NEAR(decoded(folder, images[i]).at(5, 5), greys[i], 2) << i;
  }
}

TEST(FrameImages, AreSpreadEvenly) {
  const TemporaryFolder folder;
  std::vector<double> times;
  std::vector<std::optional<double>> frames;
  for (std::size_t i = 0; i < 2 * kMostFrameImages - 1; ++i) {
    times.push_back(static_cast<double>(i));
    frames.emplace_back(times.back());
  }
  write_sequence(folder / "s", times);
  const auto shown = frames_of_images(frame_images(map_at(frames), folder / "s"));
  ASSERT_EQ(shown.size(), kMostFrameImages);
  for (std::size_t i = 0; i < shown.size(); ++i) EXPECT_EQ(shown[i], 2 * i);
}

TEST(FrameImages, AreMadeSmaller) {
  const TemporaryFolder folder;
  SequenceWriter writer(folder / "s");
  ColorImage halves(960, 480);
  for (std::size_t i = 0; i < halves.values.size(); ++i) {
    halves.values[i] = (i / 3) % 960 < 480 ? 40 : 200;
  }
  writer.add(1.0, halves, DepthImage(960, 480, 1.0F));
  writer.finish();
  const ColorImage small = decoded(folder, frame_images(map_at({1.0}), folder / "s").front());
  EXPECT_EQ(small.width, 320U);
  EXPECT_EQ(small.height, 160U);
  EXPECT_NEAR(small.at(20, 80), 40, 3);
  EXPECT_NEAR(small.at(300, 80), 200, 3);
  write_sequence(folder / "small", {1.0});
  EXPECT_EQ(decoded(folder, frame_images(map_at({1.0}), folder / "small").front()).width, 64U);
}

// A landmark that the frame sees is where the image shows it, whatever lens and principal point are.
TEST(FrameImages, FillTheFrustumWithoutDistortion) {
  const TemporaryFolder folder;
  const Camera camera{
      CameraId{1}, "OPENCV", 1024, 768, {800.0, 820.0, 480.0, 416.0, 0.12, -0.2, 0.003, -0.002}};
  ColorImage places(1024, 768);  // each pixel holds its place / 4: blue the column, green the row
  for (std::size_t row = 0; row < places.height; ++row) {
    for (std::size_t column = 0; column < places.width; ++column) {
      places.values[3 * (row * places.width + column)] = static_cast<std::uint8_t>(column / 4);
      places.values[3 * (row * places.width + column) + 1] = static_cast<std::uint8_t>(row / 4);
    }
  }
  SequenceWriter writer(folder / "s");
  writer.add(1.0, places, DepthImage(1024, 768, 1.0F));
  writer.finish();
  const LandmarkMap map = map_at({1.0}, camera);
  const ColorImage small = decoded(folder, frame_images(map, folder / "s").front());
  ASSERT_EQ(small.width, kWidestFrameImage);
  const Frustum frustum = *detail::frustum_of(map);
  int unseen = 0;  // colours come back from JPEG only roughly
  int seen = 0;
  int far = 0;
  double off_by = 0.0;
  for (std::uint32_t row = 2; row + 2 < small.height; ++row) {
    for (std::uint32_t column = 2; column + 2 < small.width; ++column) {
      const double x = (2.0 * (column + 0.5) / small.width - 1.0) * frustum.half_width;
      const double y = (2.0 * (row + 0.5) / small.height - 1.0) * frustum.half_height;
      const auto pixel = project(camera, {x, y, 1.0});
      ASSERT_TRUE(pixel);
      const std::size_t at = std::size_t{3} * (row * small.width + column);
      const double u = pixel->u / 4.0;
      const double v = pixel->v / 4.0;
      if (u < -2.0 || v < -2.0 || u > 257.0 || v > 193.0) {
        ++unseen;
        continue;
      }
      if (u < 8.0 || v < 8.0 || u > 247.0 || v > 183.0) continue;
      for (const double off : {small.values[at] - u, small.values[at + 1] - v}) {
        off_by += std::abs(off);
        if (std::abs(off) > 8.0) ++far;
        ++seen;
      }
    }
  }
  EXPECT_LT(off_by / seen, 2.0);
  EXPECT_LT(far, seen / 1000);
  EXPECT_GT(unseen, 100) << "the principal point is off the middle";
}

TEST(FrameImages, ASequenceOfAnotherTimeIsRefusedWithBothRanges) {
  const TemporaryFolder folder;
  write_sequence(folder / "s", {1, 2});
  const auto message = [&](const LandmarkMap& map) {
    try {
      frame_images(map, folder / "s");
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::kInput);
      return std::string(error.what());
    }
    return std::string("no error");
  };
  EXPECT_THAT(message(map_at({17.25, std::nullopt, 11.5})),
              AllOf(HasSubstr((folder / "s").string()), HasSubstr("from 1.000 to 2.000 s"),
                    HasSubstr("from 11.500 to 17.250 s")));
  EXPECT_THAT(message(map_at({std::nullopt})), HasSubstr("these have no times"));
  EXPECT_THROW(frame_images(map_at({1.0}), folder / "nowhere"), Error);
}

TEST(FrameImages, ADamagedImageIsNamed) {
  const TemporaryFolder folder;
  write_sequence(folder / "s", {1});
  folder.write("s/rgb/1.000000.png", "text");
  try {
    frame_images(map_at({1.0}), folder / "s");
    FAIL();
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("1.000000.png"));
  }
}

}  // namespace
}  // namespace cairn::report
