// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "cairn/alignment/align.hpp"
#include "cairn/core/execution.hpp"
#include "cairn/core/option_table.hpp"
#include "cairn/pose_graph/pose_graph.hpp"

namespace cairn {

/// The maps to link and merge, by index: in memory, from one session, or in an atlas.
class MapStore {
 public:
  MapStore() = default;
  MapStore(const MapStore&) = delete;
  MapStore& operator=(const MapStore&) = delete;
  virtual ~MapStore() = default;

  virtual std::size_t size() const = 0;
  /// Name of the map's run; empty if unknown.
  virtual std::string session(std::size_t map) const = 0;
  virtual std::size_t landmark_count(std::size_t map) const = 0;
  /// Called by one thread at a time.
  virtual std::shared_ptr<const LandmarkMap> load(std::size_t map) = 0;
  /// Largest number of prepared maps in memory.
  virtual std::size_t capacity() const = 0;
};

/// A store of maps in memory.
class MapsInMemory : public MapStore {
 public:
  /// @param maps     not null; must outlive the store
  /// @param sessions one per map, or none
  explicit MapsInMemory(std::span<const LandmarkMap* const> maps,
                        std::vector<std::string> sessions = {});

  std::size_t size() const override { return maps_.size(); }
  std::string session(std::size_t map) const override {
    return sessions_.empty() ? std::string() : sessions_[map];
  }
  std::size_t landmark_count(std::size_t map) const override {
    return maps_[map]->landmark_count();
  }
  std::shared_ptr<const LandmarkMap> load(std::size_t map) override;
  std::size_t capacity() const override { return maps_.size(); }

 private:
  std::vector<const LandmarkMap*> maps_;
  std::vector<std::string> sessions_;
};

/// Indices of two maps, the lower first.
using IndexPair = std::pair<std::size_t, std::size_t>;

struct LinkOptions {
  double min_probability = 0.99;  ///< least probability of an aligned pair; see AlignOptions
  double prior_odds = 1.0;        ///< see AlignOptions
  double effort = 1.0;            ///< see AlignOptions
  PointSetOptions points = {};
  /// Number of candidates per map: the likeliest other maps by recognition; 0: all. std::nullopt:
  /// all for up to kMapsTriedInFull maps, kDefaultCandidates for more maps.
  std::optional<std::size_t> candidates = {};

  static const OptionTable table;
  /// @throws Error (misuse) naming the field, its value and the constraint
  void validate() const;
};

inline constexpr std::size_t kMapsTriedInFull = 32;
inline constexpr std::size_t kDefaultCandidates = 10;

/// Prepares a map for linking with these options.
PreparedMap prepared_to_link(const LandmarkMap& map, const LinkOptions& options = {},
                             const Execution& execution = {});

/// Aligns two maps by parts (place_by_parts()), to show whether one is bent. std::nullopt without a
/// consensus.
std::optional<PartsAlignment> parts_of_pair(const PreparedMap& target, const PreparedMap& source,
                                            const LinkOptions& options = {},
                                            const Execution& execution = {});

/// The pairs that may show one place: all pairs, or pairs found by recognition, consecutive maps of
/// a session, and all pairs with a map without comparable descriptors.
/// @return pairs sorted by the higher index, then by the lower index
/// @throws Error (cancelled) if the caller asked to stop
std::vector<IndexPair> pairs_to_link(MapStore& maps, const LinkOptions& options = {},
                                     const Execution& execution = {});

/// Aligns pairs of maps, and caches prepared maps for further pairs. The larger of two maps is the
/// target (precedes()), so that the order of the maps does not matter. Estimates the scale if one
/// of the two maps has a free scale. The same input and seed give the same links for any number of
/// threads.
class PairLinker {
 public:
  /// @param maps must outlive the linker; an index must always denote the same map, but maps may be
  ///        added
  /// @throws Error (misuse) for invalid options
  PairLinker(MapStore& maps, const LinkOptions& options, const Execution& execution = {});
  ~PairLinker();
  PairLinker(const PairLinker&) = delete;
  PairLinker& operator=(const PairLinker&) = delete;

  /// @param take receives each link in the order of the pairs, one at a time; the link's nodes are
  ///        map indices
  /// @throws Error (cancelled) if the caller asked to stop
  void link(std::span<const IndexPair> pairs, const std::function<void(Link link)>& take);

 private:
  class PreparedMaps;

  MapStore& maps_;
  LinkOptions options_;
  Execution execution_;
  std::unique_ptr<PreparedMaps> prepared_;
};

/// Links all pairs_to_link().
/// @return one link per pair, in the order of the pairs
std::vector<Link> link_maps(MapStore& maps, const LinkOptions& options = {},
                            const Execution& execution = {});

}  // namespace cairn
