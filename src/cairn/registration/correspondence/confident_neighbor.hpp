// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <limits>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "cairn/core/executor.hpp"
#include "cairn/registration/concepts.hpp"

namespace cairn {

/// The paper's choice among the k nearest points: the one of highest confidence (Eq. 6).
///
/// @param nearest     candidates, nearest first
/// @param confidences of the set the candidates are from; empty: the nearest is chosen
/// @return of equal confidences the nearer; nothing if no candidate within `max_squared_distance` has
///         a positive confidence
std::optional<Neighbor> most_confident(std::span<const Neighbor> nearest,
                                       std::span<const double> confidences,
                                       double max_squared_distance);

/// Leaves out the share `trimmed_fraction` of the matches that is farthest apart (of equal distances
/// the later), keeping the order of the others.
std::vector<Match> trimmed(std::vector<Match> matches, double trimmed_fraction);

struct ConfidentNeighborOptions {
  std::size_t k = 5;  ///< candidates a point
  double max_distance =
      std::numeric_limits<double>::infinity();  ///< candidates beyond do not count
  double trimmed_fraction = 0.0;  ///< share of the matches, the farthest, left out; in [0, 1)
};

/// One side of the data association: a searchable set and the confidences of its points.
template <NeighborSearch Search>
struct ConfidentSet {
  const Search& search;
  std::span<const Eigen::Vector3d> positions;
  std::span<const double> confidences;  ///< one a point, or empty
};

/// The paper's data association: the match of a source point is the most confident of its k nearest
/// target points; with k = 1, or without confidences, the nearest, as in the base ICP. With a source
/// set, a match is kept only if the source point is also the target point's choice, by the same rule
/// the other way round (reciprocal matches). A CorrespondenceSearch; the sets must outlive it.
template <NeighborSearch Search>
class ConfidentNeighborCorrespondence {
 public:
  /// @param source in the source frame; nothing: matches need not be reciprocal
  ConfidentNeighborCorrespondence(ConfidentSet<Search> target,
                                  std::optional<ConfidentSet<Search>> source,
                                  const ConfidentNeighborOptions& options, Executor executor)
      : target_(target), source_(source), options_(options), executor_(std::move(executor)) {}

  std::vector<Match> operator()(std::span<const Eigen::Vector3d> moved_source,
                                const Rigid3& target_from_source) const {
    constexpr std::size_t kBlock = 256;
    const Rigid3 source_from_target = target_from_source.inverse();
    std::vector<std::optional<Neighbor>> chosen(moved_source.size());
    executor_.for_blocks(chosen.size(), kBlock, [&](std::size_t begin, std::size_t end) {
      std::vector<Neighbor> candidates(options_.k);
      for (std::size_t i = begin; i < end; ++i) {
        const auto match = choose(target_, moved_source[i], candidates);
        if (!match) continue;
        if (source_) {
          const auto back =
              choose(*source_, source_from_target * target_.positions[match->index], candidates);
          if (!back || back->index != i) continue;
        }
        chosen[i] = match;
      }
    });
    std::vector<Match> matches;
    matches.reserve(chosen.size());
    for (std::uint32_t i = 0; i < chosen.size(); ++i) {
      if (chosen[i]) matches.push_back({i, chosen[i]->index, chosen[i]->squared_distance});
    }
    return trimmed(std::move(matches), options_.trimmed_fraction);
  }

 private:
  std::optional<Neighbor> choose(const ConfidentSet<Search>& set, const Eigen::Vector3d& query,
                                 std::span<Neighbor> candidates) const {
    // Without confidences only the nearest can be chosen.
    if (set.confidences.empty()) candidates = candidates.first(1);
    const std::size_t count = set.search.nearest(query, candidates);
    return most_confident(candidates.first(count), set.confidences,
                          options_.max_distance * options_.max_distance);
  }

  ConfidentSet<Search> target_;
  std::optional<ConfidentSet<Search>> source_;
  ConfidentNeighborOptions options_;
  Executor executor_;
};

}  // namespace cairn
