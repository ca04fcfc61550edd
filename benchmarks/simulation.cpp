// SPDX-License-Identifier: BSD-3-Clause
// Frames a second of the simulation, by part: 640 x 480, the desk, along its sweep.
#include <cstddef>

#include <benchmark/benchmark.h>

#include "cairn/simulation/detail/renderer.hpp"
#include "cairn/simulation/environment.hpp"
#include "cairn/simulation/path.hpp"
#include "cairn/simulation/simulator.hpp"

namespace cairn::benchmarks {
namespace {

constexpr std::size_t kFrames = 60;

const Environment& place() {
  static const Environment environment = make_environment({}, Executor(0));
  return environment;
}

const Trajectory& path() {
  static const Trajectory trajectory = make_path(place(), {.frames = kFrames, .rate_hz = 3.0});
  return trajectory;
}

void build_environment(benchmark::State& state) {
  for (auto _ : state) {
    benchmark::DoNotOptimize(make_environment({}, Executor(static_cast<unsigned>(state.range(0)))));
  }
}

void prepare_scene(benchmark::State& state) {
  for (auto _ : state) {
    const detail::Renderer renderer(place().scene, SimulatorOptions().light_grid_m, true,
                                    Executor(static_cast<unsigned>(state.range(0))));
    benchmark::DoNotOptimize(&renderer.scene());
  }
}

void render(benchmark::State& state) {
  const detail::Renderer renderer(place().scene, SimulatorOptions().light_grid_m,
                                  state.range(0) != 0, Executor(0));
  const Camera camera = default_simulated_camera();
  const detail::RayTable rays = detail::ray_table(camera);
  std::size_t i = 0;
  for (auto _ : state) {
    benchmark::DoNotOptimize(
        renderer.render(camera, rays, path().poses()[i++ % kFrames].world_from_camera));
  }
  state.SetItemsProcessed(state.iterations());
}

// A frame with its noise, one thread a frame.
void simulate_frame(benchmark::State& state) {
  static const RgbdSimulator simulator(place().scene, path(), {}, Executor(0));
  auto i = static_cast<std::size_t>(state.thread_index());
  for (auto _ : state) {
    benchmark::DoNotOptimize(simulator.frame(i % kFrames));
    i += static_cast<std::size_t>(state.threads());
  }
  state.SetItemsProcessed(state.iterations());
}

BENCHMARK(build_environment)->Arg(1)->Arg(2)->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK(prepare_scene)->Arg(1)->Arg(2)->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK(render)->ArgName("smooth_edges")->Arg(0)->Arg(1)->Unit(benchmark::kMillisecond);
BENCHMARK(simulate_frame)->Threads(1)->Threads(2)->Unit(benchmark::kMillisecond)->UseRealTime();

}  // namespace
}  // namespace cairn::benchmarks
