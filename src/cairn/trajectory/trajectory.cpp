// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/trajectory/trajectory.hpp"

#include <algorithm>
#include <cmath>
#include <tuple>

#include <fmt/format.h>

#include "cairn/core/error.hpp"

namespace cairn {

Trajectory::Trajectory(std::vector<TimedPose> poses) : poses_(std::move(poses)) {
  for (std::size_t i = 0; i < poses_.size(); ++i) {
    const double time = poses_[i].timestamp_s;
    if (!std::isfinite(time) || !poses_[i].world_from_camera.matrix().allFinite()) {
      throw Error(ErrorKind::kInput, fmt::format("pose {}", i), "not finite", "finite numbers");
    }
    if (i > 0 && time <= poses_[i - 1].timestamp_s) {
      throw Error(ErrorKind::kInput, fmt::format("pose {}", i),
                  fmt::format("timestamp {:.6f} after {:.6f}", time, poses_[i - 1].timestamp_s),
                  "ascending timestamps, each once");
    }
  }
}

double Trajectory::duration_s() const {
  return empty() ? 0.0 : poses_.back().timestamp_s - poses_.front().timestamp_s;
}

double Trajectory::length() const {
  double sum = 0.0;
  for (std::size_t i = 1; i < poses_.size(); ++i) {
    sum +=
        (poses_[i].world_from_camera.translation() - poses_[i - 1].world_from_camera.translation())
            .norm();
  }
  return sum;
}

PosePairs associate(const Trajectory& a, const Trajectory& b, double max_difference_s) {
  struct Candidate {
    double difference_s;
    std::size_t a;
    std::size_t b;
  };
  std::vector<Candidate> candidates;
  std::size_t first = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const double time = a.poses()[i].timestamp_s;
    while (first < b.size() && b.poses()[first].timestamp_s <= time - max_difference_s) ++first;
    for (std::size_t j = first; j < b.size(); ++j) {
      const double difference = b.poses()[j].timestamp_s - time;
      if (difference >= max_difference_s) break;
      candidates.push_back({std::abs(difference), i, j});
    }
  }
  std::sort(candidates.begin(), candidates.end(), [](const Candidate& x, const Candidate& y) {
    return std::tie(x.difference_s, x.a, x.b) < std::tie(y.difference_s, y.a, y.b);
  });
  std::vector<bool> a_taken(a.size(), false);
  std::vector<bool> b_taken(b.size(), false);
  PosePairs pairs;
  for (const Candidate& candidate : candidates) {
    if (a_taken[candidate.a] || b_taken[candidate.b]) continue;
    a_taken[candidate.a] = b_taken[candidate.b] = true;
    pairs.emplace_back(candidate.a, candidate.b);
  }
  std::sort(pairs.begin(), pairs.end());
  return pairs;
}

}  // namespace cairn
