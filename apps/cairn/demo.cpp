// SPDX-License-Identifier: BSD-3-Clause
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/core/file.hpp"
#include "cairn/evaluation/trajectory_evaluation.hpp"
#include "cairn/formats/trajectory_file.hpp"
#include "cairn/geometry/rigid3.hpp"
#include "cairn/geometry/trajectory.hpp"
#include "cairn/map/landmark_map.hpp"
#include "cairn/map/synthetic.hpp"
#ifdef CAIRN_HAS_SIMULATED_SESSIONS
#include "cairn/experiments/simulated_session/simulated_session.hpp"
#endif

#include "commands.hpp"
#include "support/alignments.hpp"
#include "support/arguments.hpp"
#include "support/console.hpp"
#include "support/documents.hpp"
#include "support/experiment_reports.hpp"
#include "support/reports.hpp"

namespace cairn::cli {
namespace {

// A trajectory and the name of its file.
struct NamedTrajectory {
  std::string file;
  Trajectory trajectory;
};

// Two maps of one desk, each in a frame of its own, and how they came about.
struct DemoPair {
  LandmarkMap source;
  LandmarkMap target;
  Rigid3 target_from_source;  // the truth
  std::vector<NamedTrajectory> trajectories;
  std::string story;  // for people; ends a line
  Json description;   // fields for the document
};

#ifdef CAIRN_HAS_SIMULATED_SESSIONS
constexpr bool kCanSimulate = true;

// How long the camera takes for its way round the desk, so that both sessions see all of it.
constexpr double kRoundSeconds = 25.0;
constexpr double kChangedFraction = 0.1;  // of the movable things, before the second session

struct Session : SimulatedSession {
  std::optional<AbsoluteError> error;  // std::nullopt if too few frames were tracked
  double seconds = 0.0;
};

MapSequenceOptions mapping_options(const std::string& name, const CommonArguments& common) {
  MapSequenceOptions options;
  const auto show =
      common.console().detailed_progress(fmt::format("{} session: rendering, mapping", name));
  if (show) {
    options.on_frame = [show](const MappingProgress& now) {
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
    static_cast<SimulatedSession&>(session) = map_simulated_session(
        {.kind = EnvironmentKind::kDesk,
         .seed = common.seed,
         .session = number,
         .changed_fraction = number == 0 ? 0.0 : kChangedFraction},
        {.kind = PathKind::kOrbit,
         .frames = frames,
         .rate_hz = static_cast<double>(frames) / kRoundSeconds},
        SessionStart::kOwnFrame, mapping_options(name, common), common.execution());
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

// Renders two sessions with an RGB-D camera that goes round a desk once, some things moved in
// between, and maps them.
// @param frames a session
// @throws Error (misuse) if a session cannot be mapped with so few; (cancelled)
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
#else
constexpr bool kCanSimulate = false;
#endif

// Landmarks strewn over a desk and observed with noise; no images.
DemoPair synthetic_demo(const CommonArguments& common) {
  SyntheticPair pair = synthetic_pair({.seed = common.seed});
  DemoPair demo;
  demo.story = fmt::format(
      "Two synthetic sessions over one desk: {} and {} landmarks, of which {} are the same "
      "points.\n",
      pair.source.landmark_count(), pair.target.landmark_count(), pair.shared.size());
  demo.description = {{"landmarks",
                       {{"source", pair.source.landmark_count()},
                        {"target", pair.target.landmark_count()},
                        {"shared", pair.shared.size()}}}};
  demo.source = std::move(pair.source);
  demo.target = std::move(pair.target);
  demo.target_from_source = pair.target_from_source;
  return demo;
}

// The displacement happens at the landmarks: about the source's origin, a turn would also throw the
// map aside by the distance between the two.
Rigid3 displaced(const Rigid3& truth, const Rigid3& displacement, const LandmarkMap& source) {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& position : source.landmarks().positions) centre += truth * position;
  centre /= static_cast<double>(source.landmark_count());
  const Rigid3 to_centre(Eigen::Quaterniond::Identity(), centre);
  return to_centre * displacement * to_centre.inverse() * truth;
}

struct DemoArguments {
  CommonArguments common;
  std::string displacement = "0.15 -0.1 0.05 3 -4 15";
  std::string save;
  bool synthetic = false;
  std::size_t frames = 150;

  void add_to(const Command& command) {
    common.seed = 1;
    if (kCanSimulate) {
      const Option flag =
          command.add_flag("--synthetic", synthetic,
                           "Align maps of random landmarks, without images; takes a second");
      add_number(command, "--frames", frames, "Frames per session, along one orbit of the desk")
          .excludes(flag);
    } else {
      command.add_flag("--synthetic", synthetic,
                       "Align maps of random landmarks; this build, without OpenCV, Ceres or "
                       "Embree, always does");
    }
    command.add_text(
        "--displacement", displacement,
        "Displacement of the initial pose from the true one: \"x y z roll pitch yaw\", metres "
        "and degrees",
        "POSE");
    command.add_text(
        "--save", save,
        kCanSimulate
            ? "Write source.map, target.map, truth.txt, initial.txt and the cameras' "
              "trajectories (.tum) to FOLDER, which is new or empty"
            : "Write source.map, target.map, truth.txt and initial.txt to FOLDER, which is new "
              "or empty",
        "FOLDER");
    common.add_report_to(command, "the verdict, the maps in 3D at each iteration, and charts");
    common.add_to(command);
    common.add_threads_to(command);
    common.add_seed_to(command);
    command.footer(
        "Example: save the maps and align them\n"
        "  cairn demo --save desk\n"
        "  cairn align desk/source.map desk/target.map\n"
        "  cairn align desk/source.map desk/target.map --initial-matrix desk/initial.txt \\\n"
        "      --truth desk/truth.txt --method icp --confidence observations");
  }

  int run() {
    const Rigid3 offset = parse_pose(displacement, "--displacement");
    check();
    std::unique_ptr<detail::OutputFolder> folder;
    if (!save.empty()) folder.reset(new detail::OutputFolder(result_folder(save)));
    require_outputs(common);
    const DemoPair pair = make_pair();
    common.console().print(pair.story);  // before the alignments, which take a while
    IcpOptions options;
    options.overlap_radius = 0.05;
    options.trace = !common.report_path.empty();
    options.initial = displaced(pair.target_from_source, offset, pair.source);
    std::vector<StrategyResult> alignments = align_by_all(
        pair.source, pair.target, parse_strategies("base,covariance,observations,distance"),
        by_icp_alone(options, {}), pair.target_from_source, common);
    AlignOptions everywhere;
    everywhere.trace = options.trace;
    everywhere.overlap_radius = options.overlap_radius;
    CommonArguments searching = common;
    searching.seed = 0;  // --seed is of the sessions
    std::vector<StrategyResult> searched =
        align_by_all(pair.source, pair.target, parse_strategies("base"), everywhere,
                     pair.target_from_source, searching);
    alignments.push_back(std::move(searched.front()));

    std::string saved;
    if (folder) {
      saved = save_to_folder(pair, options.initial, folder->unfinished());
      folder->commit();
    }
    Json json = document("demo", common, Json::object(), options_json(), kAlignmentVersion);
    json.update(pair.description);
    json["truth"] = to_json(pair.target_from_source);
    json["initial"] = to_json(options.initial);
    json["results"] = Json::array();
    for (const StrategyResult& alignment : alignments) {
      json["results"].push_back(to_json(alignment, HistoryDetail::kPoses));
    }
    write_document(json, common);
    print(pair, options, alignments, saved);
    if (!common.report_path.empty()) {
      write_report(make_report(pair, options.initial, alignments, json), common);
    }
    return kDone;
  }

 private:
  void check() const {
    constexpr std::size_t kFewest = 10;
    constexpr std::size_t kMost = 10000;
    refuse_if(frames < kFewest || frames > kMost, "--frames", fmt::format("{}", frames),
              fmt::format("{} to {}", kFewest, kMost));
  }

  DemoPair make_pair() const {
#ifdef CAIRN_HAS_SIMULATED_SESSIONS
    if (!synthetic) return simulated_demo(frames, common);
#endif
    return synthetic_demo(common);
  }

  Json options_json() const {
    const bool simulates = kCanSimulate && !synthetic;
    return {{"synthetic", !simulates},
            {"frames", simulates ? Json(frames) : Json(nullptr)},
            {"displacement", displacement}};
  }

  report::Report make_report(const DemoPair& pair, const Rigid3& initial,
                             const std::vector<StrategyResult>& alignments,
                             const Json& json) const {
    ReportedPair shown;
    shown.source_name = "Second session";
    shown.target_name = "first session";
    shown.source = &pair.source;
    shown.target = &pair.target;
    shown.initial = initial;
    shown.truth = pair.target_from_source;
    shown.results = alignments;
    // Its table is for a terminal; the sentences before are for all.
    std::string story = pair.story.substr(0, pair.story.find("\n\n"));
    if (story.ends_with(':')) story.back() = '.';
    shown.story = std::move(story);
    report::Report report = begin_report("Two sessions of one desk", common);
    report.subtitle = subtitle_of(alignments, LengthUnit::kMetres);
    set_provenance(report, json);
    add_pair(report, shown);
    return report;
  }

  std::string save_to_folder(const DemoPair& pair, const Rigid3& initial,
                             const std::filesystem::path& folder) const {
    std::string names = "source.map target.map truth.txt initial.txt";
    save_map(pair.source, folder / "source.map", common);
    save_map(pair.target, folder / "target.map", common);
    write_pose(folder / "truth.txt", pair.target_from_source);
    write_pose(folder / "initial.txt", initial);
    for (const NamedTrajectory& named : pair.trajectories) {
      write_file(folder / named.file, [&](const ByteSink& sink) {
        write_trajectory(named.trajectory, TrajectoryFormat::kTum, sink);
      });
      names += " " + named.file;
    }
    return names;
  }

  void print(const DemoPair& pair, const IcpOptions& options,
             const std::vector<StrategyResult>& alignments, const std::string& saved) const {
    const Console console = common.console();
    const PoseError start =
        pose_error(options.initial, pair.target_from_source, pair.source.landmarks().positions);
    const StrategyResult& searched = alignments.back();
    console.print(
        "Pose of the second session in the first, found without an initial pose:\n"
        "\n"
        "{}",
        verdict_text(status_of(searched.alignment), searched.alignment.reason));
    if (searched.error) {
      console.print("Its error is {:.2f} mm and {:.3f} degrees.\n",
                    1e3 * searched.error->translation, degrees(searched.error->rotation_rad));
    }
    console.print(
        "\n"
        "The paper's ICP, from an initial pose {:.2f} m and {:.1f} degrees off and "
        "without a verdict:\n"
        "\n",
        start.translation, degrees(start.rotation_rad));
    const std::vector<StrategyResult> by_icp(alignments.begin(), alignments.end() - 1);
    console.print(alignment_table(by_icp, LengthUnit::kMetres));
    console.print(
        "error    difference from the true pose; a lower score does not always mean a smaller "
        "error\n"
        "\n"
        "Confidence base is plain ICP: it matches each landmark to the nearest one. The others "
        "match it to\n"
        "the most confident of the k nearest: smallest covariance, most observations, closest "
        "observer.\n");
    if (!saved.empty()) console.print("\nSaved to {}: {}\n", save, saved);
  }
};

}  // namespace

void add_demo(const Command& program) {
  add_verb<DemoArguments>(
      program, "demo",
      kCanSimulate
          ? "Simulate and map two sessions at one desk, then align the maps and judge the pose"
          : "Align two synthetic maps of one desk with every strategy");
}

}  // namespace cairn::cli
