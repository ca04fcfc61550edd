// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/formats/detail/foreign/stella_builder.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/formats/losses.hpp"
#include "cairn/geometry/limits.hpp"

namespace cairn::detail {
namespace {

// The camera whose images have the keypoints; std::nullopt for a model that Cairn cannot project with.
std::optional<Camera> camera_of(const StellaCamera& c, CameraId id) {
  if (!c.fx || !c.fy || !c.cx || !c.cy) return std::nullopt;
  Camera camera{id, "PINHOLE", c.width, c.height, {*c.fx, *c.fy, *c.cx, *c.cy}};
  const auto with = [&](const char* model, std::initializer_list<double> distortion) {
    camera.model = model;
    camera.parameters.insert(camera.parameters.end(), distortion);
  };
  if (c.model_type == "Fisheye") {
    with("OPENCV_FISHEYE", {c.k1, c.k2, c.k3, c.k4});
  } else if (c.model_type == "Perspective" && c.k3 != 0.0) {
    with("FULL_OPENCV", {c.k1, c.k2, c.p1, c.p2, c.k3, 0.0, 0.0, 0.0});
  } else if (c.model_type == "Perspective" &&
             (c.k1 != 0.0 || c.k2 != 0.0 || c.p1 != 0.0 || c.p2 != 0.0)) {
    with("OPENCV", {c.k1, c.k2, c.p1, c.p2});
  }
  return camera;
}

}  // namespace

StellaBuilder::StellaBuilder(std::string name, const MapReadOptions& options)
    : name_(std::move(name)), options_(options) {}

void StellaBuilder::lost(const std::string& text) const {
  log_remark(options_.log, name_, text, RemarkKind::kLoss);
}

void StellaBuilder::add_camera(const std::string& name, const StellaCamera& camera) {
  cameras_.emplace(name, camera);
}

std::string StellaBuilder::add_keyframe(const StellaKeyframe& keyframe,
                                        const std::vector<std::int64_t>& landmarks) {
  const std::size_t count = keyframe.undistorted.size();
  const auto differs = [&](std::size_t size) { return size != 0 && size != count; };
  const auto sizes = [&](std::size_t size, const char* of) {
    return fmt::format("has {} keypoints, but {} {}", count, size, of);
  };
  if (differs(landmarks.size())) return sizes(landmarks.size(), "landmark ids");
  if (differs(keyframe.octaves.size())) return sizes(keyframe.octaves.size(), "octaves");
  if (differs(keyframe.depths.size())) return sizes(keyframe.depths.size(), "depths");
  if (differs(keyframe.descriptors.size()))
    return sizes(keyframe.descriptors.size(), "descriptors");
  const double norm = keyframe.rotation_cw.norm();
  if (!(norm > 1e-6) || !(norm < 1e6)) return "has a rotation without direction";
  if (!keyframe.translation_cw.allFinite()) return "has a translation that is not finite";
  const Eigen::Quaterniond q = keyframe.rotation_cw.conjugate().normalized();
  const FrameIndex frame{static_cast<std::uint32_t>(frames_.size())};
  frames_.push_back({keyframe.id, std::array{q.w(), q.x(), q.y(), q.z()},
                     -(q * keyframe.translation_cw), keyframe.timestamp_s, keyframe.camera});
  // Negative ones stand for none.
  unusable_depths_ += std::count_if(keyframe.depths.begin(), keyframe.depths.end(),
                                    [](float z) { return !(z <= kLargestCoordinate); });
  for (std::size_t i = 0; i < landmarks.size(); ++i) {
    if (landmarks[i] < 0) continue;
    DescribedObservations::Entry entry{static_cast<std::uint64_t>(landmarks[i]), frame,
                                       keyframe.undistorted[i], static_cast<std::uint32_t>(i)};
    if (!keyframe.octaves.empty()) entry.octave = keyframe.octaves[i];
    if (!keyframe.depths.empty() && keyframe.depths[i] > 0.0F &&
        keyframe.depths[i] <= kLargestCoordinate) {
      entry.depth = keyframe.depths[i];
    }
    observations_.add(entry, keyframe.descriptors.empty()
                                 ? std::span<const std::uint8_t>()
                                 : std::span<const std::uint8_t>(keyframe.descriptors[i]));
  }
  return {};
}

void StellaBuilder::add_landmark(std::uint64_t id, const Eigen::Vector3d& position,
                                 std::optional<double> visible, std::optional<double> found) {
  constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
  landmarks_.push_back({id, position, visible.value_or(kUnknown), found.value_or(kUnknown)});
}

// The camera of each entry of frames_.
std::vector<std::optional<CameraIndex>> StellaBuilder::place_cameras(MapTables& tables) const {
  std::map<std::string, CameraIndex> indices;
  bool any_unknown_scale = cameras_.empty();
  for (const auto& [name, camera] : cameras_) {
    if (camera.setup_type != "Stereo" && camera.setup_type != "RGBD") any_unknown_scale = true;
    const auto usable = camera_of(camera, CameraId{tables.cameras.size()});
    if (!usable) {
      lost(fmt::format("camera {} is unknown to the map: its model {} is none of Cairn's",
                       printable(name), printable(camera.model_type)));
      continue;
    }
    if (const std::string defect = camera_defect(*usable); !defect.empty()) {
      lost(fmt::format("camera {} is unknown to the map: {}", printable(name), defect));
      continue;
    }
    if (camera.model_type != "Perspective" && camera.model_type != "Fisheye") {
      lost(
          fmt::format("camera {}: the distortion {} is none of Cairn's; the camera is that of the "
                      "undistorted image",
                      printable(name), printable(camera.model_type)));
    }
    indices.emplace(name, CameraIndex{static_cast<std::uint32_t>(tables.cameras.size())});
    tables.cameras.push_back(*usable);
  }
  tables.info.length_unit = any_unknown_scale ? LengthUnit::kFree : LengthUnit::kMetres;
  std::vector<std::optional<CameraIndex>> result;
  for (const Frame& frame : frames_) {
    const auto found = indices.find(frame.camera);
    result.push_back(found == indices.end() ? std::nullopt : std::optional(found->second));
  }
  return result;
}

LandmarkMap StellaBuilder::finish() && {
  MapTables tables;
  const auto cameras = place_cameras(tables);
  std::vector<std::uint32_t> order(frames_.size());
  std::iota(order.begin(), order.end(), 0U);
  std::stable_sort(order.begin(), order.end(),
                   [&](std::uint32_t a, std::uint32_t b) { return frames_[a].id < frames_[b].id; });
  std::vector<std::uint32_t> rank(frames_.size());
  for (std::uint32_t i = 0; i < order.size(); ++i) {
    const Frame& frame = frames_[order[i]];
    rank[order[i]] = i;
    tables.frames.ids.push_back(FrameId{frame.id});
    tables.frames.quaternions.push_back(frame.quaternion);
    tables.frames.translations.push_back(frame.centre);
    tables.frames.timestamps_s.push_back(frame.timestamp_s);
    tables.frames.cameras.push_back(cameras[order[i]]);
  }
  std::stable_sort(landmarks_.begin(), landmarks_.end(),
                   [](const Landmark& a, const Landmark& b) { return a.id < b.id; });
  NamedColumn visible{"visible", {}};
  NamedColumn found{"found", {}};
  for (const Landmark& landmark : landmarks_) {
    tables.landmarks.ids.push_back(LandmarkId{landmark.id});
    tables.landmarks.positions.push_back(landmark.position);
    visible.values.push_back(landmark.visible);
    found.values.push_back(landmark.found);
  }
  for (NamedColumn* column : {&visible, &found}) {
    const bool any = std::any_of(column->values.begin(), column->values.end(),
                                 [](double value) { return !std::isnan(value); });
    if (any) tables.landmarks.columns.push_back(std::move(*column));
  }
  for (auto& entry : observations_.entries()) {
    const std::uint32_t place = entry.frame.value;
    entry.frame = FrameIndex{rank[place]};
    if (!cameras[place]) continue;
    const Camera& camera = tables.cameras[cameras[place]->value];
    if (camera.model == "PINHOLE") continue;
    const Intrinsics k = intrinsics(camera);
    const auto pixel =
        project(camera, {(entry.pixel.u - k.cx) / k.fx, (entry.pixel.v - k.cy) / k.fy, 1.0});
    if (pixel) entry.pixel = *pixel;
  }
  const std::size_t dropped =
      std::move(observations_).fill(tables, "ORB", DescriptorNorm::kHamming);
  if (unusable_depths_ > 0) {
    lost(fmt::format("{} depths left out: not finite or beyond {:g}", unusable_depths_,
                     kLargestCoordinate));
  }
  if (dropped > 0) {
    lost(fmt::format("{} observations of landmarks that are not there; left out", dropped));
  }
  return imported_map(std::move(tables), name_, options_.log);
}

}  // namespace cairn::detail
