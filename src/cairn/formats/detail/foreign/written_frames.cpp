// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/formats/detail/foreign/written_frames.hpp"

#include <unordered_map>
#include <unordered_set>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/core/text.hpp"
#include "cairn/formats/detail/losses.hpp"
#include "cairn/map/operations.hpp"

namespace cairn::detail {

void require_cameras(const LandmarkMap& map, std::string_view image) {
  const FrameTable& frames = map.frames();
  for (std::size_t i = 0; i < map.frame_count(); ++i) {
    if (!frames.cameras.empty() && frames.cameras[i]) continue;
    throw Error(ErrorKind::kInput, fmt::format("frame {}", frames.ids[i].value),
                fmt::format("has no camera, and {} needs one", image), "a camera for every frame");
  }
}

const Camera& camera_of(const LandmarkMap& map, FrameIndex frame) {
  return map.cameras()[map.frames().cameras[frame.value]->value];
}

void refuse_model(const Camera& camera, std::string_view system) {
  throw Error(ErrorKind::kInput, fmt::format("camera {}", camera.id.value),
              fmt::format("is of model {}, which {} does not have", camera.model, system),
              "another model, e.g. OPENCV");
}

Color color_of(const LandmarkMap& map, std::uint32_t landmark) {
  const auto& colors = map.landmarks().colors;
  return colors.empty() ? Color{} : colors[landmark].value_or(Color{});
}

WrittenIds::WrittenIds(const LandmarkMap& map, std::uint64_t most, std::uint64_t most_of_landmarks,
                       std::uint64_t first_id)
    : frames(fitting_ids(map.frames().ids, most, first_id)),
      landmarks(fitting_ids(map.landmarks().ids, most_of_landmarks, first_id)),
      first(first_id) {
  std::vector<CameraId> ids;
  for (const Camera& camera : map.cameras()) ids.push_back(camera.id);
  cameras = fitting_ids(ids, most, first_id);
}

void WrittenIds::log_replaced(const LogSink& log, const LandmarkMap& map, std::string_view system,
                              std::string_view path) const {
  const auto note = [&](bool replaced, std::string_view what) {
    if (!replaced) return;
    log_remark(log, path.empty() ? system : path,
               fmt::format("ids of {} are too large for {}: numbered from {}", what, system, first),
               RemarkKind::kLoss);
  };
  note(!frames.empty() && frames[0] != map.frames().ids[0].value, "frames");
  note(!landmarks.empty() && landmarks[0] != map.landmarks().ids[0].value, "landmarks");
  note(!cameras.empty() && cameras[0] != map.cameras()[0].id.value, "cameras");
}

FrameObservations::FrameObservations(const LandmarkMap& map)
    : of_frame(map.frame_count()), landmark_of(map.observation_count()) {
  const ObservationTable& observations = map.observations();
  for (std::uint32_t i = 0; i < map.landmark_count() && map.has_observations(); ++i) {
    for (std::uint64_t k = observations.offsets[i]; k < observations.offsets[i + 1]; ++k) {
      landmark_of[k] = i;
      of_frame[observations.frames[k].value].push_back(k);
    }
  }
  if (observations.keypoints.empty()) return;
  for (auto& of_one : of_frame) {
    const auto key = [&](std::uint64_t k) {
      const auto keypoint = observations.keypoints[k];
      return keypoint ? std::uint64_t{*keypoint} : ~std::uint64_t{0};
    };
    std::stable_sort(of_one.begin(), of_one.end(),
                     [&](std::uint64_t a, std::uint64_t b) { return key(a) < key(b); });
  }
}

bool are_near(const Rigid3& a, const Rigid3& b, double tolerance) {
  return (a.translation() - b.translation()).norm() <=
             tolerance * std::max(1.0, b.translation().norm()) &&
         a.quaternion().angularDistance(b.quaternion()) <= tolerance;
}

RigInstants::RigInstants(const LandmarkMap& map) {
  constexpr double kTolerance = 1e-6;
  const FrameTable& frames = map.frames();
  const RigidFrames rigid = rigid_frames(map.rigs(), frames);
  for (std::uint32_t i = 0; i < map.frame_count(); ++i) {
    const auto instant = frames.instants.empty() ? std::nullopt : frames.instants[i];
    if (!instant) {
      alone.push_back(i);
      continue;
    }
    const Rigid3 stated = map.world_from_camera(FrameIndex{i});
    const Rigid3 expected =
        map.world_from_camera(FrameIndex{rigid.lead[i]}) * rigid.camera_from_lead[i].inverse();
    if (are_near(stated, expected, kTolerance)) {
      together[*instant].push_back(i);
      continue;
    }
    alone.push_back(i);
    ++elsewhere;
    farthest = std::max(farthest, (stated.translation() - expected.translation()).norm());
  }
}

void RigInstants::log_elsewhere(const LogSink& log, std::string_view path) const {
  if (elsewhere == 0) return;
  log_remark(log, path,
             fmt::format("{} images are not where their rig has them, up to {:.3g} away: they are "
                         "written as images alone",
                         elsewhere, farthest),
             RemarkKind::kLoss);
}

std::vector<std::string> image_names(const LandmarkMap& map) {
  const FrameTable& frames = map.frames();
  std::vector<std::string> names = frames.image_names;
  names.resize(map.frame_count());
  std::unordered_map<std::string_view, std::size_t> frame_with;
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (names[i].empty()) names[i] = fmt::format("frame_{}", frames.ids[i].value);
    const auto [other, is_new] = frame_with.emplace(names[i], i);
    if (is_new) continue;
    throw Error(ErrorKind::kInput, fmt::format("frame {}", frames.ids[i].value),
                fmt::format("image name {} is that of frame {} too", printable(names[i]),
                            frames.ids[other->second].value),
                "distinct names, by which programs find the images");
  }
  return names;
}

