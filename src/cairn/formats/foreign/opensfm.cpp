// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>
#include <tuple>
#include <unordered_map>
#include <utility>

#include <Eigen/Geometry>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include "cairn/core/error.hpp"
#include "cairn/core/number_text.hpp"
#include "cairn/core/text.hpp"
#include "cairn/formats/detail/bytes/json_document.hpp"
#include "cairn/formats/detail/bytes/record_reader.hpp"
#include "cairn/formats/detail/foreign/foreign_formats.hpp"
#include "cairn/formats/detail/foreign/opensfm_image.hpp"
#include "cairn/formats/detail/foreign/sfm_builder.hpp"
#include "cairn/formats/detail/losses.hpp"
#include "cairn/geometry/rigid3.hpp"

namespace cairn::detail {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t kMostOpenSfmPixels = std::numeric_limits<std::uint32_t>::max();
constexpr double kUnknownAccuracy =
    999999.0;  // metres: OpenSfM's value for a shot without GNSS position

// std::nullopt for a projection that Cairn has no model for.
std::optional<Camera> opensfm_lens(const JsonValue& camera, const OpenSfmImage& image,
                                   CameraId id) {
  const std::string type =
      camera.has("projection_type") ? camera.at("projection_type").text() : "perspective";
  const double size = image.size();
  const auto optional = [&](const char* key) { return camera.number_or(key, 0.0); };
  const auto focal = [&](const char* key) { return camera.at(key).number() * size; };
  const auto result = [&](const char* model, std::vector<double> parameters) {
    return Camera{id, model, static_cast<std::uint32_t>(image.width),
                  static_cast<std::uint32_t>(image.height), std::move(parameters)};
  };
  const Pixel centre = image.pixel(optional("c_x"), optional("c_y"));
  const double k1 = optional("k1");
  const double k2 = optional("k2");
  // Between a perspective camera (transition 1) and a fisheye (0) Cairn has no model.
  const double transition = type == "dual" ? camera.number_or("transition", 0.5) : -1.0;
  if (type == "perspective" || transition == 1.0) {
    return result("RADIAL", {focal("focal"), centre.u, centre.v, k1, k2});
  }
  if (type == "fisheye" || transition == 0.0) {
    return result("RADIAL_FISHEYE", {focal("focal"), centre.u, centre.v, k1, k2});
  }
  if (type == "spherical" || type == "equirectangular") {
    // The scale of both axes is that of the width.
    if (image.width != 2.0 * image.height) return std::nullopt;
    return result("EQUIRECTANGULAR", {image.width, image.height});
  }
  const auto two_focals = [&](const char* model, std::vector<double> distortion) {
    std::vector<double> parameters = {focal("focal_x"), focal("focal_y"), centre.u, centre.v};
    parameters.insert(parameters.end(), distortion.begin(), distortion.end());
    return result(model, std::move(parameters));
  };
  if (type == "simple_radial" || type == "radial") return two_focals("OPENCV", {k1, k2, 0.0, 0.0});
  if (type == "brown") {
    return two_focals("FULL_OPENCV",
                      {k1, k2, optional("p1"), optional("p2"), optional("k3"), 0.0, 0.0, 0.0});
  }
  if (type == "fisheye_opencv") {
    return two_focals("OPENCV_FISHEYE", {k1, k2, optional("k3"), optional("k4")});
  }
  if (type == "fisheye62" || type == "fisheye624") {
    // Equal to COLMAP's models but where both high powers of the angle and tangential or prism terms are in use: OpenSfM
    // takes these of the angle, COLMAP of the point that the powers moved.
    const auto none_of = [&](std::initializer_list<const char*> keys) {
      return std::all_of(keys.begin(), keys.end(),
                         [&](const char* key) { return optional(key) == 0.0; });
    };
    const double k3 = optional("k3");
    const double k4 = optional("k4");
    if (none_of({"k5", "k6", "s1", "s3"})) {
      return two_focals("THIN_PRISM_FISHEYE", {k1, k2, optional("p1"), optional("p2"), k3, k4,
                                               optional("s0"), optional("s2")});
    }
    if (none_of({"p1", "p2", "s0", "s1", "s2", "s3"})) {
      return two_focals(
          "RAD_TAN_THIN_PRISM_FISHEYE",
          {k1, k2, k3, k4, optional("k5"), optional("k6"), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0});
    }
  }
  return std::nullopt;
}

class OpenSfmReader {
 public:
  OpenSfmReader(const OpenSfmSources& sources, const Execution& execution)
      : sources_(sources), execution_(execution), out_(sources.reconstruction->name(), execution) {}

