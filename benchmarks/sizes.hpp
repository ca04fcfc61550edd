// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include <benchmark/benchmark.h>

namespace cairn::benchmarks {

/// How an alignment is asked for, whoever aligns.
struct Effort {
  std::size_t k = 1;
  int max_iterations = 1;
  unsigned threads = 1;
};

/// Of a benchmark's arguments k, most iterations and threads, the first of which is number `first`.
inline Effort effort_of(const benchmark::State& state, std::size_t first) {
  return {static_cast<std::size_t>(state.range(first)), static_cast<int>(state.range(first + 1)),
          static_cast<unsigned>(state.range(first + 2))};
}

/// Gives a benchmark the arguments landmarks, k, most iterations and threads. The difference between 11
/// iterations and one is what ten of them take.
inline void sizes(benchmark::internal::Benchmark* made, const std::vector<std::int64_t>& ks,
                  const std::vector<std::int64_t>& threads) {
  made->ArgNames({"landmarks", "k", "most", "threads"})
      ->ArgsProduct({{1'000, 10'000, 100'000, 1'000'000}, ks, {1, 11}, threads})
      ->Unit(benchmark::kMillisecond)
      ->UseRealTime();
}

}  // namespace cairn::benchmarks
