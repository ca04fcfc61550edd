// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <fmt/format.h>

#include "cairn/core/detail/descriptor_kernel.hpp"
#include "cairn/core/detail/disjoint_sets.hpp"
#include "cairn/core/error.hpp"
#include "cairn/core/text.hpp"
#include "cairn/formats/map_file.hpp"
#include "cairn/map/operations.hpp"
#include "cairn/registration/neighbors/batch_tree.hpp"
#include "cairn/vision/detail/described_image.hpp"
#include "cairn/vision/detail/landmark_colors.hpp"
#include "cairn/vision/detail/map_frames.hpp"
#include "cairn/vision/map_images.hpp"

namespace cairn {
namespace {

using detail::DescribedImage;
using detail::ImageDescriber;
using detail::Pinhole;

constexpr double kNear = 2.0;  // pixels of an octave: largest distance of one point's places

// An image of the map with the features of which the map has no landmark.
struct NewView {
  FrameIndex frame;
  Pinhole pinhole;
  std::vector<double> scales;  // pixel sizes of the octaves
  Rigid3 world_from_camera;
  Rigid3 camera_from_world;
  std::vector<detail::Keypoint> keypoints;
  std::vector<std::optional<Color>> colors;
  std::vector<std::uint8_t> descriptors;

  Eigen::Vector3d ray(std::uint32_t feature) const {
    const Eigen::Vector3d x =
        pinhole.back_project(keypoints[feature].pixel.cast<double>(), 1.0).normalized();
    return world_from_camera.rotation() * x;
  }
  // Whether a point is seen where the feature is.
  bool shows(const Eigen::Vector3d& x, std::uint32_t feature) const {
    const Eigen::Vector3d in_camera = camera_from_world * x;
    if (in_camera.z() <= 0.0) return false;
    const detail::Keypoint& keypoint = keypoints[feature];
    const Eigen::Vector2d off = pinhole.project(in_camera) - keypoint.pixel.cast<double>();
    return off.norm() <= kNear * scales[keypoint.octave];
  }
};

// A feature of one of the views.
struct Sighting {
  std::uint32_t view = 0;
  std::uint32_t feature = 0;
};

struct NewLandmark {
  Eigen::Vector3d position;
  Eigen::Matrix3d covariance;
  std::vector<Sighting> seen;  // at most one for each view
};

class NewLandmarkSearch {
 public:
  NewLandmarkSearch(const LandmarkMap& map, std::span<const FrameIndex> frames,
                    const std::function<ColorImage(FrameIndex)>& image_of,
                    const FeatureOptions& options, const Execution& execution)
      : map_(map),
        options_(options),
        execution_(execution),
        kind_(detail::image_descriptor_of(map)),
        views_(frames.size()) {
    observed_.resize(map.frame_count());
    for (std::size_t i = 0; i < map.observations().frames.size(); ++i) {
      observed_[map.observations().frames[i].value].push_back(map.observations().pixels[i]);
    }
    std::set<FrameIndex> given;
    for (const FrameIndex frame : frames) {
      refuse_if(frame.value >= map.frame_count() || !given.insert(frame).second, "frames",
                fmt::format("{}", frame.value),
                fmt::format("each once, below {}", map.frame_count()));
    }
    execution.executor.for_blocks(frames.size(), 1, [&](std::size_t k, std::size_t) {
      require_not_stopped();
      views_[k] = view_of(frames[k], image_of);
    });
  }

