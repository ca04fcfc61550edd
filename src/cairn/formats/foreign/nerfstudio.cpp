// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/formats/foreign/nerfstudio.hpp"

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
#include "cairn/formats/detail/foreign/is_file.hpp"
#include "cairn/formats/detail/foreign/pixel_centre.hpp"
#include "cairn/formats/detail/foreign/written_frames.hpp"
#include "cairn/formats/losses.hpp"
#include "cairn/formats/own/ply.hpp"
#include "cairn/geometry/rigid3.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using detail::JsonValue;
using detail::kPixelCentre;

constexpr std::string_view kPointsName = "sparse_pc.ply";

class Reader {
 public:
  Reader(std::string name, const MapReadOptions& options)
      : name_(std::move(name)), options_(options) {}

  LandmarkMap read(const JsonValue& all, const fs::path& folder) {
    const JsonValue frames = all.at("frames").array();
    std::size_t unknown = 0;
    for (std::size_t i = 0; i < frames.json().size(); ++i) {
      const JsonValue frame = frames.at(i);
      add_pose(frame.at("transform_matrix"));
      tables_.frames.ids.push_back(FrameId{i});
      tables_.frames.image_names.push_back(frame.has("file_path") ? frame.at("file_path").text()
                                                                  : std::string());
      const auto camera = camera_of(frame, all);
      tables_.frames.cameras.push_back(camera);
      unknown += camera ? 0 : 1;
    }
    if (unknown > 0)
      lost(fmt::format("{} of {} frames have no known camera", unknown, frames.json().size()));
    if (all.has("ply_file_path")) read_points(folder / all.at("ply_file_path").text());
    tables_.info.length_unit = LengthUnit::kFree;
    return detail::imported_map(std::move(tables_), name_, options_.log);
  }

 private:
  void remark(const std::string& text) const { detail::log_remark(options_.log, name_, text); }
  void lost(const std::string& text) const {
    detail::log_remark(options_.log, name_, text, RemarkKind::kLoss);
  }

  // world_from_camera, where the camera looks along -z with y up.
  void add_pose(const JsonValue& rows) {
    rows.array();
    if (rows.json().size() != 3 && rows.json().size() != 4) {
      rows.refuse(fmt::format("has {} rows", rows.json().size()), "3 or 4 rows of 4 numbers");
    }
    Eigen::Matrix3d rotation;
    Eigen::Vector3d translation;
    for (int row = 0; row < 3; ++row) {
      const JsonValue line = rows.at(static_cast<std::size_t>(row)).array();
      if (line.json().size() != 4) line.refuse("is no row of a pose", "4 numbers");
      for (int column = 0; column < 3; ++column) {
        rotation(row, column) = line.at(static_cast<std::size_t>(column)).number();
      }
      translation[row] = line.at(3).number();
    }
    constexpr double kTolerance = 1e-3;
    const Eigen::Matrix3d off = rotation * rotation.transpose() - Eigen::Matrix3d::Identity();
    if (!(off.cwiseAbs().maxCoeff() < kTolerance) || !(rotation.determinant() > 0.0)) {
      rows.refuse("is no rigid motion", "a rotation and a translation");
    }
    const Eigen::Matrix3d turned = rotation * Eigen::Vector3d(1.0, -1.0, -1.0).asDiagonal();
    const Eigen::Quaterniond q = Eigen::Quaterniond(turned).normalized();
    tables_.frames.quaternions.push_back({q.w(), q.x(), q.y(), q.z()});
    tables_.frames.translations.push_back(translation);
  }

  // Values of a frame override those for the whole file.
  std::optional<CameraIndex> camera_of(const JsonValue& frame, const JsonValue& all) {
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
    Camera camera{CameraId{tables_.cameras.size()},
                  "PINHOLE",
                  size(*width),
                  size(*height),
                  {*fx, fy, cx, cy}};
    const auto with = [&](const char* name, std::initializer_list<double> distortion) {
      camera.model = name;
      camera.parameters.insert(camera.parameters.end(), distortion);
    };
    const double k1 = coefficient("k1");
    const double k2 = coefficient("k2");
    const double k3 = coefficient("k3");
    const double k4 = coefficient("k4");
    // Nerfstudio takes all of these for one model, whatever their names say.
    constexpr std::array<std::string_view, 5> kPerspective = {"OPENCV", "PINHOLE", "SIMPLE_PINHOLE",
                                                              "RADIAL", "SIMPLE_RADIAL"};
    const bool is_perspective =
        std::find(kPerspective.begin(), kPerspective.end(), model) != kPerspective.end();
    if (is_fisheye) {
      with("OPENCV_FISHEYE", {k1, k2, k3, k4});
    } else if (!is_perspective || k4 != 0.0) {
      return std::nullopt;  // none of Cairn's models
    } else {
      const double p1 = coefficient("p1");
      const double p2 = coefficient("p2");
      if (k3 != 0.0) {
        with("FULL_OPENCV", {k1, k2, p1, p2, k3, 0.0, 0.0, 0.0});
      } else if (k1 != 0.0 || k2 != 0.0 || p1 != 0.0 || p2 != 0.0) {
        with("OPENCV", {k1, k2, p1, p2});
      }
    }
    if (!camera_defect(camera).empty()) return std::nullopt;
    if (!tables_.cameras.empty()) {
      const Camera& last = tables_.cameras.back();
      const bool is_same = last.model == camera.model && last.parameters == camera.parameters &&
                           last.width == camera.width && last.height == camera.height;
      if (is_same) return CameraIndex{static_cast<std::uint32_t>(tables_.cameras.size() - 1)};
    }
    tables_.cameras.push_back(std::move(camera));
    return CameraIndex{static_cast<std::uint32_t>(tables_.cameras.size() - 1)};
  }