  const SfmBuilder& log() const { return out_; }

  LandmarkMap read(const JsonValue& reconstruction) && {
    read_reconstruction(reconstruction);
    read_tracks();
    read_control_points();
    read_control_list();
    return std::move(out_).finish();
  }

 private:
  struct Shot {
    FrameIndex frame;
    OpenSfmImage image;
  };

  void read_reconstruction(const JsonValue& reconstruction) {
    read_reference(reconstruction);
    read_cameras(reconstruction.at("cameras").object());
    read_shots(reconstruction.at("shots").object());
    read_overrides();
    if (reconstruction.has("rig_instances") && reconstruction.has("rig_cameras")) {
      read_rigs(reconstruction.at("rig_cameras").object(),
                reconstruction.at("rig_instances").object());
    }
    if (reconstruction.has("points")) read_points(reconstruction.at("points").object());
    std::vector<std::string> dropped;
    for (const auto& [key, value] : reconstruction.json().items()) {
      static const std::set<std::string_view> kept = {
          "cameras", "shots", "points", "reference_lla", "rig_instances", "rig_cameras"};
      if (!kept.contains(key)) dropped.push_back(printable(key));
    }
    dropped.insert(dropped.end(), dropped_of_shots_.begin(), dropped_of_shots_.end());
    if (!dropped.empty()) out_.lost(fmt::format("left out: {}", fmt::join(dropped, ", ")));
  }

  void read_reference(const JsonValue& reconstruction) {
    if (reconstruction.has("reference_lla")) {
      set_reference(reconstruction.at("reference_lla").object());
    } else if (sources_.reference != nullptr) {
      const nlohmann::json json = read_json(*sources_.reference);
      set_reference(JsonValue(json, sources_.reference->name() + ": ").object());
    }
  }

  void set_reference(const JsonValue& lla) {
    const GeodeticPosition origin{lla.at("latitude").number(), lla.at("longitude").number(),
                                  lla.at("altitude").number()};
    // OpenSfM's value for an unknown position.
    if (origin == GeodeticPosition{}) {
      out_.remark("reference_lla is 0 0 0, as without GNSS positions: the map has no georeference");
      return;
    }
    // The world frame is the topocentric one.
    georeference() = GeoReference{origin};
  }

  std::optional<GeoReference>& georeference() { return out_.tables().info.georeference; }

  std::optional<GnssFix> gnss_of(const JsonValue& shot) {
    const double accuracy = shot.number_or("gps_dop", 0.0);
    if (!shot.has("gps_position") || accuracy == kUnknownAccuracy) return std::nullopt;
    const Eigen::Vector3d enu = shot.at("gps_position").vector3();
    if (!georeference()) {
      dropped_of_shots_.insert("'gps_position'");
      return std::nullopt;
    }
    GnssFix fix{georeference()->geodetic(enu), std::nullopt};
    if (accuracy > 0.0) fix.accuracy_m = accuracy;
    return fix;
  }

  // OpenSfM's place for what the files of images do not state.
  void read_overrides() {
    if (sources_.overrides == nullptr) return;
    const nlohmann::json json = read_json(*sources_.overrides);
    const JsonValue all = JsonValue(json, sources_.overrides->name() + ": ").object();
    for (const auto& [name, value] : json.items()) {
      const auto shot = shots_.find(name);
      if (shot == shots_.end() || !all.at(name).has("gps")) continue;
      const JsonValue gps = all.at(name).at("gps").object();
      auto known = out_.tables().frames.gnss[shot->second.frame.value];
      if (known || !gps.has("altitude")) continue;
      GnssFix fix{
          {gps.at("latitude").number(), gps.at("longitude").number(), gps.at("altitude").number()},
          std::nullopt};
      if (const double accuracy = gps.number_or("dop", 0.0); accuracy > 0.0) {
        fix.accuracy_m = accuracy;
      }
      known = fix;
    }
  }

