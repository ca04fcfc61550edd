// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/detail/landmark_matching.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include "cairn/core/detail/hamming.hpp"

namespace cairn::detail {
namespace {

constexpr int kNone = std::numeric_limits<int>::max();

// Keeps the most similar match of each keypoint; ties: the first.
std::vector<LandmarkMatch> one_per_keypoint(const std::vector<LandmarkMatch>& matches,
                                            std::size_t keypoints) {
  std::vector<std::optional<LandmarkMatch>> best(keypoints);
  for (const LandmarkMatch& match : matches) {
    auto& entry = best[match.keypoint];
    if (!entry || match.distance < entry->distance) entry = match;
  }
  std::vector<LandmarkMatch> kept;
  for (const auto& entry : best) {
    if (entry) kept.push_back(*entry);
  }
  return kept;
}

}  // namespace

std::optional<ExpectedAppearance> expected_appearance(const SensorModel& sensor, cv::Size image,
                                                      const TrackedLandmark& landmark,
                                                      const Rigid3& camera_from_world,
                                                      const Eigen::Vector3d& camera_centre) {
  const Eigen::Vector3d x_in_camera = camera_from_world * landmark.position;
  constexpr double kNearest = 0.1;  // m
  if (x_in_camera.z() < kNearest) return std::nullopt;
  ExpectedAppearance appearance;
  appearance.pixel = sensor.pinhole().project(x_in_camera);
  if (appearance.pixel.x() < 0.0 || appearance.pixel.y() < 0.0 ||
      appearance.pixel.x() > image.width - 1 || appearance.pixel.y() > image.height - 1) {
    return std::nullopt;
  }
  const Eigen::Vector3d ray = landmark.position - camera_centre;
  const double distance = ray.norm();
  appearance.cos_view = ray.dot(landmark.viewing_direction) / distance;
  constexpr double kMostAside = 0.5;  // cos 60°
  if (appearance.cos_view < kMostAside) return std::nullopt;
  appearance.octave = sensor.octave_of(landmark.reference_distance_m / distance);
  if (appearance.octave < -1.5 || appearance.octave > sensor.octaves() + 0.5) return std::nullopt;
  return appearance;
}

std::vector<LandmarkMatch> match_near(const LandmarkGraph& graph, const Features& features,
                                      std::span<const LandmarkIndex> landmarks,
                                      std::span<const ExpectedAppearance> appearances,
                                      const std::vector<bool>& taken, double radius_pixels,
                                      int max_distance, double max_ratio) {
  const SensorModel& sensor = graph.sensor();
  std::vector<LandmarkMatch> matches;
  for (std::size_t i = 0; i < landmarks.size(); ++i) {
    const ExpectedAppearance& appearance = appearances[i];
    const int octave =
        std::clamp(static_cast<int>(std::lround(appearance.octave)), 0, sensor.octaves() - 1);
    const Descriptor& descriptor = graph.landmark(landmarks[i]).descriptor;
    // From the side, the patch and the detected position of its corner change.
    constexpr double kFrontal = 0.998;
    const double radius =
        radius_pixels * sensor.scale(octave) * (appearance.cos_view > kFrontal ? 0.7 : 1.0);
    int best = kNone;
    int second = kNone;
    std::uint32_t best_keypoint = 0;
    int best_octave = -1;
    int second_octave = -2;
    features.visit_near(appearance.pixel, radius, [&](std::uint32_t keypoint) {
      if (taken[keypoint]) return;
      const int at = features.keypoints()[keypoint].octave;
      if (at < octave - 1 || at > octave + 1) return;
      const int distance = detail::hamming_distance(descriptor, features.descriptors()[keypoint]);
      if (distance < best) {
        second = best;
        second_octave = best_octave;
        best = distance;
        best_octave = at;
        best_keypoint = keypoint;
      } else if (distance < second) {
        second = distance;
        second_octave = at;
      }
    });
    if (best > max_distance) continue;
    // The same corner on the next octave does not count as the second best.
    if (second != kNone && second_octave == best_octave && best > max_ratio * second) continue;
    matches.push_back({best_keypoint, landmarks[i], best});
  }
  return one_per_keypoint(matches, features.size());
}

std::vector<LandmarkMatch> match_by_descriptor(const LandmarkGraph& graph, std::uint32_t keyframe,
                                               const Features& features) {
  const Keyframe& known = graph.keyframes()[keyframe];
  constexpr int kMaxDistance = 60;
  constexpr double kMaxRatio = 0.8;
  std::vector<LandmarkMatch> matches;
  std::vector<float> turns;
  for (std::uint32_t i = 0; i < known.features.size(); ++i) {
    if (!known.landmarks[i]) continue;
    const Descriptor& descriptor = known.features.descriptors()[i];
    int best = kNone;
    int second = kNone;
    std::uint32_t best_keypoint = 0;
    for (std::uint32_t j = 0; j < features.size(); ++j) {
      const int distance = detail::hamming_distance(descriptor, features.descriptors()[j]);
      if (distance < best) {
        second = best;
        best = distance;
        best_keypoint = j;
      } else if (distance < second) {
        second = distance;
      }
    }
    if (best > kMaxDistance || (second != kNone && best > kMaxRatio * second)) continue;
    matches.push_back({best_keypoint, *known.landmarks[i], best});
    turns.push_back(features.keypoints()[best_keypoint].angle -
                    known.features.keypoints()[i].angle);
  }
  return one_per_keypoint(keep_common_turn(std::move(matches), turns), features.size());
}

std::vector<LandmarkMatch> keep_common_turn(std::vector<LandmarkMatch> matches,
                                            std::span<const float> turns) {
  constexpr int kBins = 30;
  std::array<int, kBins> votes{};
  const auto bin_of = [](float turn) {
    const double share = turn / (2.0 * std::numbers::pi);
    return static_cast<int>((share - std::floor(share)) * kBins) % kBins;
  };
  for (const float turn : turns) ++votes[static_cast<std::size_t>(bin_of(turn))];
  const auto top = std::distance(votes.begin(), std::max_element(votes.begin(), votes.end()));
  std::vector<LandmarkMatch> kept;
  for (std::size_t i = 0; i < matches.size(); ++i) {
    const auto away = std::abs(bin_of(turns[i]) - top);
    if (std::min<std::ptrdiff_t>(away, kBins - away) <= 1) kept.push_back(matches[i]);
  }
  return kept;
}

}  // namespace cairn::detail
