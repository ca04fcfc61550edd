// SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <limits>
#include <optional>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/core/number_text.hpp"
#include "cairn/formats/detail/bytes/json_document.hpp"
#include "cairn/formats/detail/foreign/foreign_formats.hpp"
#include "cairn/formats/detail/foreign/sfm_builder.hpp"

namespace cairn::detail {
namespace {

constexpr std::uint64_t kMostAliceVision = std::numeric_limits<std::uint32_t>::max();
constexpr std::uint64_t kMostId = std::numeric_limits<std::uint64_t>::max();

class AliceVisionReader {
 public:
  AliceVisionReader(const std::string& name, const MapReadOptions& options) : out_(name, options) {}

  LandmarkMap read(const JsonValue& all) {
    if (all.has("intrinsics")) {
      all.at("intrinsics").each([&](const JsonValue& json) { read_camera(json); });
    }
    read_frames(all.at("poses"), all.at("views"));
    if (all.has("structure")) {
      all.at("structure").each([&](const JsonValue& json) { read_point(json); });
    }
    out_.lost(unposed_, "observations by views without a pose are left out");
    return std::move(out_).finish();
  }

 private:
  // AliceVision writes numbers as strings.
  static double number(const JsonValue& value) {
    if (!value.json().is_string()) return value.number();
    const auto number = parse_number(value.text());
    if (!number) value.refuse(printable(value.text()) + " is not a number", "a number");
    return *number;
  }

  static std::uint64_t whole(const JsonValue& value, std::uint64_t most = kMostId) {
    if (!value.json().is_string()) return value.unsigned_number(most);
    const auto number = parse_unsigned(value.text());
    if (!number || *number > most) {
      value.refuse(printable(value.text()) + " is no whole number",
                   fmt::format("a whole number from 0 to {}", most));
    }
    return *number;
  }

  static std::vector<double> numbers(const JsonValue& array) {
    std::vector<double> result;
    if (array.json().is_string()) return result;  // an empty list is written as an empty text
    array.each([&](const JsonValue& value) { result.push_back(number(value)); });
    return result;
  }

  static std::vector<double> numbers(const JsonValue& array, std::size_t count,
                                     std::string_view defect) {
    std::vector<double> result = numbers(array);
    if (result.size() != count) array.refuse(defect, fmt::format("{} numbers", count));
    return result;
  }

  static Eigen::Vector3d vector3(const JsonValue& array) {
    const std::vector<double> x = numbers(array);
    if (x.size() != 3) array.refuse(fmt::format("has {} entries", x.size()), "3 numbers");
    return {x[0], x[1], x[2]};
  }

  void read_camera(const JsonValue& json) {
    Camera camera;
    camera.id = CameraId{whole(json.at("intrinsicId"))};
    std::string defect = set_lens(camera, json);
    const std::string key = std::to_string(camera.id.value);
    out_.add_camera(key, std::move(camera), std::move(defect));
  }

  // @return why Cairn has no such camera; empty if it has
  static std::string set_lens(Camera& camera, const JsonValue& json) {
    camera.width = static_cast<std::uint32_t>(whole(json.at("width"), kMostAliceVision));
    camera.height = static_cast<std::uint32_t>(whole(json.at("height"), kMostAliceVision));
    double focal = 0.0;
    if (json.has("focalLength") && json.has("sensorWidth")) {
      focal = number(json.at("focalLength")) / number(json.at("sensorWidth")) * camera.width;
    } else if (json.has("pxFocalLength")) {
      const JsonValue value = json.at("pxFocalLength");
      focal = number(value.json().is_array() ? value.at(0) : value);
    } else {
      return "it has no focal length";
    }
    if (json.has("pixelRatio") && number(json.at("pixelRatio")) != 1.0) {
      return "its pixels are not square";
    }
    const std::vector<double> centre = numbers(json.at("principalPoint"), 2, "is no point");
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
      return std::string();
    };
    if (type == "pinhole" || d.empty()) return with("SIMPLE_PINHOLE", {focal, cx, cy});
    if (type == "radial1" && d.size() == 1) return with("SIMPLE_RADIAL", {focal, cx, cy, d[0]});
    if (type == "radial3" && d.size() == 3) {
      return with("FULL_OPENCV", {focal, focal, cx, cy, d[0], d[1], 0.0, 0.0, d[2], 0.0, 0.0, 0.0});
    }
    if (type == "brown" && d.size() == 5) {
      return with("FULL_OPENCV",
                  {focal, focal, cx, cy, d[0], d[1], d[3], d[4], d[2], 0.0, 0.0, 0.0});
    }
    if (type == "fisheye4" && d.size() == 4) {
      return with("OPENCV_FISHEYE", {focal, focal, cx, cy, d[0], d[1], d[2], d[3]});
    }
    return fmt::format("its type {} with {} parameters is none of Cairn's", printable(type),
                       d.size());
  }

