// SPDX-License-Identifier: BSD-3-Clause
// Neighbour search: in batches on each instruction set that this machine has, and one by one through
// nanoflann.
#include <cmath>
#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <benchmark/benchmark.h>
#include <hwy/targets.h>

#include "cairn/registration/neighbors/batch_tree.hpp"

#include "nanoflann_tree.hpp"
#include "workload.hpp"

namespace cairn::benchmarks {
namespace {

template <class Search>
void build(benchmark::State& state) {
  const PointSet points = random_points(static_cast<std::size_t>(state.range(0)), 1);
  for (auto _ : state) {
    const Search tree(points.positions);
    benchmark::DoNotOptimize(&tree);
  }
  state.SetItemsProcessed(state.iterations() * state.range(0));
}

// Arguments: points, k. As many queries as points.
void search_one_by_one(benchmark::State& state) {
  const PointSet points = random_points(static_cast<std::size_t>(state.range(0)), 1);
  const PointSet queries = random_points(static_cast<std::size_t>(state.range(0)), 2);
  const NanoflannTree tree(points.positions);
  std::vector<Neighbor> found(static_cast<std::size_t>(state.range(1)));
  for (auto _ : state) {
    for (const auto& query : queries.positions) {
      benchmark::DoNotOptimize(tree.nearest(query, found));
    }
  }
  state.SetItemsProcessed(state.iterations() * state.range(0));
}

// The same in a batch. Asked anew each time (nothing is known of the queries, and putting them into
// order is part of it), or again after all have moved by a share of the distance between points.
void search_batch(benchmark::State& state, std::int64_t target, double motion) {
  hwy::SetSupportedTargetsForTest(target);
  const auto count = static_cast<std::size_t>(state.range(0));
  const PointSet points = random_points(count, 1);
  PointSet queries = random_points(count, 2);
  const BatchTree tree(points.positions);
  const auto k = static_cast<std::size_t>(state.range(1));
  BatchTree::Batch kept = tree.batch(k);
  const auto use = [](std::size_t, const NearestList auto& nearest) {
    for (std::size_t j = 0; j < nearest.size(); ++j) {
      benchmark::DoNotOptimize(nearest.squared_distance(j));
    }
  };
  const double step = motion / std::cbrt(static_cast<double>(count));
  double direction = 1.0;
  for (auto _ : state) {
    if (motion < 0.0) {
      tree.batch(k).for_each(queries.positions, Executor(), use);
      continue;
    }
    kept.for_each(queries.positions, Executor(), use);
    state.PauseTiming();
    for (auto& query : queries.positions) query.x() += direction * step;
    if (queries.positions[0].x() > 1.0 || queries.positions[0].x() < 0.0) direction = -direction;
    state.ResumeTiming();
  }
  state.SetItemsProcessed(state.iterations() * state.range(0));
  hwy::SetSupportedTargetsForTest(0);
}

void sizes(benchmark::internal::Benchmark* made) {
  made->ArgNames({"points", "k"})->Unit(benchmark::kMillisecond);
  for (const int points : {6000, 100000}) {
    for (const int k : {1, 5, 10, 20}) made->Args({points, k});
  }
}

const bool kRegistered = [] {
  for (const std::int64_t target : hwy::SupportedAndGeneratedTargets()) {
    const std::string name = hwy::TargetName(target);
    for (const auto& [how, motion] :
         {std::pair{"anew", -1.0}, {"moved_0.1", 0.1}, {"moved_0.001", 0.001}}) {
      sizes(benchmark::RegisterBenchmark(("search/cairn/" + name + "/" + how).c_str(), search_batch,
                                         target, motion));
    }
  }
  return true;
}();

BENCHMARK(build<BatchTree>)
    ->Name("build/cairn")
    ->ArgName("points")
    ->Arg(6000)
    ->Arg(100000)
    ->Unit(benchmark::kMillisecond);
BENCHMARK(build<NanoflannTree>)
    ->Name("build/nanoflann")
    ->ArgName("points")
    ->Arg(6000)
    ->Arg(100000)
    ->Unit(benchmark::kMillisecond);
BENCHMARK(search_one_by_one)->Name("search/nanoflann")->Apply(sizes);

}  // namespace
}  // namespace cairn::benchmarks
