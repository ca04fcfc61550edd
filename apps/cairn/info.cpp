// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <Eigen/Geometry>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include "cairn/confidence/metric.hpp"
#include "cairn/core/error.hpp"
#include "cairn/core/statistics.hpp"
#include "cairn/core/text.hpp"
#include "cairn/evaluation/map_consistency.hpp"
#include "cairn/formats/foreign/conventions.hpp"
#include "cairn/formats/map_file.hpp"
#include "cairn/formats/pose_graph_file.hpp"
#include "cairn/geometry/angles.hpp"
#include "cairn/map/operations.hpp"
#include "cairn/map/splats.hpp"
#include "cairn/registration/point_set.hpp"

#ifdef CAIRN_HAS_BAGS
#include "cairn/recording/topics.hpp"
#endif

#include "commands.hpp"
#include "support/arguments.hpp"
#include "support/console.hpp"
#include "support/documents.hpp"

namespace cairn::cli {
namespace {

Json quantiles_json(const std::optional<ErrorStatistics>& q) {
  if (!q) return nullptr;
  return {{"lowest", q->lowest}, {"median", q->median}, {"mean", q->mean}, {"highest", q->highest}};
}

// What the verb finds out beside what the map itself says. `kept`: the landmarks that would take part in an alignment.
struct Findings {
  std::vector<LandmarkIndex> kept;
  std::optional<std::size_t> unobserved;
  std::optional<ErrorStatistics> observations_each;  // of kept
  Eigen::AlignedBox3d extent;                        // of kept, or of all if none is
  std::optional<ErrorStatistics> reprojection_px;
  ConventionCheck conventions;
  std::optional<SplatSelection> splats;
  std::vector<std::pair<std::string, std::optional<ErrorStatistics>>> confidences;  // of kept
  std::vector<std::string> warnings;
};

std::optional<ErrorStatistics> confidence_quantiles(const LandmarkMap& map, const char* metric,
                                                    std::span<const LandmarkIndex> landmarks) {
  try {
    const std::vector<double> all = metric_named(metric).evaluate(map);
    std::vector<double> values;
    for (const LandmarkIndex landmark : landmarks) values.push_back(all[landmark.value]);
    return statistics_of(values);
  } catch (const Error&) {
    return std::nullopt;  // the map lacks the metric's input
  }
}

Findings examine(const LandmarkMap& map) {
  Findings findings;
  findings.splats = selected_splats(map);
  findings.kept = findings.splats ? findings.splats->kept : landmarks_observed(map, 2);
  std::vector<double> counts;
  for (const LandmarkIndex landmark :
       findings.kept.empty() ? landmarks_observed(map, 0) : findings.kept) {
    findings.extent.extend(map.landmarks().positions[landmark.value]);
  }
  for (const LandmarkIndex landmark : findings.kept) {
    counts.push_back(static_cast<double>(map.observation_count(landmark)));
  }
  if (map.has_observations()) {
    findings.unobserved = map.landmark_count() - landmarks_observed(map, 1).size();
    findings.observations_each = statistics_of(counts);
  }
  if (const auto reprojection = map_consistency(map).reprojection) {
    findings.reprojection_px = reprojection->px;
  }
  for (const char* name : {"covariance", "observations", "distance", "parallax", "reprojection"}) {
    findings.confidences.emplace_back(name, confidence_quantiles(map, name, findings.kept));
  }
  findings.warnings = map_defects(map);
  return findings;
}

double median_opacity(const LandmarkMap& map, const SplatColumns& columns) {
  return map.landmark_count() == 0 ? 0.0 : upper_median(splat_opacities(columns, map.landmarks()));
}

std::string place_text(const GeodeticPosition& place) {
  return fmt::format("latitude {:.7f}, longitude {:.7f}, altitude {:.2f} m", place.latitude_deg,
                     place.longitude_deg, place.altitude_m);
}

Json place_json(const GeodeticPosition& place) {
  return {{"latitude_deg", place.latitude_deg},
          {"longitude_deg", place.longitude_deg},
          {"altitude_m", place.altitude_m}};
}

// Lines "name  value" of what the map says of itself.
class Properties {
 public:
  Properties(const LandmarkMap& map, const Findings& findings) : map_(map), findings_(findings) {
    add_counts();
    add_columns();
    add_splats();
    add_frame_of_reference();
    add_poses();
    add_origin();
  }

