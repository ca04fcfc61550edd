// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/storage/sqlite/statement.hpp"

struct sqlite3;

namespace cairn::sqlite {

enum class Access {
  kRead,    ///< the file must exist; read-only
  kWrite,   ///< the file must exist
  kCreate,  ///< the file is created if it does not exist
};

struct OpenOptions {
  Access access = Access::kRead;
  /// No other process writes while it is open: takes no locks, works in a read-only folder, ignores a
  /// journal. For kRead only.
  bool immutable = false;
  /// The file comes from others: no views or triggers, no functions in its schema with side effects,
  /// structure checked while reading, no value longer than the file can hold. Never for a file whose own
  /// triggers must run.
  bool untrusted = true;
  /// Longest value that this process or another writes while an untrusted file is open, bytes. std::nullopt: none that
  /// is longer than the file, for kRead; any, for other access.
  std::optional<std::uint64_t> longest_written = {};
  /// Longest wait for another process's lock.
  std::chrono::milliseconds busy_timeout{10'000};
  /// Statements end with an Error (cancelled) soon after stop was requested.
  std::stop_token stop = {};
};

/// A connection to an SQLite database file; for one thread at a time. Never loads extensions or attaches
/// other files. Errors name the file: kind input for invalid content, kind storage for failures of the
/// operating system or conflicts with another process.
class Database {
 public:
  /// @throws Error (input) if the file is missing, not a regular file or not a database, (storage) if it
  ///        cannot be opened, (misuse) for immutable with write access
  explicit Database(const std::filesystem::path& path, const OpenOptions& options = {});
  ~Database();
  Database(Database&&) noexcept;
  Database& operator=(Database&&) noexcept;
  Database(const Database&) = delete;
  Database& operator=(const Database&) = delete;

  /// Name in messages: the path as given.
  const std::string& name() const noexcept;

  /// One statement, compiled. It must not outlive the database.
  Statement prepare(std::string_view sql);
  /// Runs any number of statements without parameters; ignores rows.
  void execute(const std::string& sql);
  /// Runs one statement to its end with these parameters.
  template <class... Values>
  void run(std::string_view sql, const Values&... values) {
    prepare(sql).run(values...);
  }
  /// First column of the first row, e.g. of "PRAGMA user_version".
  /// @throws Error (input) if there is no row or its value is not an integer
  std::int64_t integer(std::string_view sql);
  std::string text(std::string_view sql);

  /// Whether there is a table (not a view) of this name.
  bool has_table(std::string_view name);
  /// Names of a table's columns, in order; empty if there is no such table.
  std::vector<std::string> columns(std::string_view table);

  std::int64_t last_row_id() const noexcept;
  /// Rows that the last INSERT, UPDATE or DELETE changed.
  std::int64_t changes() const noexcept;
  bool in_transaction() const noexcept;

 private:
  std::unique_ptr<detail::Connection> connection_;
};

/// Everything between its construction and commit() happens atomically. One at a time.
class Transaction {
 public:
  enum class Kind {
    kRead,   ///< sees one state of the database throughout
    kWrite,  ///< waits for other writers at once, so it cannot fail because of them later
  };

  explicit Transaction(Database& database, Kind kind = Kind::kWrite);
  /// Undoes everything that was not committed.
  ~Transaction();
  Transaction(const Transaction&) = delete;
  Transaction& operator=(const Transaction&) = delete;

  /// @throws Error (storage); the database is then unchanged
  void commit();

 private:
  Database* database_;
  bool open_ = true;
};

}  // namespace cairn::sqlite
