// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <stop_token>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "cairn/atlas/store/records.hpp"

namespace cairn {

/// Schema of the tables that this version writes; docs/formats.md describes it.
inline constexpr int kAtlasSchema = 1;

struct AtlasStoreOptions {
  bool read_only = false;  ///< works in a folder that cannot be written, too
  /// Allows a network file system, on which locks and the order of writes cannot be relied on, and a server
  /// that acknowledges what is not on its disk yet.
  bool insist = false;
  std::chrono::milliseconds wait{30'000};  ///< for another process that writes
  std::string author = {};                 ///< of commits
  std::string host = {};
  std::stop_token stop = {};
};

/// What a commit says of itself besides its changes.
struct AtlasCommitInfo {
  std::string verb;
  CommitId run = {};  ///< first commit of the same command; 0: this is the first
  std::optional<CommitId> undoes = {};
};

/// What came of AtlasStore::commit().
struct AtlasCommitted {
  CommitId commit;                 ///< the last commit there was, if there was nothing to change
  std::vector<NodeId> nodes;       ///< ids of the new nodes, in their order
  std::vector<AtlasLinkId> links;  ///< the same of links
};

struct AtlasVerification {
  std::uint64_t commits = 0;
  std::uint64_t nodes = 0;  ///< of all commits
  std::uint64_t links = 0;
  std::uint64_t poses = 0;
  std::uint64_t maps = 0;
  std::uint64_t map_bytes = 0;
  std::vector<std::string> problems;  ///< sentences; empty: all is sound
};

/// How many of the last commits a compaction keeps unless told otherwise.
inline constexpr std::uint64_t kKeptCommits = 100;

struct AtlasCompaction {
  std::uint64_t commits = 0;  ///< that become one
  std::uint64_t nodes = 0;    ///< dropped
  std::uint64_t links = 0;
  std::uint64_t poses = 0;
  std::uint64_t maps = 0;
  std::uint64_t map_bytes = 0;
};

/// Two maps, the lower id first.
using NodePair = std::pair<NodeId, NodeId>;

/// Pairs of maps that wait to be aligned, which all processes that work on an atlas share among them.
class AtlasPairQueue {
 public:
  AtlasPairQueue() = default;
  AtlasPairQueue(const AtlasPairQueue&) = delete;
  AtlasPairQueue& operator=(const AtlasPairQueue&) = delete;
  virtual ~AtlasPairQueue() = default;

  /// Up to `count` pairs that no other process has; none if all that are left are in work elsewhere.
  /// Those of a process that ends before it calls done() are given to others.
  virtual std::vector<NodePair> take(std::size_t count) = 0;
  /// What take() gave last needs nobody any more.
  virtual void done() = 0;
};

/// Where an atlas is kept. One thread at a time; any number of processes.
class AtlasStore {
 public:
  AtlasStore() = default;
  AtlasStore(const AtlasStore&) = delete;
  AtlasStore& operator=(const AtlasStore&) = delete;
  virtual ~AtlasStore() = default;

  /// For messages.
  virtual const std::string& name() const = 0;
  virtual CommitId last_commit() = 0;
  /// After the last commit, or after this one.
  /// @throws Error (misuse) if there is no such commit, (input) naming what is damaged
  virtual AtlasState state(std::optional<CommitId> at = std::nullopt) = 0;
  /// All commits, oldest first.
  virtual std::vector<AtlasCommit> log() = 0;
  virtual AtlasTouched touched(std::span<const CommitId> commits) = 0;

  /// Keeps a map's bytes and gives their hash; what is there already is not stored again.
  virtual std::string put_map(std::string_view bytes) = 0;
  /// @throws Error (input) if they are missing or damaged
  virtual std::string map_bytes(const std::string& hash) = 0;

  using Make = std::function<AtlasChanges(const AtlasState& now)>;
  /// One commit, whole or not at all: `make` is called while nobody else can change the atlas. When this
  /// returns, the commit is on disk.
  /// @throws Error (misuse) for changes that would leave the atlas contradictory: a name that is taken, a
  ///         link or pose of a node that is not there
  virtual AtlasCommitted commit(const AtlasCommitInfo& info, const Make& make) = 0;

  /// Adds pairs to the queue of this atlas, once each. Null if such a store has none.
  virtual std::unique_ptr<AtlasPairQueue> share(std::span<const NodePair> pairs) {
    (void)pairs;
    return nullptr;
  }

  /// Reads everything and checks it.
  virtual AtlasVerification verify() = 0;
  /// Makes one of the oldest commits so that `keep` commits are left, and drops what none of these needs.
  /// @param dry only say what would be done
  /// @throws Error (misuse) for `keep` = 0
  virtual AtlasCompaction compact(std::uint64_t keep, bool dry) = 0;
};

}  // namespace cairn
