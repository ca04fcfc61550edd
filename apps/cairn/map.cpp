// SPDX-License-Identifier: BSD-3-Clause
#include <filesystem>
#include <functional>
#include <numbers>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "cairn/core/detail/output_folder.hpp"
#include "cairn/core/error.hpp"
#include "cairn/core/file.hpp"
#include "cairn/core/number_text.hpp"
#include "cairn/formats/camera_file.hpp"
#include "cairn/formats/map_file.hpp"
#include "cairn/formats/pose_graph_file.hpp"
#include "cairn/formats/trajectory_file.hpp"
#include "cairn/vision/close_loops.hpp"
#include "cairn/vision/map_sequence.hpp"
#include "cairn/vision/sequence.hpp"

#include "commands.hpp"
#include "support/adjustment.hpp"
#include "support/arguments.hpp"
#include "support/console.hpp"
#include "support/documents.hpp"

namespace cairn::cli {
namespace {

namespace fs = std::filesystem;

struct LandmarkCounts {
  std::size_t all = 0;
  std::size_t observed_again = 0;  // by two keyframes or more
  double mean_observations = 0.0;  // of those
};

LandmarkCovariance parse_covariance(const std::string& text) {
  if (text == "recursive") return LandmarkCovariance::kRecursive;
  if (text == "marginal") return LandmarkCovariance::kMarginal;
  throw Error(ErrorKind::kMisuse, "--covariance", printable(text), "recursive or marginal");
}

MiniMapLength parse_length(const std::string& text) {
  const std::string number = text.substr(0, text.size() - 1);
  MiniMapLength length;
  if (text.ends_with('m')) {
    const auto metres = parse_number(number);
    if (metres && *metres > 0.0) length.metres = *metres;
  } else if (text.ends_with('f')) {
    const auto frames = parse_unsigned(number);
    if (frames && *frames >= 2) length.frames = *frames;
  }
  refuse_if(!length.metres && !length.frames, "--mini-map-length", printable(text),
            "metres of path such as 1m, or at least 2 frames such as 50f");
  return length;
}

Rigid3 parse_start_pose(const std::string& text) {
  constexpr std::string_view kExpected = "\"tx ty tz qw qx qy qz\", the quaternion of norm 1";
  const std::vector<double> n = parse_numbers(text, "--start-pose", kExpected);
  refuse_if(n.size() != 7, "--start-pose", fmt::format("{} numbers", n.size()), kExpected);
  const Eigen::Quaterniond rotation(n[3], n[4], n[5], n[6]);
  constexpr double kTolerance = 1e-3;
  refuse_if(!(std::abs(rotation.norm() - 1.0) <= kTolerance), "--start-pose",
            fmt::format("the quaternion's norm is {}", rotation.norm()), kExpected);
  return {rotation, {n[0], n[1], n[2]}};
}

// Nothing where no progress is shown.
std::function<void(const MappingProgress&)> progress_of(
    const Console& console, const std::string& items,
    const std::function<std::string(const MappingProgress&)>& detail) {
  const auto show = console.detailed_progress("mapping");
  if (!show) return {};
  return [=, watch = Stopwatch()](const MappingProgress& now) {
    show(static_cast<double>(now.frame) / static_cast<double>(now.frames),
         fmt::format("{:.0f} {}/s, {}", static_cast<double>(now.frame) / watch.seconds(), items,
                     detail(now)));
  };
}

std::string mini_map_name(std::size_t index) {
  return fmt::format("{:04}.map", index);
}

constexpr const char* kPoseGraphFile = "pose_graph.json";

LandmarkCounts count_landmarks(std::span<const LandmarkMap> maps) {
  LandmarkCounts counts;
  std::size_t observations = 0;
  for (const LandmarkMap& map : maps) {
    counts.all += map.landmark_count();
    for (std::uint32_t i = 0; i < map.landmark_count(); ++i) {
      const std::size_t observed = map.observation_count(LandmarkIndex{i});
      if (observed < 2) continue;
      ++counts.observed_again;
      observations += observed;
    }
  }
  if (counts.observed_again > 0) {
    counts.mean_observations =
        static_cast<double>(observations) / static_cast<double>(counts.observed_again);
  }
  return counts;
}

Json counts_json(const LandmarkCounts& landmarks) {
  return {{"all", landmarks.all},
          {"observed_again", landmarks.observed_again},
          {"mean_observations", landmarks.mean_observations}};
}

std::string summary(std::size_t keyframes, const LandmarkCounts& landmarks) {
  return fmt::format(
      "{} keyframes, {} landmarks, {} of them observed by two or more keyframes ({:.1f} on "
      "average)\n",
      keyframes, landmarks.all, landmarks.observed_again, landmarks.mean_observations);
}

Json loops_json(const LoopClosedSequence& closed) {
  const ClosedLoops& loops = closed.loops;
  Json json = {{"mini_maps", closed.mini_maps},
               {"closed", loops.closed},
               {"odometry_refuted", loops.odometry_refuted},
               {"links", Json::array()},
               {"adjustment", nullptr},
               {"largest_shift_m", loops.largest_shift_m},
               {"largest_turn_deg", loops.largest_turn_rad * 180.0 / std::numbers::pi}};
  for (std::size_t i = 0; i < loops.links.size(); ++i) {
    const Link& link = loops.links[i];
    json["links"].push_back({{"target", link.target.value},
                             {"source", link.source.value},
                             {"status", link.status()},
                             {"probability", to_json(link.probability)},
                             {"used", static_cast<bool>(loops.used[i])},
                             {"reason", link.reason}});
  }
  if (loops.closed == 0) return json;
  json["adjustment"] = adjustment_json(loops.adjustment);
  return json;
}

struct MapArguments {
  CommonArguments common;
  std::string sequence;
  std::string output;
  std::string trajectory;
  std::string camera;
  std::optional<double> depth_units;
  std::optional<double> readout;
  SequenceOptions files;
  std::string start_pose;
  std::string start_from;
  std::string poses;
  std::string mini_map_length;
  bool close_loops = false;
  bool refine_intrinsics = false;
  std::string covariance = "recursive";
  MapOptions made;
  bool skip_unreadable = false;
  FeatureOptions features;

