// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <limits>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "cairn/core/execution.hpp"
#include "cairn/registration/icp.hpp"
#include "cairn/registration/stages.hpp"

namespace cairn {

/// The paper's choice among the k nearest points: the point of highest confidence (Eq. 6).
///
/// @param nearest     candidates, nearest first
/// @param confidences one per point of the searched set; empty: the nearest point is chosen
/// @return the chosen point, the nearer of equal confidences; std::nullopt if no candidate within
///        `max_squared_distance` has a positive confidence
template <NearestList List>
std::optional<Neighbor> most_confident(const List& nearest, std::span<const double> confidences,
                                       double max_squared_distance) {
  const bool is_limited = max_squared_distance < std::numeric_limits<double>::infinity();
  std::size_t best = nearest.size();
  double best_confidence = 0.0;
  for (std::size_t j = 0; j < nearest.size(); ++j) {
    if (is_limited && nearest.squared_distance(j) > max_squared_distance) break;
    if (confidences.empty()) {
      best = j;
      break;
    }
    const double confidence = confidences[nearest.index(j)];
    if (confidence > best_confidence) {
      best = j;
      best_confidence = confidence;
    }
  }
  if (best == nearest.size()) return std::nullopt;
  return Neighbor{nearest.index(best), nearest.squared_distance(best)};
}

/// Rejects the share `trimmed_fraction` of the matches with the largest distances (among equal
/// distances, the later matches). Keeps the order of the others.
std::vector<Match> trimmed(std::vector<Match> matches, double trimmed_fraction);

/// One side of the data association: a searchable set and its points' confidences.
template <NeighborSearch Search>
struct ConfidentSet {
  const Search& search;
  std::span<const Eigen::Vector3d> positions;
  std::span<const double> confidences;  ///< one per point, or empty
};

/// The paper's data association: matches a source point with the most confident of its k nearest
/// target points. With k = 1 or without confidences, this is the nearest point, as in base ICP. If
/// a source set is given, keeps only reciprocal matches: the same rule, applied to the target
/// point, must choose the source point. A CorrespondenceSearch; the sets must outlive this object.
///
/// A search with batches reuses the previous call's results, so small motions cost little. Not thread-safe.
template <NeighborSearch Search>
class ConfidentNeighborCorrespondence {
 public:
  /// @param source  set in the source frame; std::nullopt: matches need not be reciprocal
  /// @param options only k, max_distance and trimmed_fraction are used
  ConfidentNeighborCorrespondence(ConfidentSet<Search> target,
                                  std::optional<ConfidentSet<Search>> source,
                                  const IcpOptions& options, const Executor& executor = Executor())
      : target_(target),
        source_(source),
        k_(std::min(options.k, target.positions.size())),
        max_distance_(options.max_distance),
        trimmed_fraction_(options.trimmed_fraction),
        executor_(executor),
        source_queries_(query_batch(target.search, candidates(target))) {}

  std::vector<Match> operator()(std::span<const Eigen::Vector3d> moved_source,
                                const Rigid3& target_from_source) const {
    std::vector<Match> matches(moved_source.size());
    source_queries_.for_each(
        moved_source, executor_, [&](std::size_t i, const NearestList auto& nearest) {
          const auto chosen = most_confident(nearest, target_.confidences, max_squared_distance());
          matches[i] =
              chosen ? Match{static_cast<std::uint32_t>(i), chosen->index, chosen->squared_distance}
                     : kNone;
        });
    if (source_) drop_one_sided(matches, target_from_source.inverse());
    std::erase(matches, kNone);
    return trimmed(std::move(matches), trimmed_fraction_);
  }

  /// The batch of queries for the moved source points, shared with other users of the same nearest
  /// points.
  QueryBatch<Search>& source_queries() const { return source_queries_; }

 private:
  static constexpr std::uint32_t kNobody = std::numeric_limits<std::uint32_t>::max();
  static constexpr Match kNone = {kNobody, kNobody, 0.0};

  // Without confidences only the nearest can be chosen.
  std::size_t candidates(const ConfidentSet<Search>& set) const {
    return set.confidences.empty() ? 1 : k_;
  }

  double max_squared_distance() const { return max_distance_ * max_distance_; }

  void drop_one_sided(std::span<Match> matches, const Rigid3& source_from_target) const {
    constexpr std::size_t kBlock = 256;
    executor_.for_blocks(matches.size(), kBlock, [&](std::size_t begin, std::size_t end) {
      std::vector<Neighbor> found(candidates(*source_));
      for (Match& match : matches.subspan(begin, end - begin)) {
        if (match == kNone) continue;
        const Eigen::Vector3d query = source_from_target * target_.positions[match.target];
        const std::size_t count = source_->search.nearest(query, found);
        const auto back = most_confident(NeighborList(std::span(found).first(count)),
                                         source_->confidences, max_squared_distance());
        if (!back || back->index != match.source) match = kNone;
      }
    });
  }

  ConfidentSet<Search> target_;
  std::optional<ConfidentSet<Search>> source_;
  std::size_t k_;
  double max_distance_;
  double trimmed_fraction_;
  Executor executor_;
  mutable QueryBatch<Search> source_queries_;
};

}  // namespace cairn
