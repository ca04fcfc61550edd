// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/merging/changes.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <span>
#include <unordered_map>
#include <utility>

#include "cairn/core/error.hpp"
#include "cairn/core/random.hpp"
#include "cairn/geometry/decompositions.hpp"
#include "cairn/merging/detail/descriptor_difference.hpp"
#include "cairn/merging/detail/map_sights.hpp"

namespace cairn {
namespace {

constexpr double kLargestTurn =
    0.71;                         // cosine: views of a landmark from directions within 45 degrees
constexpr double kNearer = 0.5;   // ranges at which a landmark is seen again, as shares of the
constexpr double kFarther = 1.6;  // least and of the greatest at which it was seen
constexpr double kLikeShare = 0.25;    // largest share of differing bits of similar descriptors
constexpr double kChanceFound = 0.04;  // that a landmark that is gone has a counterpart
constexpr double kSeenThroughIfGone = 0.5;
constexpr double kDependence = 0.5;    // because evidence of neighbours is correlated
constexpr double kPrior = 0.05;        // that a group is a change, before its evidence
constexpr double kLeastMean = 0.35;    // evidence per landmark around a landmark that is gone
constexpr std::size_t kMotions = 400;  // rigid motions tried for a thing that may have moved
// Share of the smaller place's landmarks that a motion explains.
constexpr double kMovedShare = 0.12;
constexpr std::size_t kMovedLeast = 5;

// Points, sorted into the cubes of a grid.
class PointGrid {
 public:
  PointGrid(std::span<const Eigen::Vector3d> points, double size) : points_(points), size_(size) {
    for (std::uint32_t i = 0; i < points.size(); ++i) cells_[key(cell_of(points[i]))].push_back(i);
  }
  template <class Visit>
  void within(const Eigen::Vector3d& query, double radius, const Visit& visit) const {
    const std::array<std::int64_t, 3> low = cell_of(query.array() - radius);
    const std::array<std::int64_t, 3> high = cell_of(query.array() + radius);
    for (std::int64_t x = low[0]; x <= high[0]; ++x) {
      for (std::int64_t y = low[1]; y <= high[1]; ++y) {
        for (std::int64_t z = low[2]; z <= high[2]; ++z) {
          const auto found = cells_.find(key({x, y, z}));
          if (found == cells_.end()) continue;
          for (const std::uint32_t i : found->second) {
            if ((points_[i] - query).squaredNorm() <= radius * radius) visit(i);
          }
        }
      }
    }
  }

 private:
  std::array<std::int64_t, 3> cell_of(const Eigen::Vector3d& point) const {
    std::array<std::int64_t, 3> cell = {};
    for (int axis = 0; axis < 3; ++axis) {
      constexpr double kMost = 1e6;  // cells: farther points share the last
      cell[static_cast<std::size_t>(axis)] =
          static_cast<std::int64_t>(std::floor(std::clamp(point[axis] / size_, -kMost, kMost)));
    }
    return cell;
  }
  static std::uint64_t key(const std::array<std::int64_t, 3>& cell) {
    std::uint64_t sum = 0;
    for (const std::int64_t one : cell) {
      sum = (sum << 21U) | (static_cast<std::uint64_t>(one + (1 << 20)) & 0x1fffffU);
    }
    return sum;
  }

