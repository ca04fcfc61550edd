// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/map_images.hpp"

#include <algorithm>
#include <set>
#include <tuple>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/core/text.hpp"
#include "cairn/formats/map_file.hpp"
#include "cairn/map/operations.hpp"
#include "cairn/vision/detail/described_image.hpp"
#include "cairn/vision/detail/map_frames.hpp"

namespace cairn {
namespace {

CameraIndex index_of_camera(std::vector<Camera>& cameras, const Camera& camera) {
  std::uint64_t next_id = 0;
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    if (is_same_lens(cameras[i], camera)) return CameraIndex{static_cast<std::uint32_t>(i)};
    next_id = std::max(next_id, cameras[i].id.value + 1);
  }
  cameras.push_back(camera);
  cameras.back().id = CameraId{next_id};
  return CameraIndex{static_cast<std::uint32_t>(cameras.size() - 1)};
}

void add_frame(MapTables& tables, const LocatedImage& image, FrameId id) {
  FrameTable& frames = tables.frames;
  const std::size_t count = frames.ids.size() + 1;
  frames.ids.push_back(id);
  const Rigid3& pose = *image.location.world_from_camera;
  frames.translations.push_back(pose.translation());
  const Eigen::Quaterniond q = pose.quaternion();
  frames.quaternions.push_back({q.w(), q.x(), q.y(), q.z()});
  frames.cameras.resize(count);
  frames.cameras[count - 1] = index_of_camera(tables.cameras, image.location.camera);
  frames.image_names.resize(count);
  frames.image_names.back() = image.name;
  detail::extend(frames.timestamps_s, count);
  detail::extend(frames.gnss, count);
  detail::extend(frames.pose_covariances, count);
  detail::extend(frames.instants, count);
}

// The observations with those of the new frames, which are the last of each landmark.
ObservationTable with_matches(const ObservationTable& old, std::size_t landmarks,
                              std::size_t first_frame, std::span<const LocatedImage> images) {
  struct Seen {
    FrameIndex frame;
    const ImageMatch* match;
  };
  std::vector<std::vector<Seen>> seen(landmarks);
  for (std::size_t k = 0; k < images.size(); ++k) {
    const FrameIndex frame{static_cast<std::uint32_t>(first_frame + k)};
    for (const ImageMatch& match : images[k].location.matches) {
      refuse_if(match.landmark.value >= landmarks, printable(images[k].name),
                fmt::format("matches landmark {} of {}", match.landmark.value, landmarks),
                "an image that was located in this map");
      seen[match.landmark.value].push_back({frame, &match});
    }
  }
  ObservationTable table;
  std::vector<std::size_t> from;           // the old row of each new one; past the end: none
  std::vector<const ImageMatch*> matches;  // of each row; null for an old one
  table.offsets = {0};
  for (std::size_t i = 0; i < landmarks; ++i) {
    if (!old.offsets.empty()) {
      for (std::uint64_t row = old.offsets[i]; row < old.offsets[i + 1]; ++row) {
        table.frames.push_back(old.frames[row]);
        table.pixels.push_back(old.pixels[row]);
        from.push_back(row);
        matches.push_back(nullptr);
      }
    }
    for (const Seen& one : seen[i]) {
      table.frames.push_back(one.frame);
      table.pixels.push_back(one.match->pixel);
      from.push_back(old.frames.size());
      matches.push_back(one.match);
    }
    table.offsets.push_back(table.frames.size());
  }
  const auto spread = [&](const auto& column, auto& wider) {
    if (column.empty()) return;
    wider.resize(from.size());
    for (std::size_t row = 0; row < from.size(); ++row) {
      if (from[row] < column.size()) wider[row] = column[from[row]];
    }
  };
  spread(old.keypoints, table.keypoints);
  spread(old.depths, table.depths);
  spread(old.octaves, table.octaves);
  spread(old.sources, table.sources);
  spread(old.sigmas_px, table.sigmas_px);
  for (std::size_t row = 0; row < matches.size(); ++row) {
    if (matches[row] == nullptr) continue;
    if (!table.octaves.empty()) table.octaves[row] = matches[row]->octave;
    if (!table.depths.empty()) table.depths[row] = matches[row]->depth_m;
  }
  return table;
}

// The landmarks' descriptors with those of the images' matches. As in a merge, the most distinct ones stay.
DescriptorColumn with_views(const DescriptorColumn& old, std::span<const LocatedImage> images) {
  std::vector<std::vector<std::span<const std::uint8_t>>> views(old.known.size());
  for (std::size_t i = 0; i < old.known.size(); ++i) {
    for (std::size_t k = 0; k < old.count(i); ++k) views[i].push_back(old.descriptor(i, k));
  }
  for (const LocatedImage& image : images) {
    const auto& [matches, rows] = std::tie(image.location.matches, image.location.descriptors);
    if (rows.size() != matches.size() * old.bytes_each) continue;
    for (std::size_t k = 0; k < matches.size(); ++k) {
      views[matches[k].landmark.value].push_back(
          std::span(rows).subspan(k * old.bytes_each, old.bytes_each));
    }
  }
  DescriptorColumn column{.kind = old.kind, .bytes_each = old.bytes_each, .known = {}, .bytes = {}};
  const DescriptorNorm norm = descriptor_norm(old.kind);
  for (std::size_t i = 0; i < views.size(); ++i) {
    const std::size_t most = std::max(kDistinctViews, old.count(i));
    if (views[i].size() == old.count(i)) {
      append_descriptors(column, views[i]);
      continue;
    }
    std::vector<std::span<const std::uint8_t>> chosen;
    for (const std::size_t k : distinct_descriptors(views[i], 0, most, norm)) {
      chosen.push_back(views[i][k]);
    }
    append_descriptors(column, chosen);
  }
  return column;
}

// The SIFT features of an image at their places in it.
detail::Features features_of(const detail::SiftFeatures& sift, const cv::Mat& gray) {
  std::vector<detail::Keypoint> keypoints;
  for (const cv::KeyPoint& found : sift.keypoints) {
    detail::Keypoint keypoint;
    keypoint.pixel = {found.pt.x, found.pt.y};
    keypoints.push_back(keypoint);
  }
  return {std::move(keypoints), {}, {gray}, {}};
}

// The feature nearest to a pixel, if it is within kSamePlace of it.
std::optional<std::uint32_t> nearest_feature(const detail::Features& features, const Pixel& pixel) {
  constexpr double kSamePlace =
      1.5;  // pixels: other programs' features are not quite where ours are
  const Eigen::Vector2d at(pixel.u, pixel.v);
  double least = kSamePlace * kSamePlace;
  std::optional<std::uint32_t> nearest;
  features.visit_near(at, kSamePlace, [&](std::uint32_t i) {
    const double squared = (features.keypoints()[i].pixel.cast<double>() - at).squaredNorm();
    if (squared > least || (nearest && squared == least)) return;
    least = squared;
    nearest = i;
  });
  return nearest;
}

}  // namespace

