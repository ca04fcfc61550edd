// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/core/file.hpp"
#include "cairn/core/number_text.hpp"
#include "cairn/core/text.hpp"
#include "cairn/formats/map_file.hpp"
#include "cairn/formats/pose_graph_file.hpp"
#include "cairn/formats/trajectory_file.hpp"
#include "cairn/map/operations.hpp"

#ifdef CAIRN_HAS_ADJUSTMENT
#include "cairn/adjustment/adjust.hpp"
#endif

#ifdef CAIRN_HAS_ODOMETRY
#include "cairn/vision/map_images.hpp"
#endif

#include "commands.hpp"
#include "support/arguments.hpp"
#include "support/documents.hpp"

namespace cairn::cli {
namespace {

struct FrameRange {
  FrameId begin;
  FrameId end;
};

struct ConvertArguments {
  CommonArguments common;
  std::string input;
  std::string output;
  std::string frames;
  std::size_t min_observations = 0;
  PoseArguments transform;
  std::string confidence;
  std::string camera;
  std::string format;
  std::optional<int> format_version;
  bool ascii = false;
  bool double_precision = false;
  bool enu = false;
  bool estimate_covariances = false;
  std::optional<double> pixel_noise;
  std::string apply;
  std::string images;
  MapLoading loading;

  void add_to(const Command& command);
  int run();

 private:
  // What the command line says of the map, read and checked before it.
  struct Changes {
    std::optional<FrameRange> range;
    std::optional<Camera> camera;
    std::vector<Strategy> strategies;
    std::optional<Rigid3> new_from_old;
  };

