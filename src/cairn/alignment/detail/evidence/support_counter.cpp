// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/alignment/detail/evidence/support_counter.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <Eigen/Geometry>

#include "cairn/alignment/detail/evidence/seen_alike.hpp"
#include "cairn/core/random.hpp"
#include "cairn/core/statistics.hpp"
#include "cairn/geometry/detail/centroid.hpp"
#include "cairn/geometry/similarity3.hpp"

namespace cairn::detail {
namespace {

// Two landmarks that are mutual nearest neighbours.
struct Pair {
  double chance;      // probability of such a distance if they are different landmarks
  std::size_t group;  // of the source landmark
};

double log_ratio(const Pair& pair, double share) {
  return std::log1p(share * (0.5 / std::sqrt(pair.chance) - 1.0));
}

// Adds the evidence for the likeliest share of pairs that are the same landmark.
void add_evidence(std::span<const Pair> pairs, Support& support) {
  double likeliest = 0.0;
  for (const double share : {0.01, 0.02, 0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.6, 0.8}) {
    double sum = 0.0;
    for (const Pair& pair : pairs) sum += log_ratio(pair, share);
    if (sum <= support.evidence) continue;
    support.evidence = sum;
    likeliest = share;
  }
  std::array<double, SupportCounter::kGroups> by_group{};
  for (const Pair& pair : pairs) by_group[pair.group] += log_ratio(pair, likeliest);
  support.spread_evidence =
      std::max(support.evidence - *std::max_element(by_group.begin(), by_group.end()), 0.0);
}

void add_likeness(std::span<const Likeness> by_group, Support& support) {
  Likeness all;
  for (const Likeness& group : by_group) all += group;
  support.likeness = all;
  support.spread_likeness = all.evidence();
  for (const Likeness& group : by_group) {
    support.spread_likeness = std::min(support.spread_likeness, (all - group).evidence());
  }
}

std::vector<Neighbor> nearest_of_each(std::span<const Eigen::Vector3d> moved,
                                      std::vector<std::uint32_t> order, const BatchTree& tree) {
  std::vector<Neighbor> found(moved.size());
  tree.batch(1, std::move(order))
      .for_each(moved, Executor(), [&](std::size_t i, const NearestList auto& nearest) {
        found[i] = {nearest.index(0), nearest.squared_distance(0)};
      });
  return found;
}

constexpr std::size_t kNeighbourhood = 24;  // landmarks of the sample
constexpr double kDense = 0.5;              // least matches around a match, times their median
constexpr double kInside = 0.97;            // quantile of the dense matches' distances
constexpr double kMargin = 1.15;            // factor of this distance
constexpr int kMedianSteps = 30;

// The point with the least sum of distances (Weiszfeld 1937).
Eigen::Vector3d geometric_median(std::span<const Eigen::Vector3d> points) {
  Eigen::Vector3d median = centroid(points);
  for (int step = 0; step < kMedianSteps; ++step) {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    double weights = 0.0;
    for (const Eigen::Vector3d& point : points) {
      const double weight = 1.0 / std::max((point - median).norm(), 1e-12);
      sum += weight * point;
      weights += weight;
    }
    median = sum / weights;
  }
  return median;
}

// The matched points whose neighbourhood has enough matches, which excludes most chance matches.
std::vector<Eigen::Vector3d> dense(std::span<const Eigen::Vector3d> sample,
                                   std::span<const std::uint32_t> matched) {
  std::vector<char> is_matched(sample.size(), 0);
  std::vector<Eigen::Vector3d> places;
  for (const std::uint32_t i : matched) {
    is_matched[i] = 1;
    places.push_back(sample[i]);
  }
  std::vector<double> counts(places.size());
  BatchTree(sample)
      .batch(kNeighbourhood)
      .for_each(places, Executor(), [&](std::size_t m, const NearestList auto& nearest) {
        double count = 0.0;
        for (std::size_t j = 0; j < nearest.size(); ++j) count += is_matched[nearest.index(j)];
        counts[m] = count;
      });
  const double least = kDense * lower_quantile(std::vector<double>(counts), 0.5);
  std::vector<Eigen::Vector3d> result;
  for (std::size_t m = 0; m < places.size(); ++m) {
    if (counts[m] >= least) result.push_back(places[m]);
  }
  return result;
}

Ball ball_about(std::span<const Eigen::Vector3d> points) {
  const Eigen::Vector3d centre = geometric_median(points);
  std::vector<double> distances;
  distances.reserve(points.size());
  for (const Eigen::Vector3d& point : points) distances.push_back((point - centre).norm());
  return {centre, kMargin * lower_quantile(std::move(distances), kInside)};
}

// Share of the radius within which two landmarks are the same rather than on one surface.
constexpr double kSameLandmark = 0.25;

// The landmarks of the source's sample with a mutual match within a distance.
std::vector<std::uint32_t> matched_within(const PreparedCloud& source, const PreparedCloud& target,
                                          const Similarity3& pose, double distance) {
  std::vector<std::uint32_t> matched;
  for (const MutualMatch& match : mutual_matches(source, target, pose, source.sample().size())) {
    if (match.squared_distance <= distance * distance) matched.push_back(match.source);
  }
  return matched;
}

std::vector<Eigen::Vector3d> outside(std::span<const Eigen::Vector3d> points, const Ball& ball) {
  std::vector<Eigen::Vector3d> result;
  std::copy_if(points.begin(), points.end(), std::back_inserter(result),
               [&](const Eigen::Vector3d& point) { return !ball.contains(point); });
  return result;
}

}  // namespace

std::vector<MutualMatch> mutual_matches(const PreparedCloud& source, const PreparedCloud& target,
                                        const Similarity3& pose, std::size_t sample) {
  const std::vector<std::uint32_t> order = source.close_by(sample);
  const std::vector<Neighbor> there =
      nearest_of_each(moved_points(std::span(source.landmarks().positions).first(sample), pose),
                      order, target.tree());
  std::vector<Eigen::Vector3d> met;
  met.reserve(sample);
  for (const Neighbor& neighbor : there) {
    met.push_back(target.landmarks().positions[neighbor.index]);
  }
  const std::vector<Neighbor> back =
      nearest_of_each(moved_points(met, pose.inverse()), order, source.tree());
  std::vector<MutualMatch> matches;
  for (std::uint32_t i = 0; i < sample; ++i) {
    if (back[i].index == i) matches.push_back({i, there[i].index, there[i].squared_distance});
  }
  return matches;
}

SupportCounter::SupportCounter(const PreparedCloud& source, const PreparedCloud& target,
                               std::size_t sample, const Random& random)
    : source_(source),
      target_(target),
      sample_(std::min({sample, source.size(), PreparedCloud::kSample})),
      looks_(source.landmarks(), target.landmarks(), sample_, random) {}

Support SupportCounter::operator()(const Similarity3& pose, double radius,
                                   Proximity* proximity) const {
  // Bounds of a distance in spacings: pairs beyond kFarthest match by chance; below the other, copies of a
  // landmark would have too much weight.
  constexpr double kFarthest = 3.0;
  constexpr double kLeastChance = 1e-6;
  Support support;
  std::vector<Pair> pairs;
  std::vector<std::uint32_t> matched;
  std::array<ContrastPairs, kGroups> contrasts;
  for (const auto& [i, there, squared] : mutual_matches(source_, target_, pose, sample_)) {
    if (squared <= radius * radius) {
      matched.push_back(i);
      add_contrast(i, there, contrasts[source_.groups()[i]]);
    }
    for (std::size_t k = 0; k < Support::kRadii; ++k) {
      if (std::ldexp(squared, 2 * static_cast<int>(k)) > radius * radius) break;
      ++support.within[k];
    }
    const double spacing = pose.scale() * source_.spacings()[i] * target_.spacings()[there];
    const double ratio =
        spacing > 0.0 ? std::min(squared / spacing, kFarthest * kFarthest) : kFarthest * kFarthest;
    const double chance = chance_on_surface(ratio);
    pairs.push_back({std::max(chance, kLeastChance), source_.groups()[i]});
    if (proximity != nullptr && spacing > 0.0) {
      proximity->add(std::sqrt(squared / spacing), source_.groups()[i]);
    }
  }
  // Scales the sample's numbers to the whole source; shares refer to the smaller cloud. That is an estimate, which
  // may exceed all there are, most where landmarks of large weight match, because more of them are in the sample.
  const double each = static_cast<double>(source_.size()) /
                      static_cast<double>(sample_ * std::min(source_.size(), target_.size()));
  support.share = std::min(each * static_cast<double>(support.matches()), 1.0);
  add_evidence(pairs, support);
  if (looks_.possible()) add_likeness(likeness_by_group(matched, pose, radius), support);
  if (has_contrasts()) support.contrast = contrast_agreement(contrasts);
  return support;
}

void SupportCounter::add_contrast(std::uint32_t source, std::uint32_t target,
                                  ContrastPairs& pairs) const {
  if (!has_contrasts()) return;
  const double here = source_.contrasts()[source];
  const double there = target_.contrasts()[target];
  if (!std::isnan(here) && !std::isnan(there)) pairs.add(here, there);
}

SupportCounter::Likenesses SupportCounter::likeness_by_group(std::span<const std::uint32_t> matched,
                                                             const Similarity3& pose,
                                                             double radius) const {
  std::vector<Eigen::Vector3d> places;
  places.reserve(matched.size());
  for (const std::uint32_t i : matched) places.push_back(source_.landmarks().positions[i]);
  places = moved_points(places, pose);
  Likenesses result;
  std::vector<std::uint32_t> partners;
  target_.tree()
      .batch(LookComparison::kPartners)
      .for_each(places, Executor(), [&](std::size_t m, const NearestList auto& nearest) {
        partners.clear();
        for (std::size_t j = 0; j < nearest.size(); ++j) {
          if (nearest.squared_distance(j) <= radius * radius) partners.push_back(nearest.index(j));
        }
        if (const auto alike = looks_.alike(matched[m], partners)) {
          result[source_.groups()[matched[m]]] += {1, *alike ? 1U : 0U};
        }
      });
  return result;
}

Surroundings surroundings(const PreparedCloud& source, const PreparedCloud& target,
                          const Similarity3& pose, double radius) {
  const std::span<const Eigen::Vector3d> sample = source.sample();
  const std::vector<std::uint32_t> matched =
      matched_within(source, target, pose, kSameLandmark * radius);
  if (matched.empty()) return {};
  const Ball here = ball_about(dense(sample, matched));
  const Ball there = {pose * here.centre, pose.scale() * here.radius};
  const std::vector<Eigen::Vector3d> of_source = outside(sample, here);
  const std::vector<Eigen::Vector3d> of_target = outside(target.sample(), there);
  const auto share = [](const auto& part, const auto& all) {
    return static_cast<double>(part.size()) / static_cast<double>(all.size());
  };
  Surroundings result{
      .landmarks = {},
      .extent = there.radius / radius,
      .share = std::min(share(of_source, sample), share(of_target, target.sample())),
      .seen_alike = seen_alike(source, target, pose, radius, kLeastDistinctive)};
  result.landmarks =
      target.views().count_around(there, moved_points(of_source, pose), target.landmarks());
  result.landmarks += source.views().count_around(here, moved_points(of_target, pose.inverse()),
                                                  source.landmarks());
  return result;
}

PlaneMatches matches_in_plane(const PreparedCloud& source, const PreparedCloud& target,
                              const Similarity3& pose, double radius) {
  constexpr int kTriples = 200;
  const std::span<const Eigen::Vector3d> sample = source.sample();
  const std::vector<std::uint32_t> matched =
      matched_within(source, target, pose, kSameLandmark * radius);
  if (matched.empty()) return {};
  const double close = kSameLandmark * radius / pose.scale();  // in the source
  Random random(0);
  std::ptrdiff_t most = 0;
  Eigen::Hyperplane<double, 3> plane(Eigen::Vector3d::UnitZ(), 0.0);
  const auto is_near = [&](const Eigen::Hyperplane<double, 3>& one) {
    return [&one, close](const Eigen::Vector3d& place) { return one.absDistance(place) <= close; };
  };
  for (int triple = 0; triple < kTriples; ++triple) {
    const auto drawn = [&] { return sample[matched[random.index(matched.size())]]; };
    const Eigen::Vector3d a = drawn();
    const Eigen::Vector3d b = drawn();
    const Eigen::Vector3d c = drawn();
    const Eigen::Vector3d normal = (b - a).cross(c - a);
    if (normal.isZero(0.0)) continue;
    const Eigen::Hyperplane<double, 3> through(normal.normalized(), a);
    const auto count =
        std::ranges::count_if(matched, is_near(through),
                              [&](std::uint32_t i) -> const Eigen::Vector3d& { return sample[i]; });
    if (count <= most) continue;
    most = count;
    plane = through;
  }
  if (most == 0) return {};
  const auto in_plane = static_cast<double>(std::ranges::count_if(sample, is_near(plane)));
  const auto beside = static_cast<double>(sample.size()) - in_plane;
  const auto of_plane = static_cast<double>(most);
  const double of_others = static_cast<double>(matched.size()) - of_plane;
  return {.share = of_plane / static_cast<double>(matched.size()),
          .elsewhere = beside > 0.0 ? of_others / beside * in_plane / of_plane : 1.0};
}

}  // namespace cairn::detail
