// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <stop_token>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/storage/database.hpp"

namespace cairn::sqlite {

enum class Access {
  kRead,    ///< the file must exist; read-only
  kWrite,   ///< the file must exist
  kCreate,  ///< the file is created if it does not exist
};

struct OpenOptions {
  Access access = Access::kRead;
  /// True if no other process writes while the file is open: takes no locks, works in a read-only
  /// folder, ignores a journal. For kRead only.
  bool immutable = false;
  /// True for a file of foreign origin: disables views, triggers and schema functions with side
  /// effects, checks the structure while reading, and limits values to the file's size. Never for a
  /// file whose own triggers must run.
  bool untrusted = true;
  /// Largest value, in bytes, that any process writes while an untrusted file is open.
  /// std::nullopt: for kRead, no longer than the file; for other access, unlimited.
  std::optional<std::uint64_t> longest_written = {};
  /// Longest wait for another process's lock.
  std::chrono::milliseconds busy_timeout{10'000};
  /// Statements end with an Error (cancelled) soon after stop was requested.
  std::stop_token stop = {};
};

using storage::ColumnType;
using storage::Statement;
using storage::Transaction;

/// A connection to an SQLite database file. Never loads extensions or attaches other files. Its
/// name in messages is the path as given.
class Database : public storage::Database {
 public:
  /// @throws Error (input) if the file is missing, not a regular file or not a database, (storage) if it
  ///        cannot be opened, (misuse) for immutable with write access
  explicit Database(const std::filesystem::path& path, const OpenOptions& options = {});

  /// Whether there is a table (not a view) of this name.
  bool has_table(std::string_view name);
  /// Names of a table's columns, in order; empty if there is no such table.
  std::vector<std::string> columns(std::string_view table);
};

}  // namespace cairn::sqlite
