// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/detail/described_landmarks.hpp"

#include <algorithm>

#include "cairn/core/statistics.hpp"
#include "cairn/geometry/detail/centroid.hpp"
#include "cairn/map/operations.hpp"

namespace cairn::detail {
namespace {

constexpr double kExtent = 3.0;  // assumed extent of a map without a scale, metres

// So that limits in metres are also valid for maps in other units.
double free_scale(std::span<const Eigen::Vector3d> positions) {
  if (positions.empty()) return 1.0;
  const Eigen::Vector3d mean = centroid(positions);
  std::vector<double> distances;
  for (const Eigen::Vector3d& position : positions) distances.push_back((position - mean).norm());
  const double middle = upper_median(distances);
  return middle > 0.0 ? kExtent / middle : 1.0;
}

}  // namespace

DescribedLandmarks::DescribedLandmarks(const LandmarkMap& map) {
  const LandmarkTable& landmarks = map.landmarks();
  const DescriptorColumn& column = *landmarks.descriptors;
  bytes_each_ = column.bytes_each;
  for (std::uint32_t i = 0; i < map.landmark_count(); ++i) {
    if (column.known[i] == 0) continue;
    for (std::size_t k = 0; k < column.count(i); ++k) {
      const auto row = column.descriptor(i, k);
      bytes_.insert(bytes_.end(), row.begin(), row.end());
      owners_.push_back(static_cast<std::uint32_t>(indices_.size()));
    }
    begins_.push_back(owners_.size());
    indices_.push_back(i);
    positions_.push_back(landmarks.positions[i]);
    covariances_.push_back(map.covariance(LandmarkIndex{i}).value_or(Eigen::Matrix3d::Zero()));
  }
  add_frames(map);
  if (map.info().length_unit == LengthUnit::kFree) set_scale(free_scale(positions_));
}

void DescribedLandmarks::add_frames(const LandmarkMap& map) {
  if (map.observation_count() == 0) return;
  centres_ = map.frames().translations;
  std::vector<std::size_t> counts(centres_.size(), 0);
  for (const std::uint32_t index : indices_) {
    for (const FrameIndex frame : map.observing_frames(LandmarkIndex{index})) {
      frames_of_.values.push_back(frame.value);
      ++counts[frame.value];
    }
    frames_of_.begins.push_back(frames_of_.values.size());
  }
  for (const std::size_t count : counts) seen_in_.begins.push_back(seen_in_.begins.back() + count);
  seen_in_.values.resize(frames_of_.values.size());
  std::vector<std::size_t> next(seen_in_.begins.begin(), seen_in_.begins.end() - 1);
  for (std::uint32_t i = 0; i < size(); ++i) {
    for (const std::uint32_t frame : frames_of_.row(i)) seen_in_.values[next[frame]++] = i;
  }
}

Sight DescribedLandmarks::sight(std::uint32_t i, const Eigen::Vector3d& centre) const {
  constexpr double kAlikeCosine = 0.94;  // of 20°
  constexpr double kAlikeDistance = 1.5;
  const auto frames = frames_of(i);
  Sight sight;
  if (frames.empty()) return sight;
  sight.cosine = -1.0;
  const Eigen::Vector3d now = centre - position(i);
  for (const std::uint32_t frame : frames) {
    const Eigen::Vector3d then = centres_[frame] - position(i);
    sight.cosine = std::max(sight.cosine, then.dot(now) / (then.norm() * now.norm()));
    sight.alike = sight.alike || are_alike(then, now, kAlikeCosine, kAlikeDistance);
  }
  return sight;
}

void DescribedLandmarks::set_scale(double scale) {
  scale_ = scale;
  for (Eigen::Vector3d& position : positions_) position *= scale;
  for (Eigen::Vector3d& centre : centres_) centre *= scale;
  for (Eigen::Matrix3d& covariance : covariances_) covariance *= scale * scale;
}

}  // namespace cairn::detail
