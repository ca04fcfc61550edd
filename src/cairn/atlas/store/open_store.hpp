// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>

#include "cairn/atlas/store/sqlite_store.hpp"
#include "cairn/atlas/store/store.hpp"

namespace cairn {

// A location is the path of a file, or the URL of a PostgreSQL database: "postgresql://...".

bool is_postgres_url(const std::string& location);

/// Sets author and host to this process's user and machine.
void set_author(AtlasStoreOptions& options);

/// @throws Error as create_sqlite_store() and create_postgres_store()
void create_store(const std::string& location, const AtlasStoreOptions& options = {});

/// @throws Error as open_sqlite_store() and open_postgres_store()
std::unique_ptr<AtlasStore> open_store(const std::string& location,
                                       const AtlasStoreOptions& options = {});

/// @throws Error as salvage_sqlite_store(); (misuse) naming a location that is no file
AtlasSalvage salvage_store(const std::string& from, const std::string& to,
                           const AtlasStoreOptions& options = {});

}  // namespace cairn
