// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/experiments/simulated_session/simulated_session.hpp"

#include <utility>
#include <variant>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/simulation/simulator.hpp"

namespace cairn {
namespace {

RgbdSimulator make_simulator(const EnvironmentOptions& environment, PathOptions path,
                             const Executor& executor) {
  const SessionSeeds seeds = session_seeds(environment.seed, environment.session);
  path.seed = seeds.path;
  Environment place = make_environment(environment, executor);
  Trajectory trajectory = make_path(place, path);
  SimulatorOptions simulator;
  simulator.seed = seeds.noise;
  return {std::move(place.scene), std::move(trajectory), simulator, executor};
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

SimulatedSession map_simulated_session(const EnvironmentOptions& environment, PathOptions path,
                                       SessionStart start, MapSequenceOptions mapping,
                                       const Execution& execution) {
  const RgbdSimulator simulator = make_simulator(environment, path, execution.executor);
  SimulatedSession session;
  session.truth = simulator.trajectory();
  mapping.odometry.start = {};
  if (start == SessionStart::kTruePose) {
    mapping.odometry.start = [&](double timestamp_s) {
      return pose_at(session.truth, timestamp_s);
    };
  }
  session.mapped = map_frames(
      path.frames, [&](std::size_t index) { return render(simulator, index); },
      default_simulated_camera(), mapping, execution);
  refuse_if(session.mapped.maps.empty(), "PathOptions.frames",
            fmt::format("none of {} frames of session {} could be tracked", path.frames,
                        environment.session),
            "more");
  for (const SceneObject& object : simulator.scene().objects) {
    if (object.movable) ++session.movable;
    if (object.moved) ++session.moved;
  }
  return session;
}

MapPair simulated_pair(const StudyPair& pair, const MapSequenceOptions& mapping,
                       const Execution& execution) {
  const auto& simulation = std::get<PairSimulation>(pair.maps);
  const auto session = [&](std::uint64_t number) {
    return map_simulated_session({.kind = environment_kind(simulation.environment),
                                  .seed = simulation.seed,
                                  .session = number,
                                  .changed_fraction = number == 0 ? 0.0 : simulation.changed},
                                 {.kind = path_kind(simulation.path),
                                  .frames = simulation.frames,
                                  .rate_hz = simulation.rate_hz},
                                 SessionStart::kTruePose, mapping, execution);
  };
  SimulatedSession target = session(0);
  SimulatedSession source = session(1);
  const Rigid3 truth = target.world_from_map().inverse() * source.world_from_map();
  return {pair.name, std::move(source.mapped.maps.front()), std::move(target.mapped.maps.front()),
          truth};
}

}  // namespace cairn