  void read_cameras(const JsonValue& cameras) {
    for (const auto& [name, json] : cameras.json().items()) {
      const JsonValue camera = cameras.at(name);
      const OpenSfmImage image{
          static_cast<double>(camera.at("width").unsigned_number(kMostOpenSfmPixels)),
          static_cast<double>(camera.at("height").unsigned_number(kMostOpenSfmPixels))};
      auto usable = opensfm_lens(camera, image, CameraId{images_.size()});
      images_.emplace(name, image);
      std::string defect;
      if (!usable) {
        defect = "projection " + printable(camera.at("projection_type").text()) +
                 " has no model in Cairn";
      }
      out_.add_camera(printable(name), std::move(usable), std::move(defect));
    }
  }

  void read_shots(const JsonValue& shots) {
    for (const auto& [name, json] : shots.json().items()) {
      const JsonValue shot = shots.at(name);
      const auto [camera_from_world, translation] = pose_of(shot);
      const std::string& camera = shot.at("camera").text();
      const auto image = images_.find(camera);
      if (image == images_.end()) {
        shot.at("camera").refuse(printable(camera) + " is not among the cameras",
                                 "the name of a camera");
      }
      SfmFrame frame =
          frame_from_inverse(FrameId{out_.frame_count()}, camera_from_world, translation);
      frame.camera = out_.camera(printable(camera));
      frame.image_name = name;
      const double time = shot.number_or("capture_time", 0.0);
      if (time != 0.0) frame.timestamp_s = time;
      frame.gnss = gnss_of(shot);
      shots_.emplace(name, Shot{out_.add_frame(std::move(frame)), image->second});
      static const std::set<std::string_view> kept = {
          "rotation", "translation", "camera", "capture_time", "gps_dop", "gps_position"};
      for (const auto& [key, value] : json.items()) {
        if (!kept.contains(key)) dropped_of_shots_.insert(printable(key));
      }
    }
  }

  static std::pair<Eigen::Quaterniond, Eigen::Vector3d> pose_of(const JsonValue& json) {
    const Eigen::Vector3d rotation = json.at("rotation").vector3();
    const double angle = rotation.norm();
    if (!std::isfinite(angle)) json.at("rotation").refuse("is out of range", "radians");
    return {Eigen::Quaterniond(angle > 0.0 ? Eigen::AngleAxisd(angle, rotation / angle)
                                           : Eigen::AngleAxisd(0.0, Eigen::Vector3d::UnitX())),
            json.at("translation").vector3()};
  }

  // OpenSfM names no rigs: all rig cameras that took images together are of one.
  void read_rigs(const JsonValue& cameras, const JsonValue& instances) {
    Rig rig;
    InstantId instant;
    for (const auto& [name, json] : instances.json().items()) {
      const JsonValue instance = instances.at(name);
      const JsonValue cameras_of_shots = instance.at("rig_camera_ids").object();
      if (cameras_of_shots.json().size() < 2) continue;
      const auto [rotation, translation] = pose_of(instance);
      for (const auto& [shot, key] : cameras_of_shots.json().items()) {
        const auto found = shots_.find(shot);
        if (found == shots_.end()) continue;
        mount(found->second.frame, cameras, cameras_of_shots.at(shot).text(), rig);
        out_.add_to_instant(instant, found->second.frame, {rotation, translation});
      }
      ++instant.value;
    }
    if (!rig.mounts.empty()) out_.tables().rigs.push_back(std::move(rig));
  }

  // Rig cameras may share a camera, which is in a rig once: all but the first get a copy.
  void mount(FrameIndex frame, const JsonValue& rig_cameras, const std::string& name, Rig& rig) {
    MapTables& tables = out_.tables();
    const std::optional<CameraIndex> camera = tables.frames.cameras[frame.value];
    if (!camera) return;
    const auto [own, is_new] = mounted_.try_emplace(std::pair(name, *camera), *camera);
    if (is_new) {
      const bool is_taken = std::any_of(rig.mounts.begin(), rig.mounts.end(),
                                        [&](const auto& other) { return other.camera == *camera; });
      if (is_taken) {
        own->second = CameraIndex{static_cast<std::uint32_t>(tables.cameras.size())};
        Camera copy = tables.cameras[camera->value];
        copy.id = CameraId{images_.size() + mounted_.size()};
        tables.cameras.push_back(std::move(copy));
      }
      const auto [q, t] = pose_of(rig_cameras.at(name));
      rig.mounts.push_back({own->second, {q.w(), q.x(), q.y(), q.z()}, t});
    }
    tables.frames.cameras.set(frame.value, own->second);
  }

