// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <array>
#include <filesystem>
#include <iterator>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <unordered_map>
#include <unordered_set>
#include <utility>
#include <vector>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/core/number_text.hpp"
#include "cairn/formats/detail/bytes/json_document.hpp"
#include "cairn/formats/detail/foreign/feature_files.hpp"
#include "cairn/formats/detail/foreign/foreign_formats.hpp"
#include "cairn/formats/detail/foreign/sfm_builder.hpp"

namespace cairn::detail {
namespace {

constexpr std::uint64_t kMostAliceVision = std::numeric_limits<std::uint32_t>::max();
constexpr std::uint64_t kMostId = std::numeric_limits<std::uint64_t>::max();

constexpr DescriptorFileType kAliceVisionTypes[] = {
    {.name = "sift", .kind = "SIFT", .numbers = 128, .is_vlfeat = true},
    {.name = "dspsift", .kind = "SIFT", .numbers = 128, .is_vlfeat = true},
    {.name = "sift_upright", .kind = "SIFT_UPRIGHT", .numbers = 128, .is_vlfeat = true},
    {.name = "akaze", .kind = "AKAZE_MSURF", .numbers = 64, .are_floats = true},
    {.name = "akaze_liop", .kind = "AKAZE_LIOP", .numbers = 144},
    {.name = "akaze_mldb", .kind = "AKAZE", .numbers = 64}};

// What a file says of its features.
struct NamedFeatures {
  std::vector<std::string> folders;
  std::map<std::string, std::unordered_set<std::uint64_t>> landmarks;  // ids, by type
};

class AliceVisionReader {
 public:
  AliceVisionReader(const std::string& name, const Execution& execution) : out_(name, execution) {}

  LandmarkMap read(const JsonValue& all) {
    if (all.has("featuresFolders") && all.at("featuresFolders").json().is_array()) {
      each(all.at("featuresFolders"), [&](const JsonValue& folder) {
        if (folder.json().is_string()) features_.folders.push_back(folder.text());
      });
    }
    if (all.has("version")) read_version(all.at("version"));
    if (all.has("intrinsics")) {
      each(all.at("intrinsics"), [&](const JsonValue& json) { read_camera(json); });
    }
    if (all.has("rigs")) each(all.at("rigs"), [&](const JsonValue& json) { read_rig(json); });
    read_frames(all.at("poses"), all.at("views"));
    if (!all.has("structure")) out_.lost("there is no structure: the map has no landmarks");
    if (all.has("structure")) {
      each(all.at("structure"), [&](const JsonValue& json) { read_point(json); });
    }
    out_.lost(unposed_, "observations by views without a pose are left out");
    return std::move(out_).finish();
  }

  const NamedFeatures& features() const { return features_; }

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

  // As JsonValue::each; an empty list is written as an empty text.
  template <class Take>
  static void each(const JsonValue& array, const Take& take) {
    if (!array.json().is_string() || !array.text().empty()) array.each(take);
  }

