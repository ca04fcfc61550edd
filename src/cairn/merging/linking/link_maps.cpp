// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/merging/linking/link_maps.hpp"

#include <mutex>
#include <utility>

#include <fmt/format.h>

#include "cairn/alignment/bends.hpp"
#include "cairn/core/error.hpp"
#include "cairn/map/operations.hpp"

namespace cairn {
namespace {

AlignOptions align_options(const LinkOptions& options) {
  AlignOptions align;
  align.min_probability = options.min_probability;
  align.prior_odds = options.prior_odds;
  align.effort = options.effort;
  align.points = options.points;
  align.seed = options.seed;
  align.execution = options.execution;
  return align;
}

MapLink linked(const PreparedMap& target, const PreparedMap& source, const AlignOptions& options) {
  Alignment alignment = align(source, target, options);
  if (alignment.registration.status == RegistrationStatus::kCancelled) {
    throw Error(ErrorKind::kCancelled, "merge", "linking was cancelled", "");
  }
  MapLink link;
  link.verdict = alignment.verdict.value_or(Verdict::kRejected);
  link.probability = alignment.probability.value_or(0.0);
  link.reason = std::move(alignment.reason);
  if (!alignment.target_from_source) return link;
  link.target_from_source = alignment.target_from_source;
  link.covariance = alignment.registration.covariance;
  link.covariance_with_scale = alignment.registration.covariance_with_scale;
  return link;
}

}  // namespace

std::string_view link_status(const std::optional<Verdict>& verdict) {
  return verdict ? to_string(*verdict) : "stated";
}

PreparedMap prepared_to_link(const LandmarkMap& map, const LinkOptions& options) {
  return PreparedMap(map, {.confidence = {},
                           .points = options.points,
                           .seed = options.seed,
                           .executor = options.execution.executor});
}

MapLink link_pair(const PreparedMap& target, const PreparedMap& source,
                  const LinkOptions& options) {
  return linked(target, source, align_options(options));
}

std::optional<PartsAlignment> parts_of_pair(const PreparedMap& target, const PreparedMap& source,
                                            const LinkOptions& options) {
  PlaceOptions placement;
  placement.min_probability = options.min_probability;
  placement.prior_odds = options.prior_odds;
  placement.effort = options.effort;
  placement.scale = scale_range(align_options(options), source.length_unit(), target.length_unit());
  placement.seed = options.seed;
  placement.execution = options.execution.without_progress();
  PartsAlignment parts = place_by_parts(source, target, placement);
  if (!parts.consensus) return std::nullopt;
  return parts;
}

std::optional<PoseLink> pose_link(const MapLink& link) {
  if (!connects(link.verdict, link.target_from_source)) return std::nullopt;
  return PoseLink{NodeId{link.target}, NodeId{link.source},        *link.target_from_source,
                  link.covariance,     link.covariance_with_scale, link.kind,
                  link.probability};
}

MapLink stated_link(const PoseLink& link) {
  return {.target = link.target.value,
          .source = link.source.value,
          .kind = link.kind,
          .verdict = std::nullopt,
          .probability = link.probability,
          .reason = fmt::format("stated by {}", to_string(link.kind)),
          .target_from_source = link.target_from_source,
          .covariance = link.covariance,
          .covariance_with_scale = link.covariance_with_scale};
}

void LinkOptions::validate() const {
  align_options(*this).validate();
}

std::vector<MapLink> link_maps(std::span<const LandmarkMap* const> maps,
                               const LinkOptions& options) {
  std::vector<std::pair<std::size_t, std::size_t>> pairs;
  for (std::size_t later = 1; later < maps.size(); ++later) {
    for (std::size_t earlier = 0; earlier < later; ++earlier) pairs.emplace_back(earlier, later);
  }
  return link_maps(maps, pairs, options);
}

std::vector<MapLink> link_maps(std::span<const LandmarkMap* const> maps,
                               std::span<const std::pair<std::size_t, std::size_t>> pairs,
                               const LinkOptions& options) {
  options.validate();
  for (const auto& [a, b] : pairs) {
    if (a < maps.size() && b < maps.size() && a != b) continue;
    throw Error(ErrorKind::kMisuse, "pairs", fmt::format("({}, {})", a, b),
                fmt::format("two of {} maps", maps.size()));
  }
  std::vector<MapLink> links(pairs.size());
  const Executor& executor = options.execution.executor;
  std::vector<PreparedMap> prepared;
  prepared.reserve(maps.size());
  for (const LandmarkMap* map : maps) prepared.push_back(prepared_to_link(*map, options));
  // With many pairs, the pairs run in parallel rather than the work within each.
  const bool by_pairs = pairs.size() >= executor.threads();
  AlignOptions align = align_options(options);
  align.execution = options.execution.without_progress();
  if (by_pairs) align.execution.executor = Executor(1);
  std::mutex mutex;
  std::size_t done = 0;
  const auto link_pairs = [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      auto [target, source] = pairs[i];
      if (precedes(*maps[source], *maps[target])) std::swap(target, source);
      links[i] = linked(prepared[target], prepared[source], align);
      links[i].target = target;
      links[i].source = source;
      const std::lock_guard lock(mutex);
      ++done;
      if (options.execution.progress) {
        options.execution.progress(static_cast<double>(done) / static_cast<double>(pairs.size()));
      }
    }
  };
  if (by_pairs) {
    executor.for_blocks(pairs.size(), 1, link_pairs);
  } else {
    link_pairs(0, pairs.size());
  }
  return links;
}

}  // namespace cairn