  std::vector<NewLandmark> find() const {
    std::vector<std::uint32_t> first;  // of each view's features among those of all
    std::uint32_t count = 0;
    for (const NewView& view : views_) {
      first.push_back(count);
      count += static_cast<std::uint32_t>(view.keypoints.size());
    }
    const auto pairs = pairs_of_views();
    std::vector<std::vector<std::pair<std::uint32_t, std::uint32_t>>> matches(pairs.size());
    execution_.executor.for_blocks(pairs.size(), 1, [&](std::size_t k, std::size_t) {
      require_not_stopped();
      matches[k] = matches_of(views_[pairs[k].first], views_[pairs[k].second]);
    });
    detail::DisjointSets tracks(count);
    std::vector<bool> is_matched(count, false);
    for (std::size_t k = 0; k < pairs.size(); ++k) {
      for (const auto& [a, b] : matches[k]) {
        const std::uint32_t one = first[pairs[k].first] + a;
        const std::uint32_t other = first[pairs[k].second] + b;
        tracks.join(one, other);
        is_matched[one] = is_matched[other] = true;
      }
    }
    std::map<std::size_t, std::vector<Sighting>> seen;
    for (std::uint32_t v = 0; v < views_.size(); ++v) {
      for (std::uint32_t i = 0; i < views_[v].keypoints.size(); ++i) {
        if (is_matched[first[v] + i]) seen[tracks.first_of(first[v] + i)].push_back({v, i});
      }
    }
    const BatchTree known(map_.landmarks().positions);
    std::vector<NewLandmark> found;
    for (const auto& [track, sightings] : seen) {
      const auto x = triangulated(sightings);
      const auto is_known = [&](const Sighting& one) { return has_near(known, *x, view(one)); };
      if (!x || std::ranges::any_of(sightings, is_known)) continue;
      found.push_back({*x, covariance_of(*x, sightings), sightings});
    }
    return found;
  }

  const NewView& view(const Sighting& sighting) const { return views_[sighting.view]; }
  std::size_t bytes_each() const { return map_.landmarks().descriptors->bytes_each; }
  std::span<const std::uint8_t> descriptor(const Sighting& sighting) const {
    return std::span(view(sighting).descriptors)
        .subspan(sighting.feature * bytes_each(), bytes_each());
  }

 private:
  void require_not_stopped() const {
    if (!execution_.stop.stop_requested()) return;
    throw Error(ErrorKind::kCancelled, "finding landmarks", "was cancelled", "");
  }

  NewView view_of(FrameIndex index, const std::function<ColorImage(FrameIndex)>& image_of) const {
    const auto& cameras = map_.frames().cameras;
    const std::size_t frame = index.value;
    refuse_if(cameras.empty() || !cameras[frame], fmt::format("frame {}", frame), "has no camera",
              "a frame with a camera");
    const Camera& camera = map_.cameras()[cameras[frame]->value];
    const ColorImage image = image_of(index);
    detail::require_camera_size(map_, index, image.width, image.height);
    const ImageDescriber describer(camera, options_, kind_);
    const auto gray = frame_images(0.0, camera.width, camera.height, image.values, {}).gray;
    const DescribedImage described = describer.describe(detail::matrix_of(gray), cv::Mat());
    NewView view;
    view.frame = index;
    view.pinhole = describer.extractor().pinhole();
    view.scales = describer.extractor().scales();
    view.world_from_camera = map_.world_from_camera(index);
    view.camera_from_world = view.world_from_camera.inverse();
    std::vector<bool> is_observed(described.features.size(), false);
    for (const Pixel& pixel : observed_[frame]) {
      const bool is_inside =
          pixel.u >= 0.0 && pixel.v >= 0.0 && pixel.u < camera.width && pixel.v < camera.height;
      if (!is_inside) continue;
      described.features.visit_near(describer.extractor().undistorted(pixel).cast<double>(), kNear,
                                    [&](std::uint32_t feature) { is_observed[feature] = true; });
    }
    for (std::uint32_t i = 0; i < is_observed.size(); ++i) {
      if (is_observed[i]) continue;
      view.keypoints.push_back(described.features.keypoints()[i]);
      view.colors.push_back(detail::color_at(image, view.keypoints.back().raw));
      const auto row = std::span(described.descriptors).subspan(i * bytes_each(), bytes_each());
      view.descriptors.insert(view.descriptors.end(), row.begin(), row.end());
    }
    return view;
  }

