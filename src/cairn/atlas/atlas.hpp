// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "cairn/atlas/store/store.hpp"
#include "cairn/core/execution.hpp"
#include "cairn/core/log.hpp"
#include "cairn/merging/fusion/merge_placed.hpp"
#include "cairn/merging/linking/link_maps.hpp"

namespace cairn {

/// Which pairs of maps are tried.
struct AtlasLinkOptions {
  LinkOptions links = {};
  /// Tries pairs again that were tried and not aligned; what was found replaces what is there.
  bool retry = false;
  /// How many of the other maps each map is tried with: those that recognition finds likeliest. 0: all.
  /// Nothing: all in an atlas of up to kMapsTriedInFull maps, else kDefaultCandidates.
  std::optional<std::size_t> candidates = {};
  /// If not empty, only pairs of which one is among these.
  std::vector<NodeId> only = {};
  /// Of several processes that share the pairs of a file: this one does every `shards`-th, from `shard`.
  std::size_t shard = 0;
  std::size_t shards = 1;
  /// Told of each result, when it is kept.
  std::function<void(const AtlasLink& link)> on_link = {};

  /// @throws Error (misuse) naming the field, its value and what it may be
  void validate() const;
};

inline constexpr std::size_t kMapsTriedInFull = 32;
inline constexpr std::size_t kDefaultCandidates = 10;

struct AtlasLinkResult {
  std::size_t pairs = 0;         ///< that there are
  std::size_t tried = 0;         ///< now
  std::size_t tried_before = 0;  ///< or linked by a person
  std::size_t not_likely = 0;    ///< left out by recognition
  std::size_t aligned = 0;       ///< of those tried now
};

/// A group of maps that links connect, in the frame of its first.
struct AtlasComponent {
  NodeId frame;
  std::vector<NodeId> nodes;  ///< ascending
};

/// Components of at least two maps, largest first.
std::vector<AtlasComponent> components_of(const AtlasState& state);

/// The component that a map is in, or the largest.
/// @param name of the atlas, for messages
/// @throws Error (misuse) if no two maps have poses in one frame, or the map has none
AtlasComponent component_with(const AtlasState& state, std::optional<NodeId> node,
                              const std::string& name);

struct AtlasOptimised {
  CommitId commit;
  std::size_t placed = 0;
  std::size_t contradicted = 0;  ///< aligned links that disagree with the poses
  bool changed = false;
};

struct AtlasMergeOptions {
  std::optional<NodeId> frame = {};  ///< of the component to merge; std::nullopt: the largest
  MergePlacedOptions placed = {};
};

struct AtlasMerged {
  std::vector<NodeId> nodes;  ///< in the order of the fusion
  MergedPlaced merged;        ///< of these maps, in their order
};

/// Maps, what is known of how they lie to each other, and how that came to be, kept where several programs
/// and sessions can use it. Every change is a commit, and is on disk when the call returns. One thread at a
/// time; other threads and processes open the same location for themselves.
class Atlas {
 public:
  explicit Atlas(std::unique_ptr<AtlasStore> store) : store_(std::move(store)) {}

  /// @param location path of a file, or URL of a PostgreSQL database ("postgresql://...")
  /// @throws Error as create_store() and open_store()
  static void create(const std::string& location, const AtlasStoreOptions& options = {});
  static Atlas open(const std::string& location, const AtlasStoreOptions& options = {});

  AtlasStore& store() { return *store_; }
  AtlasState state(std::optional<CommitId> at = std::nullopt) { return store_->state(at); }
  LandmarkMap map(const AtlasNode& node);

  struct Added {
    NodeId node;
    bool was_there = false;  ///< the same map, under whatever name; nothing was changed
  };
  /// @throws Error (misuse) if another map has the name, (input) for a map without landmarks
  Added add(const LandmarkMap& map, const std::string& name, const std::string& session = {});

  /// Links that odometry states between maps of one run; `kind` is not looked at. A pair that has one keeps it.
  /// @return how many were added
  std::size_t link_by_odometry(std::span<const PoseLink> links);

  /// Aligns pairs of maps that were not tried yet, and keeps what came of it, rejected or not. Results are
  /// kept as they come, so that another call goes on where this one was ended. Same maps and seed, same
  /// links, whatever the number of threads. In PostgreSQL, processes that do this at the same time share the
  /// pairs, and together give what one would; what one had in work when it ended, the others do.
  AtlasLinkResult link(const AtlasLinkOptions& options = {});

  /// A link that a person states. It counts like one that was judged.
  AtlasLinkId link_manually(NodeId target, NodeId source, const Similarity3& target_from_source,
                            const Matrix7d& covariance, const std::string& reason = {});

  /// Replaces the links between two maps by one that says that there is none.
  void unlink(NodeId a, NodeId b, const std::string& reason = {});

  /// Poses of all maps that aligned links connect, each component in the frame of its first map.
  AtlasOptimised optimize(const PoseOptimisationOptions& options = {});

  /// The maps of one component as one map.
  /// @throws Error (misuse) if no two maps have poses in one frame, or not in that of `options`
  AtlasMerged merge(const AtlasMergeOptions& options = {},
                    std::optional<CommitId> at = std::nullopt);

  /// Removes a map, its links and its pose. Poses in its frame go as well.
  void remove(NodeId node);

  /// A map becomes maps of so many of its keyframes each, linked as they lie in it. Its own links go.
  /// @return the new maps
  std::vector<NodeId> split(NodeId node, std::size_t frames);

  /// Undoes what the command did that this commit belongs to; nothing: the last that was not undone itself.
  /// @return the commit that was undone
  /// @throws Error (misuse) if there is nothing to undo, or later commits build on it
  CommitId undo(std::optional<CommitId> commit = std::nullopt);

  /// Commits from now on belong to one command, for log() and undo().
  void begin_run() { run_ = CommitId{}; }

 private:
  AtlasCommitted commit(const std::string& verb, const AtlasStore::Make& make,
                        std::optional<CommitId> undoes = std::nullopt);

  // std::nullopt if the atlas was changed meanwhile.
  std::optional<AtlasOptimised> optimize_once(const PoseOptimisationOptions& options);

  std::unique_ptr<AtlasStore> store_;
  CommitId run_;
};

/// The aligned links and the poses as a graph, for export; nodes by ascending id.
PoseGraph pose_graph(const AtlasState& state);

}  // namespace cairn
