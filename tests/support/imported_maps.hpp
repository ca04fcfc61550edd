// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include <gtest/gtest.h>

#include "cairn/core/error.hpp"
#include "cairn/formats/map_file.hpp"
#include "cairn/map/landmark_map.hpp"

#include "support/refusal.hpp"
#include "support/temporary_folder.hpp"

namespace cairn::testing {

/// Distances in pixels between a map's observations and the projections of their landmarks; 1e9 where a
/// landmark is behind its camera.
struct Reprojection {
  double median = 0.0;
  double worst = 0.0;
  std::size_t count = 0;
};

inline Reprojection reprojection(const LandmarkMap& map) {
  std::vector<double> errors;
  for (std::uint32_t i = 0; i < map.landmark_count(); ++i) {
    const auto frames = map.observing_frames(LandmarkIndex{i});
    for (std::size_t j = 0; j < frames.size(); ++j) {
      if (map.frames().cameras.empty() || !map.frames().cameras[frames[j].value]) continue;
      const auto camera = *map.frames().cameras[frames[j].value];
      const auto pixel =
          project(map.cameras()[camera.value],
                  map.world_from_camera(frames[j]).inverse() * map.landmarks().positions[i]);
      const Pixel seen = map.observed_pixels(LandmarkIndex{i})[j];
      errors.push_back(pixel ? std::hypot(pixel->u - seen.u, pixel->v - seen.v) : 1e9);
    }
  }
  if (errors.empty()) return {};
  std::sort(errors.begin(), errors.end());
  return {errors[errors.size() / 2], errors.back(), errors.size()};
}

/// Two maps have the same frames (poses to 1e-12), cameras (parameters to 1e-9), landmarks and observations.
inline void expect_same_model(const LandmarkMap& a, const LandmarkMap& b) {
  ASSERT_EQ(a.frames().ids, b.frames().ids);
  EXPECT_EQ(a.frames().image_names, b.frames().image_names);
  EXPECT_EQ(a.frames().cameras, b.frames().cameras);
  for (std::uint32_t i = 0; i < a.frame_count(); ++i) {
    const Rigid3 off =
        a.world_from_camera(FrameIndex{i}).inverse() * b.world_from_camera(FrameIndex{i});
    EXPECT_LT((off.rotation() - Eigen::Matrix3d::Identity()).norm(), 1e-12);
    EXPECT_LT(off.translation().norm(), 1e-12 * (1.0 + a.frames().translations[i].norm()));
  }
  ASSERT_EQ(a.cameras().size(), b.cameras().size());
  for (std::size_t i = 0; i < a.cameras().size(); ++i) {
    const Camera& camera = a.cameras()[i];
    const Camera& other = b.cameras()[i];
    EXPECT_EQ(camera.id, other.id);
    ASSERT_EQ(camera.model, other.model);
    EXPECT_EQ(camera.width, other.width);
    EXPECT_EQ(camera.height, other.height);
    for (std::size_t k = 0; k < camera.parameters.size(); ++k) {
      EXPECT_NEAR(camera.parameters[k], other.parameters[k], 1e-9) << camera.model << ' ' << k;
    }
  }
  EXPECT_EQ(a.landmarks().ids, b.landmarks().ids);
  EXPECT_EQ(a.landmarks().positions, b.landmarks().positions);
  EXPECT_EQ(a.observations().offsets, b.observations().offsets);
  EXPECT_EQ(a.observations().frames, b.observations().frames);
  EXPECT_EQ(a.observations().pixels, b.observations().pixels);
  EXPECT_EQ(a.observations().keypoints, b.observations().keypoints);
}

/// Tests of an importer: each has a folder of its own, and keeps what reading and writing remark.
class ImportTest : public ::testing::Test {
 protected:
  LandmarkMap read(const std::filesystem::path& path) {
    remarks_.clear();
    return all_formats().read(path, {.log = remarks_.sink()});
  }
  /// Reads a file of that content.
  LandmarkMap read_bytes(std::string_view bytes, std::string_view name = "input") {
    return read(folder_.write(name, bytes));
  }
  /// The message of the error when a file of that content is read.
  std::string refused(std::string_view bytes, std::string_view name = "input") {
    return refusal(ErrorKind::kInput, [&] { read_bytes(bytes, name); });
  }
  std::filesystem::path write(const LandmarkMap& map, const std::string& name,
                              const MapWriteOptions& options = {}) {
    remarks_.clear();
    all_formats().write(map, folder_ / name, options, {.log = remarks_.sink()});
    return folder_ / name;
  }

  TemporaryFolder folder_;
  Remarks remarks_;
};

}  // namespace cairn::testing
