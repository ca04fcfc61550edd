// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "cairn/atlas/store/store.hpp"
#include "cairn/core/error.hpp"

namespace cairn {

/// Kinds of the changed objects; the values are stored in files.
enum RowKind : std::int64_t { kNode = 1, kLink = 2, kPose = 3, kAgrees = 4 };

/// A logged change of one object: its new value, or std::nullopt if the object no longer exists.
struct RowChange {
  std::int64_t kind = 0;
  std::uint64_t object = 0;
  std::optional<std::uint64_t> value;
};

/// Values of all objects after some commits.
struct RowValues {
  std::map<std::uint64_t, std::uint64_t> nodes, links, poses, agrees;

  /// @return false for an unknown kind
  bool apply(const RowChange& change);
};

/// Digest of a commit and its changes, to detect damage.
std::string commit_digest(const AtlasCommit& commit, std::span<const RowChange> changes);

void apply(const AtlasChanges& changes, AtlasState& state);

/// Checks that everything that the state refers to exists in the state.
/// @param kind kind of the error: input for a state that was read, misuse for a state that changes would produce
/// @throws Error naming the defect
void check_state(const AtlasState& state, const std::string& name, ErrorKind kind);

/// Whether the state has the poses of both maps of a link. If the link agrees, the poses must also be in one frame.
bool has_poses_of(const AtlasState& state, LinkId link, bool agrees);

/// Checks that changes do not remove poses with which a link was compared.
/// @throws Error (misuse) naming the link
void check_agreements(const AtlasState& before, const AtlasState& after, const std::string& name);

/// The node with this id.
/// @throws Error (misuse) if it does not exist
const AtlasNode& require_node(const AtlasState& state, NodeId id);

/// "1 map", "2 maps".
std::string plural(std::size_t count, std::string_view noun);

/// @throws Error (input), always
[[noreturn]] void fail_as_damaged(const std::string& name, std::string_view what);

}  // namespace cairn
