// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/formats/foreign/alicevision.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <string>
#include <unordered_map>
#include <utility>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/core/number_text.hpp"
#include "cairn/formats/detail/bytes/json_document.hpp"
#include "cairn/formats/detail/foreign/observation_list.hpp"
#include "cairn/formats/losses.hpp"

namespace cairn {
namespace {

using detail::JsonValue;

// AliceVision writes numbers as strings.
double number(const JsonValue& value) {
  if (!value.json().is_string()) return value.number();
  const auto number = parse_number(value.text());
  if (!number) value.refuse(printable(value.text()) + " is not a number", "a number");
  return *number;
}

std::uint64_t whole(const JsonValue& value, std::uint64_t most) {
  if (!value.json().is_string()) return value.unsigned_number(most);
  const auto number = parse_unsigned(value.text());
  if (!number || *number > most) {
    value.refuse(printable(value.text()) + " is no whole number",
                 fmt::format("a whole number from 0 to {}", most));
  }
  return *number;
}

constexpr std::uint64_t kMost32 = std::numeric_limits<std::uint32_t>::max();
constexpr std::uint64_t kMost64 = std::numeric_limits<std::uint64_t>::max();

std::vector<double> numbers(const JsonValue& array) {
  std::vector<double> result;
  if (array.json().is_string()) return result;  // an empty list is written as an empty text
  array.array();
  for (std::size_t i = 0; i < array.json().size(); ++i) result.push_back(number(array.at(i)));
  return result;
}

Eigen::Vector3d vector3(const JsonValue& array) {
  const std::vector<double> x = numbers(array);
  if (x.size() != 3) array.refuse(fmt::format("has {} entries", x.size()), "3 numbers");
  return {x[0], x[1], x[2]};
}

class Reader {
 public:
  Reader(std::string name, const MapReadOptions& options)
      : name_(std::move(name)), options_(options) {}

  LandmarkMap read(const JsonValue& all) {
    if (all.has("intrinsics")) read_cameras(all.at("intrinsics").array());
    read_frames(all);
    if (all.has("structure")) read_structure(all.at("structure").array());
    tables_.info.length_unit = LengthUnit::kFree;
    return detail::imported_map(std::move(tables_), name_, options_.log);
  }

 private:
  void lost(const std::string& text) const {
    detail::log_remark(options_.log, name_, text, RemarkKind::kLoss);
  }

  // Adds a camera. @return why it cannot be added; empty if it was
  std::string take_camera(const JsonValue& json, std::uint64_t id) {
    Camera camera;
    camera.id = CameraId{id};
    camera.width = static_cast<std::uint32_t>(whole(json.at("width"), kMost32));
    camera.height = static_cast<std::uint32_t>(whole(json.at("height"), kMost32));
    double focal = 0.0;
    if (json.has("focalLength") && json.has("sensorWidth")) {
      focal = number(json.at("focalLength")) / number(json.at("sensorWidth")) * camera.width;
    } else if (json.has("pxFocalLength")) {
      const JsonValue value = json.at("pxFocalLength");
      focal = value.json().is_array() ? number(value.at(0)) : number(value);
    } else {
      return "it has no focal length";
    }
    if (json.has("pixelRatio") && number(json.at("pixelRatio")) != 1.0)
      return "its pixels are not square";
    const std::vector<double> centre = numbers(json.at("principalPoint"));
    if (centre.size() != 2) json.at("principalPoint").refuse("is no point", "2 numbers");
    // An offset from the image's centre; in old files, from its corner. Offsets below a quarter of the width
    // are from the centre.
    const bool is_offset = std::abs(centre[0]) < 0.25 * camera.width;
    const double cx = centre[0] + (is_offset ? 0.5 * camera.width : 0.0);
    const double cy = centre[1] + (is_offset ? 0.5 * camera.height : 0.0);
    const std::vector<double> d =
        json.has("distortionParams") ? numbers(json.at("distortionParams")) : std::vector<double>{};
    const std::string type = json.at("type").text();
    const auto with = [&](const char* model, std::vector<double> parameters) {
      camera.model = model;
      camera.parameters = std::move(parameters);
    };
    if (type == "pinhole" || d.empty()) {
      with("SIMPLE_PINHOLE", {focal, cx, cy});
    } else if (type == "radial1" && d.size() == 1) {
      with("SIMPLE_RADIAL", {focal, cx, cy, d[0]});
    } else if (type == "radial3" && d.size() == 3) {
      with("FULL_OPENCV", {focal, focal, cx, cy, d[0], d[1], 0.0, 0.0, d[2], 0.0, 0.0, 0.0});
    } else if (type == "brown" && d.size() == 5) {
      with("FULL_OPENCV", {focal, focal, cx, cy, d[0], d[1], d[3], d[4], d[2], 0.0, 0.0, 0.0});
    } else if (type == "fisheye4" && d.size() == 4) {
      with("OPENCV_FISHEYE", {focal, focal, cx, cy, d[0], d[1], d[2], d[3]});
    } else {
      return fmt::format("its type {} with {} parameters is none of Cairn's", printable(type),
                         d.size());
    }
    if (std::string defect = camera_defect(camera); !defect.empty()) return defect;
    cameras_.emplace(id, CameraIndex{static_cast<std::uint32_t>(tables_.cameras.size())});
    tables_.cameras.push_back(std::move(camera));
    return {};
  }

  void read_cameras(const JsonValue& intrinsics) {
    for (std::size_t i = 0; i < intrinsics.json().size(); ++i) {
      const JsonValue json = intrinsics.at(i);
      const std::uint64_t id = whole(json.at("intrinsicId"), kMost64);
      const std::string defect = take_camera(json, id);
      if (!defect.empty()) lost(fmt::format("camera {} is unknown to the map: {}", id, defect));
    }
  }

