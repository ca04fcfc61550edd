// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/placement/detail/descriptor_matches.hpp"

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>

#include "cairn/geometry/moved_points.hpp"
#include "cairn/placement/descriptor_kernel.hpp"
#include "cairn/placement/descriptors.hpp"
#include "cairn/placement/scales.hpp"

namespace cairn {
namespace {

constexpr std::size_t kMostPairs = std::size_t{1} << 26;  // of descriptors that are compared
constexpr double kThing = 0.25;  // radius of an object that may occur twice, in extents of a map
constexpr std::uint32_t kMostBits = 4;  // a match differs in at most one of so many bits
// Square of Lowe's ratio.
constexpr double kMostRatio = 0.85 * 0.85;

// Rows of the known descriptors among the first landmarks.
struct Rows {
  std::vector<std::uint32_t> landmarks;
  std::vector<std::uint8_t> bytes;
};

Rows rows_of(const LandmarkCloud& cloud, std::size_t first) {
  const DescriptorColumn& column = *cloud.descriptors;
  Rows rows;
  for (std::uint32_t i = 0; i < std::min(first, cloud.size()); ++i) {
    if (column.known[i] == 0) continue;
    rows.landmarks.push_back(i);
    const auto begin = column.bytes.begin() + static_cast<std::ptrdiff_t>(i * column.bytes_each);
    rows.bytes.insert(rows.bytes.end(), begin,
                      begin + static_cast<std::ptrdiff_t>(column.bytes_each));
  }
  return rows;
}

// Numbers of landmarks to compare: all, or equal numbers of both clouds within kMostPairs.
std::pair<std::size_t, std::size_t> affordable(std::size_t source, std::size_t target) {
  if (source * target <= kMostPairs) return {source, target};
  const auto side = static_cast<std::size_t>(std::sqrt(static_cast<double>(kMostPairs)));
  if (source < side) return {source, kMostPairs / source};
  if (target < side) return {kMostPairs / target, target};
  return {side, side};
}

// Largest number of places within the radius of one of them.
std::size_t largest_cluster(std::span<const Eigen::Vector3d> places, double radius) {
  std::size_t most = 0;
  for (const Eigen::Vector3d& centre : places) {
    const auto inside =
        std::count_if(places.begin(), places.end(), [&](const Eigen::Vector3d& place) {
          return (place - centre).squaredNorm() <= radius * radius;
        });
    most = std::max(most, static_cast<std::size_t>(inside));
  }
  return most;
}

}  // namespace

DescriptorMatches::DescriptorMatches(const CentredPair& pair) {
  if (!have_like_descriptors(pair.source(), pair.target())) return;
  possible_ = true;
  const auto [source_count, target_count] = affordable(pair.source().size(), pair.target().size());
  const Rows source = rows_of(pair.source(), source_count);
  const Rows target = rows_of(pair.target(), target_count);
  const std::size_t bytes_each = pair.source().descriptors->bytes_each;
  const bool binary = is_binary(pair.source().descriptors->kind);
  using descriptor_kernel::Norm;
  const auto nearest = descriptor_kernel::nearest_both_ways(
      source.bytes, target.bytes, bytes_each, binary ? Norm::kHamming : Norm::kSquaredBytes);
  for (std::uint32_t i = 0; i < nearest.of_a.size(); ++i) {
    const auto& there = nearest.of_a[i];
    if (there.index >= nearest.of_b.size() || nearest.of_b[there.index].index != i) continue;
    const bool distinct =
        binary ? kMostBits * there.first <= 8 * bytes_each
               : static_cast<double>(there.first) <= kMostRatio * static_cast<double>(there.second);
    if (!distinct) continue;
    matches_.push_back({source.landmarks[i], target.landmarks[there.index], there.first});
  }
  std::stable_sort(matches_.begin(), matches_.end(),
                   [](const DescriptorMatch& a, const DescriptorMatch& b) {
                     return a.difference < b.difference;
                   });
  for (const DescriptorMatch& match : matches_) {
    source_places_.push_back(pair.source().positions[match.source]);
    target_places_.push_back(pair.target().positions[match.target]);
  }
  source_extent_ = cloud_extent(pair.source());
  target_extent_ = cloud_extent(pair.target());
}

DescriptorAgreement DescriptorMatches::agreement(const Similarity3& pose, double radius,
                                                 std::size_t partners) const {
  DescriptorAgreement result;
  result.matches = matches_.size();
  const std::vector<Eigen::Vector3d> moved = moved_points(source_places_, pose);
  const double squared = radius * radius;
  std::vector<Eigen::Vector3d> agreeing;
  for (std::size_t i = 0; i < moved.size(); ++i) {
    if ((moved[i] - target_places_[i]).squaredNorm() <= squared) agreeing.push_back(moved[i]);
  }
  result.agreeing = agreeing.size();
  result.spread =
      agreeing.size() -
      largest_cluster(agreeing, kThing * std::min(pose.scale() * source_extent_, target_extent_));
  if (moved.empty()) return result;
  const std::size_t others = std::min(partners, moved.size() - 1);
  std::size_t met = 0;
  for (std::size_t shift = 1; shift <= others; ++shift) {
    for (std::size_t i = 0; i < moved.size(); ++i) {
      const std::size_t j = i + shift < moved.size() ? i + shift : i + shift - moved.size();
      if ((moved[i] - target_places_[j]).squaredNorm() <= squared) ++met;
    }
  }
  if (others > 0) result.expected = static_cast<double>(met) / static_cast<double>(others);
  return result;
}

}  // namespace cairn