  std::span<const Eigen::Vector3d> points_;
  double size_;
  std::unordered_map<std::uint64_t, std::vector<std::uint32_t>> cells_;
};

// Compares descriptors: whether that is possible, their differences, and the largest of like ones.
class Looks {
 public:
  Looks(const LandmarkMap& first, const LandmarkMap& second, std::uint64_t seed) {
    const auto& a = first.landmarks().descriptors;
    const auto& b = second.landmarks().descriptors;
    if (!a || !b || !detail::comparable(*a, *b)) return;
    first_ = &*a;
    second_ = &*b;
    norm_ = descriptor_norm(a->kind);
    // Half of the bits differ by chance. How far bytes differ depends on the kind and on the place.
    largest_like_ = is_binary(a->kind) ? kLikeShare * 8.0 * static_cast<double>(a->bytes_each)
                                       : static_cast<double>(detail::largest_alike(*a, *b, seed));
  }
  bool known() const { return first_ != nullptr; }
  double largest_like() const { return largest_like_; }
  // Infinite where either is unknown.
  double difference(std::size_t i, std::size_t j) const {
    if (first_->known[i] == 0 || second_->known[j] == 0) {
      return std::numeric_limits<double>::infinity();
    }
    return static_cast<double>(detail::least_difference(*first_, i, *second_, j, norm_));
  }

 private:
  const DescriptorColumn* first_ = nullptr;
  const DescriptorColumn* second_ = nullptr;
  DescriptorNorm norm_ = DescriptorNorm::kHamming;
  double largest_like_ = 0.0;
};

// A landmark that the other map should have.
struct Comparable {
  std::uint32_t landmark = 0;
  bool found = false;     // the other map has it
  bool through = false;   // the other map saw through where it would be
  std::size_t bin = 0;    // by how often it was seen, and how often it could be seen again
  double evidence = 0.0;  // log-likelihood ratio that it is gone
};

constexpr std::size_t kViewBins = 4;
constexpr std::size_t kObservationBins = 3;

std::size_t bin_of(std::size_t views, std::size_t observations) {
  const std::size_t v = views <= 2 ? 0 : views <= 5 ? 1 : views <= 10 ? 2 : 3;
  const std::size_t o = observations <= 3 ? 0 : observations <= 7 ? 1 : 2;
  return v * kObservationBins + o;
}

// Evidence of one map's landmarks for changes in the other.
class OneSide {
 public:
  /// @param swapped whether `own` is the second map of `looks`
  OneSide(const PlacedMap& own, const PlacedMap& other, const Looks& looks, bool swapped,
          const ChangeOptions& options, const Execution& execution)
      : options_(options),
        positions_(moved_points(own.map->landmarks().positions, own.world_from_map)) {
    const LandmarkMap& map = *own.map;
    const std::vector<Eigen::Vector3d> others =
        moved_points(other.map->landmarks().positions, other.world_from_map);
    const PointGrid grid(others, options.tolerance);
    const detail::MapSights sights(*other.map, other.world_from_map);
    std::vector<std::optional<Comparable>> compared(map.landmark_count());
    constexpr std::size_t kBlock = 256;
    const auto compare = [&](std::size_t begin, std::size_t end) {
      if (execution.stop.stop_requested()) {
        throw Error(ErrorKind::kCancelled, "changes", "the comparison was cancelled", "");
      }
      for (std::size_t i = begin; i < end; ++i) {
        compared[i] = compare_landmark(own, static_cast<std::uint32_t>(i), sights);
        if (!compared[i]) continue;
        grid.within(positions_[i], options.tolerance, [&](std::uint32_t j) {
          bool& found = compared[i]->found;
          found =
              found || !looks.known() ||
              (swapped ? looks.difference(j, i) : looks.difference(i, j)) <= looks.largest_like();
        });
      }
    };
    execution.executor.for_blocks(compared.size(), kBlock, compare);
    for (const std::optional<Comparable>& one : compared) {
      if (one) comparable_.push_back(*one);
    }
  }

  const std::vector<Comparable>& comparable() const { return comparable_; }

  void weigh(const std::array<double, kViewBins * kObservationBins>& found,
             double through_if_there) {
    for (Comparable& one : comparable_) {
      const double again = found[one.bin];
      one.evidence = one.found ? std::log(kChanceFound / again)
                               : std::log((1.0 - kChanceFound) / (1.0 - again));
      one.evidence += one.through ? std::log(kSeenThroughIfGone / through_if_there)
                                  : std::log((1.0 - kSeenThroughIfGone) / (1.0 - through_if_there));
    }
  }

