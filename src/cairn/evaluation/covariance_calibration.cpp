// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/evaluation/covariance_calibration.hpp"

#include <algorithm>
#include <cmath>
#include <string_view>
#include <utility>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/core/statistics.hpp"
#include "cairn/geometry/covariance.hpp"
#include "cairn/geometry/decompositions.hpp"

namespace cairn {
namespace {

std::optional<NeesStatistics> nees_statistics(const std::vector<double>& nees) {
  if (nees.empty()) return std::nullopt;
  NeesStatistics result;
  result.count = nees.size();
  std::size_t inside = 0;
  for (const double value : nees) {
    result.mean += value / static_cast<double>(nees.size());
    inside += value < kNees95 ? 1 : 0;
  }
  result.median = quantile(nees, 0.5);
  result.inside_95 = static_cast<double>(inside) / static_cast<double>(nees.size());
  return result;
}

// Sorts the judged landmarks into bins by one of their properties.
template <class Bound>
std::vector<NeesBin<Bound>> binned(std::span<const LandmarkEstimate> landmarks,
                                   const std::vector<std::optional<double>>& nees,
                                   const std::vector<Bound>& bounds,  // lower, ascending
                                   std::optional<Bound> LandmarkEstimate::*property) {
  std::vector<std::vector<double>> values(bounds.size());
  for (std::size_t i = 0; i < landmarks.size(); ++i) {
    const auto& value = landmarks[i].*property;
    if (!nees[i] || !value) continue;
    const auto above = std::upper_bound(bounds.begin(), bounds.end(), *value) - bounds.begin();
    if (above > 0) values[static_cast<std::size_t>(above - 1)].push_back(*nees[i]);
  }
  std::vector<NeesBin<Bound>> bins;
  for (std::size_t i = 0; i < bounds.size(); ++i) {
    NeesBin<Bound> bin;
    bin.from = bounds[i];
    if (i + 1 < bounds.size()) bin.to = bounds[i + 1];
    bin.statistics = nees_statistics(values[i]);
    bins.push_back(std::move(bin));
  }
  return bins;
}

[[noreturn]] void fail_missing(std::string_view missing) {
  throw Error(ErrorKind::kInput, "covariance calibration",
              fmt::format("the map has no {}", missing), "a map that has");
}

void require_count(std::string_view name, std::size_t count, std::size_t expected,
                   std::string_view of_what) {
  if (count == expected) return;
  throw Error(ErrorKind::kMisuse, name, fmt::format("{} entries", count),
              fmt::format("{}, one a {} of the map", expected, of_what));
}

}  // namespace

std::optional<double> normalised_squared_error(const Eigen::Vector3d& error,
                                               const Eigen::Matrix3d& covariance) {
  constexpr double kSmallestRatio = 1e-14;
  const auto [variances, directions] = symmetric_eigen<3>(covariance);
  if (!(variances[0] > kSmallestRatio * variances[2])) return std::nullopt;
  const Eigen::Vector3d along = directions.transpose() * error;
  return (along.array().square() / variances.array()).sum();
}

CovarianceCalibration calibrate_covariances(std::span<const LandmarkEstimate> landmarks) {
  CovarianceCalibration result;
  result.nees.resize(landmarks.size());
  std::vector<double> judged;
  for (std::size_t i = 0; i < landmarks.size(); ++i) {
    const LandmarkEstimate& landmark = landmarks[i];
    if (!landmark.truth) {
      ++result.without_truth;
    } else if (!landmark.covariance) {
      ++result.without_covariance;
    } else {
      result.nees[i] =
          normalised_squared_error(landmark.estimate - *landmark.truth, *landmark.covariance);
      if (result.nees[i]) {
        judged.push_back(*result.nees[i]);
      } else {
        ++result.singular;
      }
    }
  }
  result.all = nees_statistics(judged);
  result.by_depth =
      binned<double>(landmarks, result.nees, {0.0, 1.0, 2.0, 3.0, 4.0}, &LandmarkEstimate::depth);
  result.by_observations = binned<std::size_t>(landmarks, result.nees, {2, 3, 5, 10, 20},
                                               &LandmarkEstimate::observations);
  return result;
}

std::optional<FrameIndex> first_keyframe(const LandmarkMap& map, LandmarkIndex landmark) {
  const auto frames = map.observing_frames(landmark);
  if (frames.empty()) return std::nullopt;
  const auto& ids = map.frames().ids;
  return *std::min_element(frames.begin(), frames.end(),
                           [&](FrameIndex a, FrameIndex b) { return ids[a.value] < ids[b.value]; });
}

std::vector<LandmarkEstimate> estimates_in_first_keyframe(
    const LandmarkMap& map, std::span<const std::optional<Eigen::Vector3d>> truth_in_keyframe) {
  if (!map.has_observations()) fail_missing("observations");
  if (!map.has_covariances() && map.landmark_count() > 0) fail_missing("landmark covariances");
  require_count("truth_in_keyframe", truth_in_keyframe.size(), map.landmark_count(), "landmark");
  std::vector<LandmarkEstimate> estimates(map.landmark_count());
  for (std::uint32_t i = 0; i < map.landmark_count(); ++i) {
    const LandmarkIndex landmark{i};
    const auto keyframe = first_keyframe(map, landmark);
    LandmarkEstimate& estimate = estimates[i];
    estimate.observations = map.observation_count(landmark);
    if (!keyframe) continue;
    const Rigid3 keyframe_from_world = map.world_from_camera(*keyframe).inverse();
    estimate.estimate = keyframe_from_world * map.landmarks().positions[i];
    estimate.truth = truth_in_keyframe[i];
    if (const auto covariance = map.covariance(landmark)) {
      estimate.covariance = rotated_covariance(*covariance, keyframe_from_world.rotation());
    }
    estimate.depth = estimate.estimate.z();
  }
  return estimates;
}

KeyframePoses keyframe_poses(const LandmarkMap& map, const LandmarkMap& truth) {
  KeyframePoses poses(map.frame_count());
  for (std::uint32_t i = 0; i < map.frame_count(); ++i) {
    const auto found = truth.find(map.frames().ids[i]);
    if (found) poses[i] = truth.world_from_camera(*found);
  }
  return poses;
}

KeyframePoses keyframe_poses(const LandmarkMap& map, const Trajectory& truth,
                             double max_time_difference_s) {
  const auto& timestamps = map.frames().timestamps_s;
  reject_if(timestamps.empty() && map.frame_count() > 0, "true trajectory",
            "the map has no timestamps of its frames",
            "a map that has, to find their poses by time");
  KeyframePoses poses(map.frame_count());
  for (std::uint32_t i = 0; i < timestamps.size(); ++i) {
    if (!timestamps[i]) continue;
    const TimedPose* const nearest = nearest_pose(truth, *timestamps[i]);
    if (nearest != nullptr &&
        std::abs(nearest->timestamp_s - *timestamps[i]) < max_time_difference_s) {
      poses[i] = nearest->world_from_camera;
    }
  }
  return poses;
}

std::vector<std::optional<Eigen::Vector3d>> true_positions_in_first_keyframe(
    const LandmarkMap& map, const LandmarkMap& truth, const KeyframePoses& truth_from_keyframe) {
  require_count("truth_from_keyframe", truth_from_keyframe.size(), map.frame_count(), "frame");
  reject_if(map.info().length_unit != truth.info().length_unit, "true map",
            "its unit of length is not the map's", "maps of one scale");
  std::vector<std::optional<Eigen::Vector3d>> positions(map.landmark_count());
  for (std::uint32_t i = 0; i < map.landmark_count(); ++i) {
    const auto keyframe = first_keyframe(map, LandmarkIndex{i});
    const auto found = truth.find(map.landmarks().ids[i]);
    if (!keyframe || !found || !truth_from_keyframe[keyframe->value]) continue;
    positions[i] =
        truth_from_keyframe[keyframe->value]->inverse() * truth.landmarks().positions[found->value];
  }
  return positions;
}

}  // namespace cairn
