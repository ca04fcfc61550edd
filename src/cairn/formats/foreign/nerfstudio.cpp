// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <array>
#include <cmath>
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
  NerfstudioReader(const std::string& name, const Execution& execution)
      : execution_(execution), out_(name, execution) {}

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

  // What a frame says of its camera, or else the whole file.
  struct Stated {
    const JsonValue& frame;
    const JsonValue& all;

    std::optional<JsonValue> value(const char* key) const {
      if (frame.has(key)) return frame.at(key);
      if (all.has(key)) return all.at(key);
      return std::nullopt;
    }
    std::optional<double> number(const char* key) const {
      const auto stated = value(key);
      return stated ? std::optional(stated->number()) : std::nullopt;
    }
  };

  std::optional<CameraIndex> camera_of(const JsonValue& frame, const JsonValue& all) {
    std::vector<Camera>& cameras = out_.tables().cameras;
    std::optional<Camera> camera = lens_of({frame, all}, CameraId{cameras.size()});
    if (!camera || !camera_defect(*camera).empty()) return std::nullopt;
    if (cameras.empty() || !is_same_lens(cameras.back(), *camera)) {
      cameras.push_back(std::move(*camera));
    }
    return CameraIndex{static_cast<std::uint32_t>(cameras.size() - 1)};
  }

  // std::nullopt for a camera that is not stated, or none of Cairn's models.
  static std::optional<Camera> lens_of(const Stated& stated, CameraId id) {
    const auto width = stated.number("w");
    const auto height = stated.number("h");
    if (!width || !height) return std::nullopt;
    const auto size = [](double x) {
      return x >= 1.0 && x < 4294967296.0 ? static_cast<std::uint32_t>(x) : 0U;
    };
    auto fx = stated.number("fl_x");
    const auto stated_model = stated.value("camera_model");
    const std::string model = stated_model ? stated_model->text() : std::string("OPENCV");
    if (model == "EQUIRECTANGULAR") {
      // Other focal lengths make it a part of the sphere.
      if (fx && std::abs(*fx - 0.5 * *width) > 1e-6 * *width) return std::nullopt;
      return Camera{id, model, size(*width), size(*height), {*width, *height}};
    }
    // instant-ngp states the field of view.
    if (const auto angle = stated.number("camera_angle_x"); !fx && angle) {
      fx = 0.5 * *width / std::tan(0.5 * *angle);
    }
    if (!fx) return std::nullopt;
    const Intrinsics k{*fx, stated.number("fl_y").value_or(*fx),
                       stated.number("cx").value_or(0.5 * *width) - kPixelCentre,
                       stated.number("cy").value_or(0.5 * *height) - kPixelCentre};
    const auto list = stated.value("distortion_params");
    if (model == "FISHEYE624") {
      Camera camera{
          id, "RAD_TAN_THIN_PRISM_FISHEYE", size(*width), size(*height), {k.fx, k.fy, k.cx, k.cy}};
      if (!list) return std::nullopt;
      const std::vector<double> d = list->numbers(12);
      camera.parameters.insert(camera.parameters.end(), d.begin(), d.end());
      return camera;
    }
    const auto d = distortion_of(stated, model, list ? list->numbers(6) : std::vector<double>{});
    if (!d) return std::nullopt;
    return opencv_camera(id, size(*width), size(*height), k, *d);
  }

  // @param listed k1 k2 k3 k4 p1 p2, or nothing
  static std::optional<Distortion> distortion_of(const Stated& stated, const std::string& model,
                                                 const std::vector<double>& listed) {
    const auto coefficient = [&](const char* key, std::size_t place) {
      return listed.empty() ? stated.number(key).value_or(0.0) : listed[place];
    };
    const bool is_fisheye =
        model == "OPENCV_FISHEYE" ||
        (stated.all.has("is_fisheye") && stated.all.at("is_fisheye").json() == true);
    Distortion d{.is_fisheye = is_fisheye,
                 .k1 = coefficient("k1", 0),
                 .k2 = coefficient("k2", 1),
                 .k3 = coefficient("k3", 2),
                 .k4 = coefficient("k4", 3)};
    if (is_fisheye) return d;
    // Nerfstudio takes all of these for one model, whatever their names say.
    constexpr std::array<std::string_view, 5> kPerspective = {"OPENCV", "PINHOLE", "SIMPLE_PINHOLE",
                                                              "RADIAL", "SIMPLE_RADIAL"};
    const bool is_perspective =
        std::find(kPerspective.begin(), kPerspective.end(), model) != kPerspective.end();
    if (!is_perspective || d.k4 != 0.0) return std::nullopt;
    d.p1 = coefficient("p1", 4);
    d.p2 = coefficient("p2", 5);
    return d;
  }

  void read_points(const fs::path& path) {
    if (!is_file(path)) {
      out_.remark(printable(path.string()) + " is not there: the map has no landmarks");
      return;
    }
    FileReader file(path);
    out_.tables().landmarks = read_ply(file, execution_).landmarks();
  }

  const Execution& execution_;
  SfmBuilder out_;
};

