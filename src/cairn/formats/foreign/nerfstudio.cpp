// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <string>
#include <utility>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/core/number_text.hpp"
#include "cairn/core/text.hpp"
#include "cairn/formats/detail/bytes/json_document.hpp"
#include "cairn/formats/detail/foreign/foreign_formats.hpp"
#include "cairn/formats/detail/foreign/sfm_builder.hpp"
#include "cairn/formats/detail/foreign/written_frames.hpp"
#include "cairn/formats/detail/losses.hpp"
#include "cairn/formats/map_file.hpp"
#include "cairn/geometry/rigid3.hpp"

namespace cairn::detail {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kPointsName = "sparse_pc.ply";

class NerfstudioReader {
 public:
  NerfstudioReader(const std::string& name, const MapReadOptions& options)
      : options_(options), out_(name, options) {}

  LandmarkMap read(const JsonValue& all, const fs::path& folder) {
    const JsonValue frames = all.at("frames").array();
    std::size_t unknown = 0;
    for (std::size_t i = 0; i < frames.size(); ++i) {
      const JsonValue json = frames.at(i);
      SfmFrame frame = frame_of(json.at("transform_matrix"));
      frame.id = FrameId{i};
      if (json.has("file_path")) frame.image_name = json.at("file_path").text();
      frame.camera = camera_of(json, all);
      unknown += frame.camera ? 0 : 1;
      out_.add_frame(std::move(frame));
    }
    out_.lost(unknown, fmt::format("of {} frames have no known camera", frames.size()));
    if (all.has("ply_file_path")) read_points(folder / all.at("ply_file_path").text());
    return std::move(out_).finish();
  }

 private:
  // world_from_camera, where the camera looks along -z with y up.
  static SfmFrame frame_of(const JsonValue& rows) {
    if (rows.size() != 3 && rows.size() != 4) {
      rows.refuse(fmt::format("has {} rows", rows.size()), "3 or 4 rows of 4 numbers");
    }
    Eigen::Matrix<double, 3, 4> pose;
    for (int row = 0; row < 3; ++row) {
      const JsonValue line = rows.at(static_cast<std::size_t>(row));
      if (line.size() != 4) line.refuse("is no row of a pose", "4 numbers");
      pose.row(row) = Eigen::Map<const Eigen::RowVector4d>(line.numbers(4).data());
    }
    const Eigen::Matrix3d rotation = pose.leftCols<3>();
    if (!is_rotation(rotation)) rows.refuse("is no rigid motion", "a rotation and a translation");
    const Eigen::Matrix3d turned = rotation * Eigen::Vector3d(1.0, -1.0, -1.0).asDiagonal();
    return {.id = {},
            .world_from_camera = Eigen::Quaterniond(turned).normalized(),
            .centre = pose.col(3)};
  }

  // Values of a frame override those for the whole file.
  std::optional<CameraIndex> camera_of(const JsonValue& frame, const JsonValue& all) {
    std::vector<Camera>& cameras = out_.tables().cameras;
    const auto number = [&](const char* key) -> std::optional<double> {
      if (frame.has(key)) return frame.at(key).number();
      if (all.has(key)) return all.at(key).number();
      return std::nullopt;
    };
    const auto width = number("w");
    const auto height = number("h");
    if (!width || !height) return std::nullopt;
    const auto size = [](double x) {
      return x >= 1.0 && x < 4294967296.0 ? static_cast<std::uint32_t>(x) : 0U;
    };
    auto fx = number("fl_x");
    // instant-ngp states the field of view.
    if (const auto angle = number("camera_angle_x"); !fx && angle) {
      fx = 0.5 * *width / std::tan(0.5 * *angle);
    }
    if (!fx) return std::nullopt;
    const double fy = number("fl_y").value_or(*fx);
    const double cx = number("cx").value_or(0.5 * *width) - kPixelCentre;
    const double cy = number("cy").value_or(0.5 * *height) - kPixelCentre;
    const auto coefficient = [&](const char* key) { return number(key).value_or(0.0); };
    const JsonValue& stated = frame.has("camera_model") ? frame : all;
    const std::string model =
        stated.has("camera_model") ? stated.at("camera_model").text() : std::string("OPENCV");
    const bool is_fisheye =
        model == "OPENCV_FISHEYE" || (all.has("is_fisheye") && all.at("is_fisheye").json() == true);
    Distortion d{.is_fisheye = is_fisheye,
                 .k1 = coefficient("k1"),
                 .k2 = coefficient("k2"),
                 .k3 = coefficient("k3"),
                 .k4 = coefficient("k4")};
    // Nerfstudio takes all of these for one model, whatever their names say.
    constexpr std::array<std::string_view, 5> kPerspective = {"OPENCV", "PINHOLE", "SIMPLE_PINHOLE",
                                                              "RADIAL", "SIMPLE_RADIAL"};
    if (!is_fisheye) {
      const bool is_perspective =
          std::find(kPerspective.begin(), kPerspective.end(), model) != kPerspective.end();
      if (!is_perspective || d.k4 != 0.0) return std::nullopt;  // none of Cairn's models
      d.p1 = coefficient("p1");
      d.p2 = coefficient("p2");
    }
    Camera camera =
        opencv_camera(CameraId{cameras.size()}, size(*width), size(*height), {*fx, fy, cx, cy}, d);
    if (!camera_defect(camera).empty()) return std::nullopt;
    if (cameras.empty() || !is_same_lens(cameras.back(), camera))
      cameras.push_back(std::move(camera));
    return CameraIndex{static_cast<std::uint32_t>(cameras.size() - 1)};
  }

