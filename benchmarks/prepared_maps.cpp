// SPDX-License-Identifier: BSD-3-Clause
// One map aligned with many: as maps, and as maps that were prepared once. The maps are those of the
// folder that CAIRN_MINI_MAPS names (as `cairn map --mini-map-length` writes them); without it,
// synthetic ones, which have no descriptors, so that each pair needs a search.
#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <vector>

#include <benchmark/benchmark.h>

#include "cairn/alignment/align.hpp"
#include "cairn/formats/map_file.hpp"
#include "cairn/map/synthetic.hpp"

namespace cairn::benchmarks {
namespace {

std::vector<LandmarkMap> read_maps() {
  std::vector<LandmarkMap> maps;
  const char* const folder = std::getenv("CAIRN_MINI_MAPS");
  if (folder == nullptr) {
    const SyntheticPair pair = synthetic_pair({.seed = 8, .landmarks = 1500});
    for (int i = 0; i < 4; ++i) maps.push_back(i == 0 ? pair.target : pair.source);
    return maps;
  }
  std::vector<std::filesystem::path> paths;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    if (entry.path().extension() == ".map") paths.push_back(entry.path());
  }
  std::sort(paths.begin(), paths.end());
  for (const auto& path : paths) maps.push_back(read_map(path));
  return maps;
}

const std::vector<LandmarkMap>& maps() {
  static const std::vector<LandmarkMap> all = read_maps();
  return all;
}

void one_with_many_maps(benchmark::State& state) {
  for (auto _ : state) {
    for (std::size_t i = 1; i < maps().size(); ++i) {
      benchmark::DoNotOptimize(align(maps()[i], maps().front()));
    }
  }
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(maps().size() - 1));
}

// Without what it takes to prepare them.
void one_with_many_prepared_maps(benchmark::State& state) {
  const std::vector<PreparedMap> prepared(maps().begin(), maps().end());
  for (auto _ : state) {
    for (std::size_t i = 1; i < prepared.size(); ++i) {
      benchmark::DoNotOptimize(align(prepared[i], prepared.front()));
    }
  }
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(prepared.size() - 1));
}

void prepare(benchmark::State& state) {
  for (auto _ : state) {
    for (const LandmarkMap& map : maps()) benchmark::DoNotOptimize(PreparedMap(map));
  }
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(maps().size()));
}

BENCHMARK(one_with_many_maps)->Unit(benchmark::kMillisecond);
BENCHMARK(one_with_many_prepared_maps)->Unit(benchmark::kMillisecond);
BENCHMARK(prepare)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace cairn::benchmarks
