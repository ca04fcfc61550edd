// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/merging/linking/link_maps.hpp"

#include <algorithm>
#include <list>
#include <map>
#include <mutex>
#include <set>

#include <fmt/format.h>

#include "cairn/alignment/bends.hpp"
#include "cairn/core/error.hpp"
#include "cairn/map/operations.hpp"
#include "cairn/merging/recognition/map_index.hpp"

namespace cairn {
namespace {

AlignOptions align_options(const LinkOptions& options) {
  AlignOptions align;
  align.min_probability = options.min_probability;
  align.prior_odds = options.prior_odds;
  align.effort = options.effort;
  align.points = options.points;
  return align;
}

Link linked(const PreparedMap& target, const PreparedMap& source, const AlignOptions& options,
            const Execution& execution) {
  Alignment alignment = align(source, target, options, execution);
  if (alignment.registration.status == RegistrationStatus::kCancelled) {
    throw Error(ErrorKind::kCancelled, "merge", "linking was cancelled", "");
  }
  Link link;
  link.verdict = alignment.verdict.value_or(Verdict::kRejected);
  link.probability = alignment.probability.value_or(0.0);
  link.reason = std::move(alignment.reason);
  link.repeats = alignment.common_images > 0 || alignment.one_map;
  if (!alignment.target_from_source) return link;
  link.target_from_source = alignment.target_from_source;
  link.covariance = alignment.registration.covariance;
  link.covariance_with_scale = alignment.registration.covariance_with_scale;
  return link;
}

}  // namespace

MapsInMemory::MapsInMemory(std::span<const LandmarkMap* const> maps,
                           std::vector<std::string> sessions)
    : maps_(maps.begin(), maps.end()), sessions_(std::move(sessions)) {}

std::shared_ptr<const LandmarkMap> MapsInMemory::load(std::size_t map) {
  return {std::shared_ptr<void>(), maps_[map]};  // of the caller
}

PreparedMap prepared_to_link(const LandmarkMap& map, const LinkOptions& options,
                             const Execution& execution) {
  return PreparedMap(map, {.points = options.points}, execution);
}

std::optional<PartsAlignment> parts_of_pair(const PreparedMap& target, const PreparedMap& source,
                                            const LinkOptions& options,
                                            const Execution& execution) {
  AlignOptions placement = align_options(options);
  placement.scale = scale_range(placement, source.length_unit(), target.length_unit());
  PartsAlignment parts = place_by_parts(source, target, placement, execution.without_progress());
  if (!parts.consensus) return std::nullopt;
  return parts;
}

constexpr OptionField kLinkFields[] = {
    {"min_probability",
     option_at<&LinkOptions::min_probability>,
     {},
     "--min-probability",
     "Least probability of an aligned pair, at least 0.5 and below 1"},
    {"prior_odds",
     option_at<&LinkOptions::prior_odds>,
     {},
     "--prior-odds",
     "Odds that two of the maps show the same place, before any evidence"},
    {"effort",
     option_at<&LinkOptions::effort>,
     {},
     "--effort",
     "Work of the search, as a multiple of the default's, 1/16 to 64"},
    {"min_observations",
     option_at<&LinkOptions::points, &PointSetOptions::min_observations>,
     {},
     "--min-observations",
     "Align with landmarks of at least this many observations; all landmarks are merged"},
    {"candidates",
     option_at<&LinkOptions::candidates>,
     {},
     "--candidates",
     "Align each map only with this many other maps, those that most likely show the same place; "
     "0: with all (default: with all for up to 32 maps, else 10)"},
};
static_assert(kMapsTriedInFull == 32 && kDefaultCandidates == 10, "the help says so");
constinit const OptionTable LinkOptions::table = {"LinkOptions", kLinkFields};

// AlignOptions hold the ranges.
void LinkOptions::validate() const {
  align_options(*this).validate();
}

std::vector<IndexPair> pairs_to_link(MapStore& maps, const LinkOptions& options,
                                     const Execution& execution) {
  const std::size_t count = maps.size();
  const std::size_t candidates =
      options.candidates.value_or(count > kMapsTriedInFull ? kDefaultCandidates : 0);
  std::set<IndexPair> by_higher;  // the higher index first
  const auto add = [&](std::size_t a, std::size_t b) {
    by_higher.emplace(std::max(a, b), std::min(a, b));
  };
  const auto add_all_with = [&](std::size_t map, std::size_t below) {
    for (std::size_t other = 0; other < below; ++other) {
      if (other != map) add(map, other);
    }
  };
  if (candidates == 0) {
    for (std::size_t map = 0; map < count; ++map) add_all_with(map, map);
  } else {
    MapIndex index(execution.seed);
    std::map<std::string, std::size_t> last_of_session;
    for (std::size_t map = 0; map < count; ++map) {
      if (execution.stop.stop_requested()) {
        throw Error(ErrorKind::kCancelled, "link", "recognition was cancelled", "");
      }
      index.add(*maps.load(map));
      const std::string session = maps.session(map);
      if (session.empty()) continue;
      const auto [before, is_first] = last_of_session.try_emplace(session, map);
      if (!is_first) add(std::exchange(before->second, map), map);
    }
    std::vector<std::vector<RecognitionCandidate>> found(count);
    execution.executor.for_blocks(count, 8, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) found[i] = index.find(i, candidates);
    });
    for (std::size_t map = 0; map < count; ++map) {
      for (const RecognitionCandidate& one : found[map]) add(map, one.map);
      if (!index.holds(map)) add_all_with(map, count);
    }
  }
  std::vector<IndexPair> pairs;
  for (const auto& [higher, lower] : by_higher) pairs.emplace_back(lower, higher);
  return pairs;
}