  void add_transforms_to(const Command& command);
  void add_estimates_to(const Command& command);
  Changes changes() const;
  LandmarkMap changed(LandmarkMap map, const Changes& made, Json& covariances) const;
  Json describe(const LoadedMap& loaded, const Changes& made, const LandmarkMap& map,
                bool has_frames) const;
  const MapFormat& output_format() const;
  LandmarkMap with_descriptors(const LandmarkMap& map) const;
  LandmarkMap with_estimated_covariances(const LandmarkMap& map, Json& json) const;
  bool move_points(std::string_view first) const;
  bool convert_trajectory(std::string_view first) const;
  void refuse_atlas(std::string_view first) const;
  void refuse_options_of_maps(std::string_view input_is) const;
  std::optional<PoseGraph> read_graph(std::string_view first) const;
  bool write_graph(std::string_view first) const;
};

FrameRange parse_frames(const std::string& text) {
  const std::size_t colon = text.find(':');
  const auto begin = parse_unsigned(text.substr(0, colon));
  const auto end =
      colon == std::string::npos ? std::nullopt : parse_unsigned(text.substr(colon + 1));
  refuse_if(!begin || !end || *begin >= *end, "--frames", printable(text),
            "A:B, two frame ids with A below B");
  return {FrameId{*begin}, FrameId{*end}};
}

void ConvertArguments::add_transforms_to(const Command& command) {
  transform.add_to(command, "transform", "Transform the map by new_from_old");
  command.add_text(
      "--apply", apply,
      "Transform the input. FILE is the JSON of cairn align; or 16 numbers, row-major; or "
      "merge.json#MAP: the JSON of cairn merge, cairn atlas merge or cairn atlas show, and the map "
      "whose pose is used; or nerfstudio's dataparser_transforms.json. The input is a map, a "
      "trajectory, or a PLY cloud or mesh, whose other properties are kept",
      "FILE");
  command.add_flag(
      "--enu", enu,
      "Transform a map with a georeference into its ENU frame: metres to the east, north and up");
}

#ifdef CAIRN_HAS_ADJUSTMENT
void ConvertArguments::add_estimates_to(const Command& command) {
  const Option estimate = command.add_flag(
      "--estimate-covariances", estimate_covariances,
      "Replace the covariances of landmarks and poses by estimates from their observations, with "
      "the first frame fixed; without depths, the distance to the farthest frame is fixed too");
  add_number(command, "--pixel-noise", pixel_noise,
             "With --estimate-covariances: standard deviation of an observation, in pixels "
             "(default: from the residuals)")
      .needs(estimate);
}
#else
void ConvertArguments::add_estimates_to(const Command&) {}
#endif

void ConvertArguments::add_to(const Command& command) {
  command
      .add_text(
          "input", input,
          "Map to read: " + all_formats().titles_text() +
              "; - for stdin; or a trajectory in TUM, EuRoC or KITTI format; or a pose graph in "
              "g2o or JSON")
      .required();
  command
      .add_text("output", output,
                "Map to write; its ending selects the format: " + all_formats().endings_text() +
                    "; - for stdout, with --format")
      .required();
  command.add_text(
      "--format", format,
      "Output format, whatever the output's ending: " + all_formats().written_names_text() +
          "; for a trajectory: tum (default), euroc (.csv) or kitti; for a pose graph: kitti, "
          "because its poses have no times (default: g2o or JSON, by the output's ending)",
      "FORMAT");
  command.add_text(
      "--frames", frames,
      "Cut out a mini-map: keep frames with ids from A to below B, and landmarks observed "
      "only in these frames",
      "A:B");
  add_number(command, "--min-observations", min_observations,
             "Leave out landmarks with fewer observations, after --frames");
  add_transforms_to(command);
  command.add_text("--confidence", confidence,
                   "Add a column confidence_METRIC for each metric: " + confidence_help(),
                   "METRIC,...");
  command.add_text("--camera", camera, fmt::format("Camera of all frames: {}", kCameraHelp),
                   "CAMERA");
#ifdef CAIRN_HAS_ODOMETRY
  command.add_text(
      "--images", images,
      "Compute SIFT descriptors of the landmarks from the map's images, which are in this "
      "folder and named as in the map",
      "FOLDER");
#endif
  add_estimates_to(command);
  add_number(
      command, "--format-version", format_version,
      "Version of the text format, 1, 2 or 3 (default: the lowest that holds the whole map)");
  command.add_flag("--ascii", ascii, "Write PLY and PCD as text instead of binary");
  command.add_flag("--double", double_precision,
                   "PCD: write positions in double precision, which PCL's point types cannot read");
  loading.add_to(command);
  command.add_flag("--strict", loading.strict,
                   "Fail with exit code 3 if Cairn's maps or the output's format cannot hold "
                   "something of the input");
  common.add_to(command);
#ifdef CAIRN_HAS_ADJUSTMENT
  common.add_threads_to(command);
#endif
  command.list_under("Details of formats",
                     {"--format-version", "--ascii", "--double", "--convention", "--pixel-noise"});
  command.footer(
      "Example: cut a long map into two mini-maps, and write one for a PLY viewer\n"
      "  cairn convert desk.map first.map --frames 0:120\n"
      "  cairn convert desk.map second.map --frames 120:240\n"
      "  cairn convert first.map first.ply --confidence covariance,observations\n"
      "Example: write the pose graph of an RTAB-Map database\n"
      "  cairn convert rtabmap.db graph.g2o\n"
      "Example: write a map for Foxglove, Lichtblick or rerun\n"
      "  cairn convert desk.map desk.mcap\n"
      "Example: transform a dense cloud by the alignment of its map\n"
      "  cairn align sparse/0 other/sparse/0 --scale --json result.json\n"
      "  cairn convert dense/fused.ply moved.ply --apply result.json\n"
      "Example: transform the dense cloud of one of several merged maps\n"
      "  cairn merge one/sparse/0 two/sparse/0 -o merged/ --json merge.json\n"
      "  cairn convert two/dense/fused.ply moved.ply --apply merge.json#two");
}

const MapFormat& ConvertArguments::output_format() const {
  const bool to_stdout = output == "-";
  if (to_stdout) {
    require_map_output(output, format, "output");
  } else if (format.empty()) {
    require_map_path(output, "output");
  }
  const MapFormat* const written =
      format.empty() ? all_formats().format_of_ending(output) : all_formats().find(format);
  refuse_if(written == nullptr || !written->is_written(), "--format", printable(format),
            all_formats().written_names_text());
  if (!to_stdout) require_place_of(output, *written);
  refuse_if(format_version && written->name != "text", "--format-version",
            output + " is not in the text format", "an output that ends in .map or .txt");
  if (format_version && (*format_version < 1 || *format_version > 3)) {
    throw Error(ErrorKind::kMisuse, "--format-version", std::to_string(*format_version),
                "1, 2 or 3");
  }
  refuse_if(ascii && written->name != "ply" && written->name != "pcd", "--ascii",
            output + " is neither PLY nor PCD", "an output that ends in .ply or .pcd");
  return *written;
}

#ifdef CAIRN_HAS_ADJUSTMENT
LandmarkMap ConvertArguments::with_estimated_covariances(const LandmarkMap& map, Json& json) const {
  CovarianceOptions how;
  if (pixel_noise) {
    how.noise = estimated_noise(map);
    how.noise->pixel_px = *pixel_noise;
  }
  EstimatedCovariances estimated;
  with_option_names({{"MeasurementNoise.pixel_px", "--pixel-noise"}},
                    [&] { estimated = cairn::estimate_covariances(map, how, common.execution()); });
  const MeasurementNoise& noise = estimated.noise;
  const bool has_depths =
      map.info().length_unit == LengthUnit::kMetres && !map.observations().depths.empty();
  json = {{"known", estimated.known},
          {"pixel_noise_px", noise.pixel_px},
          {"depth_noise", has_depths ? Json({{"floor_m", noise.depth_floor},
                                             {"quadratic_per_m", noise.depth_quadratic}})
                                     : Json(nullptr)}};
  common.console().print("covariances of {} of {} landmarks, by pixel noise of {:.3g} px{}\n",
                         estimated.known, map.landmark_count(), noise.pixel_px,
                         has_depths ? fmt::format(" and depth noise of {:.2g} + {:.2g} z^2 m",
                                                  noise.depth_floor, noise.depth_quadratic)
                                    : std::string());
  return estimated.map;
}
#endif

#ifdef CAIRN_HAS_ODOMETRY
LandmarkMap ConvertArguments::with_descriptors(const LandmarkMap& map) const {
  DescribedMap described;
  with_option_names({{images, "--images " + images}}, [&] {
    described = with_image_descriptors(map, std::filesystem::path(images), common.execution());
  });
  const auto& known = described.map.landmarks().descriptors->known;
  common.console().print("SIFT descriptors of {} of {} landmarks, by {} of {} images\n",
                         std::count(known.begin(), known.end(), 1), map.landmark_count(),
                         described.images, map.frame_count());
  return described.map;
}
#endif

// An option without effect would let a script believe that it had one.
void ConvertArguments::refuse_options_of_maps(std::string_view input_is) const {
  const std::pair<std::string_view, bool> options[] = {
      {"--frames", !frames.empty()},
      {"--min-observations", min_observations > 0},
      {"--confidence", !confidence.empty()},
      {"--camera", !camera.empty()},
      {"--images", !images.empty()},
      {"--enu", enu},
      {"--estimate-covariances", estimate_covariances},
      {"--format-version", format_version.has_value()},
      {"--ascii", ascii},
      {"--double", double_precision},
      {"--json", !common.json_path.empty()}};
  for (const auto& [option, is_given] : options) {
    refuse_if(is_given, option, fmt::format("given for {}", input_is), "an input that is a map");
  }
}

// Moves a PLY file as what it is. @return false for what is read as a map
bool ConvertArguments::move_points(std::string_view first) const {
  if (!(first.starts_with("ply\n") || first.starts_with("ply\r")) ||
      std::filesystem::path(output).extension() != ".ply") {
    return false;
  }
  refuse_options_of_maps("--apply to a PLY file, whose other properties are kept");
  FileReader file(input);
  const Similarity3 new_from_old = read_similarity_file(apply);
  write_file(output, [&](const ByteSink& sink) { move_ply(file, new_from_old, sink); });
  common.console().print("{}: moved\n", output);
  return true;
}

// Whether a path is named as maps or pose graphs are; .txt is the ending of trajectories too.
bool names_other_content(const std::filesystem::path& path) {
  const std::string ending = path.extension().string();
  return ending == ".json" || ending == ".g2o" ||
         (ending != ".txt" && all_formats().format_of_ending(path) != nullptr);
}

// KITTI has no times: readers count its poses from 0.
void log_lost_times(const Trajectory& trajectory, const LogSink& log) {
  const auto poses = trajectory.poses();
  for (std::size_t i = 0; i < poses.size(); ++i) {
    if (poses[i].timestamp_s == static_cast<double>(i)) continue;
    if (log) log({"KITTI has no place for: times of the poses; left out", RemarkKind::kLoss});
    return;
  }
}

// Converts a trajectory, moved if that is asked for. @return false for what is read as a map
bool ConvertArguments::convert_trajectory(std::string_view first) const {
  if (!recognised_trajectory(first)) return false;
  refuse_options_of_maps("a trajectory");
  TrajectoryFormat written = TrajectoryFormat::kTum;
  if (!format.empty()) {
    const auto named = trajectory_format(format);
    refuse_if(!named, "--format", printable(format) + " of a trajectory", "tum, euroc or kitti");
    written = *named;
  } else if (std::filesystem::path(output).extension() == ".csv") {
    written = TrajectoryFormat::kEuroc;
  } else if (names_other_content(output)) {
    throw Error(ErrorKind::kMisuse, "output",
                fmt::format("{} does not name a trajectory, but {} is one", output, input),
                "a name that ends in .txt, .tum or .csv, or --format tum, euroc or kitti");
  }
  const LogSink log = strict_log(common.console().log(), loading.strict);
  Trajectory trajectory = read_trajectory(input, log);
  if (written == TrajectoryFormat::kKitti) log_lost_times(trajectory, log);
  if (!apply.empty()) trajectory = transformed(trajectory, read_similarity_file(apply));
  if (transform.given()) trajectory = transformed(trajectory, transform.pose());
  write_file(output, [&](const ByteSink& sink) { write_trajectory(trajectory, written, sink); });
  common.console().print("{}: {} poses{}\n", output, trajectory.size(),
                         apply.empty() && !transform.given() ? "" : ", moved");
  return true;
}

// An atlas holds many maps, and what it is asked for has options of its own.
void ConvertArguments::refuse_atlas(std::string_view first) const {
  constexpr std::string_view kApplicationId = "CRNA";  // of the SQLite file (docs/formats.md)
  constexpr std::size_t kPlace = 68;
  if (!first.starts_with("SQLite format 3") || first.size() < kPlace ||
      !first.substr(kPlace).starts_with(kApplicationId)) {
    return;
  }
  throw Error(
      ErrorKind::kMisuse, input, "is an atlas, not a map",
      fmt::format("'cairn atlas export --atlas {} -o {}', with --map NAME for one of its maps",
                  input, output));
}

// The graph that the input is, or that is asked for of an RTAB-Map database.
std::optional<PoseGraph> ConvertArguments::read_graph(std::string_view first) const {
  const LogSink log = strict_log(common.console().log(), loading.strict);
  if (is_g2o(first)) {
    FileReader file(input);
    const G2oGraph graph = read_g2o(file, log);
    if (!graph.fixed.empty() && log) {
      log({fmt::format("{}: the FIX of {} vertices is left out", input, graph.fixed.size()),
           RemarkKind::kLoss});
    }
    return pose_graph(graph);
  }
  if (is_pose_graph_text(first)) {
    FileReader file(input);
    return read_pose_graph(file);
  }
  const std::filesystem::path path(output);
  const bool is_asked_for =
      format.empty() && (path.extension() == ".g2o" ||
                         (path.extension() == ".json" && !all_formats().format_of_ending(path)));
  if (!is_asked_for || !first.starts_with("SQLite format 3")) return std::nullopt;
  return read_rtabmap_graph(input, {.log = log});
}

// The poses of the nodes in the order of their ids; a graph has no times.
// @param log receives a loss for scales, which a trajectory does not hold
Trajectory poses_of(PoseGraph graph, const LogSink& log) {
  const auto scaled = std::count_if(graph.nodes.begin(), graph.nodes.end(), [](const auto& node) {
    return node.world_from_node.scale() != 1.0;
  });
  if (scaled > 0 && log) {
    log({fmt::format("the scales of {} nodes are left out", scaled), RemarkKind::kLoss});
  }
  std::sort(graph.nodes.begin(), graph.nodes.end(),
            [](const PoseNode& a, const PoseNode& b) { return a.id < b.id; });
  std::vector<TimedPose> poses;
  for (const PoseNode& node : graph.nodes) {
    poses.push_back({static_cast<double>(poses.size()), node.world_from_node.rigid()});
  }
  return Trajectory(std::move(poses));
}

// Writes the graph that the input is or has. @return false for what is read as a map
bool ConvertArguments::write_graph(std::string_view first) const {
  const bool is_g2o_file = format.empty() && std::filesystem::path(output).extension() == ".g2o";
  if (is_g2o(first) && is_g2o_file && apply.empty() && !transform.given()) {
    refuse_options_of_maps("a pose graph");
    FileReader file(input);
    const G2oGraph read = read_g2o(file, strict_log(common.console().log(), loading.strict));
    write_file(output, [&](const ByteSink& sink) { write_g2o(read, sink); });
    common.console().print("{}: {} nodes, {} links\n", output, read.vertices.size(),
                           read.edges.size());
    return true;
  }
  const auto graph = read_graph(first);
  if (!graph) return false;
  refuse_options_of_maps("a pose graph");
  refuse_if(!apply.empty() || transform.given(), apply.empty() ? "--transform" : "--apply",
            "of a pose graph", "a map, a trajectory or a cloud");
  const std::filesystem::path path(output);
  const bool is_kitti = format == "kitti";
  refuse_if(!is_kitti && !is_g2o_file && !(format.empty() && path.extension() == ".json"),
            format.empty() ? "output" : "--format",
            printable(format.empty() ? output : format) + " of a pose graph",
            "an output that ends in .g2o or .json, or --format kitti: the poses by id, because "
            "a graph has no times");
  write_file(output, [&](const ByteSink& sink) {
    if (is_kitti) {
      const LogSink log = strict_log(common.console().log(), loading.strict);
      if (!graph->links.empty() && log) {
        log({fmt::format("KITTI has no place for: {} links; left out", graph->links.size()),
             RemarkKind::kLoss});
      }
      write_trajectory(poses_of(*graph, log), TrajectoryFormat::kKitti, sink);
    } else if (is_g2o_file) {
      write_g2o(g2o_graph(*graph), sink);
    } else {
      sink(pose_graph_text(*graph));
    }
  });
  common.console().print("{}: {} nodes, {} links\n", output, graph->nodes.size(),
                         graph->links.size());
  return true;
}

ConvertArguments::Changes ConvertArguments::changes() const {
  Changes made;
  if (!frames.empty()) made.range = parse_frames(frames);
  if (!camera.empty()) made.camera = load_camera(camera).camera;
  if (!confidence.empty()) made.strategies = parse_strategies(confidence);
  if (transform.given()) made.new_from_old = transform.pose();
  return made;
}

LandmarkMap ConvertArguments::changed(LandmarkMap map, const Changes& made,
                                      [[maybe_unused]] Json& covariances) const {
  if (made.camera) map = with_camera(map, *made.camera);
  reject_if(made.range && !map.has_observations(), input, "has no observations",
            "a map with observations, for --frames");
  if (made.range) {
    const std::size_t all = map.landmark_count();
    with_option_names({{"frames", "--frames"}},
                      [&] { map = cut_frames(map, made.range->begin, made.range->end); });
    if (map.landmark_count() < all) {
      common.console().remark(
          "--frames keeps {} of {} landmarks: those that only the kept frames observe",
          map.landmark_count(), all);
    }
  }
  if (min_observations > 0) map = with_landmarks(map, landmarks_observed(map, min_observations));
  const auto move = [&](const Similarity3& by) {
    with_option_names({{"map", input}}, [&] { map = transformed(map, by); });
  };
  if (made.new_from_old) move(*made.new_from_old);
  if (enu) with_option_names({{"map", input}}, [&] { map = in_enu_frame(map); });
#ifdef CAIRN_HAS_ODOMETRY
  if (!images.empty()) map = with_descriptors(map);
#endif
#ifdef CAIRN_HAS_ADJUSTMENT
  if (estimate_covariances) map = with_estimated_covariances(map, covariances);
#endif
  if (!apply.empty()) move(read_similarity_file(apply));
  for (const Strategy& strategy : made.strategies) {
    if (!strategy.metric) continue;
    map = with_column(map, "confidence_" + strategy.name, strategy.metric->evaluate(map));
  }
  return map;
}

Json ConvertArguments::describe(const LoadedMap& loaded, const Changes& made,
                                const LandmarkMap& map, bool has_frames) const {
  Json metrics = Json::array();
  for (const Strategy& strategy : made.strategies) {
    if (strategy.metric) metrics.push_back(strategy.name);
  }
  Json json =
      document("convert", common, {{"map", loaded.description}},
               {{"frames", text_or_null(frames)},
                {"min_observations", min_observations},
                {"transform", made.new_from_old ? to_json(*made.new_from_old) : Json(nullptr)},
                {"confidence", std::move(metrics)},
                {"camera", text_or_null(camera)},
                {"format", text_or_null(format)},
                {"format_version", to_json(format_version)},
                {"ascii", ascii},
                {"double_precision", double_precision},
                {"apply", text_or_null(apply)},
                {"convention", loading.convention},
                {"images", text_or_null(images)},
                {"strict", loading.strict},
                {"enu", enu},
                {"estimate_covariances", estimate_covariances},
                {"pixel_noise", to_json(pixel_noise)}});
  json["output"] = {
      {"path", output},
      {"frames", has_frames ? Json(map.frame_count()) : Json(nullptr)},
      {"landmarks", map.landmark_count()},
      {"observations",
       has_frames && map.has_observations() ? Json(map.observation_count()) : Json(nullptr)}};
  return json;
}

int ConvertArguments::run() {
  loading.validate();
  refuse_if(!apply.empty() && transform.given(), "--apply", "given with --transform",
            "one of them");
  refuse_if(enu && (!apply.empty() || transform.given()), "--enu",
            "given with another transform of the map", "one of them");
  const std::string first = output == "-" ? std::string() : beginning_of(input);
  refuse_atlas(first);
  if (!apply.empty() && move_points(first)) return kDone;
  if (convert_trajectory(first)) return kDone;
  if (write_graph(first)) return kDone;
  const MapFormat& written = output_format();
  require_one_stdout({{"--json", &common.json_path}, {"output", &output}});
  common.stdout_is_taken = output == "-";
  require_folder_of(common.json_path);
  const Changes made = changes();
  const LoadedMap loaded = load_map(input, common, loading);
  Json covariances = nullptr;
  LandmarkMap map = changed(loaded.map, made, covariances);
  // A map made from another has a name of its own, if that one had.
  if (loaded.map.info().uuid && !map.info().uuid) map = with_content_uuid(std::move(map));
  save_map(map, output, common,
           {.format = written.name,
            .native_version = format_version,
            .ascii = ascii,
            .double_precision = double_precision},
           strict_log(common.console().log(), loading.strict));
  const bool has_frames = written.holds_frames;
  Json json = describe(loaded, made, map, has_frames);
  json["covariances"] = std::move(covariances);
  write_document(json, common);
  const std::string frame_text =
      has_frames ? fmt::format("{} frames, ", map.frame_count()) : std::string();
  common.console().print("{}: {}{} landmarks\n", output, frame_text, map.landmark_count());
  return kDone;
}

}  // namespace

void add_convert(const Command& program) {
  add_verb<ConvertArguments>(
      program, "convert",
      "Convert a map to another format; optionally cut, filter or transform it");
}

}  // namespace cairn::cli
