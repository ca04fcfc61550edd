// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <map>
#include <unordered_map>
#include <utility>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/core/number_text.hpp"
#include "cairn/core/text.hpp"
#include "cairn/formats/detail/bytes/json_document.hpp"
#include "cairn/formats/detail/foreign/foreign_formats.hpp"
#include "cairn/formats/detail/foreign/opensfm_image.hpp"
#include "cairn/formats/detail/foreign/written_frames.hpp"
#include "cairn/formats/detail/losses.hpp"
#include "cairn/geometry/rigid3.hpp"
#include "cairn/map/operations.hpp"

namespace cairn::detail {
namespace {

namespace fs = std::filesystem;

// A camera as OpenSfM describes it; std::nullopt for a model that it does not have.
std::optional<nlohmann::json> opensfm_camera(const Camera& camera) {
  const OpenSfmImage image = opensfm_image(camera);
  const double size = image.size();
  const std::vector<double>& p = camera.parameters;
  const Intrinsics k = intrinsics(camera);
  nlohmann::json json = {{"width", camera.width}, {"height", camera.height}};
  const bool is_centred = k.cx == (image.width - 1.0) / 2.0 && k.cy == (image.height - 1.0) / 2.0;
  const auto one_focal = [&](const char* type, double k1, double k2) {
    json["projection_type"] = type;
    json["focal"] = k.fx / size;
    json["k1"] = k1;
    json["k2"] = k2;
    return json;
  };
  const auto two_focals = [&](const char* type,
                              std::initializer_list<std::pair<const char*, double>> distortion) {
    json["projection_type"] = type;
    json["focal_x"] = k.fx / size;
    json["focal_y"] = k.fy / size;
    json["c_x"] = (k.cx - (image.width - 1.0) / 2.0) / size;
    json["c_y"] = (k.cy - (image.height - 1.0) / 2.0) / size;
    for (const auto& [key, value] : distortion) json[key] = value;
    return json;
  };
  const auto brown = [&](double k1, double k2, double p1, double p2, double k3) {
    return two_focals("brown", {{"k1", k1}, {"k2", k2}, {"p1", p1}, {"p2", p2}, {"k3", k3}});
  };
  const std::string& model = camera.model;
  const double k1 = p.size() > 3 ? p[3] : 0.0;
  const double k2 = p.size() > 4 ? p[4] : 0.0;
  if (is_centred && (model == "SIMPLE_PINHOLE" || model == "SIMPLE_RADIAL" || model == "RADIAL")) {
    return one_focal("perspective", k1, k2);
  }
  if (is_centred && (model == "SIMPLE_FISHEYE" || model == "SIMPLE_RADIAL_FISHEYE" ||
                     model == "RADIAL_FISHEYE")) {
    return one_focal("fisheye", k1, k2);
  }
  if (const auto d = opencv_distortion(camera)) {
    if (!d->is_fisheye) return brown(d->k1, d->k2, d->p1, d->p2, d->k3);
    return two_focals("fisheye_opencv",
                      {{"k1", d->k1}, {"k2", d->k2}, {"k3", d->k3}, {"k4", d->k4}});
  }
  if (model == "THIN_PRISM_FISHEYE") {
    return two_focals("fisheye624", {{"k1", p[4]},
                                     {"k2", p[5]},
                                     {"k3", p[8]},
                                     {"k4", p[9]},
                                     {"p1", p[6]},
                                     {"p2", p[7]},
                                     {"s0", p[10]},
                                     {"s2", p[11]}});
  }
  const auto zero_from = [&](std::ptrdiff_t first) {
    return std::all_of(p.begin() + first, p.end(), [](double x) { return x == 0.0; });
  };
  if (model == "RAD_TAN_THIN_PRISM_FISHEYE" && zero_from(10)) {
    return two_focals(
        "fisheye62",
        {{"k1", p[4]}, {"k2", p[5]}, {"k3", p[6]}, {"k4", p[7]}, {"k5", p[8]}, {"k6", p[9]}});
  }
  if (is_panorama(camera) && camera.width == 2 * camera.height) {
    json["projection_type"] = "spherical";
    return json;
  }
  return std::nullopt;
}

class OpenSfmWriter {
 public:
  OpenSfmWriter(const LandmarkMap& map, const fs::path& path, const Execution& execution)
      : map_(map),
        path_(path),
        execution_(execution),
        mounts_(cameras_from_rigs(map.rigs())),
        instants_(map) {
    require_cameras(map, "a shot of OpenSfM");
    names_ = image_names(map);
    for (std::uint32_t i = 0; i < map.frame_count(); ++i) {
      if (names_[i].find_first_of("\t\n\r") == std::string::npos && is_utf8(names_[i])) continue;
      throw Error(ErrorKind::kInput, fmt::format("frame {}", map.frames().ids[i].value),
                  "image name " + printable(names_[i]),
                  "names in UTF-8 without tabs and line ends, which name the shots of OpenSfM");
    }
    for (const ControlPoint& point : map.info().control_points) {
      if (is_utf8(point.name)) continue;
      throw Error(ErrorKind::kInput, "control point " + printable(point.name), "is no UTF-8",
                  "a name in UTF-8, as JSON needs it");
    }
  }

