// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <filesystem>
#include <iterator>
#include <limits>
#include <optional>
#include <string>
#include <unordered_map>
#include <unordered_set>
#include <utility>
#include <vector>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/formats/detail/bytes/json_document.hpp"
#include "cairn/formats/detail/foreign/feature_files.hpp"
#include "cairn/formats/detail/foreign/foreign_formats.hpp"
#include "cairn/formats/detail/foreign/sfm_builder.hpp"

namespace cairn::detail {
namespace {

constexpr std::uint64_t kMostOpenMvg = std::numeric_limits<std::uint32_t>::max();

class OpenMvgReader {
 public:
  OpenMvgReader(const std::string& name, const Execution& execution) : out_(name, execution) {}

  LandmarkMap read(const JsonValue& all) {
    all.at("intrinsics").each([&](const JsonValue& entry) { read_camera(entry); });
    read_frames(all.at("extrinsics").array(), all.at("views").array());
    if (!all.has("structure")) out_.lost("there is no structure: the map has no landmarks");
    if (all.has("structure")) {
      all.at("structure").each([&](const JsonValue& entry) { read_point(entry); });
      out_.lost(unposed_, "observations by views without a pose are left out");
    }
    if (all.has("control_points")) {
      out_.lost(all.at("control_points").size(), "control points are left out");
    }
    return std::move(out_).finish();
  }

 private:
  // The value of an entry {"key": id, "value": {"ptr_wrapper": {"data": {...}}}}.
  static JsonValue data_of(const JsonValue& entry) {
    return entry.at("value").at("ptr_wrapper").at("data").object();
  }

  void read_camera(const JsonValue& entry) {
    const std::uint64_t id = entry.at("key").unsigned_number(kMostOpenMvg);
    const JsonValue data = data_of(entry);
    // Spherical cameras have no focal length, and their size lies deeper.
    if (data.has("focal_length")) {
      out_.add_camera(std::to_string(id), camera_of(data, CameraId{id}));
    } else if (const auto [width, height] = size_of(data.at("value0")); width == 2 * height) {
      out_.add_camera(std::to_string(id),
                      Camera{CameraId{id},
                             "EQUIRECTANGULAR",
                             width,
                             height,
                             {static_cast<double>(width), static_cast<double>(height)}});
      panoramas_.insert(id);
    } else {
      out_.add_camera(std::to_string(id), {}, "it is a sphere that is not twice as wide as high");
    }
  }

  static std::pair<std::uint32_t, std::uint32_t> size_of(const JsonValue& data) {
    return {static_cast<std::uint32_t>(data.at("width").unsigned_number(kMostOpenMvg)),
            static_cast<std::uint32_t>(data.at("height").unsigned_number(kMostOpenMvg))};
  }

  // The distortion parameters identify the model.
  static Camera camera_of(const JsonValue& data, CameraId id) {
    const auto [width, height] = size_of(data);
    const double focal = data.at("focal_length").number();
    const std::vector<double> centre = data.at("principal_point").numbers(2);
    const double cx = centre[0];
    const double cy = centre[1];
    Camera camera{id, {}, width, height, {}};
    const auto with = [&](const char* model, std::vector<double> parameters) {
      camera.model = model;
      camera.parameters = std::move(parameters);
      return camera;
    };
    if (data.has("disto_k1")) {
      return with("SIMPLE_RADIAL", {focal, cx, cy, data.at("disto_k1").numbers(1)[0]});
    }
    const auto full = [&](const std::vector<double>& d, double t1, double t2) {
      return with("FULL_OPENCV", {focal, focal, cx, cy, d[0], d[1], t1, t2, d[2], 0.0, 0.0, 0.0});
    };
    if (data.has("disto_k3")) return full(data.at("disto_k3").numbers(3), 0.0, 0.0);
    if (data.has("disto_t2")) {
      const std::vector<double> d = data.at("disto_t2").numbers(5);
      return full(d, d[3], d[4]);
    }
    if (data.has("fisheye")) {
      const std::vector<double> d = data.at("fisheye").numbers(4);
      return with("OPENCV_FISHEYE", {focal, focal, cx, cy, d[0], d[1], d[2], d[3]});
    }
    return with("SIMPLE_PINHOLE", {focal, cx, cy});
  }

  static Eigen::Matrix3d rotation_of(const JsonValue& rows) {
    if (rows.size() != 3) rows.refuse("is no 3x3 matrix", "3 rows of 3 numbers");
    Eigen::Matrix3d matrix;
    for (int i = 0; i < 3; ++i) {
      matrix.row(i) = rows.at(static_cast<std::size_t>(i)).vector3().transpose();
    }
    if (!is_rotation(matrix)) rows.refuse("is no rotation", "a rotation matrix");
    return matrix;
  }

