// SPDX-License-Identifier: BSD-3-Clause
#include <filesystem>
#include <fstream>

#include <unistd.h>

#include "cairn/interchange/colmap_database.hpp"
#include "cairn/interchange/rtabmap.hpp"
#include "cairn/interchange/stella_database.hpp"

#include "fuzz/imported.hpp"

// Databases of RTAB-Map, stella_vslam and COLMAP, in a file in memory.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const std::filesystem::path path =
      "/dev/shm/cairn_fuzz_" + std::to_string(::getpid()) + ".db";
  {
    std::ofstream file(path, std::ios::binary | std::ios::trunc);
    file << cairn::testing::text_of(data, size);
  }
  const std::string name = path.string();
  cairn::testing::expect_read_or_refused([&] { cairn::read_rtabmap(path); }, name);
  cairn::testing::expect_read_or_refused([&] { cairn::read_rtabmap_graph(path); }, name);
  cairn::testing::expect_read_or_refused([&] { cairn::read_stella_database(path); }, name);
  cairn::testing::expect_read_or_refused([&] { cairn::with_colmap_descriptors({}, path); }, name);
  std::filesystem::remove(path);
  return 0;
}
