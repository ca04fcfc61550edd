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

/// A change in the log: afterwards, the object has the value, or does not exist.
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

/// Checks that all that the state refers to is in it.
/// @param kind of the error: input for a state that was read, misuse for one that changes lead to
/// @throws Error naming the defect
void check_state(const AtlasState& state, const std::string& name, ErrorKind kind);

/// Whether the poses that a link agrees with, or contradicts, are in the state. A link that agrees has both its maps
/// in one frame.
bool has_poses_of(const AtlasState& state, LinkId link, bool agrees);

/// Checks that changes do not take away the poses that a link agrees with.
/// @throws Error (misuse) naming the link
void check_agreements(const AtlasState& before, const AtlasState& after, const std::string& name);

/// @throws Error (misuse) if it is not there
const AtlasNode& require_node(const AtlasState& state, NodeId id);

/// "1 map", "2 maps".
std::string plural(std::size_t count, std::string_view noun);

/// @throws Error (input), always
[[noreturn]] void fail_as_damaged(const std::string& name, std::string_view what);

}  // namespace cairn
