// SPDX-License-Identifier: BSD-3-Clause
// Alignment from start to end, on each instruction set that this machine has; and with the neighbour
// search of nanoflann instead of our own, from the same stages.
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

#include <benchmark/benchmark.h>
#include <hwy/targets.h>

#include "cairn/registration/convergence/pcl_criteria.hpp"
#include "cairn/registration/correspondence/confident_neighbor.hpp"
#include "cairn/registration/estimation/point_to_point.hpp"
#include "cairn/registration/icp.hpp"
#include "cairn/registration/neighbors/batch_tree.hpp"
#include "cairn/registration/neighbors/kd_tree.hpp"

#include "workload.hpp"

namespace cairn::benchmarks {
namespace {

// Arguments: k (1 is base ICP), most iterations, threads. The tree is built each time.
void align_cairn(benchmark::State& state, std::int64_t target) {
  hwy::SetSupportedTargetsForTest(target);
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
  hwy::SetSupportedTargetsForTest(0);
}

// The iteration alone: no scores, no covariance. Arguments: k, most iterations.
template <class Search>
void iterate(benchmark::State& state) {
  const Workload& work = workload();
  int iterations = 0;
  for (auto _ : state) {
    const Search search(work.target.positions);
    const ConfidentNeighborCorrespondence<Search> find_matches(
        {search, work.target.positions, work.target.confidences}, std::nullopt,
        {.k = static_cast<std::size_t>(state.range(0))}, Executor());
    const IcpRun run = run_icp(work.source.positions, work.options.initial, find_matches,
                               PointToPointEstimation(work.target.positions),
                               PclCriteria{.max_iterations = static_cast<int>(state.range(1))});
    benchmark::DoNotOptimize(run);
    iterations = run.iterations;
  }
  state.counters["iterations_made"] = iterations;
}

const bool kRegistered = [] {
  for (const std::int64_t target : hwy::SupportedAndGeneratedTargets()) {
    const std::string name = std::string("align/cairn/") + hwy::TargetName(target);
    auto* const made = benchmark::RegisterBenchmark(name.c_str(), align_cairn, target);
    made->ArgNames({"k", "most", "threads"})->Unit(benchmark::kMillisecond)->UseRealTime();
    made->Args({1, 1, 1})->Args({5, 1, 1})->Args({1, 150, 1})->Args({5, 150, 1});
    made->Args({1, 150, 2})->Args({5, 150, 2});
  }
  return true;
}();

BENCHMARK(iterate<BatchTree>)
    ->Name("iterate/cairn")
    ->ArgNames({"k", "most"})
    ->Args({1, 150})
    ->Args({5, 150})
    ->Unit(benchmark::kMillisecond);
BENCHMARK(iterate<KdTree>)
    ->Name("iterate/nanoflann")
    ->ArgNames({"k", "most"})
    ->Args({1, 150})
    ->Args({5, 150})
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace cairn::benchmarks
