// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>

#include "cairn/atlas/atlas.hpp"

#include "commands.hpp"
#include "support/arguments.hpp"
#include "support/documents.hpp"

namespace cairn::cli {

/// Arguments that every verb of atlas takes.
struct AtlasArguments {
  CommonArguments common;
  std::string location;
  bool insist = false;
  double wait_s = 30.0;
  std::optional<std::uint64_t> at;

  void add_to(const Command& command);
  /// Adds --at, for verbs that only read.
  void add_at_to(const Command& command);
  /// @throws Error (misuse) if --atlas was not given
  AtlasStoreOptions store_options(bool read_only) const;
  /// The location, without a password.
  std::string shown() const;
  Atlas open() const;
  Atlas open_to_read() const;
  std::optional<CommitId> commit() const;
  /// The head of a document of this verb.
  Json head(const std::string& verb, Json options = Json::object()) const;
};

/// The map of this name; "#" and an id also name a map.
/// @throws Error (misuse) naming the requested name and the existing maps
const AtlasNode& node_named(const AtlasState& state, const std::string& name,
                            const AtlasArguments& arguments);

/// "2026-11-25 09:30:12", UTC.
std::string time_text(std::int64_t time_ms);

/// A link in documents.
Json to_json(const Link& link, const AtlasState& state);

}  // namespace cairn::cli