  std::string text() const {
    std::string text;
    for (const auto& [name, value] : lines_) text += fmt::format("  {:<22}  {}\n", name, value);
    return text;
  }

 private:
  void add(const std::string& name, std::string value) {
    lines_.emplace_back(name, std::move(value));
  }

  void add_counts() {
    const auto& frame_ids = map_.frames().ids;
    if (frame_ids.empty()) {
      add("frames", "0");
    } else {
      const auto [first, last] = std::minmax_element(frame_ids.begin(), frame_ids.end());
      add("frames", fmt::format("{}, ids {} to {}", frame_ids.size(), first->value, last->value));
    }
    add("cameras", std::to_string(map_.cameras().size()));
    if (!map_.rigs().empty()) {
      std::size_t mounted = 0;
      for (const Rig& rig : map_.rigs()) mounted += rig.mounts.size();
      add("rigs", fmt::format("{}, of {} cameras", map_.rigs().size(), mounted));
    }
    add("landmarks", std::to_string(map_.landmark_count()));
    if (map_.has_observations()) {
      add("observations", std::to_string(map_.observation_count()));
      std::string often = std::to_string(findings_.kept.size());
      if (const auto& q = findings_.observations_each) {
        often += fmt::format(", {} to {} each, mean {:.2f}", q->lowest, q->highest, q->mean);
      }
      add("observed twice or more", often);
    } else {
      add("observations", "unknown");
    }
  }

  void add_columns() {
    if (map_.has_covariances()) add("covariances", "yes");
    if (!map_.landmarks().colors.empty()) add("colours", "yes");
    if (const auto& descriptors = map_.landmarks().descriptors) {
      std::string text =
          fmt::format("{}, {} bytes each", descriptors->kind, descriptors->bytes_each);
      if (descriptors->has_further()) {
        std::size_t all = 0;
        std::size_t described = 0;
        std::size_t most = 0;
        for (std::size_t i = 0; i < map_.landmark_count(); ++i) {
          const std::size_t count = descriptors->count(i);
          all += count;
          described += count > 0 ? 1 : 0;
          most = std::max(most, count);
        }
        text += fmt::format("; {} landmarks have {}, up to {} each", described, all, most);
      }
      add("descriptors", text);
    }
    std::vector<std::string_view> names = column_names(map_.landmarks().columns);
    if (findings_.splats) {
      for (const std::size_t i : splat_columns(names)->all()) names[i] = {};
    }
    std::erase(names, std::string_view());
    const std::string columns = fmt::format("{}", fmt::join(names, ", "));
    if (!columns.empty()) add("columns", columns);
  }

  void add_splats() {
    if (!findings_.splats) return;
    const SplatSelection& splats = *findings_.splats;
    const SplatColumns columns = *splat_columns(map_.landmarks().columns);
    add("Gaussian splats", fmt::format("of degree {}, median opacity {:.2f}", columns.degree,
                                       median_opacity(map_, columns)));
    add("serve as landmarks",
        fmt::format("{}; left out: {} transparent, {} large, {} far away, {} isolated, {} plain",
                    splats.kept.size(), splats.transparent, splats.large, splats.distant,
                    splats.isolated, splats.plain));
  }

  void add_frame_of_reference() {
    if (!findings_.extent.isEmpty()) {
      const Eigen::Vector3d& low = findings_.extent.min();
      const Eigen::Vector3d& high = findings_.extent.max();
      add("extent", fmt::format("x {:.2f} to {:.2f}, y {:.2f} to {:.2f}, z {:.2f} to {:.2f} {}",
                                low.x(), high.x(), low.y(), high.y(), low.z(), high.z(),
                                unit_symbol(map_.info().length_unit)));
    }
    add("length unit", to_string(map_.info().length_unit));
    if (map_.info().world_frame) add("world frame", *map_.info().world_frame);
    if (const auto& down = map_.info().gravity) {
      add("gravity", fmt::format("{:.4g} {:.4g} {:.4g}", down->x(), down->y(), down->z()));
    }
    if (const auto& georeference = map_.info().georeference) {
      add("georeference", place_text(georeference->origin));
      if (!georeference->is_enu()) {
        add("metres per unit", fmt::format("{:.6g}", georeference->scale));
      }
      if (!findings_.extent.isEmpty()) {
        const Eigen::Vector3d centre = findings_.extent.center();
        add("centre on the Earth", place_text(georeference->geodetic(centre)));
      }
    }
  }

