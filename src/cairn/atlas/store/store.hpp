// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <stop_token>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "cairn/core/ids.hpp"
#include "cairn/geometry/similarity3.hpp"
#include "cairn/map/landmark_map.hpp"
#include "cairn/pose_graph/optimise_poses.hpp"
#include "cairn/pose_graph/pose_graph.hpp"

namespace cairn {

/// Commits are numbered from 1 without gaps; 0 is the empty atlas.
using CommitId = StrongId<struct CommitIdTag, std::uint64_t>;

/// A map in the atlas. Its data are stored once, under the hash of their bytes, and never change.
struct AtlasNode {
  NodeId id;            ///< from 1; never reused
  std::string name;     ///< unique among the present nodes
  std::string session;  ///< shared by maps of one run; empty if unknown
  std::string map;      ///< hash of its .cairn bytes, 32 hexadecimal digits
  LengthUnit length_unit = LengthUnit::kMetres;
  std::uint64_t frames = 0;
  std::uint64_t landmarks = 0;
  std::uint64_t observations = 0;
  NodeExtent extent;
};

/// Pose of a map in its component.
struct AtlasPose {
  NodeId node;
  NodeId frame;  ///< node that defines the component's frame
  Similarity3 frame_from_node;
  Matrix7d covariance = Matrix7d::Zero();  ///< left perturbation in the frame, (δt, δφ, δ log s)
};

/// Equality up to rounding.
bool operator==(const AtlasPose& a, const AtlasPose& b);

/// Content of an atlas after a commit.
struct AtlasState {
  CommitId commit;
  std::map<NodeId, AtlasNode> nodes;
  std::map<LinkId, Link> links;
  std::map<NodeId, AtlasPose> poses;
  /// Whether each aligned link agrees with the poses. Links added since the last optimisation have
  /// no entry.
  std::map<LinkId, bool> agrees;

  /// The node of this name; null if there is none.
  const AtlasNode* find(const std::string& name) const;
};

/// Changes of a commit. Nodes and links with id 0 are new; other ids restore removed nodes and
/// links. Removing a node does not remove its links and poses.
struct AtlasChanges {
  std::string text;                ///< human-readable description
  std::optional<CommitId> undoes;  ///< last commit of the undone command
  std::vector<AtlasNode> nodes;
  std::vector<Link> links;
  std::vector<AtlasPose> poses;  ///< each replaces the node's pose
  std::vector<std::pair<LinkId, bool>> agrees;
  std::vector<NodeId> removed_nodes;
  std::vector<LinkId> removed_links;
  std::vector<NodeId> removed_poses;
  std::vector<LinkId> removed_agrees;