  void read_points(const JsonValue& points) {
    // By number if all names are numbers.
    std::vector<std::pair<std::uint64_t, std::string>> order;
    bool are_numbers = true;
    for (const auto& [name, json] : points.json().items()) {
      const auto number = parse_unsigned(name);
      are_numbers = are_numbers && number && std::to_string(*number) == name;
      order.emplace_back(number.value_or(0), name);
    }
    if (are_numbers) {
      std::sort(order.begin(), order.end());
    } else {
      for (std::size_t i = 0; i < order.size(); ++i) order[i].first = i;
    }
    for (const auto& [id, name] : order) {
      const JsonValue point = points.at(name);
      const Eigen::Vector3d position = point.at("coordinates").vector3();
      std::optional<Color> color;
      if (point.has("color")) color = color_of(point.at("color").vector3());
      landmark_ids_.emplace(name, id);
      out_.add_landmark(id, position, color);
    }
  }

  void read_tracks() {
    if (sources_.tracks == nullptr) {
      out_.remark("there is no tracks.csv beside it: observations are unknown");
      return;
    }
    ReadingProgress progress(execution_, sources_.tracks->size().value_or(0));
    TextRecords in(*sources_.tracks, progress, Separator::kTab);
    while (in.next_line()) {
      const std::string image(in.word("image"));
      const bool is_version = in.line_number() == 1 && image.starts_with("OPENSFM_TRACKS_VERSION");
      if (!is_version && (in.has_word() || !trimmed(image).empty())) read_track(image, in);
    }
  }

  // Behind the image: track, feature, x, y and more.
  void read_track(const std::string& image, TextRecords& in) {
    const auto shot = shots_.find(image);
    const auto landmark = landmark_ids_.find(std::string(in.word("track")));
    const auto keypoint = in.unsigned_number("feature", std::numeric_limits<std::uint32_t>::max());
    const double x = in.number("x");
    const double y = in.number("y");
    // The file keeps tracks whose point or image OpenSfM excludes from the reconstruction.
    if (shot == shots_.end() || landmark == landmark_ids_.end()) return;
    const Pixel pixel = shot->second.image.pixel(x, y);
    if (!std::isfinite(pixel.u) || !std::isfinite(pixel.v)) {
      in.refuse("x", "the pixel is not finite", "coordinates within the image");
    }
    out_.add_observation({.landmark_id = landmark->second,
                          .frame = shot->second.frame,
                          .pixel = pixel,
                          .keypoint = static_cast<std::uint32_t>(keypoint)});
  }

  void read_control_points() {
    if (sources_.control_points == nullptr) return;
    const std::string& name = sources_.control_points->name();
    const nlohmann::json json = read_json(*sources_.control_points);
    const JsonValue all(json, name + ": ");
    std::size_t unplaced = 0;
    all.at("points").each([&](const JsonValue& json_point) {
      if (!json_point.has("position")) {
        ++unplaced;
        return;
      }
      const JsonValue position = json_point.at("position");
      ControlPoint point;
      point.name = json_point.at("id").text();
      point.latitude_deg = position.at("latitude").number();
      point.longitude_deg = position.at("longitude").number();
      if (position.has("altitude")) point.altitude_m = position.at("altitude").number();
      json_point.at("observations").each([&](const JsonValue& view) {
        const auto shot = shots_.find(view.at("shot_id").text());
        if (shot == shots_.end() || !view.has("projection")) return;
        const JsonValue projection = view.at("projection").array();
        point.views.push_back({shot->first, shot->second.image.pixel(projection.at(0).number(),
                                                                     projection.at(1).number())});
      });
      out_.tables().info.control_points.push_back(std::move(point));
    });
    if (unplaced > 0) {
      log_remark(execution_.log, name,
                 fmt::format("{} control points without a position are left out", unplaced),
                 RemarkKind::kLoss);
    }
  }