  void read_frames(const JsonValue& all) {
    std::unordered_map<std::uint64_t, std::size_t> places;
    const JsonValue poses = all.at("poses").array();
    for (std::size_t i = 0; i < poses.json().size(); ++i) {
      places.emplace(whole(poses.at(i).at("poseId"), kMost64), i);
    }
    const JsonValue views = all.at("views").array();
    FrameTable& frames = tables_.frames;
    std::size_t without_pose = 0;
    for (std::size_t i = 0; i < views.json().size(); ++i) {
      const JsonValue view = views.at(i);
      const std::uint64_t id = whole(view.at("viewId"), kMost64);
      const auto pose = places.find(view.has("poseId") ? whole(view.at("poseId"), kMost64) : id);
      if (pose == places.end()) {
        ++without_pose;
        continue;
      }
      const JsonValue transform = poses.at(pose->second).at("pose").at("transform");
      const std::vector<double> r = numbers(transform.at("rotation"));
      if (r.size() != 9) transform.at("rotation").refuse("is no 3x3 matrix", "9 numbers");
      // camera_from_world, column by column.
      const Eigen::Matrix3d rotation = Eigen::Map<const Eigen::Matrix3d>(r.data());
      constexpr double kTolerance = 1e-3;
      const Eigen::Matrix3d off = rotation * rotation.transpose() - Eigen::Matrix3d::Identity();
      if (!(off.cwiseAbs().maxCoeff() < kTolerance) || !(rotation.determinant() > 0.0)) {
        transform.at("rotation").refuse("is no rotation", "a rotation matrix");
      }
      const Eigen::Quaterniond q = Eigen::Quaterniond(rotation).conjugate().normalized();
      frame_of_view_.emplace(id, FrameIndex{static_cast<std::uint32_t>(frames.ids.size())});
      frames.ids.push_back(FrameId{id});
      frames.quaternions.push_back({q.w(), q.x(), q.y(), q.z()});
      frames.translations.push_back(vector3(transform.at("center")));
      std::optional<CameraIndex> camera;
      if (view.has("intrinsicId")) {
        const auto found = cameras_.find(whole(view.at("intrinsicId"), kMost64));
        if (found != cameras_.end()) camera = found->second;
      }
      frames.cameras.push_back(camera);
      frames.image_names.push_back(view.has("path") ? view.at("path").text() : std::string());
    }
    if (without_pose > 0) lost(fmt::format("{} views without a pose are left out", without_pose));
  }

  void read_structure(const JsonValue& structure) {
    LandmarkTable& landmarks = tables_.landmarks;
    std::size_t unposed = 0;
    for (std::size_t i = 0; i < structure.json().size(); ++i) {
      const JsonValue json = structure.at(i);
      landmarks.ids.push_back(LandmarkId{whole(json.at("landmarkId"), kMost64)});
      landmarks.positions.push_back(vector3(json.at("X")));
      landmarks.colors.emplace_back();
      if (json.has("color")) {
        const Eigen::Vector3d c = vector3(json.at("color"));
        const auto channel = [&](int k) {
          return static_cast<std::uint8_t>(std::lround(std::clamp(c[k], 0.0, 255.0)));
        };
        landmarks.colors.back() = Color{channel(0), channel(1), channel(2)};
      }
      if (!json.has("observations")) continue;
      const JsonValue observations = json.at("observations").array();
      for (std::size_t j = 0; j < observations.json().size(); ++j) {
        const JsonValue seen = observations.at(j);
        const auto frame = frame_of_view_.find(whole(seen.at("observationId"), kMost64));
        if (frame == frame_of_view_.end()) {
          ++unposed;
          continue;
        }
        const std::vector<double> x = numbers(seen.at("x"));
        if (x.size() != 2) seen.at("x").refuse("is no pixel", "2 numbers");
        std::optional<std::uint32_t> feature;
        if (seen.has("featureId")) {
          const std::uint64_t id = whole(seen.at("featureId"), kMost64);
          if (id < kMost32) feature = static_cast<std::uint32_t>(id);
        }
        observations_.add(static_cast<std::uint32_t>(i), frame->second, {x[0], x[1]}, feature);
      }
    }
    observations_.fill(tables_.observations, landmarks.ids.size());
    if (unposed > 0) {
      lost(fmt::format("{} observations by views without a pose are left out", unposed));
    }
  }

  std::string name_;
  const MapReadOptions& options_;
  MapTables tables_;
  std::unordered_map<std::uint64_t, CameraIndex> cameras_;
  std::unordered_map<std::uint64_t, FrameIndex> frame_of_view_;
  detail::ObservationList observations_;
};

}  // namespace

LandmarkMap read_alicevision(ByteSource& source, const MapReadOptions& options) {
  const nlohmann::json json = detail::read_json(source);
  return Reader(source.name(), options).read(JsonValue(json, source.name() + ": "));
}

std::vector<MapFormat> alicevision_formats() {
  return {{.name = "alicevision",
           .title = "AliceVision",
           .recognises =
               [](const MapInput& input) {
                 const std::size_t first = input.first_bytes.find_first_not_of(" \t\r\n");
                 const auto has = [&](std::string_view text) {
                   return input.first_bytes.find(text) != std::string_view::npos;
                 };
                 return first != std::string_view::npos && input.first_bytes[first] == '{' &&
                        (has("\"viewId\"") || has("\"featuresFolders\"") ||
                         (input.path.extension() == ".sfm" && has("\"version\"")));
               },
           .read =
               [](const MapInput& input, const MapReadOptions& options) {
                 return read_alicevision(*input.source, options);
               }}};
}

}  // namespace cairn
