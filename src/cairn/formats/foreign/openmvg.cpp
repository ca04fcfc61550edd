// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/formats/foreign/openmvg.hpp"

#include <algorithm>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <unordered_map>
#include <utility>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/formats/detail/bytes/json_document.hpp"
#include "cairn/formats/detail/foreign/observation_list.hpp"
#include "cairn/formats/losses.hpp"

namespace cairn {
namespace {

using detail::JsonValue;

constexpr std::uint64_t kMost = std::numeric_limits<std::uint32_t>::max();

Eigen::Matrix3d matrix3(const JsonValue& rows) {
  rows.array();
  if (rows.json().size() != 3) rows.refuse("is no 3x3 matrix", "3 rows of 3 numbers");
  Eigen::Matrix3d matrix;
  for (std::size_t i = 0; i < 3; ++i) {
    matrix.row(static_cast<Eigen::Index>(i)) = rows.at(i).vector3().transpose();
  }
  return matrix;
}

std::vector<double> numbers(const JsonValue& array, std::size_t count) {
  array.array();
  if (array.json().size() != count) {
    array.refuse(fmt::format("has {} entries", array.json().size()),
                 fmt::format("{} numbers", count));
  }
  std::vector<double> result;
  for (std::size_t i = 0; i < count; ++i) result.push_back(array.at(i).number());
  return result;
}

// The value of an entry {"key": id, "value": {"ptr_wrapper": {"data": {...}}}}.
JsonValue data_of(const JsonValue& entry) {
  return entry.at("value").at("ptr_wrapper").at("data").object();
}

// The distortion parameters identify the model.
Camera camera_of(const JsonValue& data, CameraId id) {
  Camera camera;
  camera.id = id;
  camera.width = static_cast<std::uint32_t>(data.at("width").unsigned_number(kMost));
  camera.height = static_cast<std::uint32_t>(data.at("height").unsigned_number(kMost));
  const double focal = data.at("focal_length").number();
  const std::vector<double> centre = numbers(data.at("principal_point"), 2);
  const auto with = [&](const char* model, std::vector<double> parameters) {
    camera.model = model;
    camera.parameters = std::move(parameters);
    return camera;
  };
  if (data.has("disto_k1")) {
    const auto d = numbers(data.at("disto_k1"), 1);
    return with("SIMPLE_RADIAL", {focal, centre[0], centre[1], d[0]});
  }
  const auto full = [&](const std::vector<double>& d, double t1, double t2) {
    return with("FULL_OPENCV",
                {focal, focal, centre[0], centre[1], d[0], d[1], t1, t2, d[2], 0.0, 0.0, 0.0});
  };
  if (data.has("disto_k3")) return full(numbers(data.at("disto_k3"), 3), 0.0, 0.0);
  if (data.has("disto_t2")) {
    const auto d = numbers(data.at("disto_t2"), 5);
    return full(d, d[3], d[4]);
  }
  if (data.has("fisheye")) {
    const auto d = numbers(data.at("fisheye"), 4);
    return with("OPENCV_FISHEYE", {focal, focal, centre[0], centre[1], d[0], d[1], d[2], d[3]});
  }
  return with("SIMPLE_PINHOLE", {focal, centre[0], centre[1]});
}

class Reader {
 public:
  Reader(const std::string& name, const MapReadOptions& options) : name_(name), options_(options) {}

  LandmarkMap read(const JsonValue& all) {
    read_cameras(all.at("intrinsics").array());
    read_frames(all.at("extrinsics").array(), all.at("views").array());
    if (all.has("structure")) read_structure(all.at("structure").array());
    if (all.has("control_points") && !all.at("control_points").array().json().empty()) {
      lost(fmt::format("{} control points are left out", all.at("control_points").json().size()));
    }
    observations_.fill(tables_.observations, tables_.landmarks.ids.size());
    tables_.info.length_unit = LengthUnit::kFree;
    return detail::imported_map(std::move(tables_), name_, options_.log);
  }

 private:
  void lost(const std::string& text) const {
    detail::log_remark(options_.log, name_, text, RemarkKind::kLoss);
  }

  void read_cameras(const JsonValue& intrinsics) {
    for (std::size_t i = 0; i < intrinsics.json().size(); ++i) {
      const JsonValue entry = intrinsics.at(i);
      const std::uint64_t id = entry.at("key").unsigned_number(kMost);
      const JsonValue data = data_of(entry);
      // Spherical cameras have no focal length.
      if (!data.has("focal_length")) {
        lost(fmt::format("camera {} is unknown to the map: it has no focal length", id));
        continue;
      }
      const Camera camera = camera_of(data, CameraId{id});
      if (const std::string defect = camera_defect(camera); !defect.empty()) {
        lost(fmt::format("camera {} is unknown to the map: {}", id, defect));
        continue;
      }
      cameras_.emplace(id, CameraIndex{static_cast<std::uint32_t>(tables_.cameras.size())});
      tables_.cameras.push_back(camera);
    }
  }

