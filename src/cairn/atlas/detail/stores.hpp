// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "cairn/atlas/store/open_store.hpp"
#include "cairn/storage/sqlite/database.hpp"

/// The stores behind open_store.hpp: an SQLite file, and the schema "cairn" of a PostgreSQL database, which many hosts
/// may write concurrently.
namespace cairn::detail {

void create_sqlite_store(const std::filesystem::path& path, const AtlasStoreOptions& options);
/// @param whole whether the atlas must have all its tables
std::unique_ptr<AtlasStore> open_sqlite_store(const std::filesystem::path& path,
                                              const AtlasStoreOptions& options, bool whole = true);
/// The SQLite database of such a store.
sqlite::Database open_sqlite_database(const std::filesystem::path& path,
                                      const AtlasStoreOptions& options, bool whole);
AtlasSalvage salvage_sqlite_store(const std::filesystem::path& from,
                                  const std::filesystem::path& to,
                                  const AtlasStoreOptions& options);

/// Name of the network file system of this type (statfs); null for other types.
const char* network_file_system(long type);

// These functions throw Error (misuse) in a build without PostgreSQL (CAIRN_WITH_POSTGRES).
void create_postgres_store(const std::string& url, const AtlasStoreOptions& options);
std::unique_ptr<AtlasStore> open_postgres_store(const std::string& url,
                                                const AtlasStoreOptions& options);

}  // namespace cairn::detail
