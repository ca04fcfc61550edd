// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <stop_token>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/sqlite/statement.hpp"

struct sqlite3;

namespace cairn::sqlite {

enum class Access {
  kRead,    ///< the file must exist; nothing is written
  kWrite,   ///< the file must exist
  kCreate,  ///< the file is made if it does not exist
};

struct OpenOptions {
  Access access = Access::kRead;
  /// Nobody writes while it is open: no locks are taken, and a file in a folder that cannot be written is
  /// read. A journal beside the file is ignored. For kRead only.
  bool immutable = false;
  /// The file comes from others: no views, no triggers, no functions in its schema that act on anything
  /// else, structure checked as it is read. Never for a file whose own triggers must run.
  bool untrusted = true;
  /// How long to wait for another process's lock.
  std::chrono::milliseconds busy_timeout{10'000};
  /// Statements end with an Error (cancelled) soon after stop was requested.
  std::stop_token stop = {};
};

/// A connection to an SQLite database in a file; one thread at a time. Extensions are never loaded, other
/// files never attached. Errors name the file: those of kind input say that it holds what it must not,
/// those of kind storage that the operating system or another process stood in the way.
class Database {
 public:
  /// @throws Error (input) if the file is missing, no regular file or no database, (storage) if it cannot
  ///         be opened, (misuse) for immutable with write access
  explicit Database(const std::filesystem::path& path, const OpenOptions& options = {});
  ~Database();
  Database(Database&&) noexcept;
  Database& operator=(Database&&) noexcept;
  Database(const Database&) = delete;
  Database& operator=(const Database&) = delete;

  /// For messages: the path as given.
  const std::string& name() const noexcept;

  /// One statement, compiled. It must not outlive the database.
  Statement prepare(std::string_view sql);
  /// Any number of statements without parameters; rows are ignored.
  void execute(const std::string& sql);
  /// One statement, run to its end with these parameters.
  template <class... Values>
  void run(std::string_view sql, const Values&... values) {
    prepare(sql).run(values...);
  }
  /// First column of the first row, e.g. of "PRAGMA user_version".
  /// @throws Error (input) if there is no row or it holds no integer
  std::int64_t integer(std::string_view sql);
  std::string text(std::string_view sql);

  /// Whether there is a table (no view) of this name.
  bool has_table(std::string_view name);
  /// Names of a table's columns, in their order; none if there is no such table.
  std::vector<std::string> columns(std::string_view table);

  std::int64_t last_row_id() const noexcept;
  /// Rows that the last INSERT, UPDATE or DELETE changed.
  std::int64_t changes() const noexcept;
  bool in_transaction() const noexcept;

 private:
  std::unique_ptr<detail::Connection> connection_;
};

/// What happens between its construction and commit() happens as a whole or not at all. One at a time.
class Transaction {
 public:
  enum class Kind {
    kRead,   ///< sees one state of the database throughout
    kWrite,  ///< waits for other writers at once, so that it cannot fail for them later
  };

  explicit Transaction(Database& database, Kind kind = Kind::kWrite);
  /// Undoes everything that was not committed.
  ~Transaction();
  Transaction(const Transaction&) = delete;
  Transaction& operator=(const Transaction&) = delete;

  /// @throws Error (storage); then nothing was changed
  void commit();

 private:
  Database* database_;
  bool open_ = true;
};

}  // namespace cairn::sqlite
