// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/atlas/store/records.hpp"

namespace cairn {

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

struct AtlasCompaction {
  std::uint64_t commits = 0;  ///< that become one
  std::uint64_t nodes = 0;    ///< dropped
  std::uint64_t links = 0;
  std::uint64_t poses = 0;
  std::uint64_t maps = 0;
  std::uint64_t map_bytes = 0;
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

  /// Reads everything and checks it.
  virtual AtlasVerification verify() = 0;
  /// Makes one of the oldest commits so that `keep` commits are left, and drops what none of these needs.
  /// @param dry only say what would be done
  virtual AtlasCompaction compact(std::uint64_t keep, bool dry) = 0;
};

}  // namespace cairn
