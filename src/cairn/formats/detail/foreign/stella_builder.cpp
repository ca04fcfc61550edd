// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/formats/detail/foreign/stella_builder.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/geometry/limits.hpp"

namespace cairn::detail {

StellaBuilder::StellaBuilder(const std::string& name, const Execution& execution)
    : out_(name, execution) {
  out_.set_descriptors("ORB", kOrbBytes, DescriptorNorm::kHamming);
}

void StellaBuilder::add_camera(const std::string& name, const StellaCamera& camera) {
  cameras_.emplace(name, camera);
}

std::string StellaBuilder::add_keyframe(const StellaKeyframe& keyframe,
                                        const std::vector<std::int64_t>& landmarks) {
  const std::size_t count = keyframe.undistorted.size();
  const std::pair<std::size_t, const char*> sizes[] = {
      {landmarks.size(), "landmark ids"},
      {keyframe.octaves.size(), "octaves"},
      {keyframe.depths.size(), "depths"},
      {keyframe.descriptors.size(), "descriptors"}};
  for (const auto& [size, of] : sizes) {
    if (size != 0 && size != count) {
      return fmt::format("has {} keypoints, but {} {}", count, size, of);
    }
  }
  if (!has_direction(keyframe.rotation_cw)) return "has a rotation without direction";
  if (!keyframe.translation_cw.allFinite()) return "has a translation that is not finite";
  const Eigen::Quaterniond q = keyframe.rotation_cw.conjugate().normalized();
  const FrameIndex frame = out_.add_frame({.id = FrameId{keyframe.id},
                                           .world_from_camera = q,
                                           .centre = -(q * keyframe.translation_cw),
                                           .timestamp_s = keyframe.timestamp_s});
  camera_of_frame_.push_back(keyframe.camera);
  for (const float depth : keyframe.depths) {
    // Negative ones stand for none.
    if (!(depth <= kLargestCoordinate)) ++unusable_depths_;
  }
  for (std::size_t i = 0; i < landmarks.size(); ++i) {
    if (landmarks[i] < 0) continue;
    SfmObservation observation{.landmark_id = static_cast<std::uint64_t>(landmarks[i]),
                               .frame = frame,
                               .pixel = keyframe.undistorted[i],
                               .keypoint = static_cast<std::uint32_t>(i)};
    if (!keyframe.octaves.empty()) observation.octave = keyframe.octaves[i];
    if (!keyframe.depths.empty() && keyframe.depths[i] > 0.0F &&
        keyframe.depths[i] <= kLargestCoordinate) {
      observation.depth = keyframe.depths[i];
    }
    if (!keyframe.descriptors.empty()) observation.descriptor = keyframe.descriptors[i];
    out_.add_observation(observation);
  }
  return {};
}

void StellaBuilder::add_landmark(std::uint64_t id, const Eigen::Vector3d& position,
                                 std::optional<double> visible, std::optional<double> found) {
  constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
  out_.add_landmark(id, position);
  visible_.values.push_back(visible.value_or(kUnknown));
  found_.values.push_back(found.value_or(kUnknown));
}

std::optional<Camera> StellaBuilder::lens_of(const StellaCamera& camera) const {
  const CameraId id{out_.tables().cameras.size()};
  if (camera.model_type == "Equirectangular") {
    return Camera{id,
                  "EQUIRECTANGULAR",
                  camera.width,
                  camera.height,
                  {static_cast<double>(camera.width), static_cast<double>(camera.height)}};
  }
  if (!camera.fx || !camera.fy || !camera.cx || !camera.cy) return std::nullopt;
  const Intrinsics k{*camera.fx, *camera.fy, *camera.cx, *camera.cy};
  if (camera.model_type == "RadialDivision") {
    return Camera{
        id, "DIVISION", camera.width, camera.height, {k.fx, k.fy, k.cx, k.cy, camera.division}};
  }
  Distortion distortion = camera.distortion;
  distortion.is_fisheye = camera.model_type == "Fisheye";
  if (!distortion.is_fisheye && camera.model_type != "Perspective") return std::nullopt;
  return opencv_camera(id, camera.width, camera.height, k, distortion);
}

// @return whether all cameras know the scale
bool StellaBuilder::place_cameras() {
  bool is_metric = !cameras_.empty();
  for (const auto& [name, camera] : cameras_) {
    const bool knows_scale = camera.setup_type == "Stereo" || camera.setup_type == "RGBD";
    is_metric = is_metric && knows_scale;
    auto lens = lens_of(camera);
    std::string defect;
    if (!lens) defect = "it is no complete " + printable(camera.model_type);
    out_.add_camera(printable(name), std::move(lens), std::move(defect));
  }
  for (std::size_t i = 0; i < camera_of_frame_.size(); ++i) {
    out_.tables().frames.cameras.set(i, out_.camera(printable(camera_of_frame_[i])));
  }
  return is_metric;
}

// Keypoints are of the undistorted image, pixels of the one that the camera took.
void StellaBuilder::distort_pixels() {
  const MapTables& tables = out_.tables();
  std::vector<Pixel>& pixels = out_.tables().observations.pixels;
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    const auto index = tables.frames.cameras[tables.observations.frames[i].value];
    if (!index) continue;
    const Camera& camera = tables.cameras[index->value];
    if (camera.model == "PINHOLE") continue;
    if (camera.model == "EQUIRECTANGULAR") {
      pixels[i] = {pixels[i].u - kStellaPanorama, pixels[i].v - kStellaPanorama};
      continue;
    }
    const Intrinsics k = intrinsics(camera);
    const auto pixel =
        project(camera, {(pixels[i].u - k.cx) / k.fx, (pixels[i].v - k.cy) / k.fy, 1.0});
    if (pixel) pixels[i] = *pixel;
  }
}

LandmarkMap StellaBuilder::finish() && {
  const bool is_metric = place_cameras();
  distort_pixels();
  for (NamedColumn* column : {&visible_, &found_}) {
    const bool any = std::any_of(column->values.begin(), column->values.end(),
                                 [](double value) { return !std::isnan(value); });
    if (any) out_.tables().landmarks.columns.push_back(std::move(*column));
  }
  if (unusable_depths_ > 0) {
    out_.lost(fmt::format("{} depths left out: not finite or beyond {:g}", unusable_depths_,
                          kLargestCoordinate));
  }
  return std::move(out_).finish(
      {.length_unit = is_metric ? LengthUnit::kMetres : LengthUnit::kFree,
       .sort_by_id = true,
       .observations_by_frame = true,
       .lost_observations = "observations of landmarks that are not there; left out"});
}

}  // namespace cairn::detail