  void read_points(const fs::path& path) {
    if (!detail::is_file(path)) {
      remark(printable(path.string()) + " is not there: the map has no landmarks");
      return;
    }
    FileReader file(path);
    tables_.landmarks = read_ply(file, options_).landmarks();
  }

  std::string name_;
  const MapReadOptions& options_;
  MapTables tables_;
};

// The fields of a camera; std::nullopt for a model that nerfstudio does not have.
std::optional<nlohmann::ordered_json> json_of(const Camera& camera) {
  const Intrinsics k = intrinsics(camera);
  const std::vector<double>& p = camera.parameters;
  std::array<double, 6> d{};  // k1 k2 p1 p2 k3 k4
  std::string model = "OPENCV";
  if (camera.model == "SIMPLE_RADIAL" || camera.model == "RADIAL") {
    d[0] = p[3];
    d[1] = p.size() > 4 ? p[4] : 0.0;
  } else if (camera.model == "OPENCV") {
    std::copy_n(p.begin() + 4, 4, d.begin());
  } else if (camera.model == "FULL_OPENCV" && p[9] == 0.0 && p[10] == 0.0 && p[11] == 0.0) {
    std::copy_n(p.begin() + 4, 5, d.begin());
  } else if (camera.model == "OPENCV_FISHEYE") {
    model = "OPENCV_FISHEYE";
    d = {p[4], p[5], 0.0, 0.0, p[6], p[7]};
  } else if (camera.model != "SIMPLE_PINHOLE" && camera.model != "PINHOLE") {
    return std::nullopt;
  }
  nlohmann::ordered_json json = {{"camera_model", model},
                                 {"w", camera.width},
                                 {"h", camera.height},
                                 {"fl_x", k.fx},
                                 {"fl_y", k.fy},
                                 {"cx", k.cx + kPixelCentre},
                                 {"cy", k.cy + kPixelCentre},
                                 {"k1", d[0]},
                                 {"k2", d[1]}};
  if (model == "OPENCV") {
    json["p1"] = d[2];
    json["p2"] = d[3];
    if (d[4] != 0.0) json["k3"] = d[4];
  } else {
    json["k3"] = d[4];
    json["k4"] = d[5];
  }
  return json;
}

}  // namespace

LandmarkMap read_nerfstudio(ByteSource& source, const fs::path& folder,
                            const MapReadOptions& options) {
  const nlohmann::json json = detail::read_json(source);
  return Reader(source.name(), options).read(JsonValue(json, source.name() + ": "), folder);
}

void write_nerfstudio(const LandmarkMap& map, const fs::path& path,
                      const MapWriteOptions& options) {
  detail::require_cameras(map, "a frame of nerfstudio");
  const bool is_one_camera = map.cameras().size() == 1;
  nlohmann::ordered_json all = nlohmann::ordered_json::object();
  std::vector<nlohmann::ordered_json> cameras;
  for (const Camera& camera : map.cameras()) {
    auto json = json_of(camera);
    if (!json) {
      throw Error(ErrorKind::kInput, fmt::format("camera {}", camera.id.value),
                  "is of model " + camera.model + ", which nerfstudio does not have",
                  "another model, e.g. OPENCV");
    }
    cameras.push_back(std::move(*json));
  }
  if (is_one_camera) all = cameras[0];
  all["frames"] = nlohmann::ordered_json::array();
  const std::vector<std::string> names = detail::image_names(map);
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
  const std::string lost =
      detail::loss_remark(map, {.observations = false, .covariances = true, .columns = columns},
                          path.string(), "nerfstudio");
  if (options.log && !lost.empty()) options.log({lost, RemarkKind::kLoss});
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

std::vector<MapFormat> nerfstudio_formats() {
  return {{.name = "nerfstudio",
           .title = "nerfstudio",
           .endings = {"transforms.json"},
           .recognises =
               [](const MapInput& input) {
                 const std::size_t first = input.first_bytes.find_first_not_of(" \t\r\n");
                 const auto has = [&](std::string_view text) {
                   return input.first_bytes.find(text) != std::string_view::npos;
                 };
                 return first != std::string_view::npos && input.first_bytes[first] == '{' &&
                        (has("\"transform_matrix\"") || has("\"fl_x\"") ||
                         has("\"camera_angle_x\"") || input.path.filename() == "transforms.json");
               },
           .read =
               [](const MapInput& input, const MapReadOptions& options) {
                 return read_nerfstudio(*input.source, input.path.parent_path(), options);
               },
           .write = [](const LandmarkMap& map, const fs::path& path,
                       const MapWriteOptions& options) { write_nerfstudio(map, path, options); }}};
}

}  // namespace cairn
