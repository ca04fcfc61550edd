// SPDX-License-Identifier: BSD-3-Clause
// The Point Cloud Library on the same work as Cairn: as Debian ships it, or, in an executable of its
// own, compiled for this very machine. CAIRN_PCL_BUILD says which.
#include <vector>

#include <benchmark/benchmark.h>
#include <pcl/kdtree/kdtree_flann.h>
#include <pcl/point_types.h>
#include <pcl/registration/icp.h>

#include "adapters/pcl/confidence_correspondence_estimation.hpp"
#include "sizes.hpp"
#include "workload.hpp"

namespace cairn::benchmarks {
namespace {

using Cloud = pcl::PointCloud<pcl::PointXYZ>;

Cloud::Ptr cloud_of(const PointSet& points) {
  Cloud::Ptr cloud(new Cloud);
  for (const auto& position : points.positions) {
    cloud->push_back({static_cast<float>(position.x()), static_cast<float>(position.y()),
                      static_cast<float>(position.z())});
  }
  return cloud;
}

// PCL's ICP has one thread.
void align_pcl(benchmark::State& state, const Workload& work, const Effort& effort) {
  const Cloud::Ptr source = cloud_of(work.source);
  const Cloud::Ptr target = cloud_of(work.target);
  double score = 0.0;
  int iterations = 0;
  for (auto _ : state) {
    pcl::IterativeClosestPoint<pcl::PointXYZ, pcl::PointXYZ, double> icp;
    if (effort.k > 1) {
      icp.setCorrespondenceEstimation(
          pcl::make_shared<pcl_adapter::ConfidenceCorrespondenceEstimation<pcl::PointXYZ,
                                                                           pcl::PointXYZ, double>>(
              work.target.confidences, effort.k));
    }
    icp.setMaximumIterations(effort.max_iterations);
    icp.setInputSource(source);
    icp.setInputTarget(target);
    Cloud aligned;
    icp.align(aligned, Eigen::Matrix4d(work.options.initial.matrix()));
    score = icp.getFitnessScore();
    iterations = icp.nr_iterations_;
  }
  state.counters["iterations_made"] = iterations;
  state.counters["score"] = score;
}

void align_workload(benchmark::State& state) {
  align_pcl(state, workload(), effort_of(state, 0));
}

void align_size(benchmark::State& state) {
  align_pcl(state, workload(static_cast<std::size_t>(state.range(0))), effort_of(state, 1));
}

void build_pcl(benchmark::State& state) {
  const Cloud::Ptr cloud = cloud_of(random_points(static_cast<std::size_t>(state.range(0)), 1));
  for (auto _ : state) {
    pcl::KdTreeFLANN<pcl::PointXYZ> tree;
    tree.setInputCloud(cloud);
    benchmark::DoNotOptimize(&tree);
  }
  state.SetItemsProcessed(state.iterations() * state.range(0));
}

void search_pcl(benchmark::State& state) {
  const Cloud::Ptr cloud = cloud_of(random_points(static_cast<std::size_t>(state.range(0)), 1));
  const Cloud::Ptr queries = cloud_of(random_points(static_cast<std::size_t>(state.range(0)), 2));
  pcl::KdTreeFLANN<pcl::PointXYZ> tree;
  tree.setInputCloud(cloud);
  const int k = static_cast<int>(state.range(1));
  pcl::Indices indices(static_cast<std::size_t>(k));
  std::vector<float> distances(static_cast<std::size_t>(k));
  for (auto _ : state) {
    for (const auto& query : *queries) {
      benchmark::DoNotOptimize(tree.nearestKSearch(query, k, indices, distances));
    }
  }
  state.SetItemsProcessed(state.iterations() * state.range(0));
}

BENCHMARK(align_workload)
    ->Name("align/" CAIRN_PCL_BUILD)
    ->ArgNames({"k", "most", "threads"})
    ->Args({1, 1, 1})
    ->Args({5, 1, 1})
    ->Args({1, 150, 1})
    ->Args({5, 150, 1})
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();
BENCHMARK(align_size)->Name("size/" CAIRN_PCL_BUILD)->Apply([](auto* made) {
  sizes(made, {1, 5}, {1});
});
BENCHMARK(build_pcl)
    ->Name("build/" CAIRN_PCL_BUILD)
    ->ArgName("points")
    ->Arg(6000)
    ->Arg(100000)
    ->Unit(benchmark::kMillisecond);
BENCHMARK(search_pcl)
    ->Name("search/" CAIRN_PCL_BUILD)
    ->ArgNames({"points", "k"})
    ->Args({6000, 1})
    ->Args({6000, 5})
    ->Args({100000, 1})
    ->Args({100000, 5})
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace cairn::benchmarks
