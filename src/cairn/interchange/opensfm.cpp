// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/interchange/opensfm.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <numeric>
#include <set>
#include <unordered_map>
#include <utility>

#include <Eigen/Geometry>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include "cairn/core/error.hpp"
#include "cairn/core/number_text.hpp"
#include "cairn/core/text.hpp"
#include "cairn/interchange/detail/json_document.hpp"
#include "cairn/interchange/detail/observation_list.hpp"
#include "cairn/interchange/detail/record_reader.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using detail::JsonValue;

constexpr std::uint64_t kMostPixels = std::numeric_limits<std::uint32_t>::max();

// OpenSfM's image coordinates: the centre of the image is (0, 0), its longer side is 1.
struct ImageFrame {
  double width = 0.0;
  double height = 0.0;

  double size() const { return std::max(width, height); }
  Pixel pixel(double x, double y) const {
    return {x * size() + (width - 1.0) / 2.0, y * size() + (height - 1.0) / 2.0};
  }
};

// Nothing for a projection that Cairn has no model for.
std::optional<Camera> camera_of(const JsonValue& camera, const ImageFrame& image, CameraId id) {
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
  if (type == "perspective") {
    return result("RADIAL", {focal("focal"), centre.u, centre.v, k1, k2});
  }
  if (type == "fisheye") {
    return result("RADIAL_FISHEYE", {focal("focal"), centre.u, centre.v, k1, k2});
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
  return std::nullopt;
}

class Reader {
 public:
  Reader(const OpenSfmSources& sources, const MapReadOptions& options)
      : sources_(sources), options_(options) {}

  void read(const JsonValue& reconstruction) {
    read_cameras(reconstruction.at("cameras").object());
    read_shots(reconstruction.at("shots").object());
    if (reconstruction.has("points")) read_points(reconstruction.at("points").object());
    std::vector<std::string> dropped;
    for (const auto& [key, value] : reconstruction.json().items()) {
      if (key != "cameras" && key != "shots" && key != "points") dropped.push_back(printable(key));
    }
    dropped.insert(dropped.end(), dropped_of_shots_.begin(), dropped_of_shots_.end());
    if (!dropped.empty()) remark(fmt::format("left out: {}", fmt::join(dropped, ", ")));
  }

  void read_tracks() {
    if (sources_.tracks == nullptr) {
      remark("there is no tracks.csv beside it: observations are unknown");
      return;
    }
    detail::ReadingProgress progress(options_, sources_.tracks->size().value_or(0));
    LineReader lines(*sources_.tracks);
    std::uint64_t reported = 0;
    while (const auto line = lines.next()) {
      constexpr std::uint64_t kBlock = 1 << 20;
      if (lines.bytes_read() - reported > kBlock) {
        progress.advance(lines.bytes_read() - reported, sources_.tracks->name());
        reported = lines.bytes_read();
      }
      if (lines.line_number() == 1 && line->starts_with("OPENSFM_TRACKS_VERSION")) continue;
      if (trimmed(*line).empty()) continue;
      read_track(*line, lines.line_number());
    }
    observations_.fill(tables_.observations, tables_.landmarks.ids.size());
  }

  LandmarkMap finish() && {
    tables_.info.length_unit = LengthUnit::kFree;
    const auto place = [&](MapColumn, std::size_t) { return sources_.reconstruction->name(); };
    return LandmarkMap(std::move(tables_), place);
  }

  void remark(const std::string& text) const {
    if (options_.log) options_.log(fmt::format("{}: {}", sources_.reconstruction->name(), text));
  }

 private:
  struct KnownCamera {
    ImageFrame image;
    std::optional<CameraIndex> index;
  };

  void read_cameras(const JsonValue& cameras) {
    for (const auto& [name, json] : cameras.json().items()) {
      const JsonValue camera = cameras.at(name);
      KnownCamera& known = cameras_[name];
      known.image.width = static_cast<double>(camera.at("width").unsigned_number(kMostPixels));
      known.image.height = static_cast<double>(camera.at("height").unsigned_number(kMostPixels));
      const CameraId id{cameras_.size() - 1};
      const auto usable = camera_of(camera, known.image, id);
      const std::string defect = usable ? camera_defect(*usable)
                                        : "projection " +
                                              printable(camera.at("projection_type").text()) +
                                              " has no model in Cairn";
      if (!defect.empty()) {
        remark(fmt::format("camera {} is unknown to the map: {}", printable(name), defect));
        continue;
      }
      known.index = CameraIndex{static_cast<std::uint32_t>(tables_.cameras.size())};
      tables_.cameras.push_back(*usable);
    }
  }

  void read_shots(const JsonValue& shots) {
    FrameTable& frames = tables_.frames;
    for (const auto& [name, json] : shots.json().items()) {
      const JsonValue shot = shots.at(name);
      const Eigen::Vector3d rotation = shot.at("rotation").vector3();
      const Eigen::Vector3d translation = shot.at("translation").vector3();
      const double angle = rotation.norm();
      if (!std::isfinite(angle)) shot.at("rotation").refuse("is out of range", "radians");
      const Eigen::Quaterniond camera_from_world(
          angle > 0.0 ? Eigen::AngleAxisd(angle, rotation / angle)
                      : Eigen::AngleAxisd(0.0, Eigen::Vector3d::UnitX()));
      const Eigen::Quaterniond q = camera_from_world.conjugate();
      const auto camera = cameras_.find(shot.at("camera").text());
      if (camera == cameras_.end()) {
        shot.at("camera").refuse(printable(shot.at("camera").text()) + " is not among the cameras",
                                 "the name of a camera");
      }
      shots_.emplace(name, Shot{FrameIndex{static_cast<std::uint32_t>(frames.ids.size())},
                                camera->second.image});
      frames.ids.push_back(FrameId{frames.ids.size()});
      frames.quaternions.push_back({q.w(), q.x(), q.y(), q.z()});
      frames.translations.push_back(-(q * translation));
      frames.cameras.push_back(camera->second.index);
      frames.image_names.push_back(name);
      const double time = shot.number_or("capture_time", 0.0);
      frames.timestamps_s.push_back(time != 0.0 ? std::optional(time) : std::nullopt);
      for (const auto& [key, value] : json.items()) {
        if (key != "rotation" && key != "translation" && key != "camera" && key != "capture_time") {
          dropped_of_shots_.insert(printable(key));
        }
      }
    }
  }

  void read_points(const JsonValue& points) {
    // By number, where all names are numbers.
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
    LandmarkTable& landmarks = tables_.landmarks;
    for (const auto& [id, name] : order) {
      const JsonValue point = points.at(name);
      landmarks_.emplace(name, static_cast<std::uint32_t>(landmarks.ids.size()));
      landmarks.ids.push_back(LandmarkId{id});
      landmarks.positions.push_back(point.at("coordinates").vector3());
      if (!point.has("color")) {
        landmarks.colors.emplace_back();
        continue;
      }
      const Eigen::Vector3d color = point.at("color").vector3();
      const auto channel = [&](int i) {
        return static_cast<std::uint8_t>(std::lround(std::clamp(color[i], 0.0, 255.0)));
      };
      landmarks.colors.emplace_back(Color{channel(0), channel(1), channel(2)});
    }
  }

  // image, track, feature, x, y and more, apart by tabs.
  void read_track(std::string_view line, std::uint64_t line_number) {
    const auto refuse = [&](std::string_view field, std::string_view what,
                            std::string_view expected) {
      throw Error(ErrorKind::kInput,
                  fmt::format("{}:{}: {}", sources_.tracks->name(), line_number, field), what,
                  expected);
    };
    const auto next = [&](std::string_view field) {
      if (line.data() == nullptr) refuse(field, "the line ends before it", "one field more");
      const std::size_t tab = line.find('\t');
      const std::string_view word = line.substr(0, tab);
      line = tab == std::string_view::npos ? std::string_view() : line.substr(tab + 1);
      return word;
    };
    const auto number = [&](std::string_view field) {
      const std::string_view text = trimmed(next(field));
      const auto value = parse_number(text);
      if (!value) refuse(field, printable(text) + " is not a number", "a finite decimal number");
      return *value;
    };
    const auto shot = shots_.find(std::string(next("image")));
    const auto landmark = landmarks_.find(std::string(next("track")));
    const std::string_view feature = next("feature");
    const auto keypoint = parse_unsigned(feature);
    constexpr std::uint64_t kMost = std::numeric_limits<std::uint32_t>::max();
    if (!keypoint || *keypoint > kMost) {
      refuse("feature", printable(feature) + " is not a whole number", "an index below 2^32");
    }
    const double x = number("x");
    const double y = number("y");
    // Tracks stay in the file when OpenSfM leaves their point or image out of a reconstruction.
    if (shot == shots_.end() || landmark == landmarks_.end()) return;
    const Pixel pixel = shot->second.image.pixel(x, y);
    if (!std::isfinite(pixel.u) || !std::isfinite(pixel.v)) {
      refuse("x", "the pixel is not finite", "coordinates within the image");
    }
    observations_.add(landmark->second, shot->second.frame, pixel,
                      static_cast<std::uint32_t>(*keypoint));
  }

  struct Shot {
    FrameIndex frame;
    ImageFrame image;
  };

  const OpenSfmSources& sources_;
  const MapReadOptions& options_;
  MapTables tables_;
  std::unordered_map<std::string, KnownCamera> cameras_;
  std::unordered_map<std::string, Shot> shots_;
  std::unordered_map<std::string, std::uint32_t> landmarks_;
  std::set<std::string> dropped_of_shots_;
  detail::ObservationList observations_;
};

}  // namespace

