// SPDX-License-Identifier: BSD-3-Clause
#include <filesystem>
#include <fstream>
#include <utility>

#include <unistd.h>

#include "cairn/formats/detail/foreign/foreign_formats.hpp"
#include "cairn/formats/pose_graph_file.hpp"

#include "fuzz/imported.hpp"

namespace {

// Of one image, a.png, with two keypoints.
cairn::LandmarkMap model_without_cameras() {
  cairn::MapTables tables;
  tables.frames.ids = {cairn::FrameId{1}};
  tables.frames.quaternions = {{1.0, 0.0, 0.0, 0.0}};
  tables.frames.translations = {{0.0, 0.0, 0.0}};
  tables.frames.image_names = {"a.png"};
  tables.landmarks.ids = {cairn::LandmarkId{1}, cairn::LandmarkId{2}};
  tables.landmarks.positions = {{0.0, 0.0, 5.0}, {1.0, 0.0, 5.0}};
  tables.observations.offsets = {0, 1, 2};
  tables.observations.frames = {cairn::FrameIndex{0}, cairn::FrameIndex{0}};
  tables.observations.pixels = {{110.0, 70.0}, {90.0, 50.0}};
  tables.observations.keypoints = {0U, 2U};
  return cairn::LandmarkMap(std::move(tables));
}

}  // namespace

// Databases of RTAB-Map, stella_vslam and COLMAP, in a file in memory.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const std::filesystem::path path =
      "/dev/shm/cairn_fuzz_" + std::to_string(::getpid()) + ".db";
  {
    std::ofstream file(path, std::ios::binary | std::ios::trunc);
    file << cairn::testing::text_of(data, size);
  }
  const std::string name = path.string();
  cairn::testing::expect_read_or_refused([&] { cairn::detail::read_rtabmap(path); }, name);
  cairn::testing::expect_read_or_refused([&] { cairn::read_rtabmap_graph(path); }, name);
  cairn::testing::expect_read_or_refused([&] { cairn::detail::read_stella_database(path); }, name);
  cairn::testing::expect_read_or_refused(
      [&] { cairn::detail::with_colmap_descriptors(model_without_cameras(), path); }, name);
  std::filesystem::remove(path);
  return 0;
}
