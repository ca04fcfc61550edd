// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/alignment/detail/search/descriptor_matches.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <utility>

#include "cairn/alignment/detail/cloud_scales.hpp"
#include "cairn/core/detail/descriptor_kernel.hpp"
#include "cairn/geometry/similarity3.hpp"
#include "cairn/map/operations.hpp"
#include "cairn/registration/neighbors/batch_tree.hpp"

namespace cairn::detail {
namespace {

// Number of compared pairs of landmarks.
constexpr std::size_t kMostPairs = std::size_t{1} << 26;
// The same of rows, if landmarks have several.
constexpr std::size_t kMostRowPairs = std::size_t{1} << 28;
constexpr std::uint32_t kNone = detail::descriptor_kernel::Nearest::kNone;
constexpr double kThing = 0.25;  // radius of an object that may occur twice, in extents of a map
constexpr std::uint32_t kMostDifferingBits = 4;  // a match differs in at most one bit of so many
// Square of Lowe's ratio.
constexpr double kMostRatio = 0.85 * 0.85;
// Landmarks within this radius, in extents of a map, count as one thing.
constexpr double kSpot = 0.01;
constexpr std::size_t kOnSpot = 8;  // nearest landmarks among which a spot's are found

// Rows of the known descriptors among the first landmarks, and the landmark of each.
struct Rows {
  std::vector<std::uint32_t> landmarks;
  std::vector<std::uint8_t> bytes;
  bool has_several = false;  // whether a landmark has several rows
};

// A number for each of the first landmarks, equal for the landmarks on one spot. A map often contains one thing as
// several landmarks, because tracks end.
std::vector<std::uint32_t> spots_of(const LandmarkCloud& cloud, std::size_t first) {
  const auto positions = std::span(cloud.positions).first(std::min(first, cloud.size()));
  const BatchTree tree(positions);
  const double radius = kSpot * cloud_extent(cloud);
  std::vector<std::uint32_t> spots;
  std::array<Neighbor, kOnSpot> near;
  for (std::uint32_t i = 0; i < positions.size(); ++i) {
    const std::size_t found = tree.nearest(positions[i], near, radius * radius);
    std::uint32_t spot = i;
    for (const Neighbor& one : std::span(near).first(found)) {
      const bool leads = one.index < i && spots[one.index] == one.index;
      if (spot == i && leads) spot = one.index;
    }
    spots.push_back(spot);
  }
  return spots;
}

// @param most largest number of descriptors per landmark
Rows rows_of(const LandmarkCloud& cloud, std::size_t first, std::size_t most) {
  const DescriptorColumn& column = *cloud.descriptors;
  Rows rows;
  for (std::uint32_t i = 0; i < std::min(first, cloud.size()); ++i) {
    const std::size_t count = std::min(column.count(i), most);
    for (std::size_t k = 0; k < count; ++k) {
      rows.landmarks.push_back(i);
      const auto bytes = column.descriptor(i, k);
      rows.bytes.insert(rows.bytes.end(), bytes.begin(), bytes.end());
    }
    rows.has_several = rows.has_several || count > 1;
  }
  return rows;
}

// Rows of both clouds with as many descriptors of each landmark as kMostRowPairs allows.
std::pair<Rows, Rows> affordable_rows(const LandmarkCloud& source, std::size_t source_count,
                                      const LandmarkCloud& target, std::size_t target_count) {
  for (std::size_t most = kMostDescriptorsEach;; --most) {
    std::pair<Rows, Rows> rows = {rows_of(source, source_count, most),
                                  rows_of(target, target_count, most)};
    const std::size_t pairs = rows.first.landmarks.size() * rows.second.landmarks.size();
    if (pairs <= kMostRowPairs || most == 1) return rows;
  }
}

// A landmark's nearest landmark in the other cloud, by its best row.
struct NearestLandmark {
  std::uint32_t landmark = kNone;
  std::uint32_t owner = kNone;   // owner of that landmark's rows
  std::uint32_t first = kNone;   // difference
  std::uint32_t second = kNone;  // of the nearest row of another owner
};

// The nearest landmark of each of the `count` landmarks of the cloud with these rows.
// @param owners owners of the other rows, as for nearest_both_ways()
std::vector<NearestLandmark> by_landmark(
    std::span<const detail::descriptor_kernel::Nearest> nearest, const Rows& rows,
    const Rows& others, std::span<const std::uint32_t> owners, std::size_t count) {
  std::vector<NearestLandmark> result(count);
  for (std::size_t i = 0; i < nearest.size(); ++i) {
    if (nearest[i].index == kNone) continue;
    NearestLandmark& best = result[rows.landmarks[i]];
    const std::uint32_t owner = owners[nearest[i].index];
    if (nearest[i].first < best.first) {
      // What was nearest competes only if it has another owner.
      const std::uint32_t former = best.owner == owner ? best.second : best.first;
      best = {others.landmarks[nearest[i].index], owner, nearest[i].first,
              std::min(former, nearest[i].second)};
    } else {
      best.second =
          std::min(best.second, owner == best.owner ? nearest[i].second : nearest[i].first);
    }
  }
  return result;
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

bool have_like_descriptors(const LandmarkCloud& a, const LandmarkCloud& b) {
  return a.descriptors && b.descriptors && a.descriptors->kind == b.descriptors->kind &&
         a.descriptors->bytes_each == b.descriptors->bytes_each;
}

bool DescriptorMatches::compares_all(const LandmarkCloud& source, const LandmarkCloud& target) {
  return affordable(source.size(), target.size()) == std::pair(source.size(), target.size());
}

DescriptorMatches::DescriptorMatches(const LandmarkCloud& of_source, const LandmarkCloud& of_target,
                                     std::span<const DescriptorMatch> identities)
    : possible_(!identities.empty() || have_like_descriptors(of_source, of_target)),
      identities_(identities.size()),
      is_identity_(of_source.size(), 0),
      matches_(identities.begin(), identities.end()) {
  if (!possible_) return;
  for (const DescriptorMatch& match : identities) is_identity_[match.source] = 1;
  if (have_like_descriptors(of_source, of_target)) add_alike(of_source, of_target);
  for (const DescriptorMatch& match : matches_) {
    source_places_.push_back(of_source.positions[match.source]);
    target_places_.push_back(of_target.positions[match.target]);
  }
  source_extent_ = cloud_extent(of_source);
  target_extent_ = cloud_extent(of_target);
}

void DescriptorMatches::add_alike(const LandmarkCloud& of_source, const LandmarkCloud& of_target) {
  std::vector<char> target_is_known(of_target.size(), 0);
  for (const DescriptorMatch& match : matches_) target_is_known[match.target] = 1;
  const auto [source_count, target_count] = affordable(of_source.size(), of_target.size());
  const auto [source, target] = affordable_rows(of_source, source_count, of_target, target_count);
  const std::size_t bytes_each = of_source.descriptors->bytes_each;
  const bool binary = is_binary(of_source.descriptors->kind);
  // Landmarks on one spot do not compete for the ratio, which only bytes need.
  std::vector<std::uint32_t> owners = target.landmarks;
  if (!binary) {
    const std::vector<std::uint32_t> spots = spots_of(of_target, target_count);
    for (std::uint32_t& owner : owners) owner = spots[owner];
  }
  using detail::descriptor_kernel::Norm;
  const auto nearest = detail::descriptor_kernel::nearest_both_ways(
      source.bytes, target.bytes, bytes_each, binary ? Norm::kHamming : Norm::kSquaredBytes,
      binary && !target.has_several ? std::span<const std::uint32_t>()
                                    : std::span<const std::uint32_t>(owners));
  const auto from_source = by_landmark(nearest.of_a, source, target, owners, of_source.size());
  const auto from_target =
      by_landmark(nearest.of_b, target, source, source.landmarks, of_target.size());
  for (std::uint32_t i = 0; i < from_source.size(); ++i) {
    const NearestLandmark& there = from_source[i];
    if (there.landmark == kNone || from_target[there.landmark].landmark != i) continue;
    const bool distinct =
        binary ? kMostDifferingBits * there.first <= 8 * bytes_each
               : static_cast<double>(there.first) <= kMostRatio * static_cast<double>(there.second);
    if (!distinct || is_identity(i) || target_is_known[there.landmark] != 0) continue;
    matches_.push_back({i, there.landmark, there.first});
  }
  std::stable_sort(matches_.begin() + static_cast<std::ptrdiff_t>(identities_), matches_.end(),
                   [](const DescriptorMatch& a, const DescriptorMatch& b) {
                     return a.difference < b.difference;
                   });
}

DescriptorAgreement DescriptorMatches::agreement(const Similarity3& pose, double radius,
                                                 std::size_t partners) const {
  DescriptorAgreement result;
  result.matches = matches_.size();
  result.identities = identities_;
  const std::vector<Eigen::Vector3d> moved = moved_points(source_places_, pose);
  const double squared = radius * radius;
  std::vector<Eigen::Vector3d> agreeing;
  for (std::size_t i = 0; i < moved.size(); ++i) {
    if ((moved[i] - target_places_[i]).squaredNorm() > squared) continue;
    agreeing.push_back(moved[i]);
    result.identical += i < identities_ ? 1 : 0;
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

}  // namespace cairn::detail
