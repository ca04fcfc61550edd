// SPDX-License-Identifier: BSD-3-Clause
#include <cstdint>
#include <optional>
#include <string>
#include <utility>

#include <fmt/format.h>

#include "cairn/evaluation/trajectory_evaluation.hpp"
#include "cairn/experiments/simulated_session/simulated_session.hpp"

#include "demo_pair.hpp"
#include "support/console.hpp"
#include "support/interrupt.hpp"

namespace cairn::cli {
namespace {

// How long the camera takes for its way round the desk, so that both sessions see all of it.
constexpr double kRoundSeconds = 25.0;
constexpr double kChangedFraction = 0.1;  // of the movable things, before the second session

struct Session : SimulatedSession {
  std::optional<AbsoluteError> error;  // std::nullopt if too few frames were tracked
  double seconds = 0.0;
};

MapSequenceOptions mapping_options(const std::string& name, const CommonArguments& common) {
  MapSequenceOptions options;
  options.executor = common.executor();
  options.stop = interrupt_requests();
  const auto show =
      common.console().detailed_progress(fmt::format("{} session: rendering, mapping", name));
  if (show) {
    options.progress = [show](const MappingProgress& now) {
      show(static_cast<double>(now.frame) / static_cast<double>(now.frames),
           fmt::format("frame {} of {}, {} landmarks tracked", now.frame, now.frames,
                       now.landmarks));
    };
  }
  return options;
}

Session map_session(const std::string& name, std::uint64_t number, std::size_t frames,
                    const CommonArguments& common) {
  const Stopwatch watch;
  Session session;
  with_option_names({{"PathOptions.frames", "--frames"}}, [&] {
    static_cast<SimulatedSession&>(session) =
        map_simulated_session({.kind = EnvironmentKind::kDesk,
                               .seed = common.seed,
                               .session = number,
                               .changed_fraction = number == 0 ? 0.0 : kChangedFraction},
                              {.kind = PathKind::kOrbit,
                               .frames = frames,
                               .rate_hz = static_cast<double>(frames) / kRoundSeconds},
                              SessionStart::kOwnFrame, mapping_options(name, common));
  });
  session.error = evaluate_trajectory(session.mapped.trajectory, session.truth).absolute;
  session.seconds = watch.seconds();
  return session;
}

Json describe(const Session& session, std::uint64_t number) {
  const MappedSequence& mapped = session.mapped;
  return {{"session", number},
          {"frames", mapped.frames},
          {"tracked", mapped.tracked},
          {"lost", mapped.lost_frames()},
          {"path_length_m", session.truth.length()},
          {"objects", {{"movable", session.movable}, {"moved", session.moved}}},
          {"keyframes", mapped.keyframes},
          {"landmarks", session.map().landmark_count()},
          {"median_reprojection_error_px", to_json(mapped.median_reprojection_error)},
          {"ate_m", session.error ? to_json(session.error->translation) : Json(nullptr)},
          {"duration_s", session.seconds}};
}

// Nothing was changed before the first session: what the second lacks was taken away.
std::string tell_changes(const Session& first, const Session& second) {
  std::string text = fmt::format("Before the second session {} of {} movable things were moved",
                                 second.moved, first.movable);
  if (first.movable > second.movable) {
    text += fmt::format(" and {} taken away", first.movable - second.movable);
  }
  return text + ".\n";
}

std::string tell(const Session& first, const Session& second) {
  std::string text = fmt::format(
      "Simulated two sessions of one desk with an RGB-D camera that goes round it once: {} frames "
      "each.\n"
      "{}"
      "Mapped both, each in the frame of its own first camera:\n\n",
      first.mapped.frames, tell_changes(first, second));
  Table table({"session", "tracked", "path", "keyframes", "landmarks", "ATE", "time"});
  for (const auto& [name, session] :
       {std::pair{"first, the target", &first}, {"second, the source", &second}}) {
    const MappedSequence& mapped = session->mapped;
    const auto& error = session->error;
    table.add_row({name, fmt::format("{} of {}", mapped.tracked, mapped.frames),
                   fmt::format("{:.2f} m", session->truth.length()),
                   std::to_string(mapped.keyframes),
                   std::to_string(session->map().landmark_count()),
                   error ? fmt::format("{:.2f} mm", 1e3 * error->translation.rmse) : "-",
                   fmt::format("{:.1f} s", session->seconds)});
  }
  return text + table.text() +
         "\nATE  root mean square distance of the camera's positions from the true ones\n\n";
}

}  // namespace

DemoPair simulated_demo(std::size_t frames, const CommonArguments& common) {
  Session target = map_session("first", 0, frames, common);
  Session source = map_session("second", 1, frames, common);
  DemoPair demo;
  demo.story = tell(target, source);
  demo.description = {
      {"sessions", {{"source", describe(source, 1)}, {"target", describe(target, 0)}}}};
  demo.target_from_source = target.world_from_map().inverse() * source.world_from_map();
  demo.trajectories = {{"source.tum", std::move(source.mapped.trajectory)},
                       {"target.tum", std::move(target.mapped.trajectory)},
                       {"source_truth.tum", std::move(source.truth)},
                       {"target_truth.tum", std::move(target.truth)}};
  demo.source = std::move(source.mapped.maps.front());
  demo.target = std::move(target.mapped.maps.front());
  return demo;
}

}  // namespace cairn::cli
