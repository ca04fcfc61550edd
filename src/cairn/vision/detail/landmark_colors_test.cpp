// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/detail/landmark_colors.hpp"

#include <filesystem>
#include <optional>

#include <gtest/gtest.h>

#include "cairn/vision/image.hpp"
#include "cairn/vision/sequence.hpp"

#include "support/temporary_folder.hpp"

namespace cairn::detail {
namespace {

using testing::TemporaryFolder;

constexpr std::size_t kFrames = 3;

// All of one colour but for the pixel (5, 7), which is of another.
void write_sequence(const std::filesystem::path& folder) {
  SequenceWriter writer(folder);
  for (std::size_t i = 0; i < kFrames; ++i) {
    ColorImage image(32, 24);
    for (std::size_t row = 0; row < 24; ++row) {
      for (std::size_t column = 0; column < 32; ++column) {
        std::uint8_t* const bgr = &image.at(column, row);
        bgr[0] = 10;
        bgr[1] = 20;
        bgr[2] = static_cast<std::uint8_t>(100 + 10 * i);
      }
    }
    std::uint8_t* const bgr = &image.at(5, 7);
    bgr[0] = 201;
    bgr[1] = 202;
    bgr[2] = 203;
    writer.add(static_cast<double>(i), image, DepthImage(32, 24, 1.0F));
  }
  writer.finish();
}

// Landmark 0 is seen by all frames, 1 by the first at (5.3, 6.8), 2 by the last, 3 outside of the image.
LandmarkMap seen_map() {
  MapTables tables;
  for (std::size_t i = 0; i < kFrames; ++i) {
    tables.frames.ids.push_back(FrameId{i});
    tables.frames.translations.push_back(Eigen::Vector3d::Zero());
    tables.frames.quaternions.push_back({1.0, 0.0, 0.0, 0.0});
    tables.frames.timestamps_s.push_back(static_cast<double>(i));
  }
  for (std::uint64_t i = 0; i < 4; ++i) {
    tables.landmarks.ids.push_back(LandmarkId{i});
    tables.landmarks.positions.push_back(Eigen::Vector3d::UnitZ());
  }
  tables.observations.offsets = {0, 3, 4, 5, 6};
  for (const std::uint32_t frame : {0U, 1U, 2U, 0U, 2U, 0U}) {
    tables.observations.frames.push_back(FrameIndex{frame});
  }
  tables.observations.pixels = {{20, 20}, {20, 20}, {20, 20}, {5.3, 6.8}, {2, 2}, {31.6, 2}};
  return LandmarkMap(std::move(tables));
}

TEST(LandmarkColors, AreTheMedianOfTheImagesThatObserved) {
  const TemporaryFolder folder;
  write_sequence(folder / "s");
  const LandmarkMap before = seen_map();
  const LandmarkMap map =
      with_colors(before, ImageSequence(folder / "s"), {.executor = Executor(2)});
  const auto& colors = map.landmarks().colors;
  ASSERT_EQ(colors.size(), 4U);
  EXPECT_EQ(colors[0], (Color{110, 20, 10}));
  EXPECT_EQ(colors[1], (Color{203, 202, 201})) << "of the nearest pixel";
  EXPECT_EQ(colors[2], (Color{120, 20, 10}));
  EXPECT_EQ(colors[3], std::nullopt) << "outside of the image";
  EXPECT_NE(map.info().uuid, before.info().uuid);
  EXPECT_EQ(map.observation_count(), before.observation_count());
}

TEST(LandmarkColors, AreUnknownWhereNoImageCanBeRead) {
  const TemporaryFolder folder;
  write_sequence(folder / "s");
  const ImageSequence sequence(folder / "s");
  std::filesystem::remove(sequence.frames()[2].color);
  const LandmarkMap map = with_colors(seen_map(), sequence, {.executor = Executor(2)});
  EXPECT_EQ(map.landmarks().colors[2], std::nullopt);
  EXPECT_EQ(map.landmarks().colors[0], (Color{100, 20, 10})) << "the lower of two";
}

}  // namespace
}  // namespace cairn::detail