  void read_points(const fs::path& path) {
    if (!is_file(path)) {
      out_.remark(printable(path.string()) + " is not there: the map has no landmarks");
      return;
    }
    FileReader file(path);
    out_.tables().landmarks = read_ply(file, options_).landmarks();
  }

  const MapReadOptions& options_;
  SfmBuilder out_;
};

// The fields of a camera; std::nullopt for a model that nerfstudio does not have.
std::optional<nlohmann::ordered_json> nerfstudio_camera(const Camera& camera) {
  const Intrinsics k = intrinsics(camera);
  const auto d = opencv_distortion(camera);
  if (!d) return std::nullopt;
  nlohmann::ordered_json json = {{"camera_model", d->is_fisheye ? "OPENCV_FISHEYE" : "OPENCV"},
                                 {"w", camera.width},
                                 {"h", camera.height},
                                 {"fl_x", k.fx},
                                 {"fl_y", k.fy},
                                 {"cx", k.cx + kPixelCentre},
                                 {"cy", k.cy + kPixelCentre},
                                 {"k1", d->k1},
                                 {"k2", d->k2}};
  if (d->is_fisheye) {
    json["k3"] = d->k3;
    json["k4"] = d->k4;
  } else {
    json["p1"] = d->p1;
    json["p2"] = d->p2;
    if (d->k3 != 0.0) json["k3"] = d->k3;
  }
  return json;
}

}  // namespace

LandmarkMap read_nerfstudio(ByteSource& source, const fs::path& folder,
                            const MapReadOptions& options) {
  const nlohmann::json json = read_json(source);
  return NerfstudioReader(source.name(), options)
      .read(JsonValue(json, source.name() + ": "), folder);
}

void write_nerfstudio(const LandmarkMap& map, const fs::path& path,
                      const MapWriteOptions& options) {
  require_cameras(map, "a frame of nerfstudio");
  const bool is_one_camera = map.cameras().size() == 1;
  nlohmann::ordered_json all = nlohmann::ordered_json::object();
  std::vector<nlohmann::ordered_json> cameras;
  for (const Camera& camera : map.cameras()) {
    auto json = nerfstudio_camera(camera);
    if (!json) refuse_model(camera, "nerfstudio");
    cameras.push_back(std::move(*json));
  }
  if (is_one_camera) all = cameras[0];
  all["frames"] = nlohmann::ordered_json::array();
  const std::vector<std::string> names = image_names(map);
  for (std::uint32_t i = 0; i < map.frame_count(); ++i) {
    nlohmann::ordered_json frame = nlohmann::ordered_json::object();
    const std::string& name = names[i];
    if (!is_utf8(name)) {
      throw Error(ErrorKind::kInput, fmt::format("frame {}", map.frames().ids[i].value),
                  "image name " + printable(name), "a name in UTF-8, as JSON needs it");
    }
    frame["file_path"] = name;
    if (!is_one_camera) frame.update(cameras[map.frames().cameras[i]->value]);
    const Rigid3 pose = map.world_from_camera(FrameIndex{i});
    const Eigen::Matrix3d rotation =
        pose.rotation() * Eigen::Vector3d(1.0, -1.0, -1.0).asDiagonal();
    nlohmann::ordered_json rows = nlohmann::ordered_json::array();
    for (int row = 0; row < 3; ++row) {
      rows.push_back(
          {rotation(row, 0), rotation(row, 1), rotation(row, 2), pose.translation()[row]});
    }
    rows.push_back({0.0, 0.0, 0.0, 1.0});
    frame["transform_matrix"] = std::move(rows);
    all["frames"].push_back(std::move(frame));
  }
  // Before writing, because the caller may refuse the loss.
  std::vector<std::string_view> columns;
  for (const NamedColumn& column : map.landmarks().columns) columns.push_back(column.name);
  log_losses(options.log, map, {.observations = false, .covariances = true, .columns = columns},
             "nerfstudio", path.string());
  const fs::path points = path.parent_path() / kPointsName;
  std::error_code ignored;
  const bool has_points = map.landmark_count() > 0;
  if (has_points && fs::exists(points, ignored)) {
    throw Error(ErrorKind::kStorage, points.string(),
                "is there already, and is to hold the landmarks of " + path.string(),
                "a folder without it");
  }
  if (has_points) all["ply_file_path"] = kPointsName;
  try {
    // Both are written before either gets its name, so that only a process killed between the two leaves a file that
    // the next run refuses.
    write_file(path, [&](const ByteSink& sink) {
      sink(all.dump(1) + "\n");
      if (has_points) write_file(points, [&](const ByteSink& ply) { write_ply(map, ply); });
    });
  } catch (...) {
    if (has_points) fs::remove(points, ignored);
    throw;
  }
}

bool is_nerfstudio(const MapInput& input) {
  return begins_json(input, '{', {"\"transform_matrix\"", "\"fl_x\"", "\"camera_angle_x\""}) ||
         (input.path.filename() == "transforms.json" && begins_json(input, '{', {""}));
}

LandmarkMap read_nerfstudio_file(const MapInput& input, const MapReadOptions& options) {
  return read_nerfstudio(*input.source, input.path.parent_path(), options);
}

}  // namespace cairn::detail