  // Where the map begins, and which poses are known or corrected.
  void add_poses_to(const Command& command) {
    const Option pose =
        command.add_text("--start-pose", start_pose,
                         "Pose of the first camera, world_from_camera (default: the identity)",
                         "\"tx ty tz qw qx qy qz\"");
    const Option from =
        command
            .add_text("--start-from", start_from,
                      "Take the first camera's pose from a trajectory in TUM format, at "
                      "the time of the first frame",
                      "FILE")
            .excludes(pose);
    const Option length = command.add_text(
        "--mini-map-length", mini_map_length,
        "Cut into mini-maps of this many metres of path or frames, each in its own frame",
        "1m|50f");
    const Option loops = command.add_flag(
        "--close-loops", close_loops,
        "Close the loops of the session: cut it into mini-maps, align these with each other, and "
        "adjust them as one map. --trajectory then writes every frame, corrected");
    loops.excludes(length);
    command
        .add_flag("--refine-intrinsics", refine_intrinsics,
                  "With --close-loops: also adjust the camera's parameters")
        .needs(loops);
    command
        .add_text(
            "--poses", poses,
            "Use these known poses, world_from_camera: a trajectory in TUM format, or a "
            "recording's odometry, poses or /tf, with the camera's place by tf_static. Only the "
            "landmarks are estimated, in that world",
            "FILE|topic:NAME[,FRAME]")
        .excludes(pose)
        .excludes(from)
        .excludes(command.option("--readout"))
        .excludes(length)
        .excludes(loops);
  }

