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
#include "cairn/formats/detail/foreign/sfm_builder.hpp"
#include "cairn/formats/detail/foreign/written_frames.hpp"
#include "cairn/formats/detail/losses.hpp"
#include "cairn/geometry/rigid3.hpp"
#include "cairn/map/operations.hpp"

namespace cairn::detail {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t kMostOpenSfmPixels = std::numeric_limits<std::uint32_t>::max();
constexpr double kUnknownAccuracy =
    999999.0;  // metres: OpenSfM's value for a shot without GNSS position

// OpenSfM's image coordinates: the centre of the image is (0, 0), its longer side is 1.
struct ImageFrame {
  double width = 0.0;
  double height = 0.0;

  double size() const { return std::max(width, height); }
  Pixel pixel(double x, double y) const {
    return {x * size() + (width - 1.0) / 2.0, y * size() + (height - 1.0) / 2.0};
  }
  std::pair<double, double> normalized(const Pixel& pixel) const {
    return {(pixel.u - (width - 1.0) / 2.0) / size(), (pixel.v - (height - 1.0) / 2.0) / size()};
  }
};

ImageFrame image_frame(const Camera& camera) {
  return {static_cast<double>(camera.width), static_cast<double>(camera.height)};
}

// std::nullopt for a projection that Cairn has no model for.
std::optional<Camera> opensfm_lens(const JsonValue& camera, const ImageFrame& image, CameraId id) {
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
    ImageFrame image;
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
      const ImageFrame image{
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
  std::unordered_map<std::string, ImageFrame> images_;  // of the cameras
  std::unordered_map<std::string, Shot> shots_;
  std::unordered_map<std::string, std::uint64_t> landmark_ids_;
  std::map<std::pair<std::string, CameraIndex>, CameraIndex> mounted_;  // of rig cameras
  std::set<std::string> dropped_of_shots_;
};

// --- Writing --------------------------------------------------------------------------------------

// A camera as OpenSfM describes it; std::nullopt for a model that it does not have.
std::optional<nlohmann::json> opensfm_camera(const Camera& camera) {
  const ImageFrame image = image_frame(camera);
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
      : map_(map), path_(path), execution_(execution), mounts_(cameras_from_rigs(map.rigs())) {
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
      const auto& colors = map_.landmarks().colors;
      if (!colors.empty() && colors[i]) {
        text_ += fmt::format(", \"color\": [{}, {}, {}]", colors[i]->red, colors[i]->green,
                             colors[i]->blue);
      }
      text_ += '}';
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
        const ImageFrame image = image_frame(camera_of(map_, frames[j]));
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
            image_frame(camera_of(map_, FrameIndex{found->second})).normalized(view.pixel);
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
    const auto taken = shots_of_instants();
    const auto alone =
        std::ranges::count_if(taken, [](const auto& instant) { return instant.second.size() < 2; });
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
    for (const auto& [instant, shots] : shots_of_instants()) {
      if (shots.size() < 2) continue;
      begin_entry(std::exchange(is_first, false), fmt::format("{:010}", instant.value));
      write_instance(shots);
    }
    text_ += '}';
  }

  std::map<InstantId, std::vector<std::uint32_t>> shots_of_instants() const {
    std::map<InstantId, std::vector<std::uint32_t>> shots;
    const FrameTable& frames = map_.frames();
    for (std::uint32_t i = 0; i < map_.frame_count() && !frames.instants.empty(); ++i) {
      if (const auto instant = frames.instants[i]) shots[*instant].push_back(i);
    }
    return shots;
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
