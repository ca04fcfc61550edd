// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "cairn/atlas/store/store.hpp"

namespace cairn {

// A location is the path of a file, or the URL of a PostgreSQL database: "postgresql://...". There is one atlas in a
// database.

bool is_postgres_url(const std::string& location);

/// Whether a file is an atlas, by its first bytes. False if it cannot be read.
bool is_atlas_file(const std::filesystem::path& path);

/// Sets author and host to this process's user and machine.
void set_author(AtlasStoreOptions& options);

/// Creates an empty atlas, atomically.
/// @throws Error (misuse) if there is one already, or for a URL in a build without PostgreSQL; (storage) if one of SQLite's
///         files is beside the path, it is on a network file system, or the server cannot be reached
void create_store(const std::string& location, const AtlasStoreOptions& options = {});

/// Opens an atlas. Upgrades an older schema of a file, in one transaction.
/// @throws Error (input) naming the location if there is no atlas, one of another schema, or a rollback journal beside
///         the file; (storage) if it cannot be opened; (misuse) as create_store()
std::unique_ptr<AtlasStore> open_store(const std::string& location,
                                       const AtlasStoreOptions& options = {});

/// The file "ATLAS.merged.cairn", in which merged_world() keeps a map; compact() removes it.
std::filesystem::path merged_world_file(const std::filesystem::path& atlas);

struct AtlasSalvage {
  std::uint64_t maps = 0;
  std::uint64_t links = 0;
  std::uint64_t poses = 0;
  std::vector<std::string> lost;  ///< sentences
};

/// Copies the undamaged maps, and the last links and poses between them, from a damaged atlas to a new one
/// at `to`, without the history.
/// @throws Error as create_store() and open_store(); (misuse) naming a location that is no file
AtlasSalvage salvage_store(const std::string& from, const std::string& to,
                           const AtlasStoreOptions& options = {});

}  // namespace cairn