  void write_reconstruction(const ByteSink& sink) const {
    text_ = "[{\"cameras\": {";
    for (const Camera& camera : map_.cameras()) {
      const auto json = opensfm_camera(camera);
      if (!json) refuse_model(camera, "OpenSfM");
      begin_entry(&camera == map_.cameras().data(), camera_name(camera));
      text_ += json->dump();
    }
    text_ += "}, \"shots\": {";
    for (std::uint32_t i = 0; i < map_.frame_count(); ++i) {
      write_shot(FrameIndex{i});
      flush(sink);
    }
    text_ += "}, \"points\": {";
    for (std::uint32_t i = 0; i < map_.landmark_count(); ++i) {
      begin_entry(i == 0, std::to_string(map_.landmarks().ids[i].value));
      text_ += "{\"coordinates\": ";
      vector(map_.landmarks().positions[i]);
      // OpenSfM reads no point without a colour.
      const Color color = color_of(map_, i);
      text_ += fmt::format(", \"color\": [{}, {}, {}]}}", color.red, color.green, color.blue);
      flush(sink);
    }
    text_ += '}';
    if (!map_.rigs().empty()) write_rigs();
    if (is_georeferenced()) {
      const GeodeticPosition& origin = map_.info().georeference->origin;
      text_ += R"(, "reference_lla": {"latitude": )";
      append_number(text_, origin.latitude_deg);
      text_ += ", \"longitude\": ";
      append_number(text_, origin.longitude_deg);
      text_ += ", \"altitude\": ";
      append_number(text_, origin.altitude_m);
      text_ += '}';
    }
    text_ += "}]\n";
    sink(text_);
  }

  void write_tracks(const ByteSink& sink) const {
    const std::vector<std::uint32_t> keypoints = keypoint_indices(map_);
    text_ = "OPENSFM_TRACKS_VERSION_v1\n";
    for (std::uint32_t i = 0; i < map_.landmark_count(); ++i) {
      const auto frames = map_.observing_frames(LandmarkIndex{i});
      const auto pixels = map_.observed_pixels(LandmarkIndex{i});
      const std::uint64_t first = frames.empty() ? 0 : map_.observations().offsets[i];
      const Color color = color_of(map_, i);
      for (std::size_t j = 0; j < frames.size(); ++j) {
        const OpenSfmImage image = opensfm_image(camera_of(map_, frames[j]));
        text_ += names_[frames[j].value];
        text_ += fmt::format("\t{}\t{}\t", map_.landmarks().ids[i].value, keypoints[first + j]);
        const auto [x, y] = image.normalized(pixels[j]);
        append_number(text_, x);
        text_ += '\t';
        append_number(text_, y);
        text_ += '\t';
        // OpenSfM's adjustment weights a feature by its size: four pixels, which is typical.
        append_number(text_, 4.0 / image.size());
        text_ += fmt::format("\t{}\t{}\t{}\n", color.red, color.green, color.blue);
        flush(sink);
      }
    }
    sink(text_);
  }

