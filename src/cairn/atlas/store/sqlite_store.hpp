// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "cairn/atlas/store/store.hpp"

namespace cairn {

/// Makes an atlas without maps; whole or not at all.
/// @throws Error (storage) if something is at `path` already, or on a network file system
void create_sqlite_store(const std::filesystem::path& path, const AtlasStoreOptions& options = {});

/// Whether a file is an atlas, by its first bytes. False for what cannot be read.
bool is_sqlite_store(const std::filesystem::path& path);

/// Opens an atlas; one of an older schema is brought to this one, in one transaction.
/// @throws Error (input) naming the path if there is no atlas, or one of a newer schema; (storage) if it
///         cannot be opened
std::unique_ptr<AtlasStore> open_sqlite_store(const std::filesystem::path& path,
                                              const AtlasStoreOptions& options = {});

struct AtlasSalvage {
  std::uint64_t maps = 0;
  std::uint64_t links = 0;
  std::uint64_t poses = 0;
  std::vector<std::string> lost;  ///< sentences
};

/// Takes what is sound in a damaged atlas into a new one at `to`: maps, and links and poses between them
/// as they were last. The history is not kept.
/// @throws Error as the two above
AtlasSalvage salvage_sqlite_store(const std::filesystem::path& from,
                                  const std::filesystem::path& to,
                                  const AtlasStoreOptions& options = {});

/// Name of the network file system of this type (statfs), or null for any other.
const char* network_file_system(long type);

}  // namespace cairn
