// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include <Eigen/Geometry>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include "cairn/core/error.hpp"
#include "cairn/core/file.hpp"
#include "cairn/formats/camera_file.hpp"
#include "cairn/formats/foreign/ros2_recording.hpp"
#include "cairn/formats/trajectory_file.hpp"
#include "cairn/simulation/environment.hpp"
#include "cairn/simulation/path.hpp"
#include "cairn/simulation/simulator.hpp"
#include "cairn/vision/sequence.hpp"

#include "commands.hpp"
#include "support/arguments.hpp"
#include "support/documents.hpp"
#include "support/interrupt.hpp"

namespace cairn::cli {
namespace {

// What stands where: the box about each thing, in the world's frame.
Json things_json(const Scene& scene) {
  std::vector<Eigen::AlignedBox3d> boxes(scene.objects.size());
  for (const Surface& surface : scene.surfaces) {
    for (const Eigen::Vector3d& corner : surface.corners()) boxes[surface.object].extend(corner);
  }
  Json things = Json::array();
  for (std::size_t i = 0; i < boxes.size(); ++i) {
    if (boxes[i].isEmpty()) continue;
    const Eigen::Vector3d& low = boxes[i].min();
    const Eigen::Vector3d& high = boxes[i].max();
    things.push_back({{"name", scene.objects[i].name},
                      {"movable", scene.objects[i].movable},
                      {"moved", scene.objects[i].moved},
                      {"low", {low.x(), low.y(), low.z()}},
                      {"high", {high.x(), high.y(), high.z()}}});
  }
  return things;
}

constexpr double kRosDepthUnits = 1000.0;  // REP 118

struct SimulateArguments {
  CommonArguments common;
  std::string folder;
  std::string environment = "desk";
  std::string path = "sweep";
  std::optional<std::size_t> frames;
  std::optional<double> duration_s;
  std::optional<std::uint64_t> layout;
  PathOptions path_options;
  EnvironmentOptions environment_options;
  SimulatorOptions options;
  std::string camera;
  std::string color_format = "jpeg";
  double depth_units_per_metre = kTumDepthUnits;
  std::string sensor = "rgbd";
  std::optional<double> baseline_m;

  void add_to(const Command& command) {
    common.seed = 1;
    command
        .add_text("folder", folder,
                  "Folder for the sequence, created if it does not exist; or a recording of ROS 2, "
                  "which ends in .mcap",
                  "")
        .required();
    command.add_text("--environment", environment,
                     fmt::format("Place: {}", fmt::join(environment_names(), ", ")), "NAME");
    command.add_text("--path", path,
                     "Path of the camera: sweep, orbit, walk, or a trajectory file in TUM format",
                     "NAME|FILE");
    const Option frame_option = add_number(
        command, "--frames", frames, "Number of frames (default: 300, or the whole trajectory)");
    add_number(command, "--duration", duration_s, "Duration in seconds, instead of --frames")
        .excludes(frame_option);
    add_options(command, PathOptions::table, &path_options);
    add_number(command, "--layout", layout,
               "Layout of the place: 1 as designed, others stretched or mirrored, with other "
               "furniture. Places with one layout and different seeds look similar (default: the "
               "seed; 1 with a trajectory file)");
    add_options(command, EnvironmentOptions::table, &environment_options);
    command.add_text(
        "--camera", camera,
        fmt::format("{} (default: 640 x 480 pixels, focal length 525, no distortion)", kCameraHelp),
        "CAMERA");
    command.add_text("--sensor", sensor,
                     "rgbd, as folder in TUM's layout, or stereo, a pair of cameras, as folder in "
                     "EuRoC's",
                     "rgbd|stereo");
    add_number(command, "--baseline", baseline_m,
               "Between the cameras of --sensor stereo, metres (default: 0.11)");
    add_options(command, SimulatorOptions::table, &options);
    add_options(command, SensorOptions::table, &options.sensor);
    command.add_text("--color-format", color_format, "png or jpeg (quality 95)", "FORMAT");
    common.add_to(command);
    common.add_threads_to(command);
    common.add_seed_to(command);
    command.footer(
        "Example: simulate two sessions at one desk, with a tenth of the objects moved in the "
        "second\n"
        "  cairn simulate first --environment desk --duration 10\n"
        "  cairn simulate second --environment desk --duration 10 --session 1 --changed 0.1\n"
        "Both groundtruth.txt files are in one world frame.");
  }

