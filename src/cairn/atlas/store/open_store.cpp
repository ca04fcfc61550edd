// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/atlas/store/open_store.hpp"

#include <array>

#include <fmt/format.h>
#include <pwd.h>
#include <unistd.h>

#include "cairn/atlas/detail/stores.hpp"
#include "cairn/core/error.hpp"
#include "cairn/core/text.hpp"

namespace cairn {

bool is_postgres_url(const std::string& location) {
  return location.starts_with("postgresql://") || location.starts_with("postgres://");
}

void set_author(AtlasStoreOptions& options) {
  const passwd* const entry = ::getpwuid(::geteuid());
  options.author = entry == nullptr ? fmt::format("{}", ::geteuid()) : entry->pw_name;
  std::array<char, 256> name = {};
  const bool is_named = ::gethostname(name.data(), name.size() - 1) == 0;
  options.host = is_named ? name.data() : "";
}

void create_store(const std::string& location, const AtlasStoreOptions& options) {
  if (is_postgres_url(location)) {
    detail::create_postgres_store(location, options);
  } else {
    detail::create_sqlite_store(location, options);
  }
}

std::unique_ptr<AtlasStore> open_store(const std::string& location,
                                       const AtlasStoreOptions& options) {
  return is_postgres_url(location) ? detail::open_postgres_store(location, options)
                                   : detail::open_sqlite_store(location, options);
}

AtlasSalvage salvage_store(const std::string& from, const std::string& to,
                           const AtlasStoreOptions& options) {
  for (const std::string& location : {from, to}) {
    if (!is_postgres_url(location)) continue;
    throw Error(ErrorKind::kMisuse, without_password(location), "is a database",
                "the path of a file; repair a database with the tools of its server");
  }
  return detail::salvage_sqlite_store(from, to, options);
}

}  // namespace cairn
