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
  LinkOptions links = {};  ///< candidates are chosen from all maps of the atlas
  /// Also retries pairs that were not aligned; the new result replaces the old one.
  bool retry = false;
  /// If not empty, tries only pairs that contain one of these maps.
  std::vector<NodeId> only = {};
  /// Divides the pairs among processes that share an atlas file: this process tries every
  /// `shards`-th pair, from pair `shard`.
  std::size_t shard = 0;
  std::size_t shards = 1;
  /// Called with each stored result, and the state that the alignment used.
  std::function<void(const Link& link, const AtlasState& state)> on_link = {};

  /// @throws Error (misuse) naming the field, its value and the constraint
  void validate() const;
};

struct AtlasLinkResult {
  std::size_t pairs = 0;         ///< pairs in the atlas, limited by `only`
  std::size_t tried = 0;         ///< pairs tried by this call
  std::size_t tried_before = 0;  ///< pairs tried earlier, or linked manually
  std::size_t not_likely = 0;    ///< pairs excluded by place recognition
  std::size_t aligned = 0;       ///< pairs aligned by this call
};

/// A connected component of linked maps, in the frame of its first map.
struct AtlasComponent {
  NodeId frame;
  std::vector<NodeId> nodes;  ///< ascending
};

/// Components of at least two maps, largest first.
std::vector<AtlasComponent> components_of(const AtlasState& state);

/// The component that contains `node`; std::nullopt: the largest component.
/// @param name name of the atlas in messages
/// @throws Error (misuse) if there is none, or removed links connected it since the last optimize()
AtlasComponent component_with(const AtlasState& state, std::optional<NodeId> node,
                              const std::string& name);

struct AtlasOptimised {
  CommitId commit;
  std::size_t placed = 0;
  std::size_t contradicted = 0;  ///< aligned links that disagree with the poses
  bool changed = false;
};

/// Whether a link is aligned, agrees with the last optimised poses, and connects maps that still
/// have poses in one frame.
bool is_used(const AtlasState& state, const Link& link);

/// Maps, links between maps and their history, in storage that several programs and sessions share.
/// Every change is a commit, which is on disk when the call returns. An Atlas serves one thread at
/// a time; other threads and processes open the location separately.
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
    bool was_there = false;  ///< the atlas contained the map, under any name, and is unchanged
  };
  /// @throws Error (misuse) if another map has the name, (input) for a map without landmarks
  Added add(const LandmarkMap& map, const std::string& name, const std::string& session = {});

  /// Adds odometry links between maps of one run; ignores Link::kind. Leaves out pairs with an
  /// odometry link or a manual link, also that of unlink().
  /// @return number of links added
  std::size_t link_by_odometry(std::span<const Link> links);

  /// Aligns pairs of maps that were not tried yet, and stores each result, rejected or not, within
  /// seconds. After an interruption, another call continues. The same maps and seed give the same
  /// links for any number of threads. With PostgreSQL, concurrent processes share the pairs and
  /// produce the result of a single process; other processes continue the pairs of a process that
  /// ends.
  AtlasLinkResult link(const AtlasLinkOptions& options = {}, const Execution& execution = {});

  /// Adds a manual link, which counts as aligned.
  LinkId link_manually(NodeId target, NodeId source, const Similarity3& target_from_source,
                       const Matrix7d& covariance, const std::string& reason = {});

  /// Replaces the links between two maps by a manual, rejected link.
  void unlink(NodeId a, NodeId b, const std::string& reason = {});

  /// Computes the poses of all maps with aligned links, each component in the frame of its first map.
  AtlasOptimised optimize(const PoseOptimisationOptions& options = {});

  /// Like optimize(), but recomputes only those poses of the largest component that are near maps
  /// and links added since the last optimisation; see cairn::update_poses(). After any other
  /// change, recomputes all poses.
  AtlasOptimised update_poses(const PoseOptimisationOptions& options = {});

  /// Merges the maps of one component by fuse_placed().
  /// @param frame a map of the component; std::nullopt: the largest component
  /// @return result for all maps of the atlas, by ascending id
  /// @throws Error (misuse) as component_with(), e.g. if links that connected the component were
  ///        removed since the last optimize()
  MergeResult merge(const FusionOptions& options = {}, std::optional<NodeId> frame = std::nullopt,
                    std::optional<CommitId> at = std::nullopt, const Execution& execution = {});

  /// Removes a map, its links, its pose and all poses in its frame.
  void remove(NodeId node);

  /// Replaces a map by maps of `frames` keyframes each, linked by their original poses. Removes the
  /// map's links.
  /// @return the new maps
  std::vector<NodeId> split(NodeId node, std::size_t frames);

  /// Undoes the command of a commit; std::nullopt: the last command that is not undone.
  /// @return the last commit of the undone command
  /// @throws Error (misuse) if there is no such command, or later commits build on it
  CommitId undo(std::optional<CommitId> commit = std::nullopt);

  /// Starts a command: log() and undo() assign later commits to this command.
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

/// Pose graph of the maps, their poses and the links that connect maps; nodes by ascending id.
PoseGraph pose_graph(const AtlasState& state);

}  // namespace cairn