LandmarkMap read_opensfm(const OpenSfmSources& sources, const std::optional<std::string>& part,
                         const MapReadOptions& options) {
  if (sources.reconstruction == nullptr) {
    throw Error(ErrorKind::kMisuse, "sources.reconstruction", "is missing", "the reconstruction");
  }
  const nlohmann::json json = detail::read_json(*sources.reconstruction);
  const JsonValue all(json, sources.reconstruction->name() + ": ");
  all.array();
  if (json.empty()) all.refuse("holds no reconstruction", "an array of at least one");
  const auto index = parse_unsigned(part.value_or("0"));
  if (!index || *index >= json.size()) {
    throw Error(ErrorKind::kInput, sources.reconstruction->name(),
                "has no reconstruction " + printable(part.value_or("0")),
                fmt::format("#0 to #{}", json.size() - 1));
  }
  Reader reader(sources, options);
  if (!part && json.size() > 1) {
    reader.remark(
        fmt::format("holds {} reconstructions, of which the first is read; #1 names the "
                    "second",
                    json.size()));
  }
  reader.read(all.at(static_cast<std::size_t>(*index)));
  reader.read_tracks();
  return std::move(reader).finish();
}

std::vector<MapFormat> opensfm_formats() {
  const auto first_keys = [](const MapInput& input) {
    const std::size_t first = input.first_bytes.find_first_not_of(" \t\r\n");
    return first != std::string_view::npos && input.first_bytes[first] == '[' &&
           (input.first_bytes.find("\"shots\"") != std::string_view::npos ||
            input.first_bytes.find("\"cameras\"") != std::string_view::npos ||
            input.path.filename() == "reconstruction.json");
  };
  return {{.name = "opensfm",
           .title = "OpenSfM",
           .holds_several = true,
           .recognises = first_keys,
           .read = [](const MapInput& input, const MapReadOptions& options) {
             OpenSfmSources sources;
             sources.reconstruction = input.source;
             const fs::path tracks = input.path.parent_path() / "tracks.csv";
             std::error_code ignored;
             std::optional<FileReader> file;
             if (fs::exists(tracks, ignored)) sources.tracks = &file.emplace(tracks);
             return read_opensfm(sources, input.part, options);
           }}};
}

}  // namespace cairn
