// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/interchange/detail/database_file.hpp"

#include <algorithm>

#include "cairn/core/error.hpp"
#include "cairn/core/file.hpp"

namespace cairn::detail {

bool is_database(const MapInput& input) {
  constexpr std::string_view kMagic("SQLite format 3\0", 16);
  return input.source != nullptr && input.first_bytes.starts_with(kMagic);
}

bool is_database_with(const MapInput& input, std::initializer_list<std::string_view> tables) {
  if (!is_database(input)) return false;
  try {
    sqlite::Database database = open_foreign_database(input.path, {});
    return std::all_of(tables.begin(), tables.end(),
                       [&](std::string_view table) { return database.has_table(table); });
  } catch (const Error&) {
    return false;
  }
}

sqlite::Database open_foreign_database(const std::filesystem::path& path,
                                       const MapReadOptions& options) {
  sqlite::Database database(path, {.access = sqlite::Access::kRead,
                                   .immutable = true,
                                   .untrusted = true,
                                   .stop = options.stop});
  // SQLite opens the file itself, but does not know what the program is going to write.
  const FileReader refuses_an_output(path);
  return database;
}

}  // namespace cairn::detail
