// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/alignment/detail/evidence/seen_alike.hpp"

#include <algorithm>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include "cairn/alignment/detail/evidence/look_comparison.hpp"
#include "cairn/alignment/detail/search/descriptor_matches.hpp"
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

// What the landmarks of a map look like.
class Looks {
 public:
  // @param elsewhere distance from which a landmark is not the same
  Looks(const LandmarkCloud& cloud, double elsewhere)
      : cloud_(cloud), descriptors_(cloud, cloud.size()), elsewhere_(elsewhere) {}

  const Descriptors& descriptors() const { return descriptors_; }

  // Whether no landmark elsewhere differs by at most so much from the i-th with descriptors.
  bool is_unique(std::size_t i, std::uint32_t most) const {
    const Eigen::Vector3d& place = cloud_.positions[descriptors_.landmark(i)];
    for (std::size_t j = 0; j < descriptors_.size(); ++j) {
      if (least_difference(descriptors_, i, descriptors_, j) > most) continue;
      const Eigen::Vector3d& other = cloud_.positions[descriptors_.landmark(j)];
      if ((other - place).squaredNorm() >= elsewhere_ * elsewhere_) return false;
    }
    return true;
  }

 private:
  const LandmarkCloud& cloud_;
  Descriptors descriptors_;
  double elsewhere_;
};

}  // namespace

SeenAlike seen_alike(const PreparedCloud& source, const PreparedCloud& target,
                     const Similarity3& pose, double radius, double enough) {
  const LandmarkCloud& here = source.landmarks();
  const LandmarkCloud& there = target.landmarks();
  // If only some descriptors are matched, their number does not compare with that of what was seen alike.
  if (here.views.empty() || there.views.empty() || !have_like_descriptors(here, there) ||
      !DescriptorMatches::compares_all(here, there)) {
    return {};
  }
  const Viewers source_viewers(here, pose);
  const Viewers target_viewers(there);
  const std::vector<Eigen::Vector3d> moved = moved_points(source.sample(), pose);
  const auto were_seen_alike = [&](std::uint32_t i, std::uint32_t j) {
    return source_viewers.any_of(i, [&](const Eigen::Vector3d& a) {
      return target_viewers.any_of(j, [&](const Eigen::Vector3d& b) {
        return are_alike(a - moved[i], b - moved[i], kAlikeCosine, kAlikeDistances);
      });
    });
  };
  const Looks of_source(here, kElsewhere * radius / pose.scale());
  const Looks of_target(there, kElsewhere * radius);
  const double close = kClose * radius;
  // A landmark that was seen alike, and the target landmarks beside it, all numbered among those with descriptors.
  struct Seen {
    std::size_t landmark = 0;
    std::vector<std::size_t> partners;
  };
  std::vector<Seen> all;
  const auto find = [&](std::size_t i, const NearestList auto& nearest) {
    const auto landmark = static_cast<std::uint32_t>(i);
    const auto own = of_source.descriptors().of(landmark);
    if (!own) return;
    Seen seen{*own, {}};
    for (std::size_t k = 0; k < nearest.size(); ++k) {
      if (nearest.squared_distance(k) > close * close) break;
      const auto partner = of_target.descriptors().of(nearest.index(k));
      if (partner && were_seen_alike(landmark, nearest.index(k))) seen.partners.push_back(*partner);
    }
    if (!seen.partners.empty()) all.push_back(std::move(seen));
  };
  target.tree().batch(kPartners).for_each(moved, Executor(), find);
  SeenAlike counts{.landmarks = all.size()};
  for (const auto& [landmark, partners] : all) {
    if (static_cast<double>(counts.distinctive) >= enough * static_cast<double>(all.size())) break;
    auto least = std::numeric_limits<std::uint32_t>::max();
    std::size_t nearest = 0;
    for (const std::size_t partner : partners) {
      const std::uint32_t difference =
          least_difference(of_source.descriptors(), landmark, of_target.descriptors(), partner);
      if (difference >= least) continue;
      least = difference;
      nearest = partner;
    }
    const std::uint32_t clear = kDistinctive * least;
    if (of_source.is_unique(landmark, clear) && of_target.is_unique(nearest, clear)) {
      ++counts.distinctive;
    }
  }
  return counts;
}

}  // namespace cairn::detail
