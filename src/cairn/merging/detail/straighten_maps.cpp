// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/merging/detail/straighten_maps.hpp"

#include <algorithm>
#include <array>
#include <numeric>
#include <tuple>
#include <utility>

#include "cairn/alignment/bends.hpp"
#include "cairn/geometry/angles.hpp"
#include "cairn/map/operations.hpp"
#include "cairn/merging/detail/descriptor_difference.hpp"
#include "cairn/merging/linking/link_maps.hpp"

namespace cairn::detail {
namespace {

// Least growth of the number of fused landmarks. With less, the bend is within the uncertainty of the parts.
constexpr double kLeastGain = 1.02;
// Parts of a straight mini-map may seem bent by 1.6 degrees.
constexpr double kLeastBend = radians(2.0);
constexpr double kLeastScaleRatio = 1.02;  // of a deformation that bends less

// Number of landmarks of the source that are fused with one of the target.
double fused(const LandmarkMap& target, const LandmarkMap& source, const Link& link,
             const FusionOptions& options, const Execution& execution) {
  PlacedMap placed{&source, "source", *link.target_from_source};
  placed.covariance = link.full_covariance().value_or(Matrix7d::Zero());
  const std::vector<PlacedMap> both = {{&target, "target", Similarity3()}, placed};
  return static_cast<double>(fuse_maps(both, options, execution).maps[1].fused);
}

// Whether descriptors can show how one map is bent against the other; nothing else does.
bool can_show_bends(const LandmarkMap& a, const LandmarkMap& b) {
  const auto& one = a.landmarks().descriptors;
  const auto& other = b.landmarks().descriptors;
  return one && other && comparable(*one, *other);
}

// The straightened map, in the frame in which the link's pose holds instead of that of the parts.
LandmarkMap straightened_for(const LandmarkMap& map, const PartsAlignment& parts,
                             const Similarity3& target_from_source) {
  const Similarity3 own_from_straight =
      parts.bend->map == MapRole::kSource
          ? target_from_source.inverse() * *parts.target_from_source
          : target_from_source * parts.target_from_source->inverse();
  return transformed(straightened(map, parts), own_from_straight);
}

// The source of a link with a free scale, without its deformation against the target; std::nullopt if it is not
// clearly deformed.
std::optional<StraightenedMap> undeformed(const LandmarkMap& map, const PreparedMap& source,
                                          const PreparedMap& target, const Link& link) {
  const auto pose = DeformablePair(source, target).fit(std::array{*link.target_from_source});
  if (!pose || !pose->is_small || !pose->is_clear()) return std::nullopt;
  const MapDeformation& figures = pose->figures;
  if (figures.rotation_rad < kLeastBend && figures.scale_ratio < kLeastScaleRatio) {
    return std::nullopt;
  }
  const std::vector<FrameIndex> order = keyframes_in_order(map);
  MapBend bend;
  bend.map = MapRole::kSource;
  bend.rotation_rad = figures.rotation_rad;
  bend.displacement = figures.displacement;
  if (!order.empty()) {
    bend.first = map.frames().ids[order.front().value];
    bend.last = map.frames().ids[order.back().value];
  }
  const Similarity3 own_from_deformed =
      link.target_from_source->inverse() * pose->target_from_source;
  return StraightenedMap{transformed(straightened(map, *pose), own_from_deformed), bend};
}

// Indices of the links, the most certain first, then those of the largest maps, whatever the order of the input.
std::vector<std::size_t> order_of(std::span<const Link> links, std::span<const PlacedMap> maps) {
  const std::vector<std::size_t> by_size = largest_first(maps);
  std::vector<std::size_t> rank(maps.size());
  for (std::size_t i = 0; i < by_size.size(); ++i) rank[by_size[i]] = i;
  std::vector<std::size_t> order(links.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  const auto key = [&](std::size_t i) {
    const Link& link = links[i];
    return std::tuple(-link.probability.value_or(1.0), rank[link.target.value],
                      rank[link.source.value]);
  };
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return key(a) < key(b); });
  return order;
}

}  // namespace

std::vector<std::optional<StraightenedMap>> straighten_maps(std::span<const PlacedMap> maps,
                                                            std::span<const Link> links,
                                                            const FusionOptions& options,
                                                            const Execution& execution) {
  Execution quiet = execution.without_progress();
  quiet.log = {};
  std::vector<std::optional<PreparedMap>> prepared(maps.size());
  // Smaller parts than where the maps are not aligned: the pose is known, and the bend shows in three or more.
  const auto prepare = [&](std::size_t map) -> const PreparedMap& {
    if (!prepared[map]) {
      prepared[map].emplace(*maps[map].map, PrepareOptions{.part_landmarks = 300}, quiet);
    }
    return *prepared[map];
  };
  const auto parts_of = [&](const Link& link) {
    auto parts = parts_of_pair(prepare(link.target.value), prepare(link.source.value), {}, quiet);
    if (parts) return parts;
    // Larger ones, by which maps are aligned that are not as a whole.
    return parts_of_pair(prepared_to_link(*maps[link.target.value].map, {}, quiet),
                         prepared_to_link(*maps[link.source.value].map, {}, quiet), {}, quiet);
  };
  std::vector<std::optional<StraightenedMap>> straight(maps.size());
  const auto now = [&](std::size_t map) -> const LandmarkMap& {
    return straight[map] ? straight[map]->map : *maps[map].map;
  };
  std::vector<std::size_t> group(maps.size());
  std::iota(group.begin(), group.end(), std::size_t{0});
  for (const std::size_t index : order_of(links, maps)) {
    const Link& link = links[index];
    const std::size_t joined = group[link.source.value];
    if (joined == group[link.target.value]) continue;
    std::replace(group.begin(), group.end(), joined, group[link.target.value]);
    if (link.kind != LinkKind::kPlacement) continue;
    if (!can_show_bends(*maps[link.target.value].map, *maps[link.source.value].map)) continue;
    if (link.covariance_with_scale && !straight[link.source.value]) {
      auto mended = undeformed(*maps[link.source.value].map, prepare(link.source.value),
                               prepare(link.target.value), link);
      if (mended && fused(now(link.target.value), mended->map, link, options, quiet) >=
                        kLeastGain * fused(now(link.target.value), now(link.source.value), link,
                                           options, quiet)) {
        straight[link.source.value] = std::move(mended);
        continue;
      }
    }
    const std::optional<PartsAlignment> parts = parts_of(link);
    if (!parts || !parts->bend || parts->bend->rotation_rad < kLeastBend) continue;
    const bool of_source = parts->bend->map == MapRole::kSource;
    const std::size_t bent = of_source ? link.source.value : link.target.value;
    if (straight[bent]) continue;
    LandmarkMap map = straightened_for(*maps[bent].map, *parts, *link.target_from_source);
    const double before =
        fused(now(link.target.value), now(link.source.value), link, options, quiet);
    const double after = fused(of_source ? now(link.target.value) : map,
                               of_source ? map : now(link.source.value), link, options, quiet);
    if (after >= kLeastGain * before) straight[bent] = {std::move(map), *parts->bend};
  }
  return straight;
}

}  // namespace cairn::detail
