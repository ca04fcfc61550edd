// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <sstream>
#include <string>
#include <vector>

#include <benchmark/benchmark.h>

#include "cairn/core/file.hpp"
#include "cairn/formats/map_file.hpp"
#include "cairn/map/landmark_map.hpp"
#include "cairn/map/synthetic.hpp"

namespace cairn::benchmarks {
namespace {

// A version 1 map of about 10 MB.
const LandmarkMap& example_map() {
  static const LandmarkMap map = [] {
    MapTables tables = synthetic_map({.seed = 1, .landmarks = 30000}).tables();
    tables.info = {};
    tables.cameras.clear();
    tables.frames.cameras.clear();
    tables.frames.timestamps_s.clear();
    tables.observations.depths.clear();
    return LandmarkMap(std::move(tables));
  }();
  return map;
}

const std::string& example_text() {
  static const std::string text = [] {
    std::string result;
    write_native(example_map(), [&](std::string_view bytes) { result += bytes; });
    return result;
  }();
  return text;
}

void read_cairn(benchmark::State& state) {
  for (auto _ : state) {
    MemoryReader reader(example_text(), "example.map");
    benchmark::DoNotOptimize(read_native(reader).landmark_count());
  }
  state.SetBytesProcessed(state.iterations() * static_cast<std::int64_t>(example_text().size()));
}

void write_cairn(benchmark::State& state) {
  for (auto _ : state) {
    std::size_t size = 0;
    write_native(example_map(), [&](std::string_view bytes) { size += bytes.size(); });
    benchmark::DoNotOptimize(size);
  }
  state.SetBytesProcessed(state.iterations() * static_cast<std::int64_t>(example_text().size()));
}

// How such files are commonly read: a stream a line, operator >> a field, no checks.
void read_iostream(benchmark::State& state) {
  for (auto _ : state) {
    std::istringstream file(example_text());
    std::string line;
    std::string record;
    double sum = 0.0;
    while (std::getline(file, line)) {
      std::istringstream fields(line);
      fields >> record;
      double value = 0.0;
      while (fields >> value) sum += value;
    }
    benchmark::DoNotOptimize(sum);
  }
  state.SetBytesProcessed(state.iterations() * static_cast<std::int64_t>(example_text().size()));
}

// From a file to a map, as the tool does it: the real map of the folder that CAIRN_DATA names; without
// CAIRN_DATA, a synthetic one of about its size.
void load(benchmark::State& state, const std::string& extension) {
  static const std::string data = [] {
    const char* const folder = std::getenv("CAIRN_DATA");
    return std::string(folder == nullptr ? "" : folder);
  }();
  static const LandmarkMap map =
      data.empty() ? example_map() : read_map(data + "/map_fr1_desk.txt");
  const auto path =
      std::filesystem::temp_directory_path() / ("cairn_parsing_benchmark" + extension);
  if (!data.empty() && extension == ".txt") {
    // With the digits that its authors wrote.
    std::filesystem::copy_file(data + "/map_fr1_desk.txt", path,
                               std::filesystem::copy_options::overwrite_existing);
  } else {
    write_map(map, path);
  }
  for (auto _ : state) benchmark::DoNotOptimize(read_map(path).landmark_count());
  state.SetBytesProcessed(state.iterations() *
                          static_cast<std::int64_t>(std::filesystem::file_size(path)));
  std::filesystem::remove(path);
}

// On a machine with other work the fastest run says most.
void repeat_and_take_the_fastest(benchmark::internal::Benchmark* benchmark) {
  benchmark->Unit(benchmark::kMillisecond)
      ->Repetitions(20)
      ->ReportAggregatesOnly()
      ->ComputeStatistics("min", [](const std::vector<double>& values) {
        return *std::min_element(values.begin(), values.end());
      });
}

BENCHMARK_CAPTURE(load, text, std::string(".txt"))->Apply(repeat_and_take_the_fastest);
BENCHMARK_CAPTURE(load, binary, std::string(".cairn"))->Apply(repeat_and_take_the_fastest);
BENCHMARK(read_cairn)->Name("read/cairn")->Unit(benchmark::kMillisecond);
BENCHMARK(read_iostream)->Name("read/iostream")->Unit(benchmark::kMillisecond);
BENCHMARK(write_cairn)->Name("write/cairn")->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace cairn::benchmarks
