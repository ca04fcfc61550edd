// SPDX-License-Identifier: BSD-3-Clause
// The map that the paper's authors built of TUM fr1/desk, where the data folder is at hand.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <gtest/gtest.h>

#include "cairn/core/file.hpp"
#include "cairn/formats/map_file.hpp"
#include "cairn/map/operations.hpp"

#include "support/maps.hpp"
#include "support/real_data.hpp"

namespace cairn {
namespace {

using testing::EqualsMap;

class RealMap : public ::testing::Test {
 protected:
  void SetUp() override {
    const auto folder = testing::real_data();
    if (!folder) GTEST_SKIP() << testing::kNoRealData;
    const std::filesystem::path path = *folder / "map_fr1_desk.txt";
    if (!std::filesystem::exists(path)) {
      GTEST_SKIP() << path << " is not there: nothing was tested";
    }
    FileReader file(path);
    map_ = read_native(file);
  }

  LandmarkMap map_;
};

std::size_t count_with_observations(const LandmarkMap& map, std::size_t count) {
  return landmarks_observed(map, count).size();
}

TEST_F(RealMap, HoldsWhatItsAuthorsSay) {
  EXPECT_EQ(map_.frame_count(), 240U);
  EXPECT_EQ(map_.landmark_count(), 22338U);
  EXPECT_EQ(count_with_observations(map_, 2), 6081U);
  EXPECT_EQ(map_.landmark_count() - count_with_observations(map_, 1), 630U);
  EXPECT_TRUE(map_.has_covariances());
  EXPECT_EQ(version_1_loss(map_), std::nullopt);
}

TEST_F(RealMap, IsReadBackBitForBit) {
  for (const int version : {1, 2}) {
    std::string text;
    write_native(
        map_, [&](std::string_view bytes) { text += bytes; }, version);
    MemoryReader source(text, "written");
    EXPECT_THAT(read_native(source), EqualsMap(map_));
  }
}

TEST_F(RealMap, FallsIntoTwoMiniMaps) {
  const LandmarkMap first = cut_frames(map_, FrameId{0}, FrameId{120});
  const LandmarkMap second = cut_frames(map_, FrameId{120}, FrameId{240});
  EXPECT_EQ(first.frame_count(), 120U);
  EXPECT_EQ(second.frame_count(), 120U);
  EXPECT_EQ(count_with_observations(first, 2), 3050U);
  EXPECT_EQ(count_with_observations(second, 2), 3015U);
}

TEST_F(RealMap, ReprojectsOntoItsObservations) {
  const Camera camera{CameraId{0}, "PINHOLE", 640, 480, {517.3, 516.5, 318.6, 255.3}};
  std::vector<double> errors_px;
  std::size_t behind = 0;
  for (std::uint32_t i = 0; i < map_.landmark_count(); ++i) {
    const LandmarkIndex landmark{i};
    const auto frames = map_.observing_frames(landmark);
    const auto pixels = map_.observed_pixels(landmark);
    for (std::size_t k = 0; k < frames.size(); ++k) {
      const Eigen::Vector3d x_in_camera =
          map_.world_from_camera(frames[k]).inverse() * map_.landmarks().positions[i];
      const auto pixel = project(camera, x_in_camera);
      if (!pixel) {
        ++behind;
        continue;
      }
      errors_px.push_back(std::hypot(pixel->u - pixels[k].u, pixel->v - pixels[k].v));
    }
  }
  ASSERT_FALSE(errors_px.empty());
  std::sort(errors_px.begin(), errors_px.end());
  EXPECT_EQ(behind, 0U);
  EXPECT_EQ(errors_px.size(), map_.observation_count());
  EXPECT_LT(errors_px[errors_px.size() / 2], 1e-3);
  EXPECT_LT(errors_px[errors_px.size() * 99 / 100], 2.0);
}

}  // namespace
}  // namespace cairn