  void read_frames(const JsonValue& extrinsics, const JsonValue& views) {
    std::unordered_map<std::uint64_t, std::size_t> poses;
    for (std::size_t i = 0; i < extrinsics.json().size(); ++i) {
      poses.emplace(extrinsics.at(i).at("key").unsigned_number(kMost), i);
    }
    FrameTable& frames = tables_.frames;
    std::size_t without_pose = 0;
    for (std::size_t i = 0; i < views.json().size(); ++i) {
      const JsonValue view = data_of(views.at(i));
      const std::uint64_t id = view.at("id_view").unsigned_number(kMost);
      const auto pose = poses.find(view.at("id_pose").unsigned_number(kMost));
      if (pose == poses.end()) {
        ++without_pose;
        continue;
      }
      const JsonValue value = extrinsics.at(pose->second).at("value");
      const Eigen::Matrix3d rotation = matrix3(value.at("rotation"));
      constexpr double kTolerance = 1e-3;
      const bool is_rotation =
          ((rotation * rotation.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff() <
           kTolerance) &&
          rotation.determinant() > 0.0;
      if (!is_rotation) value.at("rotation").refuse("is no rotation", "a rotation matrix");
      const Eigen::Quaterniond q = Eigen::Quaterniond(rotation).conjugate().normalized();
      frame_of_view_.emplace(id, FrameIndex{static_cast<std::uint32_t>(frames.ids.size())});
      frames.ids.push_back(FrameId{id});
      frames.quaternions.push_back({q.w(), q.x(), q.y(), q.z()});
      frames.translations.push_back(value.at("center").vector3());
      const auto camera = cameras_.find(view.at("id_intrinsic").unsigned_number(kMost));
      frames.cameras.push_back(camera == cameras_.end() ? std::nullopt
                                                        : std::optional(camera->second));
      frames.image_names.push_back(view.at("filename").text());
    }
    if (without_pose > 0) lost(fmt::format("{} views without a pose are left out", without_pose));
  }

  void read_structure(const JsonValue& structure) {
    LandmarkTable& landmarks = tables_.landmarks;
    std::size_t unposed = 0;
    for (std::size_t i = 0; i < structure.json().size(); ++i) {
      const JsonValue entry = structure.at(i);
      landmarks.ids.push_back(
          LandmarkId{entry.at("key").unsigned_number(std::numeric_limits<std::uint64_t>::max())});
      const JsonValue value = entry.at("value");
      landmarks.positions.push_back(value.at("X").vector3());
      const JsonValue observations = value.at("observations").array();
      for (std::size_t j = 0; j < observations.json().size(); ++j) {
        const JsonValue observation = observations.at(j);
        const auto frame = frame_of_view_.find(observation.at("key").unsigned_number(kMost));
        if (frame == frame_of_view_.end()) {
          ++unposed;
          continue;
        }
        const JsonValue seen = observation.at("value");
        const std::vector<double> x = numbers(seen.at("x"), 2);
        std::optional<std::uint32_t> feature;
        if (seen.has("id_feat") && seen.at("id_feat").json().is_number_unsigned() &&
            seen.at("id_feat").json().get<std::uint64_t>() < kMost) {
          feature = static_cast<std::uint32_t>(seen.at("id_feat").json().get<std::uint64_t>());
        }
        observations_.add(static_cast<std::uint32_t>(i), frame->second, {x[0], x[1]}, feature);
      }
    }
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

LandmarkMap read_openmvg(ByteSource& source, const MapReadOptions& options) {
  const nlohmann::json json = detail::read_json(source);
  return Reader(source.name(), options).read(JsonValue(json, source.name() + ": "));
}

std::vector<MapFormat> openmvg_formats() {
  return {
      {.name = "openmvg",
       .title = "OpenMVG",
       .recognises =
           [](const MapInput& input) {
             const std::size_t first = input.first_bytes.find_first_not_of(" \t\r\n");
             return first != std::string_view::npos && input.first_bytes[first] == '{' &&
                    input.first_bytes.find("\"sfm_data_version\"") != std::string_view::npos;
           },
       .read = [](const MapInput& input,
                  const MapReadOptions& options) { return read_openmvg(*input.source, options); }}};
}

}  // namespace cairn