  struct Group {
    ChangedPlace place;
    double confidence = 0.0;
  };

  std::vector<Group> groups() const {
    std::vector<Eigen::Vector3d> points;
    for (const Comparable& one : comparable_) points.push_back(positions_[one.landmark]);
    const PointGrid grid(points, options_.reach);
    std::vector<bool> gone(points.size());
    for (std::size_t i = 0; i < points.size(); ++i) {
      double sum = 0.0;
      std::size_t count = 0;
      grid.within(points[i], options_.reach, [&](std::uint32_t j) {
        sum += comparable_[j].evidence;
        ++count;
      });
      gone[i] = !comparable_[i].found && sum > kLeastMean * static_cast<double>(count);
    }
    std::vector<bool> taken(points.size(), false);
    std::vector<Group> groups;
    for (std::uint32_t start = 0; start < points.size(); ++start) {
      if (!gone[start] || taken[start]) continue;
      std::vector<std::uint32_t> members = {start};
      taken[start] = true;
      for (std::size_t next = 0; next < members.size(); ++next) {
        const Eigen::Vector3d at = points[members[next]];
        grid.within(at, options_.reach, [&](std::uint32_t j) {
          if (!gone[j] || taken[j]) return;
          taken[j] = true;
          members.push_back(j);
        });
      }
      if (members.size() < options_.min_landmarks) continue;
      std::sort(members.begin(), members.end());
      Group group = group_of(members, points, grid);
      const bool large = (group.place.high - group.place.low).maxCoeff() >= options_.min_size;
      if (large && group.confidence >= options_.min_confidence) groups.push_back(std::move(group));
    }
    return groups;
  }

 private:
  // Compares all but `found`; std::nullopt if the other map could hardly see the landmark.
  std::optional<Comparable> compare_landmark(const PlacedMap& own, std::uint32_t i,
                                             const detail::MapSights& sights) const {
    const LandmarkMap& map = *own.map;
    const auto frames = map.observing_frames(LandmarkIndex{i});
    if (frames.size() < options_.min_observations) return std::nullopt;
    std::vector<Eigen::Vector3d> directions;
    double nearest = std::numeric_limits<double>::infinity();
    double farthest = 0.0;
    for (const FrameIndex frame : frames) {
      const Eigen::Vector3d to_camera =
          own.world_from_map * map.world_from_camera(frame).translation() - positions_[i];
      const double range = to_camera.norm();
      if (range > 0.0) directions.emplace_back(to_camera / range);
      nearest = std::min(nearest, range);
      farthest = std::max(farthest, range);
    }
    const auto seen = sights.count(positions_[i], options_.tolerance, [&](const auto& to_camera) {
      const double range = to_camera.norm();
      return range >= kNearer * nearest && range <= kFarther * farthest &&
             std::any_of(directions.begin(), directions.end(), [&](const auto& direction) {
               return direction.dot(to_camera) >= kLargestTurn * range;
             });
    });
    if (seen.views < 2) return std::nullopt;
    Comparable one;
    one.landmark = i;
    one.bin = bin_of(seen.views, frames.size());
    one.through = seen.through > seen.agrees;
    return one;
  }

  Group group_of(const std::vector<std::uint32_t>& members,
                 const std::vector<Eigen::Vector3d>& points, const PointGrid& grid) const {
    Group group;
    for (int axis = 0; axis < 3; ++axis) {
      std::vector<double> values;
      for (const std::uint32_t i : members) values.push_back(points[i][axis]);
      std::sort(values.begin(), values.end());
      const std::size_t trim = values.size() / 20;
      group.place.low[axis] = values[trim];
      group.place.high[axis] = values[values.size() - 1 - trim];
      group.place.centre[axis] = values[values.size() / 2];
    }
    // Landmarks within the group that are still there are evidence against a change.
    double evidence = 0.0;
    std::vector<bool> counted(points.size(), false);
    for (const std::uint32_t i : members) {
      group.place.landmarks.push_back(LandmarkIndex{comparable_[i].landmark});
      grid.within(points[i], 0.5 * options_.reach, [&](std::uint32_t j) {
        if (counted[j]) return;
        counted[j] = true;
        evidence += comparable_[j].evidence;
      });
    }
    const double odds = std::log(kPrior / (1.0 - kPrior)) + kDependence * evidence;
    group.confidence = 1.0 / (1.0 + std::exp(-odds));
    return group;
  }

