// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>

#include "cairn/atlas/store/store.hpp"

namespace cairn {

// An atlas in a PostgreSQL database, in the schema "cairn": one atlas per database. Many hosts may write
// concurrently.

/// Creates an empty atlas, atomically.
/// @throws Error (storage) if there is one already, or the server cannot be reached; (misuse) in a build
///        without PostgreSQL (CAIRN_WITH_POSTGRES)
void create_postgres_store(const std::string& url, const AtlasStoreOptions& options = {});

/// @throws Error (input) if there is no atlas, or one of another schema; otherwise as above
std::unique_ptr<AtlasStore> open_postgres_store(const std::string& url,
                                                const AtlasStoreOptions& options = {});

}  // namespace cairn
