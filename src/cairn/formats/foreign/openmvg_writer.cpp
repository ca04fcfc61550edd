// SPDX-License-Identifier: BSD-3-Clause
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "cairn/core/error.hpp"
#include "cairn/formats/detail/bytes/json_document.hpp"
#include "cairn/formats/detail/foreign/foreign_formats.hpp"
#include "cairn/formats/detail/foreign/written_frames.hpp"
#include "cairn/formats/detail/losses.hpp"
#include "cairn/geometry/rigid3.hpp"

namespace cairn::detail {
namespace {

using OpenMvgJson = nlohmann::ordered_json;

constexpr std::uint64_t kNoOpenMvgIndex = std::numeric_limits<std::uint32_t>::max();
// Marks of cereal, which writes OpenMVG's files: an object or a type's name that appears for the first time, and an object
// of just the type that was declared.
constexpr std::uint64_t kFirstTime = 0x80000000U;
constexpr std::uint64_t kDeclaredType = 0x40000000U;

// A camera's type and what describes it; std::nullopt for a model that OpenMVG lacks.
std::optional<std::pair<std::string, OpenMvgJson>> openmvg_camera(const Camera& camera) {
  using Result = std::pair<std::string, OpenMvgJson>;
  const OpenMvgJson size = {{"width", camera.width}, {"height", camera.height}};
  if (is_panorama(camera) && camera.width == 2 * camera.height) {
    return Result{"spherical", {{"value0", size}}};
  }
  const auto d = opencv_distortion(camera);
  const Intrinsics k = intrinsics(camera);
  if (!d || k.fx != k.fy) return std::nullopt;
  OpenMvgJson json = size;
  json["focal_length"] = k.fx;
  json["principal_point"] = {k.cx, k.cy};
  const auto with = [&](const char* type, const char* key, const std::vector<double>& distortion) {
    json[key] = distortion;
    return Result{type, json};
  };
  if (d->is_fisheye) return with("fisheye", "fisheye", {d->k1, d->k2, d->k3, d->k4});
  if (d->p1 != 0.0 || d->p2 != 0.0) {
    return with("pinhole_brown_t2", "disto_t2", {d->k1, d->k2, d->k3, d->p1, d->p2});
  }
  if (camera.model == "SIMPLE_RADIAL") return with("pinhole_radial_k1", "disto_k1", {d->k1});
  const bool is_plain = d->k1 == 0.0 && d->k2 == 0.0 && d->k3 == 0.0;
  if (is_plain) return Result{"pinhole", json};
  return with("pinhole_radial_k3", "disto_k3", {d->k1, d->k2, d->k3});
}

class OpenMvgWriter {
 public:
  explicit OpenMvgWriter(const LandmarkMap& map)
      : map_(map),
        names_(json_image_names(map)),
        ids_(map, kNoOpenMvgIndex - 1, kNoOpenMvgIndex - 1, 0) {
    require_cameras(map, "a view of OpenMVG");
    for (const Camera& camera : map.cameras()) {
      if (openmvg_camera(camera)) continue;
      const Intrinsics k = intrinsics(camera);
      if (!opencv_distortion(camera) || k.fx == k.fy) refuse_model(camera, "OpenMVG");
      throw Error(ErrorKind::kInput, fmt::format("camera {}", camera.id.value),
                  fmt::format("has focal lengths {} and {}, and OpenMVG has one", k.fx, k.fy),
                  "square pixels");
    }
  }

  void remark(const LogSink& log) const {
    log_losses(log, map_, {.keypoints = true, .colors = false}, "OpenMVG");
    ids_.log_replaced(log, map_, "OpenMVG");
  }

  void write(const ByteSink& sink) {
    JsonMembers out(sink);
    out.member("sfm_data_version", "0.3");
    out.member("root_path", "");
    out.array("views", map_.frame_count(), [&](std::size_t i) { return view(i); });
    out.array("intrinsics", map_.cameras().size(), [&](std::size_t i) { return intrinsic(i); });
    out.array("extrinsics", map_.frame_count(), [&](std::size_t i) { return extrinsic(i); });
    out.array("structure", map_.landmark_count(), [&](std::size_t i) { return landmark(i); });
    out.array("control_points", 0, [](std::size_t) { return OpenMvgJson(); });
    out.finish();
  }

