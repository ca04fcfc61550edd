// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "cairn/atlas/store/records.hpp"

namespace cairn {

/// What the objects of changes are; the numbers are in files.
enum RowKind : std::int64_t { kNode = 1, kLink = 2, kPose = 3, kAgrees = 4 };

/// A change as the log has it: after it, the object has the value, or is not there.
struct RowChange {
  std::int64_t kind = 0;
  std::uint64_t object = 0;
  std::optional<std::uint64_t> value;
};

/// What every object's value is after some commits.
struct RowValues {
  std::map<std::uint64_t, std::uint64_t> nodes, links, poses, agrees;

  /// @return false for a kind that there is not
  bool apply(const RowChange& change);
};

/// Of a commit and its changes: tells whether they are as they were written.
std::string commit_digest(const AtlasCommit& commit, std::span<const RowChange> changes);

void apply(const AtlasChanges& changes, AtlasState& state);

/// Whether the changes led to an atlas that can be.
/// @throws Error (misuse) saying what it has that no atlas may have
void check_state(const AtlasState& state, const std::string& name);

/// @throws Error (input), always
[[noreturn]] void fail_as_damaged(const std::string& name, std::string_view what);

}  // namespace cairn