  void add_poses() {
    if (const auto& gnss = map_.frames().gnss; !gnss.empty()) {
      const auto known = gnss.known();
      add("GNSS positions", fmt::format("of {} of {} frames",
                                        std::count(known.begin(), known.end(), 1), gnss.size()));
    }
    if (const auto poses = keyframe_uncertainties(map_)) {
      const std::string unit(unit_symbol(map_.info().length_unit));
      const auto text = [&](const KeyframeUncertainty& one) {
        return fmt::format("{:.2g} deg and {:.2g} {}", degrees(one.angle_rad), one.length, unit);
      };
      add("pose uncertainty", fmt::format("up to {}, of keyframe {} to the first",
                                          text(poses->of_worst), poses->worst.value));
      if (poses->of_step.angle_rad > 0.0) {
        add("grows most", fmt::format("by {}, between keyframes {} and {}", text(poses->of_step),
                                      poses->step.first.value, poses->step.second.value));
      }
    }
  }

  void add_origin() {
    if (const auto& points = map_.info().control_points; !points.empty()) {
      std::size_t views = 0;
      for (const ControlPoint& point : points) views += point.views.size();
      add("control points", fmt::format("{}, {} views", points.size(), views));
    }
    if (map_.info().uuid) add("uuid", *map_.info().uuid);
    for (const std::string& step : map_.info().provenance) add("provenance", step);
    if (const auto& q = findings_.reprojection_px) {
      add("reprojection", fmt::format("median {:.3g} px, mean {:.3g} px, worst {:.3g} px",
                                      q->median, q->mean, q->highest));
    }
  }

