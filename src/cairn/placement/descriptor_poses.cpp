// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/placement/descriptor_poses.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <limits>
#include <numeric>
#include <utility>

#include "cairn/placement/descriptors.hpp"
#include "cairn/registration/estimation/point_to_point.hpp"

namespace cairn {
namespace {

constexpr std::size_t kFewestPairs = 4;  // of a pose: three fit any triple

struct Nearest {
  std::uint32_t index = 0;
  std::uint32_t distance = std::numeric_limits<std::uint32_t>::max();
};

// For each descriptor the closest of the others; of equally close ones, the first.
template <class Distance>
std::vector<Nearest> nearest_of_each(const Descriptors& queries, const Descriptors& others,
                                     const Distance& distance, const Executor& executor) {
  std::vector<Nearest> found(queries.size());
  executor.for_blocks(queries.size(), 64, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      for (std::uint32_t j = 0; j < others.size(); ++j) {
        const std::uint32_t d = distance(queries.words(i), others.words(j));
        if (d < found[i].distance) found[i] = {j, d};
      }
    }
  });
  return found;
}

// Two landmarks that may be one.
struct LikePair {
  Eigen::Vector3d source;
  Eigen::Vector3d target;
  std::uint32_t distance = 0;
};

// Those that are each other's closest, the closest first.
template <class Distance>
std::vector<LikePair> like_pairs(const CentredPair& pair, const Descriptors& source,
                                 const Descriptors& target, const Distance& distance,
                                 const Executor& executor) {
  const std::vector<Nearest> there = nearest_of_each(source, target, distance, executor);
  const std::vector<Nearest> back = nearest_of_each(target, source, distance, executor);
  std::vector<LikePair> pairs;
  for (std::size_t i = 0; i < there.size(); ++i) {
    if (target.size() == 0 || back[there[i].index].index != i) continue;
    pairs.push_back({pair.source().positions[source.landmark(i)],
                     pair.target().positions[target.landmark(there[i].index)], there[i].distance});
  }
  std::stable_sort(pairs.begin(), pairs.end(),
                   [](const LikePair& a, const LikePair& b) { return a.distance < b.distance; });
  return pairs;
}

// Which pairs agree with which: as far from each other here as there, and far enough to tell a pose.
class Consistency {
 public:
  Consistency(const std::vector<LikePair>& pairs, double tolerance) : agrees_(pairs.size()) {
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      for (std::size_t j = 0; j < pairs.size(); ++j) {
        const double here = (pairs[i].source - pairs[j].source).norm();
        const double there = (pairs[i].target - pairs[j].target).norm();
        if (std::min(here, there) > kLeastLength * tolerance &&
            std::abs(here - there) < tolerance) {
          agrees_[i].push_back(static_cast<std::uint32_t>(j));
        }
      }
    }
  }

  const std::vector<std::uint32_t>& with(std::size_t i) const { return agrees_[i]; }
  std::vector<std::uint32_t> with_both(std::size_t i, std::size_t j) const {
    std::vector<std::uint32_t> both;
    std::set_intersection(agrees_[i].begin(), agrees_[i].end(), agrees_[j].begin(),
                          agrees_[j].end(), std::back_inserter(both));
    return both;
  }

 private:
  static constexpr double kLeastLength = 4.0;  // in tolerances

  std::vector<std::vector<std::uint32_t>> agrees_;
};

struct Proposal {
  Rigid3 pose;
  std::size_t count = 0;  // of the pairs that it brings together
};

std::vector<std::uint32_t> brought_together(const std::vector<LikePair>& pairs, const Rigid3& pose,
                                            double tolerance) {
  std::vector<std::uint32_t> together;
  for (std::uint32_t i = 0; i < pairs.size(); ++i) {
    if ((pose * pairs[i].source - pairs[i].target).squaredNorm() < tolerance * tolerance) {
      together.push_back(i);
    }
  }
  return together;
}

Rigid3 pose_of(const std::vector<LikePair>& pairs, const std::vector<std::uint32_t>& chosen) {
  std::vector<Eigen::Vector3d> from;
  std::vector<Eigen::Vector3d> to;
  for (const std::uint32_t i : chosen) {
    from.push_back(pairs[i].source);
    to.push_back(pairs[i].target);
  }
  return closest_motion(from, to);
}

std::vector<Proposal> proposals(const std::vector<LikePair>& pairs, Random& random,
                                const DescriptorPoseOptions& options) {
  std::vector<Proposal> found;
  if (pairs.size() < kFewestPairs) return found;
  const Consistency consistency(pairs, options.tolerance);
  for (int draw = 0; draw < options.draws; ++draw) {
    const auto first = static_cast<std::uint32_t>(random.index(pairs.size()));
    const auto& others = consistency.with(first);
    if (others.size() < kFewestPairs - 1) continue;
    const std::uint32_t second = others[random.index(others.size())];
    const std::vector<std::uint32_t> thirds = consistency.with_both(first, second);
    if (thirds.empty()) continue;
    const std::uint32_t third = thirds[random.index(thirds.size())];
    Rigid3 pose = pose_of(pairs, {first, second, third});
    std::vector<std::uint32_t> together = brought_together(pairs, pose, options.tolerance);
    if (together.size() < kFewestPairs) continue;
    pose = pose_of(pairs, together);
    found.push_back({pose, brought_together(pairs, pose, options.tolerance).size()});
  }
  std::stable_sort(found.begin(), found.end(),
                   [](const Proposal& a, const Proposal& b) { return a.count > b.count; });
  return found;
}

}  // namespace

std::vector<Rigid3> descriptor_poses(const CentredPair& pair, Random random,
                                     const DescriptorPoseOptions& options) {
  if (!have_like_descriptors(pair.source(), pair.target())) return {};
  const Descriptors source(pair.source(), options.sample);
  const Descriptors target(pair.target(), options.sample);
  const auto pairs_by = [&](const auto& difference) {
    return like_pairs(pair, source, target, difference, options.executor);
  };
  std::vector<LikePair> pairs =
      source.binary() ? pairs_by([](const auto& a, const auto& b) { return differing_bits(a, b); })
                      : pairs_by(squared_difference);
  pairs.resize(std::min(pairs.size(), options.matches));
  std::vector<Rigid3> poses;
  for (const Proposal& proposal : proposals(pairs, random, options)) {
    if (poses.size() == options.poses) break;
    // Where it puts the pairs tells it from others.
    const bool known = std::any_of(poses.begin(), poses.end(), [&](const Rigid3& other) {
      double sum = 0.0;
      for (const LikePair& like : pairs) {
        sum += (proposal.pose * like.source - other * like.source).squaredNorm();
      }
      return sum < options.tolerance * options.tolerance * static_cast<double>(pairs.size());
    });
    if (!known) poses.push_back(proposal.pose);
  }
  return poses;
}

}  // namespace cairn