void detail::require_camera_size(const LandmarkMap& map, FrameIndex frame, std::uint32_t width,
                                 std::uint32_t height) {
  const FrameTable& frames = map.frames();
  if (frames.cameras.empty() || !frames.cameras[frame.value]) return;
  const Camera& camera = map.cameras()[frames.cameras[frame.value]->value];
  if (width == camera.width && height == camera.height) return;
  throw Error(ErrorKind::kInput,
              frames.image_names.empty() ? fmt::format("frame {}", frame.value)
                                         : printable(frames.image_names[frame.value]),
              fmt::format("{} x {} pixels", width, height),
              fmt::format("{} x {}, as its camera has", camera.width, camera.height));
}

LandmarkMap with_frames(const LandmarkMap& map, std::span<const LocatedImage> images) {
  MapTables tables = LandmarkMap(map).tables();
  std::set<std::string> names(tables.frames.image_names.begin(), tables.frames.image_names.end());
  FrameId next = next_free_id(std::span<const FrameId>(tables.frames.ids));
  const std::size_t first_frame = tables.frames.ids.size();
  for (const LocatedImage& image : images) {
    refuse_if(!image.location.world_from_camera, printable(image.name), "is not located",
              "a located image");
    if (!names.insert(image.name).second) {
      throw Error(ErrorKind::kMisuse, printable(image.name),
                  "is the name of an image of the map, or given twice",
                  "each image once; an image of another session under another name");
    }
    add_frame(tables, image, FrameId{next.value++});
  }
  tables.observations =
      with_matches(tables.observations, tables.landmarks.ids.size(), first_frame, images);
  if (tables.landmarks.descriptors) {
    tables.landmarks.descriptors = with_views(*tables.landmarks.descriptors, images);
  }
  tables.info.provenance.push_back(fmt::format("{} images located and added", images.size()));
  return with_content_uuid(LandmarkMap(std::move(tables)));
}