  const LandmarkMap& map_;
  const Findings& findings_;
  std::vector<std::pair<std::string, std::string>> lines_;
};

void print(const Console& console, const LoadedMap& loaded, const Findings& findings) {
  const LandmarkMap& map = loaded.map;
  console.print(loaded.path + "\n");
  console.print(Properties(map, findings).text());
  if (map.landmark_count() > 0) {
    Table table({"confidence", "lowest", "median", "mean", "highest"});
    for (const auto& [name, q] : findings.confidences) {
      const auto cell = [](double value) { return fmt::format("{:.6g}", value); };
      table.add_row(
          q ? std::vector{name, cell(q->lowest), cell(q->median), cell(q->mean), cell(q->highest)}
            : std::vector<std::string>{name, "-", "-", "-", "-"});
    }
    console.print("\n" + table.text());
    if (map.has_observations() && map.frames().cameras.empty()) {
      console.print("no reprojection errors: the frames have no camera; add --camera\n");
    }
  }
  if (findings.conventions.verdict != ConventionVerdict::kNotChecked) {
    console.print("\nconventions: {}\n", findings.conventions.sentence);
  }
  if (!findings.warnings.empty()) console.print("\n");
  for (const std::string& warning : findings.warnings) console.print("warning: " + warning + "\n");
}

Json finite_or_null(double value) {
  return std::isfinite(value) ? Json(value) : Json(nullptr);
}

Json to_json(const ScoredReading& scored) {
  return {{"reading", describe(scored.reading)}, {"median_px", finite_or_null(scored.median_px)}};
}

Json to_json(const ConventionCheck& check) {
  if (check.verdict == ConventionVerdict::kNotChecked) return nullptr;
  return {{"verdict", to_string(check.verdict)},
          {"as_format_px", finite_or_null(check.as_format_px)},
          {"best", to_json(check.best)},
          {"runner_up", check.runner_up ? to_json(*check.runner_up) : Json(nullptr)},
          {"observations", check.observations},
          {"sentence", check.sentence}};
}

void add_findings(Json& json, const LandmarkMap& map, const Findings& findings) {
  json["observed_twice_or_more"] =
      map.has_observations() ? Json(findings.kept.size()) : Json(nullptr);
  json["unobserved"] = cli::to_json(findings.unobserved);
  json["observations_each"] = quantiles_json(findings.observations_each);
  json["length_unit"] = to_string(map.info().length_unit);
  json["world_frame"] = cli::to_json(map.info().world_frame);
  json["gravity"] = map.info().gravity ? cli::to_json(*map.info().gravity) : Json(nullptr);
  json["georeference"] = nullptr;
  if (const auto& georeference = map.info().georeference) {
    json["georeference"] = place_json(georeference->origin);
    json["georeference"]["enu_from_map"] = cli::to_json(georeference->enu_from_map().matrix());
    json["georeference"]["centre"] =
        findings.extent.isEmpty()
            ? Json(nullptr)
            : place_json(georeference->geodetic(Eigen::Vector3d(findings.extent.center())));
  }
  const auto gnss = map.frames().gnss.known();
  json["gnss_positions"] = std::count(gnss.begin(), gnss.end(), 1);
  json["control_points"] = map.info().control_points.size();
  json["pose_uncertainty"] = nullptr;
  if (const auto poses = keyframe_uncertainties(map)) {
    const auto to_object = [](const KeyframeUncertainty& one) {
      return Json{{"rotation_rad", one.angle_rad}, {"translation", one.length}};
    };
    json["pose_uncertainty"] = {{"greatest", to_object(poses->of_worst)},
                                {"greatest_step", to_object(poses->of_step)}};
    json["pose_uncertainty"]["greatest"]["frame"] = poses->worst.value;
    json["pose_uncertainty"]["greatest_step"]["frames"] = {poses->step.first.value,
                                                           poses->step.second.value};
  }
  json["splats"] = nullptr;
  if (const auto& splats = findings.splats) {
    const SplatColumns columns = *splat_columns(map.landmarks().columns);
    json["splats"] = {
        {"degree", columns.degree},         {"median_opacity", median_opacity(map, columns)},
        {"landmarks", splats->kept.size()}, {"transparent", splats->transparent},
        {"large", splats->large},           {"distant", splats->distant},
        {"isolated", splats->isolated},     {"plain", splats->plain}};
  }
  json["uuid"] = cli::to_json(map.info().uuid);
  json["provenance"] = map.info().provenance;
  json["cameras"] = map.cameras().size();
  json["rigs"] = map.rigs().size();
  json["columns"] = Json::array();
  for (const NamedColumn& column : map.landmarks().columns) json["columns"].push_back(column.name);
  json["extent"] = nullptr;
  if (!findings.extent.isEmpty()) {
    const Eigen::Vector3d& low = findings.extent.min();
    const Eigen::Vector3d& high = findings.extent.max();
    json["extent"] = {{"low", cli::to_json(low)}, {"high", cli::to_json(high)}};
  }
  json["reprojection_px"] = quantiles_json(findings.reprojection_px);
  json["confidence"] = Json::object();
  for (const auto& [name, q] : findings.confidences) json["confidence"][name] = quantiles_json(q);
  json["conventions"] = to_json(findings.conventions);
  json["warnings"] = findings.warnings;
}

#ifdef CAIRN_HAS_BAGS
// When the messages of a topic were recorded.
struct TopicTimes {
  std::size_t messages = 0;
  double first_s = 0.0;
  double last_s = 0.0;
  double longest_gap_s = 0.0;

