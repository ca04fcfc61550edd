// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/placement/map_parts.hpp"

#include <algorithm>
#include <cstdint>
#include <numeric>

namespace cairn {
namespace {

constexpr double kCutWithin = 0.25;  // of a part, from an even division

bool all_have_times(const FrameTable& frames) {
  return !frames.timestamps_s.empty() &&
         std::all_of(frames.timestamps_s.begin(), frames.timestamps_s.end(),
                     [](const auto& time) { return time.has_value(); });
}

// The ranks in that order of the first, the middle and the last keyframe that observed a landmark.
struct Observed {
  std::uint32_t first = 0;
  std::uint32_t middle = 0;
  std::uint32_t last = 0;
};

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

std::vector<MapPart> cut_into_parts(const LandmarkMap& map, const PointSetOptions& points,
                                    const CutOptions& options) {
  const std::vector<LandmarkIndex> kept = landmarks_to_align(map, points);
  if (!map.has_observations() || map.frame_count() == 0 || kept.empty()) return {};
  const auto& times = map.frames().timestamps_s;
  const bool by_time = all_have_times(map.frames());
  const std::vector<FrameIndex> order = keyframes_in_order(map);
  std::vector<std::uint32_t> rank(order.size());
  for (std::uint32_t i = 0; i < order.size(); ++i) rank[order[i].value] = i;

  std::vector<Observed> observed(kept.size());
  std::vector<bool> seen(kept.size());
  std::vector<std::size_t> middles(order.size());  // landmarks whose middle keyframe it is
  std::vector<std::ptrdiff_t> across(order.size() +
                                     1);  // observed before a keyframe and from it on
  std::size_t total = 0;
  for (std::size_t i = 0; i < kept.size(); ++i) {
    std::vector<std::uint32_t> ranks;
    for (const FrameIndex frame : map.observing_frames(kept[i])) ranks.push_back(rank[frame.value]);
    if (ranks.empty()) continue;
    std::sort(ranks.begin(), ranks.end());
    observed[i] = {ranks.front(), ranks[(ranks.size() - 1) / 2], ranks.back()};
    seen[i] = true;
    ++middles[observed[i].middle];
    ++across[observed[i].first + 1];
    --across[observed[i].last + 1];
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
    if (!seen[i]) continue;
    const std::uint32_t middle = observed[i].middle;
    const std::size_t index = part_of[middle];
    parts[index].landmarks.push_back(kept[i]);
    const std::size_t begin = earlier[begins[index]];
    const std::size_t end = index + 1 < begins.size() ? earlier[begins[index + 1]] : earlier.back();
    // Half of those of its own keyframe count as earlier.
    parts[index].along.push_back((0.5 * static_cast<double>(earlier[middle] + earlier[middle + 1]) -
                                  static_cast<double>(begin)) /
                                 static_cast<double>(end - begin));
  }
  return parts;
}

}  // namespace cairn
