// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/formats/detail/foreign/database_file.hpp"

#include <algorithm>
#include <optional>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/core/file.hpp"

namespace cairn::detail {
namespace {

namespace fs = std::filesystem;

// The first byte of a regular file; std::nullopt if it is empty or there is none.
std::optional<char> first_byte(const fs::path& path) {
  std::error_code failure;
  if (!fs::is_regular_file(path, failure) || fs::file_size(path, failure) == 0 || failure) {
    return std::nullopt;
  }
  char first = '\0';
  return FileReader(path).read(&first, 1) == 1 ? std::optional(first) : std::nullopt;
}

// An immutable database is read without these files. With their changes, or with those that they undo, it has other
// rows.
void require_closed(const fs::path& path) {
  std::error_code failure;
  const fs::path file = fs::canonical(path, failure);
  if (failure) return;  // opening it says why
  const auto refuse_if = [&](bool is_open, const fs::path& journal) {
    if (!is_open) return;
    throw Error(ErrorKind::kInput, path.string(),
                fmt::format("was not closed: changes are in {}", journal.string()),
                fmt::format("a closed database: close the program that writes it, or open it once "
                            "with `sqlite3 {} .tables`",
                            path.string()));
  };
  fs::path log = file;
  log += "-wal";
  refuse_if(first_byte(log).has_value(), log);
  fs::path rollback = file;
  rollback += "-journal";
  // SQLite may keep the journal of a complete change, with a zeroed header.
  refuse_if(first_byte(rollback).value_or('\0') != '\0', rollback);
}

sqlite::Database open_immutable(const fs::path& path, const Execution& execution) {
  return sqlite::Database(path, {.access = sqlite::Access::kRead,
                                 .immutable = true,
                                 .untrusted = true,
                                 .stop = execution.stop});
}

}  // namespace

bool is_database(const MapInput& input) {
  constexpr std::string_view kMagic("SQLite format 3\0", 16);
  return input.source != nullptr && input.first_bytes.starts_with(kMagic);
}

bool is_database_with(const MapInput& input, std::initializer_list<std::string_view> tables) {
  return is_database(input) && is_database_with(input.path, tables);
}

bool is_database_with(const fs::path& path, std::initializer_list<std::string_view> tables) {
  try {
    sqlite::Database database = open_immutable(path, {});
    return std::all_of(tables.begin(), tables.end(),
                       [&](std::string_view table) { return database.has_table(table); });
  } catch (const Error&) {
    return false;
  }
}

sqlite::Database open_foreign_database(const fs::path& path, const Execution& execution) {
  require_closed(path);
  sqlite::Database database = open_immutable(path, execution);
  // SQLite opens the file itself, but does not know what the program is going to write.
  const FileReader refuses_an_output(path);
  return database;
}

std::string column_or_null(sqlite::Database& database, const char* table, const char* column) {
  const auto columns = database.columns(table);
  return std::find(columns.begin(), columns.end(), column) != columns.end() ? column : "NULL";
}

void refuse_database(const sqlite::Database& database, const std::string& where,
                     std::string_view what, std::string_view expected) {
  throw Error(ErrorKind::kInput, fmt::format("{}: {}", database.name(), where), what, expected);
}

}  // namespace cairn::detail
