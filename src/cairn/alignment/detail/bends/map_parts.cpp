// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/alignment/detail/bends/map_parts.hpp"

#include <algorithm>
#include <cstdint>
#include <limits>
#include <numeric>

#include "cairn/geometry/detail/centroid.hpp"

namespace cairn {
namespace {

constexpr double kCutWithin = 0.25;  // of a part, from an even division

bool all_have_times(const FrameTable& frames) {
  return !frames.timestamps_s.empty() &&
         std::all_of(frames.timestamps_s.begin(), frames.timestamps_s.end(),
                     [](const auto& time) { return time.has_value(); });
}

// Of each keyframe.
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

}  // namespace

std::vector<FrameIndex> keyframes_in_order(const LandmarkMap& map) {
  std::vector<FrameIndex> order;
  for (std::uint32_t i = 0; i < map.frame_count(); ++i) order.push_back(FrameIndex{i});
  const FrameTable& frames = map.frames();
  const bool by_time = all_have_times(frames);
  std::stable_sort(order.begin(), order.end(), [&](FrameIndex a, FrameIndex b) {
    if (by_time) return *frames.timestamps_s[a.value] < *frames.timestamps_s[b.value];
    return frames.ids[a.value] < frames.ids[b.value];
  });
  return order;
}

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
                                    const CutOptions& options) {
  const std::vector<LandmarkIndex> kept = landmarks_to_align(map, points);
  if (!map.has_observations() || map.frame_count() == 0 || kept.empty()) return {};
  const auto& times = map.frames().timestamps_s;
  const bool by_time = all_have_times(map.frames());
  const std::vector<FrameIndex> order = keyframes_in_order(map);
  const std::vector<std::uint32_t> rank = ranks_of(order);
  std::vector<std::optional<Observed>> observed(kept.size());
  std::vector<std::size_t> middles(order.size());  // landmarks whose middle keyframe it is
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
      std::clamp<std::size_t>(total / std::max<std::size_t>(options.landmarks, 1), 1,
                              std::max<std::size_t>(options.parts, 1));
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
    if (by_time) {
      part.first_s = *times[order[begins[i]].value];
      part.last_s = *times[order[end - 1].value];
    }
    for (std::uint32_t j = begins[i]; j < end; ++j) part_of[j] = static_cast<std::uint32_t>(i);
  }
  for (std::size_t i = 0; i < kept.size(); ++i) {
    if (observed[i]) parts[part_of[observed[i]->middle]].landmarks.push_back(kept[i]);
  }
  return parts;
}

}  // namespace cairn
