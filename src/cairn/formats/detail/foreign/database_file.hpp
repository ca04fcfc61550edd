// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <initializer_list>
#include <string>
#include <string_view>

#include "cairn/formats/map_file.hpp"
#include "cairn/storage/sqlite/database.hpp"

namespace cairn::detail {

/// Whether a file is an SQLite database.
bool is_database(const MapInput& input);

/// Whether a file is an SQLite database that has all these tables, even if it was not closed.
bool is_database_with(const MapInput& input, std::initializer_list<std::string_view> tables);
bool is_database_with(const std::filesystem::path& path,
                      std::initializer_list<std::string_view> tables);

/// Opens another system's database for reading, without writing anything beside it.
/// @throws Error (input) naming the file, also if changes are in its write-ahead log or a hot journal
sqlite::Database open_foreign_database(const std::filesystem::path& path,
                                       const Execution& execution);

/// The name of a column, or "NULL" if the table lacks it, as databases of other versions may.
std::string column_or_null(sqlite::Database& database, const char* table, const char* column);

/// @param where e.g. the table
/// @throws Error (input) naming the database
[[noreturn]] void refuse_database(const sqlite::Database& database, const std::string& where,
                                  std::string_view what, std::string_view expected);

}  // namespace cairn::detail