  void add_to(const Command& command) {
    command
        .add_text(
            "sequence", sequence,
            "Recording of ROS (.bag, .mcap, .db3, or the folder of ROS 2), folder of an RGB-D "
            "sequence in the layout of TUM (rgb.txt, depth.txt), ICL-NUIM (associations.txt) or "
            "7-Scenes (frame-000000.color.png), or of a stereo sequence in that of KITTI odometry "
            "(image_0, image_1, calib.txt, times.txt) or EuRoC (mav0)")
        .required();
    command.add_text(
        "-o,--output", output,
        "Map to write; its ending selects the format: " + all_formats().endings_text() +
            "; with --mini-map-length a folder. Required",
        "FILE");
    command.add_text("--trajectory", trajectory,
                     "Also write the camera's trajectory, in TUM format: timestamp tx ty tz qx qy "
                     "qz qw per line",
                     "FILE");
    command.add_text("--camera", camera,
                     fmt::format("{}; of a stereo sequence the file of both, or LEFT,RIGHT "
                                 "(default: camera.yaml in the sequence's folder or beside the "
                                 "recording, or what the sequence brings)",
                                 kCameraHelp),
                     "CAMERA");
    command.add_text("--topics", files.topics,
                     "Topics of a recording to use, if it has several cameras: see cairn info",
                     "IMAGE,DEPTH|LEFT,RIGHT");
    add_number(
        command, "--depth-units", depth_units,
        "Depth image units per metre (default: from the camera file, else 5000; of a recording "
        "and of 7-Scenes 1000)");
    add_number(command, "--readout", readout,
               "Readout time of a rolling shutter, from the first image row to the last, "
               "seconds; 0: global "
               "shutter (default: from the camera file, else 0). Not with --poses");
    add_options(command, SequenceOptions::table, &files);
    add_poses_to(command);
    command.add_text(
        "--covariance", covariance,
        "Estimation of landmark covariances: recursive (one observation at a time) or marginal "
        "(from the whole least-squares problem)");
    add_options(command, MapOptions::table, &made);
    add_options(command, FeatureOptions::table, &features);
    command.add_flag("--skip-unreadable", skip_unreadable,
                     "Skip missing and damaged images instead of refusing the sequence");
    common.add_to(command);
    common.add_threads_to(command);
    common.add_seed_to(command);
    command.list_under("Camera and images", {"--depth-units", "--readout", "--max-time-difference",
                                             "--refine-intrinsics", "--skip-unreadable"});
    command.list_under("Frame of the map", {"--start-pose", "--start-from"});
    command.list_under("Landmarks", {"--covariance", "--min-observations", "--no-descriptors",
                                     "--descriptors-each", "--features"});
    command.footer(
        "Example: map a TUM sequence in the frame of its ground truth, and evaluate the "
        "trajectory\n"
        "  cairn map rgbd_dataset_freiburg1_desk --camera fr1 -o desk.map --trajectory desk.tum "
        "\\\n"
        "    --start-from rgbd_dataset_freiburg1_desk/groundtruth.txt\n"
        "  cairn evaluate trajectory desk.tum rgbd_dataset_freiburg1_desk/groundtruth.txt\n"
        "Example: map with known camera poses, from motion capture or another SLAM system\n"
        "  cairn map rgbd_dataset_freiburg1_desk --camera fr1 -o desk.map \\\n"
        "    --poses rgbd_dataset_freiburg1_desk/groundtruth.txt\n"
        "Example: map a recording of ROS, with its own camera\n"
        "  cairn map recording.mcap -o lab.map");
  }

