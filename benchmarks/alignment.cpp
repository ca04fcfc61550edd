// SPDX-License-Identifier: BSD-3-Clause
// Alignment from start to end, on each instruction set that this machine has and of maps of several
// sizes; and with the neighbour search of nanoflann instead of our own, from the same stages.
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

#include <benchmark/benchmark.h>
#include <hwy/targets.h>

#include "cairn/registration/convergence/pcl_criteria.hpp"
#include "cairn/registration/correspondence/confident_neighbor.hpp"
#include "cairn/registration/estimation/point_to_point.hpp"
#include "cairn/registration/neighbors/batch_tree.hpp"
#include "cairn/registration/score/fitness.hpp"
#include "cairn/registration/stages.hpp"

#include "nanoflann_tree.hpp"
#include "sizes.hpp"
#include "workload.hpp"

namespace cairn::benchmarks {
namespace {

// k of 1 is base ICP. The tree is built each time.
void align_cairn(benchmark::State& state, const Workload& work, const Effort& effort,
                 bool coarse_to_fine = false) {
  IcpOptions options = work.options;
  options.coarse_to_fine = coarse_to_fine;
  options.k = effort.k;
  options.max_iterations = effort.max_iterations;
  const Execution execution{.executor = Executor(effort.threads)};
  RegistrationResult result;
  for (auto _ : state) {
    result = icp(work.source, work.target, options, execution);
    benchmark::DoNotOptimize(result);
  }
  state.counters["iterations_made"] = result.iterations;
  state.counters["coarse_iterations"] = result.coarse_iterations;
  state.counters["score"] = result.score.value_or(-1.0);
}

// Arguments: k, most iterations, threads.
void align_on_target(benchmark::State& state, std::int64_t target) {
  hwy::SetSupportedTargetsForTest(target);
  align_cairn(state, workload(), effort_of(state, 0));
  hwy::SetSupportedTargetsForTest(0);
}

void align_fast(benchmark::State& state) {
  align_cairn(state, workload(), effort_of(state, 0), true);
}

// Many pairs side by side, each on one thread. Arguments: k, threads.
void align_pairs(benchmark::State& state) {
  constexpr std::size_t kPairs = 16;
  const Workload& work = workload();
  IcpOptions options = work.options;
  options.k = static_cast<std::size_t>(state.range(0));
  const Executor executor(static_cast<unsigned>(state.range(1)));
  for (auto _ : state) {
    executor.for_blocks(kPairs, 1, [&](std::size_t, std::size_t) {
      benchmark::DoNotOptimize(icp(work.source, work.target, options));
    });
  }
}

void align_size(benchmark::State& state) {
  align_cairn(state, workload(static_cast<std::size_t>(state.range(0))), effort_of(state, 1));
}

// The iteration alone.
template <class Search>
IcpRun iterated(const Search& search, const Workload& work, const Effort& effort) {
  const ConfidentNeighborCorrespondence<Search> find_matches(
      {search, work.target.positions, work.target.confidences}, std::nullopt, {.k = effort.k},
      Executor(effort.threads));
  return run_icp(work.source.positions, work.options.initial, find_matches,
                 PointToPointEstimation(work.target.positions),
                 PclCriteria{.max_iterations = effort.max_iterations});
}

// No scores, no covariance.
template <class Search>
void iterate(benchmark::State& state) {
  const Workload& work = workload();
  const Effort effort = effort_of(state, 0);
  int iterations = 0;
  for (auto _ : state) {
    const Search search(work.target.positions);
    iterations = iterated(search, work, effort).iterations;
  }
  state.counters["iterations_made"] = iterations;
}

// With the scores before and after, as align has them.
void align_one_by_one(benchmark::State& state) {
  const Workload& work = workload(static_cast<std::size_t>(state.range(0)));
  const Effort effort = effort_of(state, 1);
  const Executor executor(effort.threads);
  std::optional<double> score;
  for (auto _ : state) {
    const NanoflannTree tree(work.target.positions);
    const auto score_at = [&](const Rigid3& pose) {
      return fitness_score(nearest_squared_distances(work.source.positions, pose, tree, executor));
    };
    benchmark::DoNotOptimize(score_at(work.options.initial));
    const IcpRun run = iterated(tree, work, effort);
    score = score_at(run.target_from_source);
  }
  state.counters["score"] = score.value_or(-1.0);
}

const bool kRegistered = [] {
  for (const std::int64_t target : hwy::SupportedAndGeneratedTargets()) {
    const std::string name = std::string("align/cairn/") + hwy::TargetName(target);
    auto* const made = benchmark::RegisterBenchmark(name.c_str(), align_on_target, target);
    made->ArgNames({"k", "most", "threads"})->Unit(benchmark::kMillisecond)->UseRealTime();
    made->Args({1, 1, 1})->Args({5, 1, 1})->Args({1, 150, 1})->Args({5, 150, 1});
    made->Args({1, 150, 2})->Args({5, 150, 2});
  }
  return true;
}();

BENCHMARK(align_fast)
    ->Name("align/cairn/fast")
    ->ArgNames({"k", "most", "threads"})
    ->Args({1, 150, 1})
    ->Args({5, 150, 1})
    ->Args({1, 150, 2})
    ->Args({5, 150, 2})
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();
BENCHMARK(align_pairs)
    ->Name("align/cairn/pairs")
    ->ArgNames({"k", "threads"})
    ->ArgsProduct({{1, 5}, {1, 2}})
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();
BENCHMARK(align_size)->Name("size/cairn")->Apply([](auto* made) { sizes(made, {1, 5}, {1, 2}); });
BENCHMARK(align_one_by_one)->Name("size/nanoflann")->Apply([](auto* made) {
  sizes(made, {1, 5}, {1, 2});
});
BENCHMARK(iterate<BatchTree>)
    ->Name("iterate/cairn")
    ->ArgNames({"k", "most", "threads"})
    ->Args({1, 150, 1})
    ->Args({5, 150, 1})
    ->Unit(benchmark::kMillisecond);
BENCHMARK(iterate<NanoflannTree>)
    ->Name("iterate/nanoflann")
    ->ArgNames({"k", "most", "threads"})
    ->Args({1, 150, 1})
    ->Args({5, 150, 1})
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace cairn::benchmarks
