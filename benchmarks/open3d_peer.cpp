// SPDX-License-Identifier: BSD-3-Clause
// Open3D's point-to-point ICP on the same work as Cairn's base one, as Debian ships it.
#include <limits>
#include <string>

#include <benchmark/benchmark.h>
#include <omp.h>
#include <open3d/geometry/PointCloud.h>
#include <open3d/pipelines/registration/Registration.h>
#include <open3d/utility/Logging.h>

#include "sizes.hpp"
#include "workload.hpp"

namespace cairn::benchmarks {
namespace {

namespace registration = open3d::pipelines::registration;

// From the tree, which it builds each time, to the end.
registration::RegistrationResult align(const open3d::geometry::PointCloud& source,
                                       const open3d::geometry::PointCloud& target,
                                       const Workload& work, int max_iterations) {
  // It compares root mean squared distances, as Cairn compares mean squared ones.
  return registration::RegistrationICP(
      source, target, std::numeric_limits<double>::infinity(), work.options.initial.matrix(),
      registration::TransformationEstimationPointToPoint(false),
      registration::ICPConvergenceCriteria(1e-12, 1e-12, max_iterations));
}

// Its results do not say how many iterations they took; what it logs does.
int iterations_of(const open3d::geometry::PointCloud& source,
                  const open3d::geometry::PointCloud& target, const Workload& work,
                  int max_iterations) {
  int iterations = 0;
  open3d::utility::Logger& log = open3d::utility::Logger::GetInstance();
  log.SetPrintFunction([&](const std::string& line) {
    if (line.find("ICP Iteration") != std::string::npos) ++iterations;
  });
  const open3d::utility::VerbosityLevel before = log.GetVerbosityLevel();
  log.SetVerbosityLevel(open3d::utility::VerbosityLevel::Debug);
  align(source, target, work, max_iterations);
  log.SetVerbosityLevel(before);
  log.ResetPrintFunction();
  return iterations;
}

void align_open3d(benchmark::State& state, const Workload& work, const Effort& effort) {
  const open3d::geometry::PointCloud source(work.source.positions);
  const open3d::geometry::PointCloud target(work.target.positions);
  omp_set_num_threads(static_cast<int>(effort.threads));
  double rmse = 0.0;
  for (auto _ : state) {
    rmse = align(source, target, work, effort.max_iterations).inlier_rmse_;
  }
  state.counters["iterations_made"] = iterations_of(source, target, work, effort.max_iterations);
  state.counters["score"] = rmse * rmse;
}

void align_workload(benchmark::State& state) {
  align_open3d(state, workload(), effort_of(state, 0));
}

void align_size(benchmark::State& state) {
  align_open3d(state, workload(static_cast<std::size_t>(state.range(0))), effort_of(state, 1));
}

BENCHMARK(align_workload)
    ->Name("align/open3d")
    ->ArgNames({"k", "most", "threads"})
    ->ArgsProduct({{1}, {1, 150}, {1, 2}})
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();
BENCHMARK(align_size)->Name("size/open3d")->Apply([](auto* made) { sizes(made, {1}, {1, 2}); });

}  // namespace
}  // namespace cairn::benchmarks
