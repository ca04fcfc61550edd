// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "cairn/atlas/store/store.hpp"

namespace cairn {

/// Creates an empty atlas, atomically.
/// @throws Error (storage) if `path` or one of SQLite's files beside it exists, or it is on a network file system
void create_sqlite_store(const std::filesystem::path& path, const AtlasStoreOptions& options = {});

/// Whether a file is an atlas, by its first bytes. False if it cannot be read.
bool is_sqlite_store(const std::filesystem::path& path);

/// Opens an atlas and upgrades an older schema, in one transaction.
/// @throws Error (input) naming the path if there is no atlas, one of a newer schema, or a rollback journal
///        beside it; (storage) if it cannot be opened
std::unique_ptr<AtlasStore> open_sqlite_store(const std::filesystem::path& path,
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
/// @throws Error as the two above
AtlasSalvage salvage_sqlite_store(const std::filesystem::path& from,
                                  const std::filesystem::path& to,
                                  const AtlasStoreOptions& options = {});

/// Name of the network file system of this type (statfs); null for other types.
const char* network_file_system(long type);

}  // namespace cairn
