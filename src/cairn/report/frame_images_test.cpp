// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/report/frame_images.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <string>
#include <utility>
#include <variant>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/error.hpp"
#include "cairn/core/random.hpp"
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

// An image at each of these times, all of one grey that tells the time up to 25 s: 10 times it.
void write_sequence(const std::filesystem::path& folder, const std::vector<double>& times) {
  SequenceWriter writer(folder);
  for (const double time : times) {
    writer.add(time, ColorImage(64, 48, static_cast<std::uint8_t>(10.0 * std::min(time, 25.0))),
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

TEST(FrameImages, AreFoundByNameInAFolderThatIsNoSequence) {
  const TemporaryFolder folder;
  write_png(folder / "b.png", ColorImage(64, 48, 30));
  MapTables tables = map_at({std::nullopt, 1.0, std::nullopt}).tables();
  tables.frames.image_names = {"a.png", "b.png", ""};
  const LandmarkMap map(std::move(tables));
  EXPECT_THAT(frames_of_images(frame_images(map, folder / ".")), ElementsAre(1));
  std::filesystem::remove(folder / "b.png");
  const auto message = [&](const LandmarkMap& of) {
    try {
      frame_images(of, folder / ".");
    } catch (const Error& error) {
      return std::string(error.what());
    }
    return std::string("no error");
  };
  EXPECT_THAT(message(map), HasSubstr("none of the map's 3 images, such as 'a.png'"));
  EXPECT_THAT(message(map_at({1.0})), HasSubstr("holds no sequence, and the map names no images"));
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

// A map of landmarks in a row, 1 m apart, each frame with a name and the landmarks that it sees.
LandmarkMap map_of_views(
    const std::vector<std::pair<std::string, std::vector<std::size_t>>>& views) {
  constexpr std::size_t kLandmarks = 7;
  MapTables tables = map_at(std::vector<std::optional<double>>(views.size())).tables();
  for (const auto& view : views) tables.frames.image_names.push_back(view.first);
  tables.observations.offsets = {0};
  for (std::size_t i = 0; i < kLandmarks; ++i) {
    tables.landmarks.ids.push_back(LandmarkId{i});
    tables.landmarks.positions.emplace_back(static_cast<double>(i), 0.0, 0.0);
    for (std::uint32_t k = 0; k < views.size(); ++k) {
      if (std::count(views[k].second.begin(), views[k].second.end(), i) == 0) continue;
      tables.observations.frames.push_back(FrameIndex{k});
      tables.observations.pixels.push_back({});
    }
    tables.observations.offsets.push_back(tables.observations.frames.size());
  }
  return LandmarkMap(std::move(tables));
}

// Two maps whose frames are images in a folder; frame i of a map is as grey as 10 * i, more by 100 in the source.
class LinkImagesTest : public ::testing::Test {
 protected:
  LinkImagesTest() {
    for (std::size_t i = 0; i < 3; ++i) {
      const auto grey = static_cast<std::uint8_t>(10 * i);
      write_png(folder_ / fmt::format("t{}.png", i), ColorImage(64, 48, grey));
      write_png(folder_ / fmt::format("s{}.png", i), ColorImage(64, 48, 100 + grey));
    }
  }

  Report report(const std::vector<NetworkEdge>& edges, const Execution& execution = {}) const {
    const std::vector<std::filesystem::path> folders(2, folder_ / ".");
    Report report;
    add_network(report, maps_, edges);
    LinkImages(std::vector<const LandmarkMap*>{&target_, &source_}, folders, execution.log)
        .add_to(report, edges, execution);
    write_report(report, "<!--CAIRN:TITLE--><!--CAIRN:DATA-->", [](std::string_view) {});
    return report;
  }

  static const Network& network(const Report& report) {
    return std::get<Network>(report.sections.front().content);
  }

  TemporaryFolder folder_;
  LandmarkMap target_ =
      map_of_views({{"t0.png", {0, 1}}, {"t1.png", {0, 1, 2, 3}}, {"t2.png", {3, 4, 5, 6}}});
  LandmarkMap source_ = map_of_views({{"s0.png", {1, 2, 3}}, {"s1.png", {4, 5}}, {"s2.png", {}}});
  std::vector<NetworkMap> maps_ = {{.name = "t", .map = &target_}, {.name = "s", .map = &source_}};
  NetworkEdge identity_ = {
      .target = 0, .source = 1, .use = LinkUse::kUsed, .target_from_source = Similarity3()};
};

TEST_F(LinkImagesTest, AreOfTheKeyframesThatSeeTheMostCommonLandmarks) {
  NetworkEdge shifted = identity_;  // source landmark i is at target landmark i + 1
  shifted.target_from_source = Rigid3(Eigen::Matrix3d::Identity(), {1.0, 0.3, 0.0});
  const Report page = report({identity_, {.target = 0, .source = 1}, shifted});
  const auto& links = network(page).links;
  ASSERT_TRUE(links[0].view);
  EXPECT_EQ(links[0].view->target_frame, 1U);
  EXPECT_EQ(links[0].view->source_frame, 0U);
  EXPECT_EQ(links[0].view->matches, 3U);
  EXPECT_FALSE(links[1].view) << "it has no pose";
  ASSERT_TRUE(links[2].view);
  EXPECT_EQ(links[2].view->target_frame, 1U) << "the first of several that see as many";
  EXPECT_EQ(links[2].view->source_frame, 0U);
  EXPECT_EQ(links[2].view->matches, 2U);
  const auto& images = page.maps[1].frames->images;
  EXPECT_THAT(frames_of_images(images), ElementsAre(0));
  EXPECT_NEAR(decoded(folder_, images[0]).at(5, 5), 100, 2);
  EXPECT_EQ(page.sections.front().text,
            "2 of 3 links show the images of two keyframes; the others: 1 without a pose.");
}

TEST_F(LinkImagesTest, OfALinkWithoutAPoseAreThoseAtThePosesOfItsMaps) {
  for (NetworkMap& map : maps_) map.frame = 0;
  maps_[1].frame_from_map = Similarity3(2.0, Rigid3(Eigen::Matrix3d::Identity(), {0.0, 0.0, 0.0}));
  const Report page = report({{.target = 0, .source = 1, .probability = 0.4}});
  const auto& view = network(page).links[0].view;  // source landmarks 1, 2, 3 are at 2, 4, 6
  ASSERT_TRUE(view);
  EXPECT_EQ(view->target_frame, 2U);
  EXPECT_EQ(view->source_frame, 0U);
  EXPECT_EQ(view->matches, 2U);
}

TEST_F(LinkImagesTest, LandmarksFartherApartThanNeighboursAreNotCommon) {
  NetworkEdge far = identity_;
  far.target_from_source = Rigid3(Eigen::Matrix3d::Identity(), {0.0, 1.1, 0.0});
  const Report page = report({far});
  EXPECT_FALSE(network(page).links[0].view);
  EXPECT_THAT(*page.sections.front().text, HasSubstr("1 without two keyframes that have images"));
}

TEST_F(LinkImagesTest, WhatIsMissingOrDamagedIsLeftOutAndCounted) {
  std::filesystem::remove(folder_ / "s0.png");
  const Report without = report({identity_});
  EXPECT_EQ(network(without).links[0].view->target_frame, 2U);
  EXPECT_EQ(network(without).links[0].view->source_frame, 1U);
  EXPECT_EQ(without.sections.front().text,
            "1 of 1 links show the images of two keyframes. 1 of 6 keyframes have no image.");
  folder_.write("s1.png", "text");
  std::string log;
  Execution execution;
  execution.log = [&](std::string_view text) { log += text; };
  const Report damaged = report({identity_}, execution);
  EXPECT_FALSE(network(damaged).links[0].view);
  EXPECT_THAT(*damaged.sections.front().text,
              HasSubstr("the others: 1 with an image that cannot be read."));
  EXPECT_THAT(log, HasSubstr("s1.png"));
  for (const char* const name : {"s1.png", "s2.png"}) std::filesystem::remove(folder_ / name);
  EXPECT_NO_THROW(report({identity_})) << "images of the other map are there";
  for (const char* const name : {"t0.png", "t1.png", "t2.png"})
    std::filesystem::remove(folder_ / name);
  EXPECT_THROW(report({identity_}), Error);
}

TEST_F(LinkImagesTest, AViewOfAKeyframeWithoutAnImageIsNotWritten) {
  Report page = report({identity_});
  std::get<Network>(page.sections.front().content).links[0].view->target_frame = 0;
  EXPECT_THROW(write_report(page, "<!--CAIRN:TITLE--><!--CAIRN:DATA-->", [](std::string_view) {}),
               Error);
}

TEST_F(LinkImagesTest, TheLeastCertainLinksComeFirstUpToALimit) {
  ColorImage noise(320, 2560);
  Random rng(1);
  for (std::uint8_t& value : noise.values) value = static_cast<std::uint8_t>(rng.index(256));
  write_png(folder_ / "noise.png", noise);
  const LandmarkMap map = map_of_views({{"noise.png", {0, 1, 2}}});
  constexpr std::size_t kLinks = 8;
  std::vector<NetworkMap> maps;
  std::vector<NetworkEdge> edges;
  for (std::size_t i = 0; i < kLinks; ++i) {
    for (int k = 0; k < 2; ++k) maps.push_back({.name = fmt::format("{} {}", i, k), .map = &map});
    edges.push_back(identity_);
    edges.back().target = 2 * i;
    edges.back().source = 2 * i + 1;
    if (i > 0) edges.back().probability = 1.0 - 0.01 * static_cast<double>(i);
  }
  edges[1].use = LinkUse::kContradicted;
  Report page;
  add_network(page, maps, edges);
  const std::vector<std::filesystem::path> folders(maps.size(), folder_ / ".");
  LinkImages(std::vector<const LandmarkMap*>(maps.size(), &map), folders).add_to(page, edges);
  std::size_t bytes = 0;
  for (const Map& one : page.maps) {
    for (const FrameImage& image : one.frames->images) bytes += image.bytes.size();
  }
  EXPECT_LE(bytes, kMostLinkImageBytes);
  EXPECT_GT(bytes, kMostLinkImageBytes / 2);
  const auto& links = network(page).links;
  EXPECT_TRUE(links[1].view) << "contradicted";
  EXPECT_TRUE(links[kLinks - 1].view);
  EXPECT_FALSE(links[0].view) << "stated";
  EXPECT_THAT(*page.sections.front().text, HasSubstr("beyond the page's limit of 8 MB"));
}

}  // namespace
}  // namespace cairn::report