  int run() {
    // Not CLI11's own check, which would come before that of options it does not know.
    refuse_if(output.empty(), "--output", "not given", "the name of the map to write");
    require_folder_of(common.json_path);
    if (!trajectory.empty()) require_folder_of(trajectory);
    if (mini_map_length.empty()) {
      require_map_path(output, "--output");
    } else {
      parse_length(mini_map_length);
      std::error_code ignored;
      refuse_if(fs::exists(output, ignored), output, "exists already", "the name of a new folder");
      require_folder_of(output);
    }
    if (!ImageSequence::is_in(sequence)) {
      const fs::path parent = (fs::path(sequence) / "..").lexically_normal();
      reject_if(ImageSequence::is_in(parent), sequence, "is a part of a sequence",
                "the sequence, " + parent.string());
      if (const auto known = foreign_content(sequence)) {
        throw Error(ErrorKind::kInput, sequence, known->what, known->advice);
      }
    }
    const std::optional<CameraFile> given = given_camera();
    if (given && given->depth_units_per_metre) {
      files.depth_units_per_metre = *given->depth_units_per_metre;
    }
    if (depth_units) files.depth_units_per_metre = *depth_units;
    if (given) files.rig = given->rig;
    with_option_names(
        {SequenceOptions::table, {"SequenceOptions.depth_units_per_metre", "--depth-units"}},
        [&] { files.validate(); });
    std::optional<ImageSequence> opened;
    const std::string calibration = camera.empty() ? camera_beside().string() : camera;
    with_option_names({{"topics", "--topics"}, {"rig", calibration}},
                      [&] { opened.emplace(sequence, files, common.console().log()); });
    const ImageSequence& images = *opened;
    files.depth_units_per_metre = images.depth_units_per_metre();
    const CameraFile camera_file = camera_of(images, given);
    if (poses.empty()) {
      run_odometry(images, camera_file);
    } else {
      run_at_poses(images, camera_file);
    }
    return kDone;
  }

 private:
  fs::path camera_beside() const {
    std::error_code ignored;
    const bool is_folder = fs::is_directory(sequence, ignored);
    return (is_folder ? fs::path(sequence) : fs::path(sequence).parent_path()) / "camera.yaml";
  }

  std::optional<CameraFile> given_camera() const {
    if (!camera.empty()) return load_calibration(camera);
    std::error_code ignored;
    if (!fs::is_regular_file(camera_beside(), ignored)) return std::nullopt;
    if (!fs::is_directory(sequence, ignored)) {
      common.console().remark("{}: the camera is that of {}", sequence, camera_beside().string());
    }
    FileReader file(camera_beside());
    return read_calibration_file(file);
  }

  CameraFile camera_of(const ImageSequence& images, const std::optional<CameraFile>& given) const {
    refuse_if(!given && !images.has_camera(), "--camera",
              "not given, and there is no " + camera_beside().string(), kCameraHelp);
    // A stereo sequence has its calibration; one camera in camera.yaml beside it gives the readout.
    CameraFile file{{}, std::nullopt, given ? given->readout_s : std::nullopt};
    const bool is_used = given && !given->rig && (!images.is_stereo() || !camera.empty());
    with_option_names({{"camera", "--camera"}}, [&] {
      file.camera = images.camera(is_used ? std::optional(given->camera) : std::nullopt);
    });
    return file;
  }

  double readout_s(const CameraFile& camera_file) const {
    return readout.value_or(camera_file.readout_s.value_or(0.0));
  }

  // With the log; the mapping tells its progress by itself.
  Execution execution(const std::string& work = {}) const {
    Execution logged = common.execution(work);
    logged.log = common.console().log();
    return logged;
  }

  // Sets what mapping by odometry and at known poses have in common.
  template <class Options>
  void set_shared(Options& options) const {
    options.map = made;
    options.map.covariance = parse_covariance(covariance);
    options.skip_unreadable = skip_unreadable;
  }

  MapSequenceOptions options(const CameraFile& camera_file) const {
    MapSequenceOptions options;
    options.odometry.features = features;
    options.odometry.readout_s = readout_s(camera_file);
    if (!start_pose.empty()) {
      options.odometry.start = [pose = parse_start_pose(start_pose)](double) { return pose; };
    }
    if (!start_from.empty()) {
      options.odometry.start = [truth = read_trajectory(start_from, common.console().log()),
                                path = start_from](double time) {
        const auto pose = interpolated(truth, time);
        if (pose) return *pose;
        throw Error(ErrorKind::kInput, path,
                    fmt::format("no pose near {:.6f} s, when the map begins", time),
                    "a trajectory that covers the sequence");
      };
    }
    if (!mini_map_length.empty()) options.mini_maps = parse_length(mini_map_length);
    set_shared(options);
    options.on_frame = progress_of(common.console(), "frames", [](const MappingProgress& now) {
      return fmt::format("{} landmarks tracked, {} frames lost", now.landmarks, now.lost);
    });
    with_option_names(
        {FeatureOptions::table, MapOptions::table, {"OdometryOptions.readout_s", "--readout"}},
        [&] { options.validate(); });
    return options;
  }