  void read_frames(const JsonValue& extrinsics, const JsonValue& views) {
    std::unordered_map<std::uint64_t, std::size_t> poses;
    for (std::size_t i = 0; i < extrinsics.size(); ++i) {
      poses.emplace(extrinsics.at(i).at("key").unsigned_number(kMostOpenMvg), i);
    }
    std::size_t without_pose = 0;
    views.each([&](const JsonValue& entry) {
      const JsonValue view = data_of(entry);
      const std::uint64_t id = view.at("id_view").unsigned_number(kMostOpenMvg);
      const auto pose = poses.find(view.at("id_pose").unsigned_number(kMostOpenMvg));
      if (pose == poses.end()) {
        ++without_pose;
        return;
      }
      const JsonValue value = extrinsics.at(pose->second).at("value");
      const Eigen::Matrix3d rotation = rotation_of(value.at("rotation"));
      const std::uint64_t camera = view.at("id_intrinsic").unsigned_number(kMostOpenMvg);
      const FrameIndex frame = out_.add_frame(
          {.id = FrameId{id},
           .world_from_camera = Eigen::Quaterniond(rotation).conjugate().normalized(),
           .centre = value.at("center").vector3(),
           .camera = out_.camera(std::to_string(camera)),
           .image_name = image_name(view)});
      frame_of_view_.emplace(id, SeenBy{frame, panoramas_.contains(camera)});
    });
    out_.lost(without_pose, "views without a pose are left out");
  }

  static std::string image_name(const JsonValue& view) {
    std::string folder = view.has("local_path") ? view.at("local_path").text() : std::string();
    if (!folder.empty() && folder.back() != '/') folder += '/';
    return folder + view.at("filename").text();
  }

  void read_point(const JsonValue& entry) {
    const std::uint64_t id =
        entry.at("key").unsigned_number(std::numeric_limits<std::uint64_t>::max());
    const JsonValue value = entry.at("value");
    out_.add_landmark(id, value.at("X").vector3());
    value.at("observations").each([&](const JsonValue& observation) {
      const auto frame = frame_of_view_.find(observation.at("key").unsigned_number(kMostOpenMvg));
      if (frame == frame_of_view_.end()) {
        ++unposed_;
        return;
      }
      const JsonValue seen = observation.at("value");
      const std::vector<double> x = seen.at("x").numbers(2);
      std::optional<std::uint32_t> feature;
      if (seen.has("id_feat") && seen.at("id_feat").json().is_number_unsigned()) {
        const auto number = seen.at("id_feat").json().get<std::uint64_t>();
        if (number < kMostOpenMvg) feature = static_cast<std::uint32_t>(number);
      }
      const double first = frame->second.is_panorama ? kOpenMvgPanorama : 0.0;
      out_.add_observation({.landmark_id = id,
                            .frame = frame->second.frame,
                            .pixel = {x[0] - first, x[1] - first},
                            .keypoint = feature});
    });
  }

  struct SeenBy {
    FrameIndex frame;
    bool is_panorama = false;
  };

  SfmBuilder out_;
  std::unordered_set<std::uint64_t> panoramas_;  // ids of cameras
  std::unordered_map<std::uint64_t, SeenBy> frame_of_view_;
  std::size_t unposed_ = 0;
};

constexpr DescriptorFileType kOpenMvgTypes[] = {
    // Its own implementation, whose histograms are in another order than Lowe's.
    {.name = "SIFT_Regions", .kind = "OPENMVG_SIFT", .numbers = 128},
    {.name = "AKAZE_Float_Regions", .kind = "AKAZE_MSURF", .numbers = 64, .are_floats = true},
    {.name = "AKAZE_Liop_Regions", .kind = "AKAZE_LIOP", .numbers = 144},
    {.name = "AKAZE_Binary_Regions", .kind = "AKAZE", .numbers = 64}};

// The type that image_describer.json beside the features states; std::nullopt if there is no such file.
std::optional<DescriptorFileType> type_of_features(const std::filesystem::path& folder,
                                                   const Execution& execution) {
  const std::filesystem::path path = folder / "image_describer.json";
  if (!is_file(path)) return std::nullopt;
  try {
    FileReader source(path);
    const nlohmann::json json = read_json(source);
    const std::string& name =
        JsonValue(json, source.name() + ": ").at("regions_type").at("polymorphic_name").text();
    const auto* const type = std::ranges::find(kOpenMvgTypes, name, &DescriptorFileType::name);
    if (type != std::end(kOpenMvgTypes)) return *type;
    log_remark(execution.log, path.string(),
               fmt::format("descriptors of {} are left out", printable(name)), RemarkKind::kLoss);
  } catch (const Error& error) {
    if (error.kind() != ErrorKind::kInput) throw;
    log_remark(execution.log, path.string(),
               fmt::format("{}; descriptors are left out", error.what()), RemarkKind::kLoss);
  }
  return std::nullopt;
}

}  // namespace

LandmarkMap read_openmvg(const MapInput& input, const Execution& execution) {
  const nlohmann::json json = read_json(*input.source);
  const std::string& name = input.source->name();
  LandmarkMap model = OpenMvgReader(name, execution).read(JsonValue(json, name + ": "));
  // Projects keep the features in "matches", beside the folder of the reconstruction.
  const std::filesystem::path folder = input.path.parent_path();
  for (const auto& place : {folder, folder / "matches", folder / ".." / "matches"}) {
    const auto type = type_of_features(place, execution);
    if (!type) continue;
    const std::vector<std::string> names = model.frames().image_names;
    return with_feature_files(
        std::move(model),
        {.folders = {place},
         .type = *type,
         .name =
             [&](FrameIndex frame) {
               return std::filesystem::path(names[frame.value]).stem().string();
             }},
        name, execution);
  }
  return model;
}

bool is_openmvg(const MapInput& input) {
  return begins_json(input, '{', {"\"sfm_data_version\""});
}

}  // namespace cairn::detail
