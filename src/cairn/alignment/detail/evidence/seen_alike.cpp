// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/alignment/detail/evidence/seen_alike.hpp"

#include <algorithm>
#include <cstdint>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include "cairn/alignment/detail/evidence/look_comparison.hpp"
#include "cairn/alignment/detail/search/descriptor_matches.hpp"
#include "cairn/core/detail/descriptor_kernel.hpp"
#include "cairn/map/operations.hpp"

namespace cairn::detail {
namespace {

constexpr std::size_t kPartners = 8;  // nearest target landmarks that are compared
// Of two lines of sight to one point: features hardly change between them.
constexpr double kAlikeCosine = 0.985;    // of 10 degrees
constexpr double kAlikeDistances = 1.25;  // ratio
constexpr double kClose = 0.5;            // matching radii within which landmarks are compared
// Two landmarks are distinctive if no landmark of their own maps that is at least this far away, in matching radii,
// differs from them by at most this multiple of their own difference.
constexpr double kElsewhere = 4.0;
constexpr std::uint32_t kDistinctive = 2;
// Of a larger map, only some descriptors are matched, and their number would not compare with that of what was seen
// alike.
constexpr std::size_t kMostLandmarks = 8192;

// The views of a cloud by the landmarks that they saw.
class Viewers {
 public:
  // @param moved pose that moves the centres
  explicit Viewers(const LandmarkCloud& cloud, const Similarity3& moved = Similarity3()) {
    for (std::uint32_t view = 0; view < cloud.views.size(); ++view) {
      centres_.push_back(moved * cloud.views[view].centre);
      for (const std::uint32_t landmark : cloud.views[view].landmarks) {
        seen_.push_back({landmark, view});
      }
    }
    std::ranges::sort(seen_);
  }

  // Calls visit with the centre of each camera that saw the landmark, until one returns true.
  // @return whether one did
  template <class Visit>
  bool any_of(std::uint32_t landmark, const Visit& visit) const {
    auto seen = std::ranges::lower_bound(seen_, std::pair(landmark, std::uint32_t{0}));
    for (; seen != seen_.end() && seen->first == landmark; ++seen) {
      if (visit(centres_[seen->second])) return true;
    }
    return false;
  }

 private:
  std::vector<Eigen::Vector3d> centres_;
  std::vector<std::pair<std::uint32_t, std::uint32_t>> seen_;  // landmark, view; ascending
};

bool are_alike(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  const double here = a.norm();
  const double there = b.norm();
  return a.dot(b) > kAlikeCosine * here * there && here < kAlikeDistances * there &&
         there < kAlikeDistances * here;
}

using Rows = std::vector<std::uint8_t>;

// All descriptors of a landmark.
Rows rows_of(const DescriptorColumn& column, std::uint32_t landmark) {
  Rows rows;
  for (std::size_t k = 0; k < column.count(landmark); ++k) {
    const auto row = column.descriptor(landmark, k);
    rows.insert(rows.end(), row.begin(), row.end());
  }
  return rows;
}

// What the landmarks of a map look like.
class Looks {
 public:
  // @param elsewhere distance from which a landmark is not the same
  Looks(const LandmarkCloud& cloud, double elsewhere)
      : cloud_(cloud), all_(cloud, cloud.size()), elsewhere_(elsewhere) {}

  // Difference of the most similar descriptors.
  std::uint32_t difference(std::span<const std::uint8_t> a, std::span<const std::uint8_t> b) const {
    const auto norm =
        all_.binary() ? descriptor_kernel::Norm::kHamming : descriptor_kernel::Norm::kSquaredBytes;
    return descriptor_kernel::nearest_pair(a, b, all_.bytes_each(), norm).distance;
  }

  // Whether no landmark elsewhere differs from a landmark by at most so much.
  bool is_unique(std::uint32_t landmark, std::uint32_t most) const {
    const Rows rows = rows_of(*cloud_.descriptors, landmark);
    const Eigen::Vector3d& place = cloud_.positions[landmark];
    for (std::size_t j = 0; j < all_.size(); ++j) {
      if (difference(rows, all_.rows(j)) > most) continue;
      const Eigen::Vector3d& other = cloud_.positions[all_.landmark(j)];
      if ((other - place).squaredNorm() >= elsewhere_ * elsewhere_) return false;
    }
    return true;
  }

 private:
  const LandmarkCloud& cloud_;
  Descriptors all_;
  double elsewhere_;
};

}  // namespace

SeenAlike seen_alike(const PreparedCloud& source, const PreparedCloud& target,
                     const Similarity3& pose, double radius, double enough) {
  const LandmarkCloud& here = source.landmarks();
  const LandmarkCloud& there = target.landmarks();
  if (here.views.empty() || there.views.empty() || !have_like_descriptors(here, there) ||
      std::max(here.size(), there.size()) > kMostLandmarks) {
    return {};
  }
  const Viewers source_viewers(here, pose);
  const Viewers target_viewers(there);
  const std::vector<Eigen::Vector3d> moved = moved_points(source.sample(), pose);
  const auto were_seen_alike = [&](std::uint32_t i, std::uint32_t j) {
    return source_viewers.any_of(i, [&](const Eigen::Vector3d& a) {
      return target_viewers.any_of(
          j, [&](const Eigen::Vector3d& b) { return are_alike(a - moved[i], b - moved[i]); });
    });
  };
  const double close = kClose * radius;
  // Per landmark of the sample: the target landmarks that were seen alike, nearest first.
  std::vector<std::vector<std::uint32_t>> partners(moved.size());
  const auto find = [&](std::size_t i, const NearestList auto& nearest) {
    if (here.descriptors->known[i] == 0) return;
    for (std::size_t k = 0; k < nearest.size(); ++k) {
      if (nearest.squared_distance(k) > close * close) break;
      const std::uint32_t j = nearest.index(k);
      if (there.descriptors->known[j] == 0) continue;
      if (were_seen_alike(static_cast<std::uint32_t>(i), j)) partners[i].push_back(j);
    }
  };
  target.tree().batch(kPartners).for_each(moved, Executor(), find);
  SeenAlike counts;
  for (const auto& others : partners) counts.landmarks += others.empty() ? 0 : 1;
  const Looks of_source(here, kElsewhere * radius / pose.scale());
  const Looks of_target(there, kElsewhere * radius);
  for (std::uint32_t i = 0; i < partners.size(); ++i) {
    if (static_cast<double>(counts.distinctive) >= enough * static_cast<double>(counts.landmarks)) {
      break;
    }
    if (partners[i].empty()) continue;
    const Rows rows = rows_of(*here.descriptors, i);
    auto least = std::numeric_limits<std::uint32_t>::max();
    std::uint32_t partner = 0;
    for (const std::uint32_t j : partners[i]) {
      const std::uint32_t difference = of_source.difference(rows, rows_of(*there.descriptors, j));
      if (difference >= least) continue;
      least = difference;
      partner = j;
    }
    const std::uint32_t clear = kDistinctive * least;
    if (of_source.is_unique(i, clear) && of_target.is_unique(partner, clear)) ++counts.distinctive;
  }
  return counts;
}

}  // namespace cairn::detail
