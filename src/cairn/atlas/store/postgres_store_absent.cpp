// SPDX-License-Identifier: BSD-3-Clause
// For builds without PostgreSQL: throws an error that says so.
#include "cairn/atlas/store/postgres_store.hpp"
#include "cairn/core/error.hpp"

namespace cairn {
namespace {

[[noreturn]] void fail() {
  throw Error(ErrorKind::kMisuse, "atlas", "a PostgreSQL database",
              "the path of a file: this build is without PostgreSQL (CAIRN_WITH_POSTGRES)");
}

}  // namespace

void create_postgres_store(const std::string&, const AtlasStoreOptions&) {
  fail();
}

std::unique_ptr<AtlasStore> open_postgres_store(const std::string&, const AtlasStoreOptions&) {
  fail();
}

}  // namespace cairn
