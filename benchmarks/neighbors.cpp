// SPDX-License-Identifier: BSD-3-Clause
#include <vector>

#include <benchmark/benchmark.h>

#include "cairn/registration/neighbors/kd_tree.hpp"

#include "workload.hpp"

namespace cairn::benchmarks {
namespace {

void build_cairn(benchmark::State& state) {
  const PointSet points = random_points(static_cast<std::size_t>(state.range(0)), 1);
  for (auto _ : state) {
    const KdTree tree(points.positions);
    benchmark::DoNotOptimize(&tree);
  }
  state.SetItemsProcessed(state.iterations() * state.range(0));
}

// Arguments: points, k. As many queries as points.
void search_cairn(benchmark::State& state) {
  const PointSet points = random_points(static_cast<std::size_t>(state.range(0)), 1);
  const PointSet queries = random_points(static_cast<std::size_t>(state.range(0)), 2);
  const KdTree tree(points.positions);
  std::vector<Neighbor> found(static_cast<std::size_t>(state.range(1)));
  for (auto _ : state) {
    for (const auto& query : queries.positions) {
      benchmark::DoNotOptimize(tree.nearest(query, found));
    }
  }
  state.SetItemsProcessed(state.iterations() * state.range(0));
}

BENCHMARK(build_cairn)
    ->Name("build/cairn")
    ->ArgName("points")
    ->Arg(6000)
    ->Arg(100000)
    ->Unit(benchmark::kMillisecond);
BENCHMARK(search_cairn)
    ->Name("search/cairn")
    ->ArgNames({"points", "k"})
    ->Args({6000, 1})
    ->Args({6000, 5})
    ->Args({100000, 1})
    ->Args({100000, 5})
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace cairn::benchmarks
