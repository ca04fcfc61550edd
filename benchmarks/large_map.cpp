// SPDX-License-Identifier: BSD-3-Clause
// Speed and memory of reading a large map: cairn_large_map_benchmark [MEGABYTES=2000] [FOLDER=/tmp]
// Writes a synthetic map of about that size, reads it on one core, removes it again.
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <new>
#include <optional>
#include <string>

#include <malloc.h>
#include <sys/resource.h>

#include "cairn/map/io/map_file.hpp"
#include "cairn/map/synthetic.hpp"

namespace {

std::atomic<std::size_t> g_in_use{0};
std::atomic<std::size_t> g_peak{0};

void* allocate(std::size_t size, std::size_t alignment) {
  void* const memory =
      std::aligned_alloc(alignment, (size + alignment - 1) / alignment * alignment);
  if (memory == nullptr) throw std::bad_alloc();
  const std::size_t now = g_in_use += ::malloc_usable_size(memory);
  std::size_t peak = g_peak;
  while (now > peak && !g_peak.compare_exchange_weak(peak, now)) {
  }
  return memory;
}

void release(void* memory) noexcept {
  g_in_use -= ::malloc_usable_size(memory);
  std::free(memory);
}

double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

}  // namespace

void* operator new(std::size_t size) {
  return allocate(size, 16);
}
void* operator new(std::size_t size, std::align_val_t alignment) {
  return allocate(size, static_cast<std::size_t>(alignment));
}
void operator delete(void* memory) noexcept {
  release(memory);
}
void operator delete(void* memory, std::size_t /*size*/) noexcept {
  release(memory);
}
void operator delete(void* memory, std::align_val_t /*alignment*/) noexcept {
  release(memory);
}
void operator delete(void* memory, std::size_t /*size*/, std::align_val_t /*alignment*/) noexcept {
  release(memory);
}

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
    g_peak = g_in_use.load();
    const std::size_t before = g_in_use;
    const auto start = std::chrono::steady_clock::now();
    const cairn::LandmarkMap map = cairn::read_map(path);
    const double duration = seconds_since(start);
    const double kept = static_cast<double>(g_in_use - before);
    const double peak = static_cast<double>(g_peak - before);
    std::printf(
        "%.0f MB, %zu landmarks, %zu observations: %.2f s, %.0f MB/s, heap kept %.0f MB, peak %.2f "
        "times that\n",
        size / 1e6, map.landmark_count(), map.observation_count(), duration, size / 1e6 / duration,
        kept / 1e6, peak / kept);
  }
  std::filesystem::remove(path);
  return 0;
}