LandmarkMap with_image_descriptors(
    const LandmarkMap& map, const std::function<std::optional<GrayImage>(FrameIndex)>& image_of,
    const Execution& execution) {
  constexpr std::size_t kBytes = detail::kSiftBytes;
  constexpr int kMostFeatures = 20000;
  const ObservationTable& observations = map.observations();
  std::vector<std::vector<std::size_t>> seen_by(map.frame_count());
  for (std::size_t i = 0; i < observations.frames.size(); ++i) {
    seen_by[observations.frames[i].value].push_back(i);
  }
  std::vector<std::vector<std::uint8_t>> found(observations.frames.size());
  execution.executor.for_blocks(map.frame_count(), 1, [&](std::size_t frame, std::size_t) {
    if (execution.stop.stop_requested()) {
      throw Error(ErrorKind::kCancelled, "describing images", "was cancelled", "");
    }
    const FrameIndex index{static_cast<std::uint32_t>(frame)};
    const std::optional<GrayImage> image = image_of(index);
    if (!image) return;
    detail::require_camera_size(map, index, image->width, image->height);
    const cv::Mat gray = detail::matrix_of(*image);
    const detail::SiftFeatures sift = detail::sift_features(gray, kMostFeatures, true);
    const detail::Features features = features_of(sift, gray);
    for (const std::size_t i : seen_by[frame]) {
      const auto feature = nearest_feature(features, observations.pixels[i]);
      if (!feature) continue;
      const auto bytes = std::span(sift.descriptors).subspan(*feature * kBytes, kBytes);
      found[i].assign(bytes.begin(), bytes.end());
    }
  });
  DescriptorColumn column{.kind = "SIFT", .bytes_each = kBytes, .known = {}, .bytes = {}};
  std::vector<std::span<const std::uint8_t>> of_landmark;
  for (std::size_t i = 0; i < map.landmark_count(); ++i) {
    of_landmark.clear();
    for (std::uint64_t k = observations.offsets[i]; k < observations.offsets[i + 1]; ++k) {
      if (!found[k].empty()) of_landmark.emplace_back(found[k]);
    }
    append_distinct(column, of_landmark, DescriptorNorm::kSquared);
  }
  MapTables tables = LandmarkMap(map).tables();
  tables.landmarks.descriptors = std::move(column);
  return with_content_uuid(LandmarkMap(std::move(tables)));
}

DescribedMap with_image_descriptors(const LandmarkMap& map, const std::filesystem::path& folder,
                                    const Execution& execution) {
  const std::vector<std::string>& names = map.frames().image_names;
  std::vector<std::optional<std::filesystem::path>> files(map.frame_count());
  std::size_t images = 0;
  for (std::size_t i = 0; i < names.size(); ++i) {
    const std::filesystem::path file = folder / names[i];
    if (names[i].empty() || !std::filesystem::is_regular_file(file)) continue;
    files[i] = file;
    ++images;
  }
  reject_if(images == 0, folder.string(),
            names.empty() ? "the map names no images"
                          : fmt::format("has none of the map's {} images, such as {}", names.size(),
                                        printable(names.front())),
            "the folder of the map's images");
  const auto image_of = [&](FrameIndex frame) -> std::optional<GrayImage> {
    if (!files[frame.value]) return std::nullopt;
    return read_gray_image(*files[frame.value]);
  };
  return {with_image_descriptors(map, image_of, execution), images};
}

}  // namespace cairn
