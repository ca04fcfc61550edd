// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/alignment/detail/evidence/seen_alike.hpp"

#include <algorithm>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "cairn/alignment/detail/evidence/look_comparison.hpp"
#include "cairn/alignment/detail/search/descriptor_matches.hpp"

namespace cairn::detail {
namespace {

constexpr std::size_t kPartners = 8;  // nearest target landmarks that are compared
// Of two lines of sight to one point: features hardly change between them.
constexpr double kAlikeCosine = 0.985;    // of 10 degrees
constexpr double kAlikeDistances = 1.25;  // ratio
constexpr double kClose = 0.5;            // matching radii within which landmarks are compared
// A landmark is distinctive if no landmark at least this far away, in matching radii, in its own map differs from it by
// less than this multiple of its difference from its partner.
constexpr double kElsewhere = 4.0;
constexpr std::uint32_t kDistinctive = 2;

using Centres = std::vector<Eigen::Vector3d>;

// Per landmark: the centres of the cameras that saw it.
std::vector<Centres> viewers(const LandmarkCloud& cloud) {
  std::vector<Centres> result(cloud.size());
  for (const LandmarkView& view : cloud.views) {
    for (const std::uint32_t landmark : view.landmarks) result[landmark].push_back(view.centre);
  }
  return result;
}

bool are_alike(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  const double here = a.norm();
  const double there = b.norm();
  return a.dot(b) > kAlikeCosine * here * there && here < kAlikeDistances * there &&
         there < kAlikeDistances * here;
}

bool saw_alike(const Centres& some, const Centres& others, const Eigen::Vector3d& point) {
  return std::ranges::any_of(some, [&](const Eigen::Vector3d& a) {
    return std::ranges::any_of(
        others, [&](const Eigen::Vector3d& b) { return are_alike(a - point, b - point); });
  });
}

// The landmarks of a map by their looks.
class Looks {
 public:
  // @param elsewhere distance from which a landmark is not the same
  Looks(const LandmarkCloud& cloud, double elsewhere)
      : cloud_(cloud), descriptors_(cloud, cloud.size()), elsewhere_(elsewhere) {}

  const Descriptors& descriptors() const { return descriptors_; }

  // Whether no landmark elsewhere differs by at most so much from one with descriptors.
  bool is_unique(std::size_t i, std::uint32_t difference) const {
    const Eigen::Vector3d& place = cloud_.positions[descriptors_.landmark(i)];
    for (std::size_t j = 0; j < descriptors_.size(); ++j) {
      if (least_difference(descriptors_, i, descriptors_, j) > difference) continue;
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
                     const Similarity3& pose, double radius) {
  const LandmarkCloud& here = source.landmarks();
  const LandmarkCloud& there = target.landmarks();
  if (here.views.empty() || there.views.empty() || !have_like_descriptors(here, there)) return {};
  std::vector<Centres> source_viewers = viewers(here);
  for (Centres& centres : source_viewers) {
    for (Eigen::Vector3d& centre : centres) centre = pose * centre;
  }
  const std::vector<Centres> target_viewers = viewers(there);
  const Looks of_source(here, kElsewhere * radius / pose.scale());
  const Looks of_target(there, kElsewhere * radius);
  const std::vector<Eigen::Vector3d> moved = moved_points(source.sample(), pose);
  const double close = kClose * radius;
  SeenAlike counts;
  const auto compare = [&](std::size_t landmark, const NearestList auto& nearest) {
    const auto i = of_source.descriptors().of(static_cast<std::uint32_t>(landmark));
    if (!i) return;
    auto least = std::numeric_limits<std::uint32_t>::max();
    std::size_t partner = 0;
    bool compared = false;
    for (std::size_t k = 0; k < nearest.size(); ++k) {
      if (nearest.squared_distance(k) > close * close) break;
      const auto j = of_target.descriptors().of(nearest.index(k));
      if (!j ||
          !saw_alike(source_viewers[landmark], target_viewers[nearest.index(k)], moved[landmark])) {
        continue;
      }
      compared = true;
      const std::uint32_t difference =
          least_difference(of_source.descriptors(), *i, of_target.descriptors(), *j);
      if (difference >= least) continue;
      least = difference;
      partner = *j;
    }
    if (!compared) return;
    ++counts.landmarks;
    const std::uint32_t clear = kDistinctive * least;
    if (of_source.is_unique(*i, clear) && of_target.is_unique(partner, clear)) {
      ++counts.distinctive;
    }
  };
  target.tree().batch(kPartners).for_each(moved, Executor(), compare);
  return counts;
}

}  // namespace cairn::detail
