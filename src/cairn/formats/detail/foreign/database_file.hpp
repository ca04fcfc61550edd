// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <initializer_list>
#include <string_view>

#include "cairn/formats/map_file.hpp"
#include "cairn/storage/sqlite/database.hpp"

namespace cairn::detail {

/// Whether a file is an SQLite database.
bool is_database(const MapInput& input);

/// Whether a file is an SQLite database that has all these tables, also if it was not closed.
bool is_database_with(const MapInput& input, std::initializer_list<std::string_view> tables);
bool is_database_with(const std::filesystem::path& path,
                      std::initializer_list<std::string_view> tables);

/// Opens another system's database for reading, without writing anything beside it.
/// @throws Error (input) naming the file, also if changes are in its write-ahead log or a hot journal
sqlite::Database open_foreign_database(const std::filesystem::path& path,
                                       const MapReadOptions& options);

}  // namespace cairn::detail
