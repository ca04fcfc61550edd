// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "cairn/atlas/store/store.hpp"
#include "cairn/core/execution.hpp"
#include "cairn/core/log.hpp"
#include "cairn/merging/merge.hpp"

namespace cairn {

/// Selects the pairs of maps to try.
struct AtlasLinkOptions {
  LinkOptions links = {};  ///< its candidates are of all maps of the atlas
  /// Also tries pairs that were tried before and not aligned; the new result replaces the old.
  bool retry = false;
  /// If not empty, tries only pairs with one of these.
  std::vector<NodeId> only = {};
  /// For several processes that share the pairs of a file: this one tries every `shards`-th pair, from
  /// `shard`.
  std::size_t shard = 0;
  std::size_t shards = 1;
  /// Called with each result after it is stored, and the maps that it was aligned with.
  std::function<void(const Link& link, const AtlasState& state)> on_link = {};

  /// @throws Error (misuse) naming the field, its value and the constraint
  void validate() const;
};

struct AtlasLinkResult {
  std::size_t pairs = 0;         ///< in the atlas
  std::size_t tried = 0;         ///< by this call
  std::size_t tried_before = 0;  ///< or linked by a person
  std::size_t not_likely = 0;    ///< excluded by recognition
  std::size_t aligned = 0;       ///< of those tried by this call
};

/// A group of linked maps, in the frame of its first.
struct AtlasComponent {
  NodeId frame;
  std::vector<NodeId> nodes;  ///< ascending
};

/// Components of at least two maps, largest first.
std::vector<AtlasComponent> components_of(const AtlasState& state);

/// The component that contains `node`; std::nullopt: the largest component.
/// @param name of the atlas, for messages
/// @throws Error (misuse) if no two maps have poses in one frame, or `node` has no pose
AtlasComponent component_with(const AtlasState& state, std::optional<NodeId> node,
                              const std::string& name);

struct AtlasOptimised {
  CommitId commit;
  std::size_t placed = 0;
  std::size_t contradicted = 0;  ///< aligned links that disagree with the poses
  bool changed = false;
};

/// Whether a link is aligned, agreed with the poses when they were last optimised, and still has those of both its
/// maps in one frame.
bool is_used(const AtlasState& state, const Link& link);

/// Maps, their relations and the history of both, stored for several programs and sessions. Every change is
/// a commit, which is on disk when the call returns. Use by one thread at a time; other threads and
/// processes open the location separately.
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
    bool was_there = false;  ///< the same map was in the atlas, under any name; it was not changed
  };
  /// @throws Error (misuse) if another map has the name, (input) for a map without landmarks
  Added add(const LandmarkMap& map, const std::string& name, const std::string& session = {});

  /// Adds odometry links between maps of one run; ignores `kind`. A pair keeps an earlier odometry link.
  /// @return number of links added
  std::size_t link_by_odometry(std::span<const Link> links);

  /// Aligns pairs of maps that were not tried yet, and stores each result, rejected or not, at once. After
  /// an interruption, another call continues. The same maps and seed give the same links for any number of
  /// threads. With PostgreSQL, concurrent processes share the pairs and together give the same result as
  /// one; others take over the pairs of a process that ends.
  AtlasLinkResult link(const AtlasLinkOptions& options = {}, const Execution& execution = {});

  /// Adds a link stated by a person. It counts like a judged one.
  LinkId link_manually(NodeId target, NodeId source, const Similarity3& target_from_source,
                       const Matrix7d& covariance, const std::string& reason = {});

  /// Replaces the links between two maps by one that states that they are not linked.
  void unlink(NodeId a, NodeId b, const std::string& reason = {});

  /// Computes the poses of all maps with aligned links, each component in the frame of its first map.
  AtlasOptimised optimize(const PoseOptimisationOptions& options = {});

  /// Like optimize(), but of the largest component it computes only poses near the maps and links that were added
  /// since the last optimisation; see cairn::update_poses(). Computes all poses if anything else was changed.
  AtlasOptimised update_poses(const PoseOptimisationOptions& options = {});

  /// Merges the maps of one component: fuse_placed().
  /// @param frame a map of the component; std::nullopt: the largest
  /// @return of all maps of the atlas, by ascending id
  /// @throws Error (misuse) if no two maps have poses in one frame, or in that of `frame`
  MergeResult merge(const FusionOptions& options = {}, std::optional<NodeId> frame = std::nullopt,
                    std::optional<CommitId> at = std::nullopt, const Execution& execution = {});

  /// Removes a map, its links and its pose, and the poses in its frame.
  void remove(NodeId node);

  /// Splits a map into maps of `frames` keyframes each, linked by their poses in it. Removes its own links.
  /// @return the new maps
  std::vector<NodeId> split(NodeId node, std::size_t frames);

  /// Undoes the command of this commit; std::nullopt: the last command that is not undone.
  /// @return the commit that was undone
  /// @throws Error (misuse) if there is no such command, or later commits build on it
  CommitId undo(std::optional<CommitId> commit = std::nullopt);

  /// Starts a command: later commits belong to it, for log() and undo().
  void begin_run() { run_ = CommitId{}; }

 private:
  AtlasCommitted commit(const std::string& verb, const AtlasStore::Make& make);

  enum class Scope { kAll, kAdded };
  AtlasOptimised optimize(const PoseOptimisationOptions& options, Scope scope);
  // std::nullopt if another process changed the atlas meanwhile.
  std::optional<AtlasOptimised> optimize_once(const PoseOptimisationOptions& options, Scope scope);
  // Whether maps and links were only added since the last optimisation.
  bool has_only_grown(const AtlasState& state);

  std::unique_ptr<AtlasStore> store_;
  CommitId run_;
};

/// The links that connect maps, and the poses, as a graph; nodes by ascending id.
PoseGraph pose_graph(const AtlasState& state);

}  // namespace cairn