  bool empty() const {
    return nodes.empty() && links.empty() && poses.empty() && agrees.empty() &&
           removed_nodes.empty() && removed_links.empty() && removed_poses.empty() &&
           removed_agrees.empty();
  }
};

/// A line of the log.
struct AtlasCommit {
  CommitId id;
  std::int64_t time_ms = 0;  ///< since 1970, UTC
  std::string author;
  std::string host;
  std::string verb;  ///< "add" etc.
  std::string text;
  std::optional<CommitId> undoes;  ///< last commit of the undone command
  CommitId run;                    ///< first commit of the same command
};

/// Objects that commits changed.
struct AtlasTouched {
  std::vector<NodeId> nodes;
  std::vector<LinkId> links;
  std::vector<NodeId> poses;
  std::vector<LinkId> agrees;
};

/// Schema of the tables that this version writes; docs/formats.md describes it.
inline constexpr int kAtlasSchema = 1;

struct AtlasStoreOptions {
  bool read_only = false;  ///< also works in a read-only folder
  /// Allows a network file system, where locks and write order are unreliable, and a server that confirms
  /// writes before they are on its disk.
  bool insist = false;
  std::chrono::milliseconds wait{30'000};  ///< longest wait for another process that writes
  std::string author = {};                 ///< author of commits
  std::string host = {};
  std::stop_token stop = {};
};

/// Metadata of a commit.
struct AtlasCommitInfo {
  std::string verb;
  CommitId run = {};  ///< first commit of the same command; 0: this one
};

/// Result of AtlasStore::commit().
struct AtlasCommitted {
  CommitId commit;            ///< the new commit, or the last one if there was no change
  bool is_new = false;        ///< whether there was a change
  std::vector<NodeId> nodes;  ///< ids of the new nodes, in order
  std::vector<LinkId> links;  ///< ids of the new links, in order
};

struct AtlasVerification {
  std::uint64_t commits = 0;
  std::uint64_t nodes = 0;  ///< in all commits
  std::uint64_t links = 0;
  std::uint64_t poses = 0;
  std::uint64_t maps = 0;
  std::uint64_t map_bytes = 0;
  std::vector<std::string> problems;  ///< one sentence each; empty if no damage was found
};

/// Default number of last commits that a compaction keeps.
inline constexpr std::uint64_t kKeptCommits = 100;

struct AtlasCompaction {
  std::uint64_t commits = 0;  ///< commits joined into one
  std::uint64_t nodes = 0;    ///< dropped nodes
  std::uint64_t links = 0;
  std::uint64_t poses = 0;
  std::uint64_t maps = 0;
  std::uint64_t map_bytes = 0;
};

/// Two maps, the lower id first.
using NodePair = std::pair<NodeId, NodeId>;

/// A queue of pairs to align, shared by all processes that work on an atlas.
class AtlasPairQueue {
 public:
  AtlasPairQueue() = default;
  AtlasPairQueue(const AtlasPairQueue&) = delete;
  AtlasPairQueue& operator=(const AtlasPairQueue&) = delete;
  virtual ~AtlasPairQueue() = default;

  /// Reserves up to `count` pairs that no other process has reserved; empty if none is left. Pairs
  /// of a process that ends before done() are released.
  virtual std::vector<NodePair> take(std::size_t count) = 0;
  /// Marks the pairs of the last take() as finished.
  virtual void done() = 0;
};

/// Storage of an atlas, for one thread at a time and any number of processes.
class AtlasStore {
 public:
  AtlasStore() = default;
  AtlasStore(const AtlasStore&) = delete;
  AtlasStore& operator=(const AtlasStore&) = delete;
  virtual ~AtlasStore() = default;

  /// Name in messages.
  virtual const std::string& name() const = 0;
  virtual CommitId last_commit() = 0;
  /// State after commit `at`; std::nullopt: the last commit.
  /// @throws Error (misuse) if there is no such commit, (input) naming the damage
  virtual AtlasState state(std::optional<CommitId> at = std::nullopt) = 0;
  /// All commits, oldest first.
  virtual std::vector<AtlasCommit> log() = 0;
  virtual AtlasTouched touched(std::span<const CommitId> commits) = 0;

  /// Stores a map's bytes; equal bytes are stored once. Until a commit adds a node with this map,
  /// compact() of another process may drop the bytes. @return hash of the bytes
  virtual std::string put_map(std::string_view bytes) = 0;
  /// @throws Error (input) for missing or damaged bytes, (storage) if no commit needs them any more
  virtual std::string map_bytes(const std::string& hash) = 0;

  using Make = std::function<AtlasChanges(const AtlasState& now)>;
  /// Makes one commit, atomically: calls `make` while no other process can change the atlas. `make`
  /// may read this store and call put_map(), as part of the commit. The commit is on disk when the
  /// call returns.
  /// @throws Error (misuse) for inconsistent changes: a name that is taken, a link or pose of a missing
  ///        node, a restored node or link that is not stored
  virtual AtlasCommitted commit(const AtlasCommitInfo& info, const Make& make) = 0;

  /// Adds the pairs to the atlas's queue, except those in it. Null if the store has no queue.
  virtual std::unique_ptr<AtlasPairQueue> share(std::span<const NodePair> pairs) {
    (void)pairs;
    return nullptr;
  }

  /// Reads and checks all data.
  virtual AtlasVerification verify() = 0;
  /// Joins the oldest commits so that `keep` commits remain, and drops data that no remaining
  /// commit needs. Dropped ids are never reused.
  /// @param dry only report the effect
  /// @throws Error (misuse) for `keep` = 0
  virtual AtlasCompaction compact(std::uint64_t keep, bool dry) = 0;
};

}  // namespace cairn