  std::optional<double> rate_hz() const {
    if (!(last_s > first_s)) return std::nullopt;
    return static_cast<double>(messages - 1) / (last_s - first_s);
  }
};

std::vector<TopicTimes> topic_times(const Recording& recording) {
  std::vector<TopicTimes> times(recording.topics().size());
  for (const RecordedMessage& message : recording.messages()) {
    TopicTimes& its = times[message.topic];
    const double now_s = 1e-9 * static_cast<double>(message.time_ns);
    if (its.messages++ == 0) its.first_s = its.last_s = now_s;
    its.longest_gap_s = std::max(its.longest_gap_s, now_s - its.last_s);
    its.last_s = now_s;
  }
  return times;
}

// The camera of images, or why there is none.
std::pair<std::optional<Camera>, std::string> recorded_camera(const ImageTopic& image,
                                                              const std::string& topic) {
  if (!image.info) return {std::nullopt, "no CameraInfo"};
  try {
    return {camera_of(*image.info, is_rectified_topic(topic), topic), ""};
  } catch (const Error& error) {
    return {std::nullopt, error.what()};
  }
}

std::string camera_text(const Camera& camera) {
  return fmt::format("{} {} x {}, {:.6g}", camera.model, camera.width, camera.height,
                     fmt::join(camera.parameters, " "));
}
#endif

struct InfoArguments {
  CommonArguments common;
  std::string input;
  std::string camera;
  MapLoading loading;

  void add_to(const Command& command) {
    command
        .add_text("map", input,
                  "Map to read: " + all_formats().titles_text() +
                      "; or a pose graph in g2o or JSON; or a "
                      "recording of ROS (.bag, .mcap, .db3)")
        .required();
    command.add_text("--camera", camera,
                     fmt::format("Camera of all frames, for reprojection errors: {}", kCameraHelp),
                     "CAMERA");
    loading.add_to(command);
    common.add_to(command);
    command.footer(
        "Example: print what a map holds and its reprojection errors\n"
        "  cairn info desk.map --camera \"PINHOLE 640 480 517.3 516.5 318.6 255.3\"");
  }

  int run() const {
    loading.validate();
    require_folder_of(common.json_path);
    if (describe_graph() || describe_recording()) return kDone;
    const auto given_camera =
        camera.empty() ? std::nullopt : std::optional(load_camera(camera).camera);
    LoadedMap loaded = load_map(input, common, MapLoading{.convention = "format"});
    if (given_camera) loaded.map = with_camera(loaded.map, *given_camera);
    const ConventionCheck conventions = check_conventions(loaded.map);
    if (conventions.verdict == ConventionVerdict::kOther && loading.convention == "data") {
      loaded.map = reread(std::move(loaded.map), conventions.best.reading);
    }
    Findings findings = examine(loaded.map);
    findings.conventions = conventions;
    Json json = document("info", common, {{"map", loaded.description}},
                         {{"camera", text_or_null(camera)}, {"convention", loading.convention}});
    add_findings(json, loaded.map, findings);
    write_document(json, common);
    print(common.console(), loaded, findings);
    return kDone;
  }

