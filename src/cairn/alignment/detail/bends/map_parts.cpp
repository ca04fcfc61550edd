// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/alignment/detail/bends/map_parts.hpp"

#include <algorithm>
#include <limits>
#include <numeric>
#include <utility>

#include "cairn/geometry/detail/centroid.hpp"
#include "cairn/map/operations.hpp"

namespace cairn::detail {
namespace {

// Largest distance of a cut from an even division, in parts.
constexpr double kCutWithin = 0.25;
constexpr std::size_t kMostPlaced = 1500;  // landmarks of a part: the most observed ones

// Rank of each keyframe in the order.
std::vector<std::uint32_t> ranks_of(const std::vector<FrameIndex>& order) {
  std::vector<std::uint32_t> rank(order.size());
  for (std::uint32_t i = 0; i < order.size(); ++i) rank[order[i].value] = i;
  return rank;
}

// The ranks of the first, the middle and the last keyframe that observed a landmark.
struct Observed {
  std::uint32_t first = 0;
  std::uint32_t middle = 0;
  std::uint32_t last = 0;
};

std::optional<Observed> observed_by(const LandmarkMap& map, LandmarkIndex landmark,
                                    const std::vector<std::uint32_t>& rank) {
  std::vector<std::uint32_t> ranks;
  for (const FrameIndex frame : map.observing_frames(landmark)) ranks.push_back(rank[frame.value]);
  if (ranks.empty()) return std::nullopt;
  std::sort(ranks.begin(), ranks.end());
  return Observed{ranks.front(), ranks[(ranks.size() - 1) / 2], ranks.back()};
}

// The landmarks with the most observations, at most `count`, in their order.
std::vector<LandmarkIndex> most_observed(const LandmarkMap& map,
                                         const std::vector<LandmarkIndex>& landmarks,
                                         std::size_t count) {
  if (landmarks.size() <= count) return landmarks;
  std::vector<LandmarkIndex> chosen = landmarks;
  const auto before = [&](LandmarkIndex a, LandmarkIndex b) {
    const std::size_t of_a = map.observing_frames(a).size();
    const std::size_t of_b = map.observing_frames(b).size();
    return of_a != of_b ? of_a > of_b : a < b;
  };
  std::nth_element(chosen.begin(), chosen.begin() + static_cast<std::ptrdiff_t>(count),
                   chosen.end(), before);
  chosen.resize(count);
  std::sort(chosen.begin(), chosen.end());
  return chosen;
}

}  // namespace

AlongParts along_parts(const LandmarkMap& map, std::span<const FrameId> middles) {
  const std::vector<FrameIndex> order = keyframes_in_order(map);
  const std::vector<std::uint32_t> rank = ranks_of(order);
  std::vector<double> of_middle;  // rank
  for (const FrameId middle : middles) {
    const auto found = std::find_if(order.begin(), order.end(), [&](FrameIndex frame) {
      return map.frames().ids[frame.value] == middle;
    });
    of_middle.push_back(static_cast<double>(found - order.begin()));
  }
  AlongParts along;
  for (const std::uint32_t own : rank) {
    const auto place = static_cast<double>(own);
    const auto next = std::upper_bound(of_middle.begin() + 1, of_middle.end() - 1, place);
    const auto part = static_cast<double>(next - of_middle.begin() - 1);
    along.keyframes.push_back(0.5 + part + (place - *(next - 1)) / (*next - *(next - 1)));
  }
  for (std::uint32_t i = 0; i < map.landmark_count(); ++i) {
    const auto observed = observed_by(map, LandmarkIndex{i}, rank);
    along.landmarks.push_back(observed ? along.keyframes[order[observed->middle].value]
                                       : std::numeric_limits<double>::quiet_NaN());
  }
  along.centre = centroid(map.landmarks().positions);
  return along;
}

std::vector<MapPart> cut_into_parts(const LandmarkMap& map, const PointSetOptions& points,
                                    std::size_t part_landmarks) {
  if (!map.has_observations() || map.frame_count() == 0) return {};
  const std::vector<LandmarkIndex> kept = landmarks_to_align(map, points);
  if (kept.empty()) return {};
  const std::vector<FrameIndex> order = keyframes_in_order(map);
  const std::vector<std::uint32_t> rank = ranks_of(order);
  std::vector<std::optional<Observed>> observed(kept.size());
  std::vector<std::size_t> middles(order.size());  // number of landmarks per middle keyframe
  std::vector<std::ptrdiff_t> across(order.size() +
                                     1);  // observed before a keyframe and from it on
  std::size_t total = 0;
  for (std::size_t i = 0; i < kept.size(); ++i) {
    observed[i] = observed_by(map, kept[i], rank);
    if (!observed[i]) continue;
    ++middles[observed[i]->middle];
    ++across[observed[i]->first + 1];
    --across[observed[i]->last + 1];
    ++total;
  }
  std::partial_sum(across.begin(), across.end(), across.begin());

  const std::size_t count =
      std::clamp<std::size_t>(total / std::max<std::size_t>(part_landmarks, 1), 1, kMostParts);
  // Each part begins with the keyframe of that rank.
  std::vector<std::uint32_t> begins = {0};
  const double size = static_cast<double>(total) / static_cast<double>(count);
  std::size_t before = 0;  // landmarks of earlier keyframes
  std::vector<std::size_t> earlier(order.size() + 1);
  for (std::size_t i = 0; i < order.size(); ++i) {
    earlier[i] = before;
    before += middles[i];
  }
  earlier.back() = before;
  for (std::size_t part = 1; part < count; ++part) {
    const double even = size * static_cast<double>(part);
    std::optional<std::uint32_t> best;
    for (std::uint32_t i = begins.back() + 1; i < order.size(); ++i) {
      const double off = static_cast<double>(earlier[i]) - even;
      if (off < -kCutWithin * size) continue;
      if (off > kCutWithin * size) break;
      if (!best || across[i] < across[*best]) best = i;
    }
    if (best) begins.push_back(*best);
  }

  std::vector<MapPart> parts;
  std::vector<std::uint32_t> part_of(order.size());
  for (std::size_t i = 0; i < begins.size(); ++i) {
    const std::uint32_t end =
        i + 1 < begins.size() ? begins[i + 1] : static_cast<std::uint32_t>(order.size());
    MapPart& part = parts.emplace_back();
    part.first = map.frames().ids[order[begins[i]].value];
    part.last = map.frames().ids[order[end - 1].value];
    std::uint32_t middle = begins[i];
    while (middle + 1 < end && 2 * earlier[middle + 1] < earlier[begins[i]] + earlier[end]) {
      ++middle;
    }
    part.middle = map.frames().ids[order[middle].value];
    for (std::uint32_t j = begins[i]; j < end; ++j) part_of[j] = static_cast<std::uint32_t>(i);
  }
  for (std::size_t i = 0; i < kept.size(); ++i) {
    if (observed[i]) parts[part_of[observed[i]->middle]].landmarks.push_back(kept[i]);
  }
  return parts;
}

PreparedParts::PreparedParts(const LandmarkMap& map, const PrepareOptions& options,
                             std::uint64_t seed)
    : seed_(seed) {
  parts_ = cut_into_parts(map, options.points, options.part_landmarks);
  if (parts_.size() < 2) parts_.clear();
  std::vector<std::uint32_t> of_landmark(map.landmark_count(),
                                         static_cast<std::uint32_t>(parts_.size()));
  std::vector<FrameId> middles;
  for (std::uint32_t i = 0; i < parts_.size(); ++i) {
    for (const LandmarkIndex landmark : parts_[i].landmarks) of_landmark[landmark.value] = i;
    middles.push_back(parts_[i].middle);
  }
  AlongParts of_map;
  if (!parts_.empty()) of_map = along_parts(map, middles);
  for (const LandmarkIndex landmark : landmarks_to_align(map, options.points)) {
    part_of_.push_back(of_landmark[landmark.value]);
    if (!parts_.empty()) along_.landmarks.push_back(of_map.landmarks[landmark.value]);
  }
  along_.keyframes = std::move(of_map.keyframes);
  along_.centre = of_map.centre;
  for (const MapPart& part : parts_) {
    clouds_.push_back(
        landmark_cloud(with_landmarks(map, most_observed(map, part.landmarks, kMostPlaced)),
                       options.confidence, options.points));
  }
}

std::span<const PreparedPart> PreparedParts::prepared() {
  std::call_once(once_, [&] {
    for (std::size_t i = 0; i < parts_.size(); ++i) {
      // On this thread only, because executing other tasks here could deadlock.
      prepared_.push_back(
          {std::move(parts_[i]), PreparedMap(std::move(clouds_[i]), "part", {.seed = seed_})});
    }
    clouds_.clear();
  });
  return prepared_;
}

}  // namespace cairn::detail
