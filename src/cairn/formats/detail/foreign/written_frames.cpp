// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/formats/detail/foreign/written_frames.hpp"

#include <algorithm>
#include <unordered_map>
#include <unordered_set>

#include <fmt/format.h>

#include "cairn/core/error.hpp"

namespace cairn::detail {

void require_cameras(const LandmarkMap& map, std::string_view image) {
  const FrameTable& frames = map.frames();
  for (std::size_t i = 0; i < map.frame_count(); ++i) {
    if (!frames.cameras.empty() && frames.cameras[i]) continue;
    throw Error(ErrorKind::kInput, fmt::format("frame {}", frames.ids[i].value),
                fmt::format("has no camera, and {} needs one", image), "a camera for every frame");
  }
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

std::optional<Pixel> undistorted_offset(const Camera& camera, const Pixel& pixel) {
  const auto x = unproject(camera, pixel);
  if (!x) return std::nullopt;
  const double focal = intrinsics(camera).fx;
  return Pixel{focal * x->x(), focal * x->y()};
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
