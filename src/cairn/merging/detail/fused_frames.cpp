// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <tuple>
#include <utility>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/core/statistics.hpp"
#include "cairn/geometry/angles.hpp"
#include "cairn/geometry/covariance.hpp"
#include "cairn/map/operations.hpp"
#include "cairn/merging/detail/fusion.hpp"

// Keyframes, observations and what a fused map says of itself.
namespace cairn::detail {
namespace {

// Covariance of a keyframe's pose in the world: that of its pose in its map, and that of the map's pose.
std::optional<Matrix6d> pose_covariance(const PlacedMap& placed, FrameIndex frame) {
  const auto& in_map = placed.map->frames().pose_covariances;
  if (in_map.empty() || !in_map[frame.value]) return std::nullopt;
  const Vector3d arm =
      placed.world_from_map.linear() * placed.map->world_from_camera(frame).translation();
  Eigen::Matrix<double, 6, 7> by_pose = Eigen::Matrix<double, 6, 7>::Zero();
  by_pose.topRows<3>() = point_by_pose(arm);
  by_pose.block<3, 3>(3, 3).setIdentity();
  const Matrix6d sum = left_transformed_covariance(*in_map[frame.value], placed.world_from_map) +
                       by_pose * placed.covariance * by_pose.transpose();
  return 0.5 * (sum + sum.transpose());
}

// Takes what is not known yet of a fused frame from a map's frame of the same image.
void fill_unknown(const FrameTable& theirs, std::uint32_t i, FrameTable& fused, std::uint32_t f) {
  if (!fused.timestamps_s[f] && !theirs.timestamps_s.empty()) {
    fused.timestamps_s.set(f, theirs.timestamps_s[i]);
  }
  if (!fused.gnss[f] && !theirs.gnss.empty()) fused.gnss.set(f, theirs.gnss[i]);
  if (fused.image_names[f].empty() && !theirs.image_names.empty()) {
    fused.image_names[f] = theirs.image_names[i];
  }
}

}  // namespace

CameraIndex Fusion::add_camera(Camera camera, bool is_mounted) {
  const CameraIndex index{static_cast<std::uint32_t>(tables_.cameras.size())};
  camera.id = CameraId{index.value};
  tables_.cameras.push_back(std::move(camera));
  is_mounted_.push_back(is_mounted);
  return index;
}

// The camera of the fused map for each camera of a map. Cameras of a rig are recognised only with the whole rig: the
// cameras of a stereo rig may be equal, and a rig of another map may have another baseline.
std::vector<CameraIndex> Fusion::add_cameras(std::size_t m) {
  const LandmarkMap& map = *maps_[m].map;
  const auto is_same = [&](CameraIndex fused, const Camera& camera) {
    return is_same_lens(tables_.cameras[fused.value], camera);
  };
  std::vector<std::optional<CameraIndex>> of(map.cameras().size());
  for (Rig rig : map.rigs()) {
    for (Rig::Mount& mount : rig.mounts) mount.translation *= maps_[m].world_from_map.scale();
    const auto known =
        std::find_if(tables_.rigs.begin(), tables_.rigs.end(), [&](const Rig& fused) {
          return std::equal(fused.mounts.begin(), fused.mounts.end(), rig.mounts.begin(),
                            rig.mounts.end(), [&](const Rig::Mount& a, const Rig::Mount& b) {
                              return a.quaternion == b.quaternion &&
                                     a.translation == b.translation &&
                                     is_same(a.camera, map.cameras()[b.camera.value]);
                            });
        });
    for (std::size_t i = 0; i < rig.mounts.size(); ++i) {
      CameraIndex& camera = rig.mounts[i].camera;
      const CameraIndex fused = known == tables_.rigs.end()
                                    ? add_camera(map.cameras()[camera.value], true)
                                    : known->mounts[i].camera;
      of[camera.value] = fused;
      camera = fused;
    }
    if (known != tables_.rigs.end()) continue;
    rig.id = RigId{tables_.rigs.size()};
    tables_.rigs.push_back(std::move(rig));
  }
  std::vector<CameraIndex> result;
  for (std::size_t i = 0; i < of.size(); ++i) {
    const Camera& camera = map.cameras()[i];
    for (std::uint32_t k = 0; k < tables_.cameras.size() && !of[i]; ++k) {
      if (!is_mounted_[k] && is_same(CameraIndex{k}, camera)) of[i] = CameraIndex{k};
    }
    result.push_back(of[i] ? *of[i] : add_camera(camera, false));
  }
  return result;
}

void Fusion::add_frames(std::size_t m) {
  const LandmarkMap& map = *maps_[m].map;
  const Similarity3& world_from_map = maps_[m].world_from_map;
  const FrameTable& theirs = map.frames();
  FrameTable& frames = tables_.frames;
  std::vector<FrameIndex>& own = result_.frames.emplace_back();
  const std::vector<CameraIndex> camera_of = add_cameras(m);
  result_.cameras.emplace_back(camera_of.begin(), camera_of.end());
  std::map<InstantId, InstantId> instant_of;
  const auto instant = [&](std::uint32_t i) -> std::optional<InstantId> {
    if (theirs.instants.empty() || !theirs.instants[i]) return std::nullopt;
    const auto [found, is_new] = instant_of.emplace(*theirs.instants[i], InstantId{instants_});
    if (is_new) ++instants_;
    return found->second;
  };
  const std::vector<std::optional<FrameIndex>> known_images = known_images_of(m);
  for (std::uint32_t i = 0; i < map.frame_count(); ++i) {
    std::optional<CameraIndex> camera;
    if (!theirs.cameras.empty() && theirs.cameras[i]) camera = camera_of[theirs.cameras[i]->value];
    Vector3d translation = theirs.translations[i];
    std::array<double, 4> quaternion = theirs.quaternions[i];
    if (!maps_[m].is_in_world()) {
      const Rigid3 pose = map.world_from_camera(FrameIndex{i});
      const Eigen::Quaterniond q = (world_from_map.rigid() * pose).quaternion();
      translation = world_from_map * pose.translation();
      quaternion = {q.w(), q.x(), q.y(), q.z()};
    }
    const auto known = known_images[i] ? known_images[i] : known_frame(m, i, camera);
    if (known) {
      const std::uint32_t f = known->value;
      own.push_back(*known);
      is_shared_[f] = true;
      fill_unknown(theirs, i, frames, f);
      if (camera && (!frames.cameras[f] || precedes(map, *maps_[map_of_camera_[f]].map))) {
        map_of_camera_[f] = m;
        frames.cameras.set(f, camera);
      }
      if (!precedes(map, *maps_[map_of_frame_[f]].map)) continue;
      map_of_frame_[f] = m;
      frames.instants.set(f, instant(i));
      frames.translations[f] = translation;
      frames.quaternions[f] = quaternion;
      frames.pose_covariances.set(f, pose_covariance(maps_[m], FrameIndex{i}));
      continue;
    }
    own.push_back(FrameIndex{static_cast<std::uint32_t>(frames.ids.size())});
    is_shared_.push_back(false);
    map_of_frame_.push_back(m);
    map_of_camera_.push_back(m);
    frames.ids.push_back(FrameId{frames.ids.size()});
    frames.translations.push_back(translation);
    frames.quaternions.push_back(quaternion);
    frames.cameras.push_back(camera);
    frames.timestamps_s.push_back(std::nullopt);
    frames.image_names.emplace_back();
    frames.gnss.push_back(std::nullopt);
    fill_unknown(theirs, i, frames, own.back().value);
    frames.pose_covariances.push_back(pose_covariance(maps_[m], FrameIndex{i}));
    frames.instants.push_back(instant(i));
  }
}

// Drops cameras without frames: an image that several maps contain keeps one camera, a folded part none. Rigs stay
// whole.
void Fusion::drop_unused_cameras() {
  OptionalColumn<CameraIndex>& of_frames = tables_.frames.cameras;
  std::vector<bool> is_used = is_mounted_;
  bool any = false;
  for (const std::optional<CameraIndex> camera : of_frames) {
    if (camera) any = is_used[camera->value] = true;
  }
  if (!any) return;
  std::vector<Camera> kept;
  std::vector<CameraIndex> now(is_used.size());
  for (std::size_t i = 0; i < is_used.size(); ++i) {
    if (!is_used[i]) continue;
    now[i] = CameraIndex{static_cast<std::uint32_t>(kept.size())};
    kept.push_back(std::move(tables_.cameras[i]));
    kept.back().id = CameraId{now[i].value};
  }
  tables_.cameras = std::move(kept);
  for (std::size_t i = 0; i < of_frames.size(); ++i) {
    if (of_frames[i]) of_frames.set(i, now[of_frames[i]->value]);
  }
  for (Rig& rig : tables_.rigs) {
    for (Rig::Mount& mount : rig.mounts) mount.camera = now[mount.camera.value];
  }
  for (auto& cameras : result_.cameras) {
    for (std::optional<CameraIndex>& camera : cameras) {
      camera = is_used[camera->value] ? std::optional(now[camera->value]) : std::nullopt;
    }
  }
}

namespace {

std::vector<Pixel> pixels_in(const LandmarkMap& map, FrameIndex frame) {
  const ObservationTable& observations = map.observations();
  std::vector<Pixel> pixels;
  for (std::size_t k = 0; k < observations.frames.size(); ++k) {
    if (observations.frames[k] == frame) pixels.push_back(observations.pixels[k]);
  }
  return pixels;
}

// Whether two lists of pixels are of one image: a quarter of the shorter list is within a pixel of the other list. Each
// map tracks its own features, to tenths of a pixel. Of the pixels of two different images, a few in a hundred
// coincide.
bool show_one_image(std::vector<Pixel> few, std::vector<Pixel> many) {
  constexpr double kWithin = 1.0;
  if (few.size() > many.size()) std::swap(few, many);
  std::sort(many.begin(), many.end(), [](const Pixel& a, const Pixel& b) { return a.u < b.u; });
  std::size_t common = 0;
  for (const Pixel& pixel : few) {
    const auto is_left = [](const Pixel& a, double u) { return a.u < u; };
    auto other = std::lower_bound(many.begin(), many.end(), pixel.u - kWithin, is_left);
    const auto in_reach = [&] { return other != many.end() && other->u <= pixel.u + kWithin; };
    while (in_reach() && std::abs(other->v - pixel.v) > kWithin) ++other;
    common += in_reach() ? 1 : 0;
  }
  return 4 * common >= few.size();
}

}  // namespace

// The frames of earlier maps that show each frame's image.
std::vector<std::optional<FrameIndex>> Fusion::known_images_of(std::size_t m) {
  std::vector<std::optional<FrameIndex>> known(maps_[m].map->frame_count());
  images_.emplace_back(*maps_[m].map);
  for (std::size_t k = 0; k < m; ++k) {
    // Whatever the order in which the maps are given.
    const bool is_first = rank_[m] < rank_[k];
    const std::size_t earlier = is_first ? m : k;
    const std::size_t later = is_first ? k : m;
    const CommonImages common = common_images(images_[earlier], images_[later]);
    if (common.same.empty()) continue;
    if (execution_.log) log_common_images(earlier, later, common);
    if (original_[m] == m && original_[k] == k) {
      identities_.push_back({earlier, later, common.landmarks});
    }
    for (auto [there, here] : common.same) {
      if (is_first) std::swap(there, here);
      if (!known[here.value]) known[here.value] = result_.frames[k][there.value];
    }
  }
  return known;
}

void Fusion::log_common_images(std::size_t k, std::size_t m, const CommonImages& common) const {
  PoseDifferences poses = pose_differences({maps_[k].map, maps_[k].world_from_map},
                                           {maps_[m].map, maps_[m].world_from_map}, common);
  const auto rounded = [](double value) { return value < 1e-9 ? 0.0 : value; };
  execution_.log(fmt::format(
      "{} images are both in {} and in {}, and count once; their poses differ by "
      "{:.3g} {} and {:.2g}° (medians)",
      common.same.size(), maps_[k].name, maps_[m].name, rounded(upper_median(poses.apart)),
      unit_symbol(maps_.front().map->info().length_unit), rounded(upper_median(poses.turned_deg))));
}

// The frame of an earlier map that is the same keyframe: the last of one mini-map is the first of the next.
std::optional<FrameIndex> Fusion::known_frame(std::size_t m, std::uint32_t i,
                                              std::optional<CameraIndex> camera) const {
  const FrameTable& theirs = maps_[m].map->frames();
  const bool is_last = i + 1 == maps_[m].map->frame_count();
  if (i > 0 && !is_last) return std::nullopt;
  if (theirs.timestamps_s.empty() || !theirs.timestamps_s[i]) return std::nullopt;
  const std::string name = theirs.image_names.empty() ? std::string() : theirs.image_names[i];
  const auto is_same = [&](std::size_t k, FrameIndex frame, std::size_t in_earlier) {
    const std::uint32_t f = frame.value;
    if (tables_.frames.timestamps_s[f] != theirs.timestamps_s[i] ||
        tables_.frames.image_names[f] != name || tables_.frames.cameras[f] != camera) {
      return false;
    }
    // Maps whose clocks start at 0 have equal times, too.
    return show_one_image(
        pixels_in(*maps_[k].map, FrameIndex{static_cast<std::uint32_t>(in_earlier)}),
        pixels_in(*maps_[m].map, FrameIndex{i}));
  };
  for (std::size_t k = 0; k < m; ++k) {
    const std::vector<FrameIndex>& earlier = result_.frames[k];
    if (earlier.empty()) continue;
    if (i == 0 && is_same(k, earlier.back(), earlier.size() - 1)) return earlier.back();
    if (is_last && is_same(k, earlier.front(), 0)) return earlier.front();
  }
  return std::nullopt;
}

// Sessions number their images alike, but programs find an image by its name. If images of different maps have the same
// name, the names of their maps distinguish them.
void Fusion::tell_images_apart() {
  std::vector<std::string>& names = tables_.frames.image_names;
  std::vector<std::size_t> map_of(names.size());  // the first map that names each frame
  for (std::size_t m = maps_.size(); m-- > 0;) {
    const std::vector<std::string>& theirs = maps_[m].map->frames().image_names;
    for (std::size_t i = 0; i < theirs.size(); ++i) {
      if (!theirs[i].empty()) map_of[result_.frames[m][i].value] = m;
    }
  }
  std::string example;
  std::size_t alike = 0;
  for (bool changed = true; changed;) {
    changed = false;
    std::vector<bool> next = has_prefix_;
    std::map<std::string, std::size_t> map_with;
    for (std::size_t i = 0; i < names.size(); ++i) {
      if (names[i].empty()) continue;
      const std::size_t m = map_of[i];
      const auto [other, is_new] = map_with.emplace(image_name(m, names[i]), m);
      if (is_new || other->second == m) continue;
      alike += names[i] == other->first ? 1 : 0;
      if (has_prefix_[m] && has_prefix_[other->second]) continue;
      if (example.empty()) {
        example = fmt::format("{} of {} and {}", printable(names[i]), maps_[other->second].name,
                              maps_[m].name);
      }
      next[m] = next[other->second] = changed = true;
    }
    has_prefix_ = std::move(next);
  }
  if (example.empty()) return;
  std::string folders;
  std::size_t renamed = 0;
  for (std::size_t m = 0; m < maps_.size(); ++m) {
    if (!has_prefix_[m]) continue;
    constexpr std::size_t kShown = 4;
    if (++renamed <= kShown) folders += (renamed > 1 ? ", " : "") + image_folder(m);
    if (renamed == kShown + 1) folders += ", ...";
  }
  for (std::size_t i = 0; i < names.size(); ++i) names[i] = image_name(map_of[i], names[i]);
  if (execution_.log) {
    execution_.log(fmt::format(
        "names that images of different maps share: {}, e.g. {}; the names of all images of these "
        "{} maps begin with the map's name now. Programs find the images if those of each map are "
        "copied into a folder of that name: {}",
        alike, example, renamed, folders));
  }
}

// By map and observation: whether the landmark already has an observation in the same frame, because two maps share the
// frame. Empty for a map without such observations.
std::vector<std::vector<bool>> Fusion::repeated_observations() const {
  std::vector<std::vector<bool>> repeated(maps_.size());
  if (std::find(is_shared_.begin(), is_shared_.end(), true) == is_shared_.end()) return repeated;
  std::set<std::pair<std::uint32_t, FrameIndex>> seen;
  for (const std::size_t m : order_) {
    const ObservationTable& theirs = maps_[m].map->observations();
    if (theirs.offsets.empty()) continue;
    for (std::size_t i = 0; i < landmark_of_[m].size(); ++i) {
      for (std::uint64_t k = theirs.offsets[i]; k < theirs.offsets[i + 1]; ++k) {
        const FrameIndex frame = result_.frames[m][theirs.frames[k].value];
        if (!is_shared_[frame.value] || seen.emplace(landmark_of_[m][i], frame).second) continue;
        repeated[m].resize(theirs.frames.size(), false);
        repeated[m][k] = true;
      }
    }
  }
  return repeated;
}

void Fusion::set_observations() {
  ObservationTable& observations = tables_.observations;
  bool any = false;
  bool keypoints = false;
  bool depths = false;
  bool octaves = false;
  bool sources = false;
  bool sigmas = false;
  for (const PlacedMap& placed : maps_) {
    const ObservationTable& theirs = placed.map->observations();
    any = any || !theirs.offsets.empty();
    keypoints = keypoints || !theirs.keypoints.empty();
    depths = depths || !theirs.depths.empty();
    octaves = octaves || !theirs.octaves.empty();
    sources = sources || !theirs.sources.empty();
    sigmas = sigmas || !theirs.sigmas_px.empty();
    if (!placed.map->has_observations() && execution_.log) {
      execution_.log(placed.name +
                     ": does not know who observed its landmarks, which count as not observed");
    }
  }
  if (!any) return;
  const std::vector<std::vector<bool>> repeated = repeated_observations();
  observations.offsets.assign(last_member_.size() + 1, 0);
  for (std::size_t m = 0; m < maps_.size(); ++m) {
    const ObservationTable& theirs = maps_[m].map->observations();
    if (theirs.offsets.empty()) continue;
    for (std::size_t i = 0; i < landmark_of_[m].size(); ++i) {
      std::uint64_t& count = observations.offsets[landmark_of_[m][i] + 1];
      for (std::uint64_t k = theirs.offsets[i]; k < theirs.offsets[i + 1]; ++k) {
        count += repeated[m].empty() || !repeated[m][k] ? 1 : 0;
      }
    }
  }
  for (std::size_t i = 1; i < observations.offsets.size(); ++i) {
    observations.offsets[i] += observations.offsets[i - 1];
  }
  const std::size_t count = observations.offsets.back();
  observations.frames.resize(count);
  observations.pixels.resize(count);
  if (keypoints) observations.keypoints.resize(count);
  if (depths) observations.depths.resize(count);
  if (octaves) observations.octaves.resize(count);
  if (sources) observations.sources.resize(count);
  if (sigmas) observations.sigmas_px.resize(count);
  std::vector<std::uint64_t> next(observations.offsets.begin(), observations.offsets.end() - 1);
  for (std::size_t m = 0; m < maps_.size(); ++m) {
    const ObservationTable& theirs = maps_[m].map->observations();
    if (theirs.offsets.empty()) continue;
    const double scale = maps_[m].world_from_map.scale();
    for (std::size_t i = 0; i < landmark_of_[m].size(); ++i) {
      for (std::uint64_t k = theirs.offsets[i]; k < theirs.offsets[i + 1]; ++k) {
        if (!repeated[m].empty() && repeated[m][k]) continue;
        const std::uint64_t to = next[landmark_of_[m][i]]++;
        observations.frames[to] = result_.frames[m][theirs.frames[k].value];
        observations.pixels[to] = theirs.pixels[k];
        if (!theirs.keypoints.empty()) observations.keypoints[to] = theirs.keypoints[k];
        if (!theirs.depths.empty() && theirs.depths[k]) {
          observations.depths[to] = scale * *theirs.depths[k];
        }
        if (!theirs.octaves.empty()) observations.octaves[to] = theirs.octaves[k];
        // A patch defines the landmark of its own map, not the fused one.
        const bool defines =
            !theirs.sources.empty() && theirs.sources[k] == PixelSource::kReference;
        if (defines && parts_[landmark_of_[m][i]] > 1) continue;
        if (!theirs.sources.empty()) observations.sources[to] = theirs.sources[k];
        if (!theirs.sigmas_px.empty()) observations.sigmas_px[to] = theirs.sigmas_px[k];
      }
    }
  }
}

namespace {

// Adds control points; points with the same name and place are the same.
void add_control_points(const std::vector<ControlPoint>& more, std::vector<ControlPoint>& all) {
  for (const ControlPoint& point : more) {
    const auto same = std::find_if(all.begin(), all.end(), [&](const ControlPoint& other) {
      return other.name == point.name && other.latitude_deg == point.latitude_deg &&
             other.longitude_deg == point.longitude_deg && other.altitude_m == point.altitude_m;
    });
    if (same == all.end()) {
      all.push_back(point);
      continue;
    }
    for (const ControlPoint::View& view : point.views) {
      if (std::find(same->views.begin(), same->views.end(), view) == same->views.end()) {
        same->views.push_back(view);
      }
    }
  }
}

}  // namespace

// States which frames belong to a map: consecutive ones, and those that belong to an earlier map too.
std::string Fusion::frames_line(std::size_t m) const {
  constexpr std::size_t kNamed = 2;  // frames that mini-maps share
  // New frames come behind all others.
  std::uint32_t known = 0;
  for (std::size_t k = 0; k < m; ++k) {
    for (const FrameIndex frame : result_.frames[k]) known = std::max(known, frame.value + 1);
  }
  std::string line;
  std::vector<FrameIndex> own;
  std::size_t shared = 0;
  for (std::size_t i = 0; i < result_.frames[m].size(); ++i) {
    const FrameIndex frame = result_.frames[m][i];
    if (frame.value >= known) {
      own.push_back(frame);
    } else {
      line += fmt::format("; frame {} is its {} too", frame.value, i == 0 ? "first" : "last");
      ++shared;
    }
  }
  if (shared > kNamed) line = fmt::format("; {} of its frames are those of earlier maps", shared);
  if (own.empty()) return line;
  return fmt::format("; frames {} to {} are its {}{} in their order", own.front().value,
                     own.back().value, line.empty() ? "" : "other ", own.size()) +
         line;
}

MapInfo info_of_world(std::span<const PlacedMap> maps) {
  const MapInfo& first = maps.front().map->info();
  MapInfo info;
  info.length_unit = first.length_unit;
  if (maps.front().is_in_world()) info.world_frame = first.world_frame;
  for (const PlacedMap& placed : maps) {
    const auto& [gravity, georeference] =
        std::tie(placed.map->info().gravity, placed.map->info().georeference);
    const bool is_moved = !placed.is_in_world();
    if (!info.gravity && gravity) {
      info.gravity = is_moved ? placed.world_from_map.rigid().rotation() * *gravity : *gravity;
    }
    if (!info.georeference && georeference) {
      info.georeference = is_moved ? georeference->moved(placed.world_from_map) : *georeference;
    }
  }
  return info;
}

// The name that an image of a map has in the fused map, maybe that of another map that has it too.
std::string Fusion::fused_name(std::size_t m, const std::string& name) const {
  const std::vector<std::string>& theirs = maps_[m].map->frames().image_names;
  const auto found = std::ranges::find(theirs, name);
  if (found == theirs.end()) return image_name(m, name);
  const auto i = static_cast<std::size_t>(found - theirs.begin());
  return tables_.frames.image_names[result_.frames[m][i].value];
}

void Fusion::set_info() {
  MapInfo& info = tables_.info = info_of_world(maps_);
  for (std::size_t m = 0; m < maps_.size(); ++m) {
    const MapInfo& theirs = maps_[m].map->info();
    std::vector<ControlPoint> points = theirs.control_points;
    for (ControlPoint& point : points) {
      for (ControlPoint::View& view : point.views) view.image_name = fused_name(m, view.image_name);
    }
    add_control_points(points, info.control_points);
    for (const std::string& line : theirs.provenance) {
      info.provenance.push_back(fmt::format("{}: {}", maps_[m].name, line));
    }
    std::string line = fmt::format("map {} of a merge: {}", m, maps_[m].name);
    if (theirs.uuid) line += fmt::format(", uuid {}", *theirs.uuid);
    line += fmt::format(", {} landmarks, of which {} were fused with those of other maps",
                        result_.maps[m].landmarks, result_.maps[m].fused);
    line += frames_line(m);
    info.provenance.push_back(std::move(line));
  }
}

}  // namespace cairn::detail
