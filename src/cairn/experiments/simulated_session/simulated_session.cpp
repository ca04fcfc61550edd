// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/experiments/simulated_session/simulated_session.hpp"

#include <utility>
#include <variant>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/simulation/simulator.hpp"

namespace cairn {
namespace {

RgbdSimulator make_simulator(const SimulatedSessionOptions& options, const Executor& executor) {
  const SessionSeeds seeds = session_seeds(options.environment.seed, options.environment.session);
  Environment place = make_environment(options.environment, executor);
  Trajectory path = make_path(place, {.kind = options.path,
                                      .seed = seeds.path,
                                      .frames = options.frames,
                                      .rate_hz = options.rate_hz});
  SimulatorOptions simulator;
  simulator.seed = seeds.noise;
  return {std::move(place.scene), std::move(path), simulator, executor};
}

FrameImages render(const RgbdSimulator& simulator, std::size_t index) {
  const RgbdFrame frame = simulator.frame(index);
  return frame_images(frame.timestamp_s, frame.width, frame.height, frame.bgr, frame.depth_m);
}

}  // namespace

Rigid3 SimulatedSession::world_from_map() const {
  const TimedPose& first = mapped.trajectory.poses().front();
  return pose_at(truth, first.timestamp_s) * first.world_from_camera.inverse();
}

SimulatedSession map_simulated_session(const SimulatedSessionOptions& options,
                                       MapSequenceOptions mapping) {
  const RgbdSimulator simulator = make_simulator(options, mapping.executor);
  SimulatedSession session;
  session.truth = simulator.trajectory();
  mapping.odometry.start = {};
  if (options.in_world_frame) {
    mapping.odometry.start = [&](double timestamp_s) {
      return pose_at(session.truth, timestamp_s);
    };
  }
  session.mapped = map_frames(
      options.frames, [&](std::size_t index) { return render(simulator, index); },
      default_simulated_camera(), mapping);
  if (session.mapped.maps.empty()) {
    throw Error(ErrorKind::kMisuse, "SimulatedSessionOptions.frames",
                fmt::format("none of {} frames of session {} could be tracked", options.frames,
                            options.environment.session),
                "more");
  }
  for (const SceneObject& object : simulator.scene().objects) {
    if (object.movable) ++session.movable;
    if (object.moved) ++session.moved;
  }
  return session;
}

MapPair simulated_pair(const StudyPair& pair, const MapSequenceOptions& mapping) {
  const auto& simulation = std::get<PairSimulation>(pair.maps);
  const auto session = [&](std::uint64_t number) {
    SimulatedSessionOptions options;
    options.environment.kind = environment_kind(simulation.environment);
    options.environment.seed = simulation.seed;
    options.environment.session = number;
    options.environment.changed_fraction = number == 0 ? 0.0 : simulation.changed;
    options.path = path_kind(simulation.path);
    options.frames = simulation.frames;
    options.rate_hz = simulation.rate_hz;
    options.in_world_frame = true;
    return map_simulated_session(options, mapping);
  };
  SimulatedSession target = session(0);
  SimulatedSession source = session(1);
  const Rigid3 truth = target.world_from_map().inverse() * source.world_from_map();
  return {pair.name, std::move(source.mapped.maps.front()), std::move(target.mapped.maps.front()),
          truth};
}

}  // namespace cairn
