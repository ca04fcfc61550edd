// SPDX-License-Identifier: BSD-3-Clause
// For builds without PostgreSQL: throws an error that says so.
#include "cairn/atlas/detail/stores.hpp"
#include "cairn/core/error.hpp"

namespace cairn::detail {
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

}  // namespace cairn::detail