// The prepared maps that were used last, for any number of threads.
class PairLinker::PreparedMaps {
 public:
  explicit PreparedMaps(MapStore& maps) : maps_(maps) {}

  PreparedMap get(std::size_t map, const LinkOptions& options, const Execution& execution) {
    const std::lock_guard lock(mutex_);
    const auto found = std::find_if(prepared_.begin(), prepared_.end(),
                                    [&](const auto& one) { return one.first == map; });
    if (found != prepared_.end()) {
      prepared_.splice(prepared_.begin(), prepared_, found);
      return prepared_.front().second;
    }
    prepared_.emplace_front(map, prepared_to_link(*maps_.load(map), options, execution));
    if (prepared_.size() > maps_.capacity()) prepared_.pop_back();
    return prepared_.front().second;
  }

  // Target and source, whatever the order of the pair.
  IndexPair larger_first(const IndexPair& pair) {
    const auto [first, second] = pair;
    bool swap = maps_.landmark_count(first) < maps_.landmark_count(second);
    if (maps_.landmark_count(first) == maps_.landmark_count(second)) {
      const std::lock_guard lock(mutex_);
      swap = precedes(*maps_.load(second), *maps_.load(first));
    }
    return swap ? IndexPair(second, first) : pair;
  }

  // While held, no other thread uses the store.
  std::mutex& mutex() { return mutex_; }

 private:
  MapStore& maps_;
  std::mutex mutex_;
  std::list<std::pair<std::size_t, PreparedMap>> prepared_;  // last used first
};

PairLinker::PairLinker(MapStore& maps, const LinkOptions& options, const Execution& execution)
    : maps_(maps),
      options_(options),
      execution_(execution),
      prepared_(std::make_unique<PreparedMaps>(maps)) {
  options.validate();
}

PairLinker::~PairLinker() = default;

void PairLinker::link(std::span<const IndexPair> pairs,
                      const std::function<void(Link link)>& take) {
  for (const auto& [a, b] : pairs) {
    if (a < maps_.size() && b < maps_.size() && a != b) continue;
    throw Error(ErrorKind::kMisuse, "pairs", fmt::format("({}, {})", a, b),
                fmt::format("two of {} maps", maps_.size()));
  }
  const Executor& executor = execution_.executor;
  // With many pairs, the pairs run in parallel rather than the work within each.
  const bool by_pairs = pairs.size() >= executor.threads();
  Execution each = execution_.without_progress();
  // A thread that waits for others while holding the mutex could be given work that waits for the mutex.
  if (by_pairs) each.executor = Executor(1);
  const AlignOptions align = align_options(options_);
  const auto make = [&](std::size_t i) {
    const auto [target, source] = prepared_->larger_first(pairs[i]);
    Link link = linked(prepared_->get(target, options_, each),
                       prepared_->get(source, options_, each), align, each);
    link.target = NodeId{target};
    link.source = NodeId{source};
    return link;
  };
  std::size_t done = 0;
  const auto use = [&](std::size_t, Link link) {
    const std::lock_guard lock(prepared_->mutex());
    take(std::move(link));
    ++done;
    if (execution_.progress) {
      execution_.progress(static_cast<double>(done) / static_cast<double>(pairs.size()));
    }
  };
  if (by_pairs) {
    executor.in_order(pairs.size(), 2 * std::size_t{executor.threads()}, make, use);
  } else {
    for (std::size_t i = 0; i < pairs.size(); ++i) use(i, make(i));
  }
}

std::vector<Link> link_maps(MapStore& maps, const LinkOptions& options,
                            const Execution& execution) {
  PairLinker linker(maps, options, execution);
  std::vector<Link> links;
  linker.link(pairs_to_link(maps, options, execution),
              [&](Link link) { links.push_back(std::move(link)); });
  return links;
}

}  // namespace cairn