  void write(const MappedSequence& mapped) const {
    if (mini_map_length.empty()) {
      save_map(mapped.maps.front(), output, common);
    } else {
      write_mini_maps(mapped);
    }
    write_trajectory(mapped.trajectory);
  }

  void write_mini_maps(const MappedSequence& mapped) const {
    detail::OutputFolder folder(output);
    std::vector<std::string> names;
    for (std::size_t i = 0; i < mapped.maps.size(); ++i) names.push_back(mini_map_name(i));
    const PoseGraph graph = pose_graph(mapped, names);
    Json index = document("mini_maps", common, {{"sequence", sequence}}, {});
    index["session"] = graph.nodes.empty() ? Json(nullptr) : Json(graph.nodes.front().session);
    index["pose_graph"] = kPoseGraphFile;
    index["mini_maps"] = Json::array();
    for (std::size_t i = 0; i < mapped.maps.size(); ++i) {
      const LandmarkMap& mini_map = mapped.maps[i];
      write_map(mini_map, folder.unfinished() / names[i]);
      index["mini_maps"].push_back(
          {{"file", names[i]},
           {"uuid", to_json(mini_map.info().uuid)},
           {"world_from_map", to_json(graph.nodes[i].world_from_node.matrix())},
           {"keyframes", mini_map.frame_count()},
           {"landmarks", mini_map.landmark_count()},
           {"first_timestamp", mini_map.frames().timestamps_s.front().value()},
           {"last_timestamp", mini_map.frames().timestamps_s.back().value()}});
    }
    index["links"] = Json::array();
    for (std::size_t i = 0; i < mapped.links.size(); ++i) {
      index["links"].push_back(
          {{"source", mini_map_name(i + 1)},
           {"target", mini_map_name(i)},
           {"target_from_source", to_json(mapped.links[i].target_from_source->rigid())},
           {"covariance", to_json(*mapped.links[i].covariance)}});
    }
    write_file(folder.unfinished() / kPoseGraphFile,
               [text = pose_graph_text(graph)](const ByteSink& sink) { sink(text); });
    write_file(folder.unfinished() / "pose_graph.g2o",
               [&](const ByteSink& sink) { write_g2o(g2o_graph(graph), sink); });
    write_file(folder.unfinished() / "mini_maps.json",
               [text = to_text(index)](const ByteSink& sink) { sink(text); });
    folder.commit();
  }

  void write_trajectory(const Trajectory& camera_path) const {
    if (trajectory.empty()) return;
    write_file(trajectory, [&](const ByteSink& sink) {
      cairn::write_trajectory(camera_path, TrajectoryFormat::kTum, sink);
    });
  }

  // What was asked for.
  Json describe(std::size_t frames, const CameraFile& camera_file) const {
    Json json = document("map", common, {{"sequence", {{"path", sequence}, {"frames", frames}}}},
                         {{"camera", to_json(camera_file.camera)},
                          {"depth_units_per_metre", to_json(files.depth_units_per_metre)},
                          {"readout_s", poses.empty() ? readout_s(camera_file) : 0.0},
                          {"max_time_difference_s", files.max_time_difference_s},
                          {"topics", text_or_null(files.topics)},
                          {"start_pose", text_or_null(start_pose)},
                          {"start_from", text_or_null(start_from)},
                          {"poses", text_or_null(poses)},
                          {"mini_map_length", text_or_null(mini_map_length)},
                          {"close_loops", close_loops},
                          {"refine_intrinsics", refine_intrinsics},
                          {"covariance", covariance},
                          {"features", features.count},
                          {"skip_unreadable", skip_unreadable}});
    json["options"].update(options_of(MapOptions::table, &made));
    json["output"] = {{"path", output}, {"trajectory", text_or_null(trajectory)}};
    return json;
  }