  // Each view with those nearest to it that look in about its direction.
  std::vector<std::pair<std::uint32_t, std::uint32_t>> pairs_of_views() const {
    constexpr std::size_t kMost = 8;
    const double least_cosine = std::cos(std::numbers::pi / 4.0);
    std::vector<std::pair<std::uint32_t, std::uint32_t>> pairs;
    for (std::uint32_t i = 0; i < views_.size(); ++i) {
      const Rigid3& here = views_[i].world_from_camera;
      std::vector<std::pair<double, std::uint32_t>> others;
      for (std::uint32_t j = 0; j < views_.size(); ++j) {
        const Rigid3& there = views_[j].world_from_camera;
        if (j == i || here.rotation().col(2).dot(there.rotation().col(2)) < least_cosine) continue;
        others.emplace_back((there.translation() - here.translation()).norm(), j);
      }
      std::ranges::sort(others);
      others.resize(std::min(others.size(), kMost));
      for (const auto& [distance, j] : others) pairs.push_back(std::minmax(i, j));
    }
    std::ranges::sort(pairs);
    const auto repeated = std::ranges::unique(pairs);
    pairs.erase(repeated.begin(), repeated.end());
    return pairs;
  }

  // Features that are alike and lie on lines of sight that meet.
  std::vector<std::pair<std::uint32_t, std::uint32_t>> matches_of(const NewView& a,
                                                                  const NewView& b) const {
    constexpr double kRatio = 0.8;  // Lowe 2004
    const auto norm = detail::norm_of(kind_);
    const bool is_squared = norm == detail::descriptor_kernel::Norm::kSquaredBytes;
    const double ratio = is_squared ? kRatio * kRatio : kRatio;
    using detail::descriptor_kernel::nearest_both_ways;
    const auto of_a = nearest_both_ways(a.descriptors, b.descriptors, bytes_each(), norm).of_a;
    const auto of_b = nearest_both_ways(b.descriptors, a.descriptors, bytes_each(), norm).of_a;
    std::vector<std::pair<std::uint32_t, std::uint32_t>> matches;
    for (std::uint32_t i = 0; i < of_a.size(); ++i) {
      const auto& [j, distance, second] = of_a[i];
      if (j >= of_b.size() || of_b[j].index != i) continue;
      // Either way, so that the order of the images does not matter.
      if (distance > ratio * std::min(second, of_b[j].second)) continue;
      const auto x = meeting({a.ray(i), b.ray(j)}, {a.world_from_camera.translation(),
                                                    b.world_from_camera.translation()});
      if (x && a.shows(*x, i) && b.shows(*x, j)) matches.emplace_back(i, j);
    }
    return matches;
  }

  // The point nearest to lines of sight, from their directions and centres.
  static std::optional<Eigen::Vector3d> meeting(const std::vector<Eigen::Vector3d>& rays,
                                                const std::vector<Eigen::Vector3d>& centres) {
    Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
    Eigen::Vector3d right = Eigen::Vector3d::Zero();
    for (std::size_t i = 0; i < rays.size(); ++i) {
      const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - rays[i] * rays[i].transpose();
      sum += across;
      right += across * centres[i];
    }
    const Eigen::Vector3d x = sum.ldlt().solve(right);
    return x.allFinite() ? std::optional(x) : std::nullopt;
  }

  std::optional<Eigen::Vector3d> triangulated(const std::vector<Sighting>& seen) const {
    if (seen.size() < 2) return std::nullopt;
    const double most_cosine = std::cos(2.0 * std::numbers::pi / 180.0);
    std::vector<Eigen::Vector3d> rays;
    std::vector<Eigen::Vector3d> centres;
    double least = 1.0;
    for (std::size_t i = 0; i < seen.size(); ++i) {
      if (i > 0 && seen[i].view == seen[i - 1].view) return std::nullopt;  // a mistaken track
      rays.push_back(view(seen[i]).ray(seen[i].feature));
      centres.push_back(view(seen[i]).world_from_camera.translation());
      for (std::size_t j = 0; j < i; ++j) least = std::min(least, rays[j].dot(rays[i]));
    }
    if (least > most_cosine) return std::nullopt;
    const auto x = meeting(rays, centres);
    const auto shows_x = [&](const Sighting& one) { return view(one).shows(*x, one.feature); };
    return x && std::ranges::all_of(seen, shows_x) ? x : std::nullopt;
  }

