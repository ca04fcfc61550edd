// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/detail/landmark_graph.hpp"

#include <algorithm>
#include <limits>

#include <Eigen/LU>

#include "cairn/core/detail/hamming.hpp"

namespace cairn::detail {

std::uint32_t LandmarkGraph::add_keyframe(Keyframe keyframe) {
  keyframe.landmarks.assign(keyframe.features.size(), std::nullopt);
  keyframe.depth_disagrees.assign(keyframe.features.size(), false);
  keyframes_.push_back(std::move(keyframe));
  return static_cast<std::uint32_t>(keyframes_.size() - 1);
}

LandmarkIndex LandmarkGraph::add_landmark(KeypointReference reference) {
  const LandmarkIndex index{static_cast<std::uint32_t>(landmarks_.size())};
  const Keyframe& keyframe = keyframes_[reference.keyframe];
  const Keypoint& keypoint = keyframe.features.keypoints()[reference.keypoint];
  TrackedLandmark landmark;
  landmark.position =
      keyframe.world_from_camera *
      sensor_->pinhole().back_project(keypoint.pixel.cast<double>(), keypoint.depth_m);
  landmark.last_seen = keyframe.frame;
  landmark.expected = 1;
  landmark.found = 1;
  landmarks_.push_back(std::move(landmark));
  observe(index, reference);
  refresh(index);
  return index;
}

void LandmarkGraph::observe(LandmarkIndex index, KeypointReference reference) {
  keyframes_[reference.keyframe].landmarks[reference.keypoint] = index;
  landmark(index).observations.push_back(reference);
}

void LandmarkGraph::forget(KeypointReference reference) {
  auto& entry = keyframes_[reference.keyframe].landmarks[reference.keypoint];
  if (!entry) return;
  TrackedLandmark& seen = landmark(*entry);
  std::erase(seen.observations, reference);
  if (seen.appearance && seen.appearance->seen_at == reference) {
    seen.appearance.reset();
    keyframes_[reference.keyframe].features.set_source(reference.keypoint, PixelSource::kCorner);
  }
  entry.reset();
}

std::optional<Eigen::Matrix2d> LandmarkGraph::patch_from_image(
    const TrackedLandmark& landmark, const Rigid3& camera_from_world) const {
  if (!landmark.appearance) return std::nullopt;
  const KeypointReference& reference = landmark.appearance->seen_at;
  const Keyframe& keyframe = keyframes_[reference.keyframe];
  const Keypoint& keypoint = keyframe.features.keypoints()[reference.keypoint];
  const double depth = (keyframe.world_from_camera.inverse() * landmark.position).z();
  if (depth < kNearestDepth) return std::nullopt;
  const Rigid3 camera_from_reference = camera_from_world * keyframe.world_from_camera;
  const Pinhole& pinhole = sensor_->pinhole();
  const Eigen::Vector2d at = keypoint.pixel.cast<double>();
  const double step = sensor_->scale(keypoint.octave);  // one pixel of the patch's level
  const auto seen = [&](const Eigen::Vector2d& pixel) -> std::optional<Eigen::Vector2d> {
    const double there = depth * (1.0 + landmark.appearance->slope.dot(pixel - at));
    const Eigen::Vector3d x = camera_from_reference * pinhole.back_project(pixel, there);
    if (x.z() < kNearestDepth) return std::nullopt;
    return pinhole.project(x);
  };
  const auto middle = seen(at);
  const auto right = seen(at + Eigen::Vector2d(step, 0.0));
  const auto below = seen(at + Eigen::Vector2d(0.0, step));
  if (!middle || !right || !below) return std::nullopt;
  Eigen::Matrix2d image_from_patch;
  image_from_patch << *right - *middle, *below - *middle;
  constexpr double kEdgeOn = 0.05;  // share of an area, below which the patch is not visible
  if (!(image_from_patch.determinant() > kEdgeOn)) return std::nullopt;
  return image_from_patch.inverse();
}

void LandmarkGraph::remove(LandmarkIndex index) {
  for (const KeypointReference& reference : landmark(index).observations) {
    keyframes_[reference.keyframe].landmarks[reference.keypoint].reset();
  }
  landmark(index).observations.clear();
  landmark(index).appearance.reset();
}

void LandmarkGraph::merge(LandmarkIndex from, LandmarkIndex into) {
  const std::vector<KeypointReference> moving = landmark(from).observations;
  const std::uint32_t expected = landmark(from).expected;
  const std::uint32_t found = landmark(from).found;
  const std::size_t last_seen = landmark(from).last_seen;
  remove(from);
  for (const KeypointReference& reference : moving) {
    if (observes(reference.keyframe, into)) continue;
    // It was not aligned with this patch.
    keyframes_[reference.keyframe].features.set_source(reference.keypoint, PixelSource::kCorner);
    observe(into, reference);
  }
  TrackedLandmark& kept = landmark(into);
  std::sort(kept.observations.begin(), kept.observations.end(),
            [](const KeypointReference& a, const KeypointReference& b) {
              return a.keyframe < b.keyframe;
            });
  kept.expected += expected;
  kept.found += found;
  kept.last_seen = std::max(kept.last_seen, last_seen);
  refresh(into);
}

void LandmarkGraph::refresh(LandmarkIndex index) {
  TrackedLandmark& seen = landmark(index);
  if (seen.gone()) return;
  // Chooses among the latest descriptors only, which bounds the work.
  constexpr std::size_t kMost = 8;
  const std::size_t first = seen.observations.size() - std::min(kMost, seen.observations.size());
  const auto descriptor = [&](std::size_t i) -> const Descriptor& {
    const KeypointReference& reference = seen.observations[i];
    return keyframes_[reference.keyframe].features.descriptors()[reference.keypoint];
  };
  int least = std::numeric_limits<int>::max();
  for (std::size_t i = first; i < seen.observations.size(); ++i) {
    int sum = 0;
    for (std::size_t j = first; j < seen.observations.size(); ++j) {
      sum += detail::hamming_distance(descriptor(i), descriptor(j));
    }
    if (sum < least) {
      least = sum;
      seen.descriptor = descriptor(i);
    }
  }
  Eigen::Vector3d directions = Eigen::Vector3d::Zero();
  for (const KeypointReference& reference : seen.observations) {
    directions += (seen.position - keyframes_[reference.keyframe].world_from_camera.translation())
                      .normalized();
  }
  if (directions.norm() > 1e-9) seen.viewing_direction = directions.normalized();
  const KeypointReference& latest = seen.observations.back();
  const Keyframe& keyframe = keyframes_[latest.keyframe];
  seen.reference_distance_m = (seen.position - keyframe.world_from_camera.translation()).norm() *
                              sensor_->scale(keyframe.features.keypoints()[latest.keypoint].octave);
}

bool LandmarkGraph::observes(std::uint32_t keyframe, LandmarkIndex index) const {
  const auto& observations = landmark(index).observations;
  return std::any_of(
      observations.begin(), observations.end(),
      [&](const KeypointReference& reference) { return reference.keyframe == keyframe; });
}

PointMeasurement LandmarkGraph::measurement(KeypointReference reference) const {
  const Keyframe& keyframe = keyframes_[reference.keyframe];
  PointMeasurement measured =
      sensor_->measurement(keyframe.features.keypoints()[reference.keypoint]);
  if (keyframe.depth_disagrees[reference.keypoint]) measured.depth_m = 0.0;
  return measured;
}

std::vector<std::pair<std::uint32_t, std::size_t>> LandmarkGraph::covisible(
    std::uint32_t keyframe) const {
  std::vector<std::size_t> shared(keyframes_.size(), 0);
  for (const auto& index : keyframes_[keyframe].landmarks) {
    if (!index) continue;
    for (const KeypointReference& reference : landmark(*index).observations) {
      ++shared[reference.keyframe];
    }
  }
  shared[keyframe] = 0;
  std::vector<std::pair<std::uint32_t, std::size_t>> neighbours;
  for (std::uint32_t i = 0; i < shared.size(); ++i) {
    if (shared[i] > 0) neighbours.emplace_back(i, shared[i]);
  }
  std::stable_sort(neighbours.begin(), neighbours.end(),
                   [](const auto& a, const auto& b) { return a.second > b.second; });
  return neighbours;
}

}  // namespace cairn::detail