  Json describe(const MappedSequence& mapped, const LandmarkCounts& landmarks,
                const CameraFile& camera_file) const {
    Json json = describe(mapped.frames, camera_file);
    json["frames"] = {{"all", mapped.frames},
                      {"tracked", mapped.tracked},
                      {"waiting", mapped.waiting},
                      {"lost", mapped.lost_frames()},
                      {"unreadable", mapped.unreadable},
                      {"without_depth", mapped.frames_without_depth}};
    json["lost"] = Json::array();
    for (const LostStretch& stretch : mapped.lost) {
      json["lost"].push_back({{"first_timestamp", stretch.first_timestamp_s},
                              {"last_timestamp", stretch.last_timestamp_s},
                              {"frames", stretch.frames}});
    }
    json["maps"] = mapped.maps.size();
    json["keyframes"] = mapped.keyframes;
    json["landmarks"] = counts_json(landmarks);
    json["mean_tracked_landmarks"] = mapped.mean_tracked_landmarks;
    json["median_reprojection_error_px"] = to_json(mapped.median_reprojection_error);
    json["path_length_m"] = mapped.trajectory.length();
    return json;
  }

  LoopClosedSequence map_closing_loops(const ImageSequence& images,
                                       const CameraFile& camera_file) const {
    const MapSequenceOptions mapping = options(camera_file);
    MergeOptions closing;
    closing.adjustment.refine_intrinsics = refine_intrinsics;
    return map_and_close_loops(images, camera_file.camera, mapping, closing,
                               execution("closing loops"));
  }

  void print_loops(const LoopClosedSequence& closed) const {
    const ClosedLoops& loops = closed.loops;
    std::string text;
    if (loops.closed == 0) {
      text =
          fmt::format("no loop closed between {} mini-maps: the map is as without --close-loops\n",
                      closed.mini_maps);
    } else {
      text = fmt::format(
          "{} loops closed between {} mini-maps: keyframes moved by up to {:.1f} cm and {:.2f}°; "
          "residuals {:.2f} px{}\n",
          loops.closed, closed.mini_maps, 100.0 * loops.largest_shift_m,
          loops.largest_turn_rad * 180.0 / std::numbers::pi, loops.adjustment.final_rms_px,
          loops.adjustment.converged ? "" : ", not converged");
      if (loops.odometry_refuted > 0) {
        text +=
            fmt::format("{} of {} steps of odometry disagree with the loops and were not used\n",
                        loops.odometry_refuted, closed.mini_maps - 1);
      }
    }
    common.console().print(text);
  }

  void print(const MappedSequence& mapped, const LandmarkCounts& landmarks, double seconds) const {
    const Console console = common.console();
    std::string text = fmt::format("{}: ", output);
    if (!mini_map_length.empty()) text += fmt::format("{} mini-maps, ", mapped.maps.size());
    text += summary(mapped.keyframes, landmarks);
    text += fmt::format("{} of {} frames tracked over {:.2f} m, {:.0f} landmarks a frame",
                        mapped.tracked, mapped.frames, mapped.trajectory.length(),
                        mapped.mean_tracked_landmarks);
    if (mapped.median_reprojection_error) {
      text +=
          fmt::format(", median reprojection error {:.2f} px", *mapped.median_reprojection_error);
    }
    text += fmt::format("; {:.1f} frames a second\n", static_cast<double>(mapped.frames) / seconds);
    if (mapped.waiting > 0) {
      text += fmt::format("{} frames came before the first with depth and texture enough\n",
                          mapped.waiting);
    }
    if (mapped.frames_without_depth > 0) {
      text += fmt::format("{} frames have no depth image near in time, or no right image\n",
                          mapped.frames_without_depth);
    }
    for (const LostStretch& stretch : mapped.lost) {
      text +=
          fmt::format("TRACKING WAS LOST in {} frames from {:.6f} to {:.6f} s: no poses there\n",
                      stretch.frames, stretch.first_timestamp_s, stretch.last_timestamp_s);
    }
    console.print(text);
  }