  // By the errors of the features alone.
  Eigen::Matrix3d covariance_of(const Eigen::Vector3d& x, const std::vector<Sighting>& seen) const {
    constexpr double kNoise = 1.0;  // pixels of the octave, as SensorNoise
    Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
    for (const Sighting& one : seen) {
      const NewView& by = view(one);
      const Eigen::Vector3d ray = by.ray(one.feature);
      const double distance = (x - by.world_from_camera.translation()).norm();
      const double across =
          kNoise * by.scales[by.keypoints[one.feature].octave] * distance / by.pinhole.fx;
      information += (Eigen::Matrix3d::Identity() - ray * ray.transpose()) / (across * across);
    }
    return information.inverse();
  }

  // Whether a landmark of the map appears at the same place.
  static bool has_near(const BatchTree& known, const Eigen::Vector3d& x, const NewView& view) {
    const double radius = kNear * (view.camera_from_world * x).z() / view.pinhole.fx;
    std::array<Neighbor, 1> nearest;
    return known.nearest(x, nearest, radius * radius) > 0;
  }

  const LandmarkMap& map_;
  const FeatureOptions& options_;
  const Execution& execution_;
  detail::ImageDescriptor kind_;
  std::vector<std::vector<Pixel>> observed_;  // by frame
  std::vector<NewView> views_;
};

void add_landmarks(const NewLandmarkSearch& search, std::span<const NewLandmark> found,
                   MapTables& tables) {
  LandmarkTable& landmarks = tables.landmarks;
  ObservationTable& observations = tables.observations;
  LandmarkId next = next_free_id(std::span<const LandmarkId>(landmarks.ids));
  landmarks.colors.resize(landmarks.ids.size());
  if (observations.offsets.empty()) observations.offsets.resize(landmarks.ids.size() + 1, 0);
  const bool has_covariances = !landmarks.covariances.empty();
  const std::size_t old_rows = observations.frames.size();
  const DescriptorNorm norm = descriptor_norm(landmarks.descriptors->kind);
  for (const NewLandmark& landmark : found) {
    landmarks.ids.push_back(LandmarkId{next.value++});
    landmarks.positions.push_back(landmark.position);
    std::vector<std::span<const std::uint8_t>> descriptors;
    for (const Sighting& one : landmark.seen) {
      observations.frames.push_back(search.view(one).frame);
      observations.pixels.push_back(search.view(one).keypoints[one.feature].raw);
      descriptors.push_back(search.descriptor(one));
    }
    observations.offsets.push_back(observations.frames.size());
    append_distinct(*landmarks.descriptors, descriptors, norm);
    const Sighting& first = landmark.seen.front();
    landmarks.colors.push_back(search.view(first).colors[first.feature]);
    if (has_covariances) landmarks.covariances.push_back(landmark.covariance);
  }
  constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
  for (NamedColumn& column : landmarks.columns)
    column.values.resize(landmarks.ids.size(), kUnknown);
  const std::size_t rows = observations.frames.size();
  detail::extend(observations.keypoints, rows);
  detail::extend(observations.depths, rows);
  detail::extend(observations.octaves, rows);
  std::size_t row = old_rows;
  for (const NewLandmark& landmark : found) {
    for (const Sighting& one : landmark.seen) {
      if (observations.octaves.empty()) break;
      observations.octaves[row++] = search.view(one).keypoints[one.feature].octave;
    }
  }
  detail::extend(observations.sources, rows);
  detail::extend(observations.sigmas_px, rows);
}

}  // namespace

LandmarkMap with_new_landmarks(const LandmarkMap& map, std::span<const FrameIndex> frames,
                               const std::function<ColorImage(FrameIndex)>& image_of,
                               const FeatureOptions& features, const Execution& execution) {
  const NewLandmarkSearch search(map, frames, image_of, features, execution);
  const std::vector<NewLandmark> found = search.find();
  MapTables tables = LandmarkMap(map).tables();
  add_landmarks(search, found, tables);
  tables.info.provenance.push_back(
      fmt::format("{} landmarks found in {} images", found.size(), frames.size()));
  return with_content_uuid(LandmarkMap(std::move(tables)));
}

}  // namespace cairn