  void read_frames(const JsonValue& poses, const JsonValue& views) {
    std::unordered_map<std::uint64_t, std::size_t> places;
    for (std::size_t i = 0; i < poses.size(); ++i)
      places.emplace(whole(poses.at(i).at("poseId")), i);
    std::size_t without_pose = 0;
    views.each([&](const JsonValue& view) {
      const std::uint64_t id = whole(view.at("viewId"));
      const auto pose = places.find(view.has("poseId") ? whole(view.at("poseId")) : id);
      if (pose == places.end()) {
        ++without_pose;
        return;
      }
      const JsonValue transform = poses.at(pose->second).at("pose").at("transform");
      // camera_from_world, column by column.
      const std::vector<double> r = numbers(transform.at("rotation"), 9, "is no 3x3 matrix");
      const Eigen::Matrix3d rotation = Eigen::Map<const Eigen::Matrix3d>(r.data());
      if (!is_rotation(rotation)) {
        transform.at("rotation").refuse("is no rotation", "a rotation matrix");
      }
      SfmFrame frame{.id = FrameId{id},
                     .world_from_camera = Eigen::Quaterniond(rotation).conjugate().normalized(),
                     .centre = vector3(transform.at("center"))};
      if (view.has("intrinsicId")) {
        frame.camera = out_.camera(std::to_string(whole(view.at("intrinsicId"))));
      }
      if (view.has("path")) frame.image_name = view.at("path").text();
      frame_of_view_.emplace(id, out_.add_frame(std::move(frame)));
    });
    out_.lost(without_pose, "views without a pose are left out");
  }

  void read_point(const JsonValue& json) {
    const std::uint64_t id = whole(json.at("landmarkId"));
    const Eigen::Vector3d position = vector3(json.at("X"));
    std::optional<Color> color;
    if (json.has("color")) color = color_of(vector3(json.at("color")));
    out_.add_landmark(id, position, color);
    if (!json.has("observations")) return;
    json.at("observations").each([&](const JsonValue& seen) {
      const auto frame = frame_of_view_.find(whole(seen.at("observationId")));
      if (frame == frame_of_view_.end()) {
        ++unposed_;
        return;
      }
      const std::vector<double> x = numbers(seen.at("x"), 2, "is no pixel");
      SfmObservation observation{.landmark_id = id, .frame = frame->second, .pixel = {x[0], x[1]}};
      if (seen.has("featureId")) {
        const std::uint64_t feature = whole(seen.at("featureId"));
        if (feature < kMostAliceVision) observation.keypoint = static_cast<std::uint32_t>(feature);
      }
      out_.add_observation(observation);
    });
  }

  SfmBuilder out_;
  std::unordered_map<std::uint64_t, FrameIndex> frame_of_view_;
  std::size_t unposed_ = 0;
};

}  // namespace

LandmarkMap read_alicevision(ByteSource& source, const MapReadOptions& options) {
  const nlohmann::json json = read_json(source);
  return AliceVisionReader(source.name(), options).read(JsonValue(json, source.name() + ": "));
}

bool is_alicevision(const MapInput& input) {
  return begins_json(input, '{', {"\"viewId\"", "\"featuresFolders\""}) ||
         (input.path.extension() == ".sfm" && begins_json(input, '{', {"\"version\""}));
}

}  // namespace cairn::detail
