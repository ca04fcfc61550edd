// SPDX-License-Identifier: BSD-3-Clause
#include <benchmark/benchmark.h>

#include "workload.hpp"

namespace cairn::benchmarks {
namespace {

// Arguments: k (1 is base ICP), most iterations, threads. The tree is built each time.
void align_cairn(benchmark::State& state) {
  const Workload& work = workload();
  AlignOptions options = work.options;
  options.k = static_cast<std::size_t>(state.range(0));
  options.max_iterations = static_cast<int>(state.range(1));
  options.executor = Executor(static_cast<unsigned>(state.range(2)));
  AlignResult result;
  for (auto _ : state) {
    result = align(work.source, work.target, options);
    benchmark::DoNotOptimize(result);
  }
  state.counters["iterations_made"] = result.iterations;
  state.counters["score"] = result.score.value_or(-1.0);
}

BENCHMARK(align_cairn)
    ->Name("align/cairn")
    ->ArgNames({"k", "most", "threads"})
    ->Args({1, 1, 1})
    ->Args({5, 1, 1})
    ->Args({1, 150, 1})
    ->Args({5, 150, 1})
    ->Args({1, 150, 2})
    ->Args({5, 150, 2})
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();

}  // namespace
}  // namespace cairn::benchmarks