// The fields of a camera; std::nullopt for a model that nerfstudio does not have.
std::optional<nlohmann::ordered_json> nerfstudio_camera(const Camera& camera) {
  const auto with = [&](const char* model, const Intrinsics& k) {
    return nlohmann::ordered_json{{"camera_model", model},
                                  {"w", camera.width},
                                  {"h", camera.height},
                                  {"fl_x", k.fx},
                                  {"fl_y", k.fy},
                                  {"cx", k.cx + kPixelCentre},
                                  {"cy", k.cy + kPixelCentre}};
  };
  const Intrinsics k = intrinsics(camera);
  if (is_panorama(camera)) {  // focal lengths in pixels for half a turn
    const auto height = static_cast<double>(camera.height);
    return with("EQUIRECTANGULAR", {0.5 * camera.width, height, k.cx, k.cy});
  }
  if (camera.model == "RAD_TAN_THIN_PRISM_FISHEYE") {
    nlohmann::ordered_json json = with("FISHEYE624", k);
    json["distortion_params"] =
        std::vector<double>(camera.parameters.begin() + 4, camera.parameters.end());
    return json;
  }
  const auto d = opencv_distortion(camera);
  if (!d) return std::nullopt;
  nlohmann::ordered_json json = with(d->is_fisheye ? "OPENCV_FISHEYE" : "OPENCV", k);
  json["k1"] = d->k1;
  json["k2"] = d->k2;
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
                            const Execution& execution) {
  const nlohmann::json json = read_json(source);
  return NerfstudioReader(source.name(), execution)
      .read(JsonValue(json, source.name() + ": "), folder);
}

void write_nerfstudio(const LandmarkMap& map, const fs::path& path, const Execution& execution) {
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
  // nerfstudio reads one model for all images.
  if (!cameras.empty()) all["camera_model"] = cameras[0]["camera_model"];
  for (std::size_t i = 1; i < cameras.size(); ++i) {
    reject_if(
        cameras[i]["camera_model"] != all["camera_model"],
        fmt::format("camera {}", map.cameras()[i].id.value),
        fmt::format("is {}, and camera {} is {}", cameras[i]["camera_model"].get<std::string>(),
                    map.cameras()[0].id.value, all["camera_model"].get<std::string>()),
        "cameras of one model, as nerfstudio reads one for all images");
  }
  all["frames"] = nlohmann::ordered_json::array();
  const std::vector<std::string> names = json_image_names(map);
  for (std::uint32_t i = 0; i < map.frame_count(); ++i) {
    nlohmann::ordered_json frame = nlohmann::ordered_json::object();
    frame["file_path"] = names[i];
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
  const std::vector<std::string_view> columns = column_names(map.landmarks().columns);
  log_losses(execution.log, map, {.observations = false, .covariances = true, .columns = columns},
             "nerfstudio", path.string());
  const fs::path points = path.parent_path() / kPointsName;
  std::error_code ignored;
  const bool has_points = map.landmark_count() > 0;
  refuse_if(has_points && fs::exists(points, ignored), points.string(),
            "is there already, and is to hold the landmarks of " + path.string(),
            "a folder without it");
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

LandmarkMap read_nerfstudio_file(const MapInput& input, const Execution& execution) {
  return read_nerfstudio(*input.source, input.path.parent_path(), execution);
}

}  // namespace cairn::detail