  static std::vector<double> numbers(const JsonValue& array) {
    std::vector<double> result;
    each(array, [&](const JsonValue& value) { result.push_back(number(value)); });
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

  void read_version(const JsonValue& json) {
    const std::vector<double> parts = numbers(json);
    version_ = {};
    for (std::size_t i = 0; i < std::min(parts.size(), version_.size()); ++i) {
      version_[i] = parts[i];
    }
  }

  bool is_before(double minor, double revision) const {
    return version_ < std::array<double, 3>{1.0, minor, revision};
  }

  // Focal lengths in pixels; std::nullopt if the file states none. The ratio is of the pixels' width and height from
  // version 1.2.5 on, before of the focal lengths.
  std::optional<Eigen::Vector2d> focal_lengths(const JsonValue& json, double width) const {
    if (json.has("focalLength") && json.has("sensorWidth")) {
      const double focal = number(json.at("focalLength")) / number(json.at("sensorWidth")) * width;
      const double ratio = json.has("pixelRatio") ? number(json.at("pixelRatio")) : 1.0;
      if (is_before(2, 5)) return Eigen::Vector2d(focal, focal / ratio);
      if (is_before(2, 11)) return Eigen::Vector2d(focal, focal * ratio);
      return Eigen::Vector2d(focal / ratio, focal);
    }
    if (!json.has("pxFocalLength")) return std::nullopt;
    const JsonValue value = json.at("pxFocalLength");
    if (!value.json().is_array()) return Eigen::Vector2d::Constant(number(value));
    const std::vector<double> focal = numbers(value, 2, "is no pair");
    return Eigen::Vector2d(focal[0], focal[1]);
  }

  // The lens and its distortion. Before version 1.2.8 one name is for both.
  struct LensType {
    std::string lens;
    std::string distortion;
  };

  static LensType lens_type(const JsonValue& json) {
    const std::string& type = json.at("type").text();
    if (json.has("distortionType")) return {type, json.at("distortionType").text()};
    static const std::map<std::string_view, LensType> old = {
        {"pinhole", {"pinhole", "none"}},
        {"radial1", {"pinhole", "radialk1"}},
        {"radial3", {"pinhole", "radialk3"}},
        {"brown", {"pinhole", "brown"}},
        {"fisheye4", {"pinhole", "fisheye"}},
        {"fisheye1", {"pinhole", "fisheye1"}},
        {"equidistant", {"equidistant", "none"}},
        {"equidistant_r3", {"equidistant", "radialk3pt"}}};
    const auto found = old.find(type);
    return found == old.end() ? LensType{type, "none"} : found->second;
  }

  // Half the field of view, in radians: the unit of the angle that an equidistant lens distorts. It is the circle of the
  // image.
  static double equidistant_unit(const JsonValue& json, const Camera& camera, double focal) {
    const double width_mm = number(json.at("sensorWidth"));
    const double height_mm = number(json.at("sensorHeight"));
    const double focal_mm = focal * width_mm / std::max<double>(camera.width, camera.height);
    return 0.5 * std::min(width_mm, height_mm) / focal_mm;
  }

  // @return why Cairn has no such camera; empty if it has
  std::string set_lens(Camera& camera, const JsonValue& json) const {
    camera.width = static_cast<std::uint32_t>(whole(json.at("width"), kMostAliceVision));
    camera.height = static_cast<std::uint32_t>(whole(json.at("height"), kMostAliceVision));
    const auto focal = focal_lengths(json, camera.width);
    if (!focal) return "it has no focal length";
    const std::vector<double> centre = numbers(json.at("principalPoint"), 2, "is no point");
    // From version 1.2.1 on an offset from the image's centre.
    const double half = is_before(2, 1) ? 0.0 : 0.5;
    const double cx = centre[0] + half * camera.width;
    const double cy = centre[1] + half * camera.height;
    const LensType type = lens_type(json);
    std::vector<double> d =
        json.has("distortionParams") ? numbers(json.at("distortionParams")) : std::vector<double>{};
    if (json.has("undistortionType") && json.at("undistortionType").text() != "none") {
      return "its undistortion " + printable(json.at("undistortionType").text()) +
             " is none of Cairn's";
    }
    Eigen::Vector2d scale = *focal;
    const std::string& name = d.empty() ? "none" : type.distortion;
    if (name == "radialk3pt" && d.size() == 3) scale /= 1.0 + d[0] + d[1] + d[2];
    const auto with = [&](const char* model, std::vector<double> distortion) {
      camera.model = model;
      camera.parameters = {scale.x()};
      if (!camera.model.starts_with("SIMPLE_")) camera.parameters.push_back(scale.y());
      camera.parameters.insert(camera.parameters.end(), {cx, cy});
      camera.parameters.insert(camera.parameters.end(), distortion.begin(), distortion.end());
      return std::string();
    };
    const bool is_cubic = (name == "radialk3" || name == "radialk3pt") && d.size() == 3;
    if (type.lens == "equidistant" && (is_cubic || name == "none")) {
      const double unit = equidistant_unit(json, camera, focal->x());
      scale *= number(json.at("fisheyeCircleRadius")) / (unit * focal->x());
      d.resize(3, 0.0);
      const double u2 = unit * unit;
      return with("OPENCV_FISHEYE", {d[0] / u2, d[1] / (u2 * u2), d[2] / (u2 * u2 * u2), 0.0});
    }
    if (type.lens == "pinhole") {
      const bool is_square = scale.x() == scale.y();
      if (name == "none") return with(is_square ? "SIMPLE_PINHOLE" : "PINHOLE", {});
      if (name == "radialk1" && d.size() == 1) {
        return is_square ? with("SIMPLE_RADIAL", d) : with("OPENCV", {d[0], 0.0, 0.0, 0.0});
      }
      if (is_cubic) return with("FULL_OPENCV", {d[0], d[1], 0.0, 0.0, d[2], 0.0, 0.0, 0.0});
      if (name == "brown" && d.size() == 5) {
        return with("FULL_OPENCV", {d[0], d[1], d[3], d[4], d[2], 0.0, 0.0, 0.0});
      }
      if (name == "fisheye" && d.size() == 4) return with("OPENCV_FISHEYE", d);
      if (name == "fisheye1" && d.size() == 1) return with("FOV", d);
    }
    return fmt::format("its type {} with {} parameters is none of Cairn's",
                       printable(json.at("type").text()), d.size());
  }

  // reference_from_camera.
  static Rigid3 pose_of(const JsonValue& transform) {
    // camera_from_reference, column by column.
    const std::vector<double> r = numbers(transform.at("rotation"), 9, "is no 3x3 matrix");
    const Eigen::Matrix3d rotation = Eigen::Map<const Eigen::Matrix3d>(r.data());
    if (!is_rotation(rotation)) {
      transform.at("rotation").refuse("is no rotation", "a rotation matrix");
    }
    return {Eigen::Quaterniond(rotation).conjugate(), vector3(transform.at("center"))};
  }

  void read_rig(const JsonValue& json) {
    auto& mounts = mounts_[whole(json.at("rigId"))];
    each(json.at("subPoses"), [&](const JsonValue& mount) {
      const bool is_known = !mount.has("status") || mount.at("status").text() != "uninitialized";
      mounts.push_back(is_known ? std::optional(pose_of(mount.at("pose"))) : std::nullopt);
    });
  }

  // Whether the pose that a view names is its rig's, not its own.
  static bool is_mounted(const JsonValue& view) {
    if (!view.has("rigId") || !view.has("isPoseIndependant")) return false;
    const nlohmann::json& own = view.at("isPoseIndependant").json();
    return own == false || own == "false" || own == "0";
  }

  // rig_from_camera of a mounted view; std::nullopt if unknown.
  std::optional<Rigid3> mount_of(const JsonValue& view) const {
    const auto rig = mounts_.find(whole(view.at("rigId")));
    if (rig == mounts_.end()) view.at("rigId").refuse("is no rig of the file", "the id of a rig");
    const std::uint64_t mount = whole(view.at("subPoseId"));
    if (mount >= rig->second.size()) {
      view.at("subPoseId")
          .refuse("is no subpose of the rig", fmt::format("a number below {}", rig->second.size()));
    }
    return rig->second[mount];
  }

  void read_frames(const JsonValue& poses, const JsonValue& views) {
    std::unordered_map<std::uint64_t, std::size_t> places;
    std::size_t place = 0;
    each(poses, [&](const JsonValue& pose) { places.emplace(whole(pose.at("poseId")), place++); });
    std::size_t without_pose = 0;
    views.each([&](const JsonValue& view) {
      const std::uint64_t id = whole(view.at("viewId"));
      const auto pose = places.find(view.has("poseId") ? whole(view.at("poseId")) : id);
      const bool mounted = is_mounted(view);
      const auto mount = mounted ? mount_of(view) : std::optional(Rigid3());
      if (pose == places.end() || !mount) {
        ++without_pose;
        return;
      }
      Rigid3 world_from_camera = pose_of(poses.at(pose->second).at("pose").at("transform"));
      if (mounted) world_from_camera = world_from_camera * *mount;
      SfmFrame frame{.id = FrameId{id},
                     .world_from_camera = world_from_camera.quaternion(),
                     .centre = world_from_camera.translation()};
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
    if (json.has("descType") && json.at("descType").json().is_string())
      features_.landmarks[json.at("descType").text()].insert(id);
    if (!json.has("observations")) return;
    each(json.at("observations"), [&](const JsonValue& seen) {
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
  NamedFeatures features_;
  std::array<double, 3> version_ = {1.0, 2.0, 11.0};  // the newest unless stated
  // rig_from_camera of each rig's subposes; std::nullopt if unknown.
  std::unordered_map<std::uint64_t, std::vector<std::optional<Rigid3>>> mounts_;
  std::unordered_map<std::uint64_t, FrameIndex> frame_of_view_;
  std::size_t unposed_ = 0;
};

// The type of most landmarks, if Cairn knows it.
const DescriptorFileType* usual_type(const NamedFeatures& features) {
  if (features.landmarks.empty()) return nullptr;
  const auto most = std::ranges::max_element(features.landmarks, {},
                                             [](const auto& named) { return named.second.size(); });
  const auto* const type =
      std::ranges::find(kAliceVisionTypes, most->first, &DescriptorFileType::name);
  return type == std::end(kAliceVisionTypes) ? nullptr : type;
}

}  // namespace

LandmarkMap read_alicevision(const MapInput& input, const Execution& execution) {
  const nlohmann::json json = read_json(*input.source);
  const std::string& name = input.source->name();
  AliceVisionReader reader(name, execution);
  LandmarkMap model = reader.read(JsonValue(json, name + ": "));
  const NamedFeatures& features = reader.features();
  const DescriptorFileType* const type = usual_type(features);
  if (type == nullptr) return model;
  const std::filesystem::path folder = input.path.parent_path();
  std::vector<std::filesystem::path> folders;
  for (std::string place : features.folders) {
    std::ranges::replace(place, '\\', '/');  // written on Windows
    folders.push_back(folder / place);
  }
  folders.push_back(folder);
  const std::vector<FrameId> views = model.frames().ids;
  const std::vector<LandmarkId> ids = model.landmarks().ids;
  const auto& of_type = features.landmarks.at(std::string(type->name));
  return with_feature_files(
      std::move(model),
      {.folders = std::move(folders),
       .type = *type,
       .name =
           [&](FrameIndex frame) {
             return fmt::format("{}.{}", views[frame.value].value, type->name);
           },
       .has_landmark =
           [&](LandmarkIndex landmark) { return of_type.contains(ids[landmark.value].value); }},
      name, execution);
}

bool is_alicevision(const MapInput& input) {
  return begins_json(input, '{', {"\"viewId\"", "\"featuresFolders\""}) ||
         (input.path.extension() == ".sfm" && begins_json(input, '{', {"\"version\""}));
}

}  // namespace cairn::detail