 private:
  OpenMvgJson pointer_to(OpenMvgJson data) {
    return {{"id", kFirstTime | ++pointers_}, {"data", std::move(data)}};
  }

  OpenMvgJson view(std::size_t i) {
    const Camera& camera = camera_of(map_, FrameIndex{static_cast<std::uint32_t>(i)});
    const std::size_t slash = names_[i].rfind('/') + 1;  // 0 without one
    OpenMvgJson data = {{"local_path", names_[i].substr(0, slash)},
                        {"filename", names_[i].substr(slash)},
                        {"width", camera.width},
                        {"height", camera.height},
                        {"id_view", ids_.frames[i]},
                        {"id_intrinsic", ids_.cameras[map_.frames().cameras[i]->value]},
                        {"id_pose", ids_.frames[i]}};
    return {{"key", ids_.frames[i]},
            {"value",
             {{"polymorphic_id", kDeclaredType}, {"ptr_wrapper", pointer_to(std::move(data))}}}};
  }

  OpenMvgJson intrinsic(std::size_t i) {
    auto [type, data] = *openmvg_camera(map_.cameras()[i]);
    const auto [known, is_new] = types_.try_emplace(type, types_.size() + 1);
    OpenMvgJson value = {{"polymorphic_id", known->second | (is_new ? kFirstTime : 0)}};
    if (is_new) value["polymorphic_name"] = type;
    value["ptr_wrapper"] = pointer_to(std::move(data));
    return {{"key", ids_.cameras[i]}, {"value", std::move(value)}};
  }

  OpenMvgJson extrinsic(std::size_t i) const {
    const Rigid3 world_from_camera =
        map_.world_from_camera(FrameIndex{static_cast<std::uint32_t>(i)});
    const Eigen::Matrix3d r = world_from_camera.rotation().transpose();
    OpenMvgJson rows = OpenMvgJson::array();
    for (int row = 0; row < 3; ++row) rows.push_back({r(row, 0), r(row, 1), r(row, 2)});
    const Eigen::Vector3d& centre = world_from_camera.translation();
    return {{"key", ids_.frames[i]},
            {"value",
             {{"rotation", std::move(rows)}, {"center", {centre.x(), centre.y(), centre.z()}}}}};
  }

  OpenMvgJson landmark(std::size_t i) const {
    const LandmarkIndex index{static_cast<std::uint32_t>(i)};
    const Eigen::Vector3d& x = map_.landmarks().positions[i];
    const auto frames = map_.observing_frames(index);
    const auto pixels = map_.observed_pixels(index);
    const std::uint64_t first = frames.empty() ? 0 : map_.observations().offsets[i];
    OpenMvgJson observations = OpenMvgJson::array();
    for (std::size_t j = 0; j < frames.size(); ++j) {
      const double shift = is_panorama(camera_of(map_, frames[j])) ? kOpenMvgPanorama : 0.0;
      const std::uint64_t feature = keypoint_index(map_, first + j, kNoOpenMvgIndex);
      observations.push_back(
          {{"key", ids_.frames[frames[j].value]},
           {"value", {{"id_feat", feature}, {"x", {pixels[j].u + shift, pixels[j].v + shift}}}}});
    }
    return {{"key", ids_.landmarks[i]},
            {"value", {{"X", {x.x(), x.y(), x.z()}}, {"observations", std::move(observations)}}}};
  }

  const LandmarkMap& map_;
  std::vector<std::string> names_;
  WrittenIds ids_;
  std::uint64_t pointers_ = 0;
  std::map<std::string, std::uint64_t> types_;  // by name, numbered from 1
};

}  // namespace

void write_openmvg(const LandmarkMap& map, const ByteSink& sink, const Execution& execution) {
  OpenMvgWriter writer(map);
  writer.remark(execution.log);  // before writing, because the caller may refuse the loss
  writer.write(sink);
}

}  // namespace cairn::detail