std::vector<std::string> json_image_names(const LandmarkMap& map) {
  std::vector<std::string> names = image_names(map);
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (is_utf8(names[i])) continue;
    throw Error(ErrorKind::kInput, fmt::format("frame {}", map.frames().ids[i].value),
                "image name " + printable(names[i]), "a name in UTF-8, as JSON needs it");
  }
  return names;
}

std::optional<RadialCamera> radial_camera(const Camera& camera) {
  const std::vector<double>& p = camera.parameters;
  const std::string& model = camera.model;
  if (model == "SIMPLE_PINHOLE") return RadialCamera{p[0]};
  if (model == "SIMPLE_RADIAL") return RadialCamera{p[0], p[3]};
  if (model == "RADIAL") return RadialCamera{p[0], p[3], p[4]};
  if (p.size() < 4 || p[0] != p[1]) return std::nullopt;
  if (model == "PINHOLE") return RadialCamera{p[0]};
  const bool is_brown = model == "OPENCV" || model == "FULL_OPENCV";
  const bool is_radial =
      is_brown && std::all_of(p.begin() + 6, p.end(), [](double x) { return x == 0.0; });
  return is_radial ? std::optional(RadialCamera{p[0], p[4], p[5]}) : std::nullopt;
}

std::optional<Distortion> opencv_distortion(const Camera& camera) {
  const std::vector<double>& p = camera.parameters;
  const std::string& model = camera.model;
  if (model == "SIMPLE_PINHOLE" || model == "PINHOLE") return Distortion{};
  if (model == "SIMPLE_RADIAL") return Distortion{.k1 = p[3]};
  if (model == "RADIAL") return Distortion{.k1 = p[3], .k2 = p[4]};
  if (model == "OPENCV") return Distortion{.k1 = p[4], .k2 = p[5], .p1 = p[6], .p2 = p[7]};
  if (model == "FULL_OPENCV" && p[9] == 0.0 && p[10] == 0.0 && p[11] == 0.0) {
    return Distortion{.k1 = p[4], .k2 = p[5], .p1 = p[6], .p2 = p[7], .k3 = p[8]};
  }
  if (model == "OPENCV_FISHEYE") {
    return Distortion{.is_fisheye = true, .k1 = p[4], .k2 = p[5], .k3 = p[6], .k4 = p[7]};
  }
  if (model == "SIMPLE_FISHEYE" || model == "FISHEYE") return Distortion{.is_fisheye = true};
  if (model != "SIMPLE_RADIAL_FISHEYE" && model != "RADIAL_FISHEYE") return std::nullopt;
  return Distortion{.is_fisheye = true, .k1 = p[3], .k2 = p.size() > 4 ? p[4] : 0.0};
}

bool is_panorama(const Camera& camera) {
  return camera.model == "EQUIRECTANGULAR" &&
         camera.parameters == std::vector<double>{static_cast<double>(camera.width),
                                                  static_cast<double>(camera.height)};
}

Camera opencv_camera(CameraId id, std::uint32_t width, std::uint32_t height, const Intrinsics& k,
                     const Distortion& d) {
  const auto with = [&](const char* model, std::initializer_list<double> distortion) {
    Camera camera{id, model, width, height, {k.fx, k.fy, k.cx, k.cy}};
    camera.parameters.insert(camera.parameters.end(), distortion);
    return camera;
  };
  if (d.is_fisheye) return with("OPENCV_FISHEYE", {d.k1, d.k2, d.k3, d.k4});
  if (d.k3 != 0.0) return with("FULL_OPENCV", {d.k1, d.k2, d.p1, d.p2, d.k3, 0.0, 0.0, 0.0});
  const bool is_plain = d.k1 == 0.0 && d.k2 == 0.0 && d.p1 == 0.0 && d.p2 == 0.0;
  return is_plain ? with("PINHOLE", {}) : with("OPENCV", {d.k1, d.k2, d.p1, d.p2});
}

std::optional<Pixel> undistorted_offset(const Camera& camera, const Pixel& pixel) {
  const auto ray = unproject(camera, pixel);
  if (!ray || !(ray->z() > 0.0)) return std::nullopt;
  const double by = intrinsics(camera).fx / ray->z();
  return Pixel{by * ray->x(), by * ray->y()};
}

std::uint64_t keypoint_index(const LandmarkMap& map, std::uint64_t observation,
                             std::uint64_t unknown) {
  const auto& keypoints = map.observations().keypoints;
  if (keypoints.empty() || !keypoints[observation]) return unknown;
  return *keypoints[observation];
}

std::vector<std::uint32_t> keypoint_indices(const LandmarkMap& map) {
  const ObservationTable& observations = map.observations();
  const std::size_t count = observations.frames.size();
  std::vector<std::uint32_t> indices;
  indices.reserve(count);
  std::unordered_set<std::uint64_t> seen;
  for (std::size_t k = 0; k < count && !observations.keypoints.empty(); ++k) {
    const auto& keypoint = observations.keypoints[k];
    if (!keypoint) break;
    const bool is_new =
        seen.insert(std::uint64_t{observations.frames[k].value} << 32 | *keypoint).second;
    if (!is_new) break;
    indices.push_back(*keypoint);
  }
  if (indices.size() == count) return indices;
  indices.clear();
  std::vector<std::uint32_t> next(map.frame_count(), 0);
  for (const FrameIndex frame : observations.frames) indices.push_back(next[frame.value]++);
  return indices;
}

}  // namespace cairn::detail