  int run() {
    check();
    require_folder_of(common.json_path);
    if (is_recording()) {
      require_folder_of(folder);
      depth_units_per_metre = kRosDepthUnits;
    } else {
      refuse_existing();
    }
    Json inputs = Json::object();
    if (!camera.empty()) {
      const CameraFile read = load_camera(camera);
      options.camera = read.camera;
      refuse_if(
          is_recording() && read.depth_units_per_metre.value_or(kRosDepthUnits) != kRosDepthUnits,
          camera, "depth units of a recording of ROS", "1000 a metre");
      depth_units_per_metre = read.depth_units_per_metre.value_or(depth_units_per_metre);
      inputs["camera"] = describe_file(camera, common, true);
    }
    if (path_is_file()) {
      const FileReader readable(path);  // fails before the work
      inputs["trajectory"] = {{"path", path}, {"hash", hash_file(path)}};
    }
    // Takes the folder before the work, so that two runs into one do not both do it.
    std::optional<SequenceWriter> writer;
    if (!is_recording()) make_writer(writer);
    const Stopwatch watch;
    const Executor executor = common.executor();
    Environment place = make_environment(environment_options, executor);
    Trajectory trajectory = make_trajectory(place);
    const RgbdSimulator simulator(std::move(place.scene), std::move(trajectory), options, executor);
    const double ready = watch.seconds();
    if (writer) {
      write_folder(simulator, *writer);
    } else {
      write_recording(simulator);
    }
    const double rendering = watch.seconds() - ready;

    const auto& objects = simulator.scene().objects;
    const auto count_of = [&](bool SceneObject::*property) {
      return std::count_if(objects.begin(), objects.end(),
                           [&](const SceneObject& object) { return object.*property; });
    };
    Json json = document("simulate", common, std::move(inputs), options_json());
    json["sequence"] = {{"path", folder},
                        {"frames", simulator.frame_count()},
                        {"duration_s", simulator.trajectory().duration_s()},
                        {"path_length_m", simulator.trajectory().length()}};
    json["objects"] = {{"all", objects.size()},
                       {"movable", count_of(&SceneObject::movable)},
                       {"moved", count_of(&SceneObject::moved)},
                       {"things", things_json(simulator.scene())}};
    write_document(json, common);
    common.console().print(
        "{}: {} frames of {} x {}, {:.1f} s along {:.1f} m of path\n"
        "  {} objects, of which {} movable and {} moved\n"
        "  made in {:.1f} s and {:.1f} s to set up: {:.0f} frames a second\n",
        folder, simulator.frame_count(), options.camera.width, options.camera.height,
        simulator.trajectory().duration_s(), simulator.trajectory().length(), objects.size(),
        count_of(&SceneObject::movable), count_of(&SceneObject::moved), rendering, ready,
        static_cast<double>(simulator.frame_count()) / std::max(rendering, 1e-9));
    return kDone;
  }

 private:
  bool path_is_file() const { return path != "sweep" && path != "orbit" && path != "walk"; }

  bool is_stereo() const { return options.stereo_baseline_m > 0.0; }

  bool is_recording() const { return std::filesystem::path(folder).extension() == ".mcap"; }

  void check_sensor() {
    refuse_if(sensor != "rgbd" && sensor != "stereo", "--sensor", printable(sensor),
              "rgbd or stereo");
    refuse_if(baseline_m && sensor != "stereo", "--baseline", "given for an RGB-D sensor",
              "--sensor stereo");
    refuse_if(baseline_m && !(*baseline_m > 0.0), "--baseline", fmt::format("{}", *baseline_m),
              "more than 0 metres");
    constexpr double kUsualBaseline = 0.11;
    if (sensor == "stereo") options.stereo_baseline_m = baseline_m.value_or(kUsualBaseline);
  }

