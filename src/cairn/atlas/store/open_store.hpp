// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "cairn/atlas/store/store.hpp"

namespace cairn {

// A location is the path of a file, or the URL of a PostgreSQL database: "postgresql://...". A
// database holds one atlas.

bool is_postgres_url(const std::string& location);

/// Whether a file is an atlas, by its first bytes; false for an unreadable file. Not for an atlas that
/// this process has open: closing the file releases SQLite's locks on it.
bool is_atlas_file(const std::filesystem::path& path);

/// Sets author and host to this process's user and machine.
void set_author(AtlasStoreOptions& options);

/// Creates an empty atlas, atomically.
/// @throws Error (misuse) if an atlas exists already, or for a URL in a build without PostgreSQL;
///         (storage) if SQLite's log or journal is beside the path, for a network file system, or
///         an unreachable server
void create_store(const std::string& location, const AtlasStoreOptions& options = {});

/// Opens an atlas. Upgrades an older schema of a file, in one transaction.
/// @throws Error (input) naming the location if there is no atlas, another schema, or a rollback
///         journal beside the file; (storage) if opening fails; (misuse) as create_store()
std::unique_ptr<AtlasStore> open_store(const std::string& location,
                                       const AtlasStoreOptions& options = {});

/// The cache file of merged_world(), "ATLAS.merged.cairn"; AtlasStore::compact() removes the file.
std::filesystem::path merged_world_file(const std::filesystem::path& atlas);

struct AtlasSalvage {
  std::uint64_t maps = 0;
  std::uint64_t links = 0;
  std::uint64_t poses = 0;
  std::vector<std::string> lost;  ///< one sentence per loss
};

/// Copies the undamaged maps, and the last links and poses between them, from a damaged atlas to a new one
/// at `to`, without the history.
/// @throws Error as create_store() and open_store(); (misuse) naming a location that is not a file
AtlasSalvage salvage_store(const std::string& from, const std::string& to,
                           const AtlasStoreOptions& options = {});

}  // namespace cairn