  void write_control_points(const ByteSink& sink) const {
    std::unordered_map<std::string_view, std::uint32_t> frames;
    for (std::uint32_t i = 0; i < names_.size(); ++i) frames.emplace(names_[i], i);
    nlohmann::json points = nlohmann::json::array();
    for (const ControlPoint& point : map_.info().control_points) {
      nlohmann::json position = {{"latitude", point.latitude_deg},
                                 {"longitude", point.longitude_deg}};
      if (point.altitude_m) position["altitude"] = *point.altitude_m;
      nlohmann::json views = nlohmann::json::array();
      for (const ControlPoint::View& view : point.views) {
        const auto found = frames.find(view.image_name);
        if (found == frames.end()) continue;
        const auto [x, y] =
            opensfm_image(camera_of(map_, FrameIndex{found->second})).normalized(view.pixel);
        views.push_back({{"shot_id", view.image_name}, {"projection", {x, y}}});
      }
      points.push_back({{"id", point.name}, {"position", position}, {"observations", views}});
    }
    sink(nlohmann::json{{"points", points}}.dump(1) + "\n");
  }

  void remark() const {
    if (!execution_.log) return;
    if (map_.info().georeference && !is_georeferenced()) {
      execution_.log(fmt::format(
          "{}: the world of OpenSfM is the east-north-up frame of reference_lla, and this map lies "
          "otherwise; cairn convert --enu moves it there",
          path_.string()));
    }
    const auto log = [&](const std::string& text) {
      log_remark(execution_.log, path_.string(), text, RemarkKind::kLoss);
    };
    if (map_.rigs().size() > 1) {
      log(fmt::format("the {} rigs become one, because OpenSfM does not name rigs",
                      map_.rigs().size()));
    }
    const auto& times = map_.frames().timestamps_s;
    std::size_t at_zero = 0;
    for (std::size_t i = 0; i < times.size(); ++i) at_zero += times[i] == 0.0 ? 1 : 0;
    if (at_zero > 0) {
      log(fmt::format("{} shots at time 0 lose it: OpenSfM writes 0 for an unknown time", at_zero));
    }
    instants_.log_elsewhere(execution_.log, path_.string());
    const auto alone = std::ranges::count_if(
        instants_.together, [](const auto& instant) { return instant.second.size() < 2; });
    if (alone > 0) log(fmt::format("{} instants with one image each are left out", alone));
    const Holdings holdings{.timestamps = true,
                            .keypoints = true,
                            .georeference = is_georeferenced(),
                            .gnss = is_georeferenced(),
                            .rigs = true,
                            .control_points = true};
    log_losses(execution_.log, map_, holdings, "OpenSfM", path_.string());
  }

 private:
  bool is_georeferenced() const {
    return map_.info().georeference && map_.info().georeference->is_enu();
  }

  static std::string camera_name(const Camera& camera) {
    // Padded, so that the order of names is that of ids.
    return fmt::format("camera {:010}", camera.id.value);
  }

  void begin_entry(bool is_first, const std::string& key) const {
    text_ += is_first ? "\n" : ",\n";
    text_ += nlohmann::json(key).dump();
    text_ += ": ";
  }

  void vector(const Eigen::Vector3d& x) const {
    for (int i = 0; i < 3; ++i) {
      text_ += i == 0 ? "[" : ", ";
      append_number(text_, x[i]);
    }
    text_ += ']';
  }

  // A camera of a rig; OpenSfM names rig cameras that it makes itself as their cameras.
  std::string mount_name(CameraIndex camera) const {
    return "rig " + camera_name(map_.cameras()[camera.value]);
  }

  // Begins an object with a pose.
  void pose(const Rigid3& a_from_b) const {
    text_ += "{\"rotation\": ";
    vector(rotation_log(a_from_b.quaternion()));
    text_ += ", \"translation\": ";
    vector(a_from_b.translation());
  }

  void write_rigs() const {
    text_ += ", \"rig_cameras\": {";
    bool is_first = true;
    for (const Rig& rig : map_.rigs()) {
      for (const Rig::Mount& mount : rig.mounts) {
        begin_entry(std::exchange(is_first, false), mount_name(mount.camera));
        pose(mount.camera_from_rig());
        text_ += '}';
      }
    }
    text_ += "}, \"rig_instances\": {";
    is_first = true;
    for (const auto& [instant, shots] : instants_.together) {
      if (shots.size() < 2) continue;
      begin_entry(std::exchange(is_first, false), fmt::format("{:010}", instant.value));
      write_instance(shots);
    }
    text_ += '}';
  }