  // The library names its own fields; people know the options.
  void check() {
    check_sensor();
    if (!path_is_file()) path_options.kind = path_kind(path);
    environment_options.kind = environment_kind(environment);
    if (duration_s) {
      refuse_if(!(*duration_s > 0.0), "--duration", fmt::format("{}", *duration_s),
                "more than 0 seconds");
      frames = static_cast<std::size_t>(
          std::clamp(std::round(*duration_s * path_options.rate_hz), 1.0, 1e7));
    }
    if (frames || !path_is_file()) path_options.frames = frames.value_or(path_options.frames);
    refuse_if(color_format != "png" && color_format != "jpeg", "--color-format",
              printable(color_format), "png or jpeg");
    environment_options.seed = common.seed;
    // A given trajectory knows one plan alone.
    environment_options.layout = layout ? layout : path_is_file() ? 1 : common.seed;
    const SessionSeeds seeds = session_seeds(common.seed, environment_options.session);
    path_options.seed = seeds.path;
    options.seed = seeds.noise;
    with_option_names({PathOptions::table,
                       EnvironmentOptions::table,
                       SensorOptions::table,
                       SimulatorOptions::table,
                       {"PathOptions.frames", "--frames"},
                       {"SimulatorOptions.stereo_baseline_m", "--baseline"}},
                      [&] {
                        path_options.validate();
                        environment_options.validate();
                        options.validate();
                      });
  }

  void refuse_existing() const {
    if (SequenceWriter::is_unfinished(folder)) return;
    for (const char* const name :
         {"rgb.txt", "depth.txt", "mav0", "groundtruth.txt", "camera.yaml"}) {
      std::error_code ignored;  // writing explains it
      refuse_if(std::filesystem::exists(std::filesystem::path(folder) / name, ignored), folder,
                fmt::format("holds {} already", name), "a new folder");
    }
  }

  Trajectory make_trajectory(const Environment& place) const {
    if (!path_is_file()) return make_path(place, path_options);
    FileReader file(path);
    Trajectory result = resampled(read_trajectory(file, {}, common.console().log()),
                                  path_options.rate_hz, frames.value_or(0));
    constexpr double kTouching = 0.05;
    const auto near =
        std::count_if(result.poses().begin(), result.poses().end(), [&](const TimedPose& pose) {
          return place.scene.distance(pose.world_from_camera.translation()) < kTouching;
        });
    if (near > 0) {
      common.console().remark(
          "{}: {} of {} poses lie less than {} cm from something in "
          "the {}",
          path, near, result.size(), 100.0 * kTouching, environment);
    }
    return result;
  }

  void make_writer(std::optional<SequenceWriter>& writer) const {
    const ColorFormat format = color_format == "png" ? ColorFormat::kPng : ColorFormat::kJpeg;
    if (!is_stereo()) {
      writer.emplace(folder, format, depth_units_per_metre);
      return;
    }
    const Rigid3 left_from_right(Eigen::Quaterniond::Identity(),
                                 {options.stereo_baseline_m, 0.0, 0.0});
    writer.emplace(folder, StereoRig{options.camera, options.camera, left_from_right}, format);
  }

  void write_folder(const RgbdSimulator& simulator, SequenceWriter& writer) const {
    render(simulator, [&](RgbdFrame frame) {
      const ColorImage color(frame.width, frame.height, std::move(frame.bgr));
      if (is_stereo()) {
        writer.add(frame.timestamp_s, color,
                   ColorImage(frame.width, frame.height, std::move(frame.right_bgr)));
      } else {
        writer.add(frame.timestamp_s, color,
                   DepthImage(frame.width, frame.height, std::move(frame.depth_m)));
      }
      return [] {};
    });
    writer.add_file("groundtruth.txt", [&](const ByteSink& sink) {
      write_trajectory(simulator.trajectory(), TrajectoryFormat::kTum, sink);
    });
    writer.add_file("camera.yaml", [&](const ByteSink& sink) {
      const auto readout =
          options.readout_s > 0.0 ? std::optional(options.readout_s) : std::nullopt;
      const auto units = is_stereo() ? std::nullopt : std::optional(depth_units_per_metre);
      sink(camera_file_text({options.camera, units, readout}));
    });
    writer.finish();
  }