 private:
  // Prints what a pose graph holds, if the input is one. @return false for what is read as a map
  bool describe_graph() const {
    const std::string first = beginning_of(input);
    const bool has_g2o = is_g2o(first);
    if (!has_g2o && !is_pose_graph_text(first)) return false;
    FileReader file(input);
    const Console console = common.console();
    G2oGraph g2o;
    if (has_g2o) g2o = read_g2o(file, console.log());
    const PoseGraph graph = has_g2o ? pose_graph(g2o) : read_pose_graph(file);
    const auto neighbours =
        std::count_if(graph.links.begin(), graph.links.end(),
                      [](const Link& link) { return link.kind == LinkKind::kOdometry; });
    Eigen::AlignedBox3d extent;
    for (const PoseNode& node : graph.nodes) extent.extend(node.world_from_node.translation());
    Json json = document("info_pose_graph", common, {{"graph", describe_file(input, common)}},
                         Json::object());
    json["format"] = has_g2o ? "g2o" : "cairn.pose_graph";
    json["vertices"] = graph.nodes.size();
    json["edges"] = graph.links.size();
    json["odometry_edges"] = neighbours;
    json["fixed"] = has_g2o ? Json(g2o.fixed.size()) : Json(nullptr);
    json["extent"] = graph.nodes.empty()
                         ? Json(nullptr)
                         : Json{{"low", cli::to_json(Eigen::Vector3d(extent.min()))},
                                {"high", cli::to_json(Eigen::Vector3d(extent.max()))}};
    json["length_unit"] = nullptr;
    write_document(json, common);
    const auto line = [&](std::string_view name, std::string_view value) {
      console.print("  {:<22}  {}\n", name, value);
    };
    console.print(input + "\n");
    line("pose graph", has_g2o ? "g2o" : "JSON of Cairn");
    line("vertices", std::to_string(graph.nodes.size()));
    line("edges", fmt::format("{}, {} of them {}", graph.links.size(), neighbours,
                              has_g2o ? "between consecutive ids" : "odometry"));
    if (has_g2o) line("fixed vertices", std::to_string(g2o.fixed.size()));
    if (!graph.nodes.empty()) {
      const Eigen::Vector3d& low = extent.min();
      const Eigen::Vector3d& high = extent.max();
      line("extent", fmt::format("x {:.2f} to {:.2f}, y {:.2f} to {:.2f}, z {:.2f} to {:.2f}",
                                 low.x(), high.x(), low.y(), high.y(), low.z(), high.z()));
    }
    line("length unit", "not stated: that of its maps, metres unless their scale is free");
    return true;
  }

#ifdef CAIRN_HAS_BAGS
  // The same of a recording: its topics, its cameras, and how to map it.
  bool describe_recording() const {
    if (!Recording::is_at(input)) return false;
    const Console console = common.console();
    const Recording recording(input, console.log());
    Json json =
        document("info_recording", common, {{"recording", {{"path", input}}}}, Json::object());
    json["topics"] = Json::array();
    json["cameras"] = Json::array();
    json["pose_topics"] = Json::array();
    console.print("{}\n", input);
    const std::vector<TopicTimes> times = topic_times(recording);
    for (std::size_t i = 0; i < times.size(); ++i) {
      const RecordedTopic& topic = recording.topics()[i];
      const TopicTimes& its = times[i];
      json["topics"].push_back({{"name", topic.name},
                                {"type", topic.type},
                                {"encoding", topic.encoding},
                                {"messages", its.messages},
                                {"rate_hz", cli::to_json(its.rate_hz())},
                                {"longest_gap_s", its.longest_gap_s}});
      console.print("  {:<40} {:<28} {:>7} messages{}\n", plain_text(topic.name),
                    plain_text(topic.type), its.messages,
                    its.rate_hz() ? fmt::format(", {:.1f} Hz, longest gap {:.3f} s", *its.rate_hz(),
                                                its.longest_gap_s)
                                  : "");
    }
    const std::vector<ImageTopic> images = image_topics(recording);
    for (const ImageTopic& image : images) {
      const std::string& name = recording.topics()[image.topic].name;
      const auto [camera_of_images, defect] = recorded_camera(image, name);
      json["cameras"].push_back(
          {{"topic", name},
           {"is_depth", image.is_depth},
           {"camera", camera_of_images ? cli::to_json(*camera_of_images) : Json(nullptr)}});
      console.print("  camera of {}{}: {}\n", plain_text(name), image.is_depth ? " (depth)" : "",
                    camera_of_images ? camera_text(*camera_of_images) : defect);
    }
    try {
      choose_topics(recording, images);
      const std::string command = fmt::format("cairn map {} -o lab.map", input);
      json["command"] = command;
      console.print("to map it: {}\n", command);
      for (const PoseTopic& topic : pose_topics(recording)) {
        json["pose_topics"].push_back({{"name", topic.name}, {"body", text_or_null(topic.body)}});
        console.print("  at the recorded poses{}: --poses topic:{}{}\n",
                      topic.body.empty() ? "" : " of " + plain_text(topic.body),
                      plain_text(topic.name), topic.body.empty() && !topic.is_tree ? ",FRAME" : "");
      }
    } catch (const Error& error) {
      json["command"] = nullptr;
      console.print("cairn map needs a choice: {}\n", error.what());
    }
    write_document(json, common);
    return true;
  }
#else
  bool describe_recording() const { return false; }
#endif
};

}  // namespace

void add_info(const Command& program) {
  add_verb<InfoArguments>(program, "info", "Print what a map holds, its quality and its defects");
}

}  // namespace cairn::cli
