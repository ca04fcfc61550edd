// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/atlas/store/open_store.hpp"

#include "cairn/atlas/store/postgres_store.hpp"
#include "cairn/atlas/store/sqlite_store.hpp"

namespace cairn {

bool is_postgres_url(const std::string& location) {
  return location.starts_with("postgresql://") || location.starts_with("postgres://");
}

void create_store(const std::string& location, const AtlasStoreOptions& options) {
  if (is_postgres_url(location)) {
    create_postgres_store(location, options);
  } else {
    create_sqlite_store(location, options);
  }
}

std::unique_ptr<AtlasStore> open_store(const std::string& location,
                                       const AtlasStoreOptions& options) {
  return is_postgres_url(location) ? open_postgres_store(location, options)
                                   : open_sqlite_store(location, options);
}

}  // namespace cairn