  void run_odometry(const ImageSequence& images, const CameraFile& camera_file) const {
    const Stopwatch watch;
    LoopClosedSequence closed;
    if (close_loops) {
      closed = map_closing_loops(images, camera_file);
    } else {
      closed.mapped = map_sequence(images, camera_file.camera, options(camera_file), execution());
    }
    const MappedSequence& mapped = closed.mapped;
    const double seconds = watch.seconds();
    reject_if(mapped.maps.empty(), sequence,
              fmt::format("none of {} frames could be tracked", mapped.frames),
              "frames with depth and texture");
    write(mapped);
    const LandmarkCounts landmarks = count_landmarks(mapped.maps);
    Json json = describe(mapped, landmarks, camera_file);
    json["loops"] = close_loops ? loops_json(closed) : Json(nullptr);
    json["duration_s"] = seconds;
    write_document(json, common);
    print(mapped, landmarks, seconds);
    if (close_loops) print_loops(closed);
  }

  MapAtPosesOptions options_at_poses() const {
    MapAtPosesOptions options;
    options.features = features;
    set_shared(options);
    options.on_frame = progress_of(common.console(), "keyframes", [](const MappingProgress& now) {
      return fmt::format("{} landmarks observed", now.landmarks);
    });
    return options;
  }

  MapAtPoses map_at_given_poses(const ImageSequence& images, const Camera& model) const {
    constexpr std::string_view kTopic = "topic:";
    const Trajectory given = poses.starts_with(kTopic)
                                 ? images.recorded_poses(poses.substr(kTopic.size()))
                                 : read_trajectory(poses, common.console().log());
    std::optional<MapAtPoses> mapped;
    with_option_names(
        {FeatureOptions::table,
         MapOptions::table,
         {"MapAtPosesOptions.map.covariance", "--covariance"},
         {"poses", poses},
         {"sequence", sequence}},
        [&] { mapped = map_at_poses(images, given, model, options_at_poses(), execution()); });
    return std::move(*mapped);
  }

  Json describe(const MapAtPoses& mapped, const LandmarkCounts& landmarks,
                const CameraFile& camera_file) const {
    Json json = describe(mapped.frames, camera_file);
    json["frames"] = {{"all", mapped.frames},
                      {"without_pose", mapped.without_pose},
                      {"without_depth", mapped.without_depth},
                      {"unreadable", mapped.unreadable}};
    json["maps"] = 1;
    json["keyframes"] = mapped.map.frame_count();
    json["landmarks"] = counts_json(landmarks);
    json["path_length_m"] = mapped.trajectory.length();
    return json;
  }

  void print(const MapAtPoses& mapped, const LandmarkCounts& landmarks, double seconds) const {
    std::string text = fmt::format("{}: {}", output, summary(mapped.map.frame_count(), landmarks));
    text += fmt::format("{} of {} frames have a pose, over {:.2f} m; {:.1f} frames a second\n",
                        mapped.trajectory.size(), mapped.frames, mapped.trajectory.length(),
                        static_cast<double>(mapped.frames) / seconds);
    if (mapped.without_pose > 0) {
      text += fmt::format("{} frames have no pose near in time: left out\n", mapped.without_pose);
    }
    if (mapped.without_depth > 0) {
      text += fmt::format("{} frames have a pose but no depth image near in time\n",
                          mapped.without_depth);
    }
    common.console().print(text);
  }

  void run_at_poses(const ImageSequence& images, const CameraFile& camera_file) const {
    const Stopwatch watch;
    const MapAtPoses mapped = map_at_given_poses(images, camera_file.camera);
    const double seconds = watch.seconds();
    save_map(mapped.map, output, common);
    write_trajectory(mapped.trajectory);
    const LandmarkCounts landmarks = count_landmarks({&mapped.map, 1});
    Json json = describe(mapped, landmarks, camera_file);
    json["duration_s"] = seconds;
    write_document(json, common);
    print(mapped, landmarks, seconds);
  }
};

}  // namespace

void add_map(const Command& program) {
  add_verb<MapArguments>(
      program, "map",
      "Build a landmark map and a trajectory from RGB-D or stereo images, or from a bag");
}

}  // namespace cairn::cli
