// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/map/common_images.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/random.hpp"

namespace cairn {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::Pair;
using ::testing::SizeIs;

// An image and the keypoints of it that a map observes; keypoint k of image "x" is always at the same pixel.
struct Shown {
  std::string name;
  int content = 0;
  std::vector<int> keypoints;
};

Pixel pixel_of(int content, int keypoint) {
  Random random = Random(static_cast<std::uint64_t>(content)).fork(keypoint);
  return {random.uniform(0.0, 640.0), random.uniform(0.0, 480.0)};
}

// Landmark i is what keypoint i of each image shows.
LandmarkMap map_of(const std::vector<Shown>& images, int landmarks, double noise_px = 0.0,
                   bool with_times = false) {
  MapTables tables;
  tables.cameras.push_back({CameraId{1}, "PINHOLE", 640, 480, {500.0, 500.0, 320.0, 240.0}});
  for (std::uint32_t i = 0; i < images.size(); ++i) {
    tables.frames.ids.push_back(FrameId{i});
    tables.frames.translations.emplace_back(i, 0.0, 0.0);
    tables.frames.quaternions.push_back({1.0, 0.0, 0.0, 0.0});
    tables.frames.cameras.push_back(CameraIndex{0});
    tables.frames.image_names.push_back(images[i].name);
    if (with_times) tables.frames.timestamps_s.push_back(1.0 + i);
  }
  Random random(7);
  tables.observations.offsets.push_back(0);
  for (int l = 0; l < landmarks; ++l) {
    tables.landmarks.ids.push_back(LandmarkId{static_cast<std::uint64_t>(l)});
    tables.landmarks.positions.emplace_back(l, 0.0, 5.0);
    for (std::uint32_t i = 0; i < images.size(); ++i) {
      for (const int keypoint : images[i].keypoints) {
        if (keypoint != l) continue;
        Pixel pixel = pixel_of(images[i].content, keypoint);
        pixel.u += noise_px * random.normal();
        pixel.v += noise_px * random.normal();
        tables.observations.frames.push_back(FrameIndex{i});
        tables.observations.pixels.push_back(pixel);
      }
    }
    tables.observations.offsets.push_back(tables.observations.frames.size());
  }
  return LandmarkMap(std::move(tables));
}

std::vector<int> from_to(int begin, int end) {
  std::vector<int> all;
  for (int i = begin; i < end; ++i) all.push_back(i);
  return all;
}

CommonImages common(const LandmarkMap& a, const LandmarkMap& b) {
  const CommonImages result = common_images(MapImages(a), MapImages(b));
  // Whichever is first.
  const CommonImages turned = common_images(MapImages(b), MapImages(a));
  EXPECT_EQ(turned.same.size(), result.same.size());
  EXPECT_EQ(turned.landmarks.size(), result.landmarks.size());
  return result;
}

TEST(CommonImages, HaveOneNameAndOneContent) {
  const auto a = map_of({{"1.jpg", 1, from_to(0, 60)}, {"2.jpg", 2, from_to(0, 60)}}, 60);
  const auto b = map_of({{"2.jpg", 2, from_to(40, 100)}, {"3.jpg", 3, from_to(0, 100)}}, 100, 0.1);
  const CommonImages result = common(a, b);
  EXPECT_THAT(result.same, ElementsAre(Pair(FrameIndex{1}, FrameIndex{0})));
  ASSERT_THAT(result.landmarks, SizeIs(20));
  for (const auto& [first, second] : result.landmarks) EXPECT_EQ(first, second);
}

TEST(CommonImages, HaveAFewKeypointsThatAreExactlyTheSame) {
  const auto a = map_of({{"1.jpg", 1, from_to(0, 100)}}, 200);
  const auto with = [&](int shared, double noise_px) {
    return common(a, map_of({{"1.jpg", 1, from_to(100 - shared, 200)}}, 200, noise_px));
  };
  EXPECT_THAT(with(4, 0.0).same, SizeIs(1));
  EXPECT_THAT(with(4, 0.0).landmarks, SizeIs(4));
  EXPECT_THAT(with(3, 0.0).same, IsEmpty());
  EXPECT_THAT(with(4, 0.05).same, IsEmpty()) << "chance brings some near";
}

// Corner detectors give whole pixels, which coincide by chance.
TEST(CommonImages, AreNotKnownByAFewWholePixels) {
  const auto rounded = [](int content) {
    MapTables tables = map_of({{"1.jpg", content, from_to(0, 800)}}, 800).tables();
    for (Pixel& pixel : tables.observations.pixels) {
      pixel = {std::round(pixel.u) + 0.5, std::round(pixel.v) + 0.5};
    }
    return LandmarkMap(std::move(tables));
  };
  EXPECT_THAT(common(rounded(1), rounded(2)).same, IsEmpty());
  EXPECT_THAT(common(rounded(1), rounded(1)).same, SizeIs(1));
}

// As those of dense matchers, which describe the middle of each cell.
LandmarkMap on_cells(const LandmarkMap& map) {
  constexpr double kCell = 8.0;
  MapTables tables = LandmarkMap(map).tables();
  for (Pixel& pixel : tables.observations.pixels) {
    pixel = {kCell * std::floor(pixel.u / kCell) + 3.3, kCell * std::floor(pixel.v / kCell) + 3.3};
  }
  return LandmarkMap(std::move(tables));
}

TEST(CommonImages, AreNotKnownByCellsThatAnyImageHas) {
  const std::vector<int> many = from_to(0, 1500);
  for (const bool timed : {false, true}) {
    for (const char* name : {"a", "b", ""}) {
      const LandmarkMap first = on_cells(map_of({{"a", 1, many}}, 1500, 0.0, timed));
      const LandmarkMap second = on_cells(map_of({{name, 2, many}}, 1500, 0.0, timed));
      EXPECT_THAT(common(first, second).same, IsEmpty()) << name << timed;
    }
  }
  // Few keypoints in the same cells are no chance.
  const std::vector<int> few = from_to(0, 200);
  const LandmarkMap once = on_cells(map_of({{"a", 1, few}}, 200));
  EXPECT_THAT(common(once, on_cells(map_of({{"a", 1, few}}, 200))).same, SizeIs(1));
}

TEST(CommonImages, AreToldFromOthersOfOneName) {
  const auto a = map_of({{"1.jpg", 1, from_to(0, 200)}}, 200);
  const auto b = map_of({{"1.jpg", 9, from_to(0, 200)}}, 200);
  const CommonImages result = common(a, b);
  EXPECT_THAT(result.same, IsEmpty());
  EXPECT_THAT(result.landmarks, IsEmpty());
}

TEST(CommonImages, AreFoundInOtherFolders) {
  const auto a = map_of({{"left/1.jpg", 1, from_to(0, 60)},
                         {"right/1.jpg", 2, from_to(0, 60)},
                         {"left/2.jpg", 3, from_to(0, 60)}},
                        60);
  const auto b = map_of({{"2.jpg", 3, from_to(0, 15)}}, 60);
  EXPECT_THAT(common(a, b).same, ElementsAre(Pair(FrameIndex{2}, FrameIndex{0})));
  EXPECT_THAT(common(a, map_of({{"2.jpg", 3, from_to(0, 2)}}, 60)).same, IsEmpty()) << "too few";
  // One base name of another content is no contradiction: cameras number their images alike.
  const auto c = map_of({{"2.jpg", 8, from_to(0, 60)}}, 60);
  EXPECT_THAT(common(a, c).same, IsEmpty());
}

TEST(CommonImages, AreFoundByTheirKeypointsUnderOtherNames) {
  const auto a = map_of({{"1.jpg", 1, from_to(0, 60)}, {"2.jpg", 2, from_to(0, 60)}}, 60);
  const auto renamed = [&](int begin, double noise_px) {
    return map_of({{"frame_000.png", 2, from_to(begin, begin + 60)}}, 120, noise_px);
  };
  EXPECT_THAT(common(a, renamed(30, 0.0)).same, ElementsAre(Pair(FrameIndex{1}, FrameIndex{0})));
  EXPECT_THAT(common(a, renamed(45, 0.0)).same, IsEmpty()) << "too few";
  EXPECT_THAT(common(a, renamed(30, 0.1)).same, IsEmpty()) << "not exactly";
}

// Sessions number their images alike, and their clocks start at 0.
TEST(CommonImages, WithTimesAreKnownByTheseAndTheirKeypoints) {
  const auto timed = [](int content, const char* name, int begin, int end) {
    return map_of({{name, content, from_to(begin, end)}}, 60, 0.0, true);
  };
  const auto a = timed(1, "1.jpg", 0, 60);
  EXPECT_THAT(common(a, timed(1, "a/1.jpg", 0, 60)).landmarks, SizeIs(60)) << "a renamed copy";
  EXPECT_THAT(common(a, timed(1, "1.jpg", 50, 60)).same, SizeIs(1)) << "a part";
  EXPECT_THAT(common(a, timed(2, "1.jpg", 0, 60)).same, IsEmpty()) << "another session";
  MapTables later = timed(1, "1.jpg", 0, 60).tables();
  later.frames.timestamps_s[0] = 2.0;
  EXPECT_THAT(common(a, LandmarkMap(std::move(later))).same, IsEmpty()) << "a camera at rest";
}

// A program that does not know them writes (0, 0).
TEST(CommonImages, AreNotKnownByAPixelThatManyKeypointsShare) {
  const auto with_placeholders = [](const char* name, int content) {
    MapTables tables = map_of({{name, content, from_to(0, 60)}}, 60).tables();
    std::fill_n(tables.observations.pixels.begin(), 30, Pixel{0.0, 0.0});
    return LandmarkMap(std::move(tables));
  };
  const auto a = with_placeholders("1.jpg", 1);
  EXPECT_THAT(common(a, with_placeholders("2.jpg", 2)).same, IsEmpty());
  EXPECT_THAT(common(a, with_placeholders("2.jpg", 1)).landmarks, SizeIs(30)) << "by the others";
}

TEST(CommonImages, WithoutNamesHaveNearlyAllKeypointsInCommon) {
  const auto a = map_of({{"", 1, from_to(0, 60)}}, 60);
  EXPECT_THAT(common(a, map_of({{"", 1, from_to(20, 60)}}, 60)).same, SizeIs(1));
  EXPECT_THAT(common(a, map_of({{"", 1, from_to(30, 90)}}, 90)).same, IsEmpty());
}

TEST(CommonImages, GiveTheLandmarksThatMostKeypointsShow) {
  const std::vector<Shown> images = {{"1.jpg", 1, from_to(0, 60)}, {"2.jpg", 2, from_to(0, 60)}};
  const LandmarkMap a = map_of(images, 60);
  // In the second image, keypoints 0 and 1 are confused.
  MapTables tables = map_of(images, 60).tables();
  std::swap(tables.observations.pixels[1], tables.observations.pixels[3]);
  const CommonImages result = common(a, LandmarkMap(std::move(tables)));
  EXPECT_THAT(result.landmarks, SizeIs(60));
  for (const auto& [first, second] : result.landmarks) EXPECT_EQ(first, second);
}

}  // namespace
}  // namespace cairn