  void write_recording(const RgbdSimulator& simulator) const {
    const std::string first = is_stereo() ? "/camera/left" : "/camera/color";
    const std::string second = is_stereo() ? "/camera/right" : "/camera/aligned_depth_to_color";
    write_file(folder, [&](const ByteSink& sink) {
      Ros2RecordingWriter recording(sink);
      const auto poses = simulator.trajectory().poses();
      const auto stamp_of = [&](double time_s, std::string_view frame) {
        refuse_if(!(time_s >= 0.0 && time_s < 0x1p32), path, fmt::format("a pose at {} s", time_s),
                  "times that ROS can state: 0 to 2^32 s");
        return Ros2RecordingWriter::Stamp{
            1000 * static_cast<std::uint64_t>(std::llround(1e6 * time_s)), frame};
      };
      const CameraCalibration cameras[] = {
          ros_calibration(options.camera),
          ros_calibration(options.camera, options.stereo_baseline_m)};
      const auto encoded = [&](const ColorImage& image) {
        return color_format == "png" ? std::string(image.values.begin(), image.values.end())
                                     : jpeg_bytes(image);
      };
      const auto add_color = [&](const std::string& camera_name,
                                 const Ros2RecordingWriter::Stamp& stamp,
                                 const std::string& bytes) {
        if (color_format == "png") {
          recording.add_image(camera_name + "/image_raw", stamp, options.camera.width,
                              options.camera.height, "bgr8", bytes);
        } else {
          recording.add_jpeg(camera_name + "/image_raw/compressed", stamp, bytes);
        }
      };
      std::size_t next = 0;
      render(simulator, [&](RgbdFrame frame) {
        const std::string color =
            encoded(ColorImage(frame.width, frame.height, std::move(frame.bgr)));
        std::string other;
        if (is_stereo()) {
          other = encoded(ColorImage(frame.width, frame.height, std::move(frame.right_bgr)));
        } else {
          const StoredDepthImage depth =
              stored_depth(DepthImage(frame.width, frame.height, std::move(frame.depth_m)),
                           depth_units_per_metre);
          other.assign(reinterpret_cast<const char*>(depth.values.data()), 2 * depth.values.size());
        }
        return [&, color, other, time_s = frame.timestamp_s] {
          const auto stamp = stamp_of(time_s, "camera");
          recording.add_camera(first + "/camera_info", stamp, cameras[0]);
          recording.add_camera(second + "/camera_info", stamp, cameras[1]);
          add_color(first, stamp, color);
          if (is_stereo()) {
            add_color(second, stamp, other);
          } else {
            recording.add_image(second + "/image_raw", stamp, options.camera.width,
                                options.camera.height, "16UC1", other);
          }
          recording.add_pose("/ground_truth", stamp_of(time_s, "world"),
                             poses[next++].world_from_camera);
        };
      });
      recording.finish();
    });
    if (options.readout_s > 0.0) {
      common.console().remark("{}: recordings of ROS do not state a readout: map it with --readout",
                              folder);
    }
  }

  // `take` has each frame on some thread; what it returns is called in the order of time.
  void render(const RgbdSimulator& simulator,
              const std::function<std::function<void()>(RgbdFrame)>& take) const {
    const Progress progress = common.console().progress("rendering");
    const auto stop = interrupt_requests();
    const Executor executor = common.executor();
    const std::size_t count = simulator.frame_count();
    // A frame each thread: rendering one and compressing another go on side by side.
    const std::size_t batch = 16;
    for (std::size_t begin = 0; begin < count; begin += batch) {
      std::vector<std::function<void()>> finish(std::min(batch, count - begin));
      executor.for_blocks(finish.size(), 1, [&](std::size_t i, std::size_t) {
        if (!stop.stop_requested()) finish[i] = take(simulator.frame(begin + i));
      });
      if (stop.stop_requested()) {
        throw Error(ErrorKind::kCancelled, folder, "the simulation was cancelled", "");
      }
      for (const auto& step : finish) step();
      if (progress) {
        progress(static_cast<double>(begin + finish.size()) / static_cast<double>(count));
      }
    }
  }

  Json options_json() const {
    const Camera& model = options.camera;
    return {{"environment", environment},
            {"path", path},
            {"rate_hz", path_options.rate_hz},
            {"layout", *environment_options.layout},
            {"session", environment_options.session},
            {"changed", environment_options.changed_fraction},
            {"camera", to_json(model)},
            {"sensor", sensor},
            {"stereo_baseline_m", options.stereo_baseline_m},
            {"exposure", options.sensor.exposure},
            {"motion_blur_s", options.shutter_s},
            {"readout_s", options.readout_s},
            {"color_noise", options.sensor.color_noise},
            {"depth_noise_m", options.sensor.depth_noise_m},
            {"depth_step_m", options.sensor.depth_step_m},
            {"min_depth_m", options.sensor.min_depth_m},
            {"max_depth_m", options.sensor.max_depth_m},
            {"ideal_depth", options.sensor.ideal_depth},
            {"color_format", color_format},
            {"depth_units_per_metre", depth_units_per_metre}};
  }
};

}  // namespace

void add_simulate(const Command& program) {
  add_verb<SimulateArguments>(program, "simulate",
                              "Write a simulated RGB-D or stereo sequence with ground truth");
}

}  // namespace cairn::cli