  void read_control_list() {
    if (sources_.control_list == nullptr) return;
    ReadingProgress progress(execution_, 0);
    TextRecords in(*sources_.control_list, progress);
    if (!in.next_record()) return;
    if (const std::string_view system = in.rest(); system != "WGS84") {
      log_remark(execution_.log, sources_.control_list->name(),
                 fmt::format("control points in {} are left out; those in WGS84 are read",
                             printable(system)),
                 RemarkKind::kLoss);
      return;
    }
    while (in.next_record()) read_control_line(in);
  }

  // Longitude, latitude, altitude, u, v and an image. Lines of one place are of one point.
  void read_control_line(TextRecords& in) {
    ControlPoint point;
    point.longitude_deg = in.number("longitude");
    point.latitude_deg = in.number("latitude");
    const std::string_view altitude = in.word("altitude");
    if (altitude != "NaN" && altitude != "nan") {
      point.altitude_m = parse_number(altitude);
      if (!point.altitude_m) {
        in.refuse("altitude", printable(altitude) + " is not a number", "metres or NaN");
      }
    }
    const double u = in.number("u");
    const double v = in.number("v");
    const std::string image(in.word("image"));
    auto& points = out_.tables().info.control_points;
    const auto [place, is_new] = listed_.try_emplace(
        std::tuple(point.longitude_deg, point.latitude_deg, point.altitude_m), points.size());
    if (is_new) {
      point.name = fmt::format("unnamed-{}", listed_.size() - 1);
      points.push_back(std::move(point));
    }
    if (shots_.contains(image)) points[place->second].views.push_back({image, Pixel{u, v}});
  }

  const OpenSfmSources& sources_;
  const Execution& execution_;
  SfmBuilder out_;
  // The control points of gcp_list.txt by longitude, latitude and altitude.
  std::map<std::tuple<double, double, std::optional<double>>, std::size_t> listed_;
  std::unordered_map<std::string, OpenSfmImage> images_;  // of the cameras
  std::unordered_map<std::string, Shot> shots_;
  std::unordered_map<std::string, std::uint64_t> landmark_ids_;
  std::map<std::pair<std::string, CameraIndex>, CameraIndex> mounted_;  // of rig cameras
  std::set<std::string> dropped_of_shots_;
};

}  // namespace

LandmarkMap read_opensfm(const OpenSfmSources& sources, const std::optional<std::string>& part,
                         const Execution& execution) {
  refuse_if(sources.reconstruction == nullptr, "sources.reconstruction", "is missing",
            "the reconstruction");
  const nlohmann::json json = read_json(*sources.reconstruction);
  const JsonValue all(json, sources.reconstruction->name() + ": ");
  all.array();
  if (json.empty()) all.refuse("holds no reconstruction", "an array of at least one");
  const auto index = parse_unsigned(part.value_or("0"));
  reject_if(!index || *index >= json.size(), sources.reconstruction->name(),
            "has no reconstruction " + printable(part.value_or("0")),
            fmt::format("#0 to #{}", json.size() - 1));
  OpenSfmReader reader(sources, execution);
  if (!part && json.size() > 1) {
    reader.log().remark(
        fmt::format("holds {} reconstructions, of which the first is read; #1 names the "
                    "second",
                    json.size()));
  }
  return std::move(reader).read(all.at(static_cast<std::size_t>(*index)));
}

bool is_opensfm(const MapInput& input) {
  return begins_json(input, '[', {"\"shots\"", "\"cameras\""}) ||
         (input.path.filename() == "reconstruction.json" && begins_json(input, '[', {""}));
}

LandmarkMap read_opensfm_files(const MapInput& input, const Execution& execution) {
  OpenSfmSources sources;
  sources.reconstruction = input.source;
  const auto beside = [&](const char* name, std::optional<FileReader>& file) {
    const fs::path path = input.path.parent_path() / name;
    return is_file(path) ? &file.emplace(path) : nullptr;
  };
  std::optional<FileReader> tracks;
  std::optional<FileReader> control_points;
  std::optional<FileReader> control_list;
  std::optional<FileReader> reference;
  std::optional<FileReader> overrides;
  sources.tracks = beside("tracks.csv", tracks);
  sources.control_points = beside("ground_control_points.json", control_points);
  sources.control_list = beside("gcp_list.txt", control_list);
  sources.reference = beside("reference_lla.json", reference);
  sources.overrides = beside("exif_overrides.json", overrides);
  return read_opensfm(sources, input.part, execution);
}

}  // namespace cairn::detail