  const ChangeOptions& options_;
  std::vector<Eigen::Vector3d> positions_;
  std::vector<Comparable> comparable_;
};

struct Motion {
  std::size_t explained = 0;
  Rigid3 after_from_before;
};

Rigid3 rigid_fit(const std::vector<Eigen::Vector3d>& from, const std::vector<Eigen::Vector3d>& to) {
  return Rigid3::from_matrix(least_squares_similarity(from, to, false), 1e-6);
}

// Positions of the landmarks of two places that are mutually most similar.
struct SimilarLandmarks {
  std::vector<Eigen::Vector3d> from;
  std::vector<Eigen::Vector3d> to;
};

SimilarLandmarks similar_landmarks(const ChangedPlace& before, const ChangedPlace& after,
                                   const Looks& looks, const std::vector<Eigen::Vector3d>& first,
                                   const std::vector<Eigen::Vector3d>& second) {
  SimilarLandmarks similar;
  const auto nearest_to = [&](const auto& difference, std::size_t count) {
    std::pair<std::size_t, double> nearest = {count, looks.largest_like()};
    for (std::size_t j = 0; j < count; ++j) {
      if (difference(j) < nearest.second) nearest = {j, difference(j)};
    }
    return nearest.first;
  };
  for (std::size_t i = 0; i < before.landmarks.size(); ++i) {
    const auto to_second = [&](std::size_t j) {
      return looks.difference(before.landmarks[i].value, after.landmarks[j].value);
    };
    const std::size_t j = nearest_to(to_second, after.landmarks.size());
    if (j == after.landmarks.size()) continue;
    const auto to_first = [&](std::size_t k) {
      return looks.difference(before.landmarks[k].value, after.landmarks[j].value);
    };
    if (nearest_to(to_first, before.landmarks.size()) != i) continue;
    similar.from.push_back(first[before.landmarks[i].value]);
    similar.to.push_back(second[after.landmarks[j].value]);
  }
  return similar;
}

// The rigid motion that explains most of the similar landmarks of two places.
Motion motion_between(const ChangedPlace& before, const ChangedPlace& after, const Looks& looks,
                      const std::vector<Eigen::Vector3d>& first,
                      const std::vector<Eigen::Vector3d>& second, const ChangeOptions& options,
                      std::uint64_t seed) {
  Motion best;
  const auto [from, to] = similar_landmarks(before, after, looks, first, second);
  if (from.size() < kMovedLeast) return best;
  Random random(seed);
  for (std::size_t attempt = 0; attempt < kMotions; ++attempt) {
    std::array<std::size_t, 3> pick = {random.index(from.size()), random.index(from.size()),
                                       random.index(from.size())};
    if (pick[0] == pick[1] || pick[0] == pick[2] || pick[1] == pick[2]) continue;
    std::vector<Eigen::Vector3d> some_from;
    std::vector<Eigen::Vector3d> some_to;
    for (const std::size_t k : pick) {
      some_from.push_back(from[k]);
      some_to.push_back(to[k]);
    }
    bool rigid = true;
    for (std::size_t k = 0; k < 3; ++k) {
      const double was = (some_from[k] - some_from[(k + 1) % 3]).norm();
      const double is = (some_to[k] - some_to[(k + 1) % 3]).norm();
      rigid = rigid && std::abs(was - is) <= options.tolerance && was > 0.2 * options.tolerance;
    }
    if (!rigid) continue;
    const Rigid3 motion = rigid_fit(some_from, some_to);
    std::size_t explained = 0;
    for (std::size_t k = 0; k < from.size(); ++k) {
      explained += (motion * from[k] - to[k]).norm() <= 0.6 * options.tolerance ? 1 : 0;
    }
    if (explained > best.explained) best = {explained, motion};
  }
  if (best.explained < 3) return best;
  std::vector<Eigen::Vector3d> inliers_from;
  std::vector<Eigen::Vector3d> inliers_to;
  for (std::size_t k = 0; k < from.size(); ++k) {
    if ((best.after_from_before * from[k] - to[k]).norm() > 0.6 * options.tolerance) continue;
    inliers_from.push_back(from[k]);
    inliers_to.push_back(to[k]);
  }
  best.after_from_before = rigid_fit(inliers_from, inliers_to);
  return best;
}

struct PlacePair {
  std::size_t before;
  std::size_t after;
  Motion motion;
};

// Pairs of places that one motion explains, those with the most explained landmarks first.
std::vector<PlacePair> moved_pairs(const std::vector<OneSide::Group>& before,
                                   const std::vector<OneSide::Group>& after, const Looks& looks,
                                   const PlacedMap& first, const PlacedMap& second,
                                   const ChangeOptions& options, std::uint64_t seed) {
  const std::vector<Eigen::Vector3d> first_positions =
      moved_points(first.map->landmarks().positions, first.world_from_map);
  const std::vector<Eigen::Vector3d> second_positions =
      moved_points(second.map->landmarks().positions, second.world_from_map);
  std::vector<PlacePair> pairs;
  for (std::size_t i = 0; i < before.size(); ++i) {
    for (std::size_t j = 0; j < after.size(); ++j) {
      const Motion motion = motion_between(before[i].place, after[j].place, looks, first_positions,
                                           second_positions, options, seed);
      const std::size_t lesser =
          std::min(before[i].place.landmarks.size(), after[j].place.landmarks.size());
      const bool agrees =
          motion.explained >= kMovedLeast &&
          static_cast<double>(motion.explained) >= kMovedShare * static_cast<double>(lesser);
      if (agrees) pairs.push_back({i, j, motion});
    }
  }
  std::stable_sort(pairs.begin(), pairs.end(), [](const PlacePair& a, const PlacePair& b) {
    return a.motion.explained > b.motion.explained;
  });
  return pairs;
}

}  // namespace

constexpr OptionRange kChangeLength = {.least = 0.0,
                                       .expected = "a positive length",
                                       .least_is = OptionRange::End::kExcluded,
                                       .most_is = OptionRange::End::kExcluded};
constexpr OptionField kChangeFields[] = {
    {"min_observations", option_at<&ChangeOptions::min_observations>, kAtLeastOne},
    {"tolerance", option_at<&ChangeOptions::tolerance>, kChangeLength},
    {"reach", option_at<&ChangeOptions::reach>, kChangeLength},
    {"min_landmarks", option_at<&ChangeOptions::min_landmarks>, {.least = 3}},
    {"min_size",
     option_at<&ChangeOptions::min_size>,
     {.least = 0.0, .expected = "a length, 0 or more", .most_is = OptionRange::End::kExcluded},
     "--min-size",
     "With --world: least size of a thing, along its longest side, in the map's unit"},
    {"min_confidence",
     option_at<&ChangeOptions::min_confidence>,
     {.least = 0.0,
      .most = 1.0,
      .expected = "between 0 and 1",
      .least_is = OptionRange::End::kExcluded,
      .most_is = OptionRange::End::kExcluded},
     "--min-confidence",
     "With --world: least confidence of a reported thing, above 0 and below 1"},
};
constinit const OptionTable ChangeOptions::table = {"ChangeOptions", kChangeFields};

void ChangeOptions::validate() const {
  check_options(*this);
}

std::string_view to_string(ChangeKind kind) {
  switch (kind) {
    case ChangeKind::kAppeared:
      return "appeared";
    case ChangeKind::kMoved:
      return "moved";
    case ChangeKind::kVanished:
      break;
  }
  return "vanished";
}

ChangeResult find_changes(const PlacedMap& first, const PlacedMap& second,
                          const ChangeOptions& options, const Execution& execution) {
  options.validate();
  const Looks looks(*first.map, *second.map, execution.seed);
  OneSide vanished(first, second, looks, false, options, execution);
  OneSide appeared(second, first, looks, true, options, execution);
  ChangeResult result;
  result.comparable_first = vanished.comparable().size();
  result.comparable_second = appeared.comparable().size();

  // Rates at which unchanged landmarks are found again, and wrongly seen through; most landmarks are
  // unchanged.
  std::array<double, kViewBins* kObservationBins> found = {};
  std::array<double, kViewBins* kObservationBins> total = {};
  double all_found = 0.0;
  double all = 0.0;
  double through = 0.0;
  for (const OneSide* const side : {&vanished, &appeared}) {
    for (const Comparable& one : side->comparable()) {
      total[one.bin] += 1.0;
      all += 1.0;
      if (!one.found) continue;
      found[one.bin] += 1.0;
      all_found += 1.0;
      through += one.through ? 1.0 : 0.0;
    }
  }
  if (all == 0.0) return result;
  result.repeated = all_found / all;
  constexpr double kSmoothing = 20.0;
  for (std::size_t bin = 0; bin < found.size(); ++bin) {
    found[bin] = std::clamp((found[bin] + kSmoothing * result.repeated) / (total[bin] + kSmoothing),
                            2.0 * kChanceFound, 0.95);
  }
  const double through_if_there = std::clamp((through + 1.0) / (all_found + 2.0), 0.02, 0.4);
  vanished.weigh(found, through_if_there);
  appeared.weigh(found, through_if_there);
  const std::vector<OneSide::Group> before = vanished.groups();
  const std::vector<OneSide::Group> after = appeared.groups();

  std::vector<bool> before_taken(before.size(), false);
  std::vector<bool> after_taken(after.size(), false);
  const std::vector<PlacePair> pairs =
      looks.known() ? moved_pairs(before, after, looks, first, second, options, execution.seed)
                    : std::vector<PlacePair>();
  for (const PlacePair& pair : pairs) {
    if (before_taken[pair.before] || after_taken[pair.after]) continue;
    before_taken[pair.before] = true;
    after_taken[pair.after] = true;
    result.changes.push_back(
        {ChangeKind::kMoved, before[pair.before].place, after[pair.after].place,
         pair.motion.after_from_before,
         std::min(before[pair.before].confidence, after[pair.after].confidence)});
  }
  for (std::size_t i = 0; i < before.size(); ++i) {
    if (before_taken[i]) continue;
    result.changes.push_back(
        {ChangeKind::kVanished, before[i].place, std::nullopt, std::nullopt, before[i].confidence});
  }
  for (std::size_t j = 0; j < after.size(); ++j) {
    if (after_taken[j]) continue;
    result.changes.push_back(
        {ChangeKind::kAppeared, std::nullopt, after[j].place, std::nullopt, after[j].confidence});
  }
  const auto order = [](ChangeKind kind) {
    return kind == ChangeKind::kMoved ? 0 : kind == ChangeKind::kVanished ? 1 : 2;
  };
  std::stable_sort(result.changes.begin(), result.changes.end(),
                   [&](const Change& a, const Change& b) {
                     if (a.kind != b.kind) return order(a.kind) < order(b.kind);
                     return a.confidence > b.confidence;
                   });
  return result;
}

}  // namespace cairn