  void write_instance(const std::vector<std::uint32_t>& shots) const {
    const auto camera_of_shot = [&](std::uint32_t shot) { return *map_.frames().cameras[shot]; };
    const Rigid3 rig_from_camera = mounts_.at(camera_of_shot(shots.front())).inverse();
    pose(rig_from_camera * map_.world_from_camera(FrameIndex{shots.front()}).inverse());
    text_ += ", \"rig_camera_ids\": {";
    for (const std::uint32_t shot : shots) {
      begin_entry(shot == shots.front(), names_[shot]);
      text_ += nlohmann::json(mount_name(camera_of_shot(shot))).dump();
    }
    text_ += "}}";
  }

  void write_shot(FrameIndex frame) const {
    const FrameTable& frames = map_.frames();
    begin_entry(frame.value == 0, names_[frame.value]);
    pose(map_.world_from_camera(frame).inverse());
    text_ += fmt::format(R"(, "camera": "{}")", camera_name(camera_of(map_, frame)));
    if (!frames.timestamps_s.empty() && frames.timestamps_s[frame.value]) {
      text_ += ", \"capture_time\": ";
      append_number(text_, *frames.timestamps_s[frame.value]);
    }
    if (is_georeferenced() && !frames.gnss.empty() && frames.gnss[frame.value]) {
      const GnssFix fix = *frames.gnss[frame.value];
      text_ += ", \"gps_position\": ";
      vector(map_.info().georeference->in_map(fix.position));
      if (fix.accuracy_m) {
        text_ += ", \"gps_dop\": ";
        append_number(text_, *fix.accuracy_m);
      }
    }
    text_ += '}';
  }

  void flush(const ByteSink& sink) const {
    constexpr std::size_t kLarge = std::size_t{1} << 20;
    if (text_.size() < kLarge) return;
    sink(text_);
    text_.clear();
  }

  const LandmarkMap& map_;
  const fs::path& path_;
  const Execution& execution_;
  std::vector<std::string> names_;
  std::unordered_map<CameraIndex, Rigid3> mounts_;  // camera_from_rig
  RigInstants instants_;
  mutable std::string text_;
};

}  // namespace

void write_opensfm(const LandmarkMap& map, const fs::path& path, const Execution& execution) {
  const OpenSfmWriter writer(map, path, execution);
  const fs::path tracks = path.parent_path() / "tracks.csv";
  const bool has_tracks = map.has_observations();
  std::error_code ignored;
  refuse_if(fs::exists(tracks, ignored), tracks.string(),
            "is there already, and belongs to " + path.string() + " by its name",
            "a folder without it");
  const fs::path control_points = path.parent_path() / "ground_control_points.json";
  const bool has_control_points = !map.info().control_points.empty();
  refuse_if(has_control_points && fs::exists(control_points, ignored), control_points.string(),
            "is there already, and would be overwritten", "a folder without it");
  writer.remark();  // before writing, because the caller may refuse the loss
  // All are written before the first gets its name, and the reconstruction gets its own last. Only a process killed in
  // between leaves a file that the next run refuses, and none a reconstruction without its tracks.
  const auto write_control_points = [&] {
    if (!has_control_points) return;
    write_file(control_points, [&](const ByteSink& sink) { writer.write_control_points(sink); });
  };
  const auto write_beside = [&] {
    if (!has_tracks) return write_control_points();
    write_file(tracks, [&](const ByteSink& sink) {
      writer.write_tracks(sink);
      write_control_points();
    });
  };
  try {
    write_file(path, [&](const ByteSink& sink) {
      writer.write_reconstruction(sink);
      write_beside();
    });
  } catch (...) {
    if (has_tracks) fs::remove(tracks, ignored);
    if (has_control_points) fs::remove(control_points, ignored);
    throw;
  }
}

}  // namespace cairn::detail
