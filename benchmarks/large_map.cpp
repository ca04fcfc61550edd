// SPDX-License-Identifier: BSD-3-Clause
// Speed and memory of reading a large map: cairn_large_map_benchmark [MEGABYTES=2000] [FOLDER=/tmp]
// Writes a synthetic map of about that size, reads it on one core, removes it again.
#include <chrono>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <utility>

#include "cairn/formats/map_file.hpp"
#include "cairn/map/synthetic.hpp"

#include "counting_heap.hpp"

namespace {

double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

}  // namespace

int main(int argc, char** argv) {
  const double megabytes = argc > 1 ? std::atof(argv[1]) : 2000.0;
  const std::filesystem::path path =
      std::filesystem::path(argc > 2 ? argv[2] : "/tmp") / "cairn_large_benchmark.map";
  {
    constexpr double kBytesALandmark = 349.0;  // measured
    cairn::MapTables tables =
        cairn::synthetic_map(
            {.seed = 1,
             .landmarks = static_cast<std::size_t>(1e6 * megabytes / kBytesALandmark),
             .frames = 5})
            .tables();
    tables.info = {};
    tables.cameras.clear();
    tables.frames.cameras.clear();
    tables.frames.timestamps_s.clear();
    tables.observations.depths.clear();
    cairn::write_map(cairn::LandmarkMap(std::move(tables)), path);
  }
  const double size = static_cast<double>(std::filesystem::file_size(path));
  for (int run = 0; run < 3; ++run) {
    const cairn::benchmarks::HeapUse heap;
    const auto start = std::chrono::steady_clock::now();
    const cairn::LandmarkMap map = cairn::read_map(path);
    const double duration = seconds_since(start);
    const auto kept = static_cast<double>(heap.kept());
    const auto peak = static_cast<double>(heap.peak());
    std::printf(
        "%.0f MB, %zu landmarks, %zu observations: %.2f s, %.0f MB/s, heap kept %.0f MB, peak %.2f "
        "times that\n",
        size / 1e6, map.landmark_count(), map.observation_count(), duration, size / 1e6 / duration,
        kept / 1e6, peak / kept);
  }
  std::filesystem::remove(path);
  return 0;
}
