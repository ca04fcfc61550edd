// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <concepts>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>

/// Statements and transactions, common to SQLite and PostgreSQL. sqlite/database.hpp and
/// postgres/database.hpp open databases.
namespace cairn::storage {

enum class ColumnType { kInteger, kReal, kText, kBlob, kNull, kOther };

/// "integer" etc.
std::string_view to_string(ColumnType type);

namespace detail {

/// Implements a Statement for one database system, with the functions of Statement. A column must
/// have the requested type, except that real() also reads an integer.
class Cursor {
 public:
  virtual ~Cursor() = default;

  virtual void bind(int parameter, std::int64_t value) = 0;
  virtual void bind(int parameter, double value) = 0;
  virtual void bind(int parameter, std::string_view text) = 0;
  virtual void bind(int parameter, std::span<const std::byte> blob) = 0;
  virtual void bind(int parameter, std::nullptr_t) = 0;
  virtual bool step() = 0;
  virtual void reset() = 0;

  virtual const std::string& database() const = 0;
  virtual std::string column_name(int column) const = 0;
  virtual ColumnType type(int column) const = 0;
  virtual std::int64_t integer(int column) const = 0;
  virtual double real(int column) const = 0;
  virtual std::string_view text(int column) const = 0;
  virtual std::span<const std::byte> blob(int column) const = 0;
};

}  // namespace detail

/// A statement: bind parameters, step through rows, read columns. Parameters count from 1 and are
/// written "?1"; columns count from 0.
class Statement {
 public:
  explicit Statement(std::unique_ptr<detail::Cursor> cursor) : cursor_(std::move(cursor)) {}

  /// Binds an integer, a double, text, a blob (a span of bytes) or nullptr.
  /// @throws Error (misuse) for text with a NUL, which PostgreSQL cannot store
  template <class Value>
  Statement& bind(int parameter, const Value& value) {
    if constexpr (std::integral<Value>) {
      cursor_->bind(parameter, static_cast<std::int64_t>(value));
    } else if constexpr (std::convertible_to<Value, std::string_view> &&
                         !std::same_as<Value, std::nullptr_t>) {
      cursor_->bind(parameter, std::string_view(value));
    } else {
      cursor_->bind(parameter, value);
    }
    return *this;
  }
  template <class Value>
  Statement& bind(int parameter, const std::optional<Value>& value) {
    return value ? bind(parameter, *value) : bind(parameter, nullptr);
  }
  /// Resets, then binds `values` to parameters 1, 2, ...; all others are NULL.
  template <class... Values>
  Statement& bind_all(const Values&... values) {
    reset();
    int parameter = 0;
    (bind(++parameter, values), ...);
    return *this;
  }

  /// Moves to the next row. @return false at the end; the statement can then run again.
  bool step() { return cursor_->step(); }
  /// Rewinds to before the first row and clears the parameters.
  void reset() { cursor_->reset(); }
  /// Calls bind_all(), then steps to the end.
  template <class... Values>
  void run(const Values&... values) {
    bind_all(values...);
    while (step()) {
    }
  }

  ColumnType type(int column) const { return cursor_->type(column); }
  bool is_null(int column) const { return type(column) == ColumnType::kNull; }

  // Columns of the current row. A value of another type throws Error (input) naming database,
  // column, value and constraint. Text and blobs are valid until the next step() or reset(), or the
  // statement's destruction.
  std::int64_t integer(int column) const;
  /// @throws Error (input) also for an integer below 0
  std::uint64_t unsigned_integer(int column) const;
  /// Accepts an integer as a real number.
  double real(int column) const;
  std::string_view text(int column) const;
  std::span<const std::byte> blob(int column) const;

  // std::nullopt for NULL.
  std::optional<std::int64_t> optional_integer(int column) const {
    return is_null(column) ? std::nullopt : std::optional(integer(column));
  }
  std::optional<double> optional_real(int column) const {
    return is_null(column) ? std::nullopt : std::optional(real(column));
  }
  std::optional<std::string_view> optional_text(int column) const {
    return is_null(column) ? std::nullopt : std::optional(text(column));
  }
  std::optional<std::span<const std::byte>> optional_blob(int column) const {
    return is_null(column) ? std::nullopt : std::optional(blob(column));
  }

 private:
  [[noreturn]] void refuse(int column, std::string_view found, std::string_view expected) const;
  void require(int column, ColumnType type) const;

  std::unique_ptr<detail::Cursor> cursor_;
};

class Database;

namespace detail {
class Connection;
}

/// All statements from construction to commit() take effect atomically. One transaction at a time
/// per connection.
class Transaction {
 public:
  enum class Kind {
    kRead,   ///< reads one snapshot of the database throughout
    kWrite,  ///< waits for other writers when it begins, so that they cannot make it fail later
    kRows,   ///< PostgreSQL: only the row locks of its statements; SQLite: as kWrite
  };

  /// @throws Error (storage) if another process held its lock beyond the timeout
  explicit Transaction(Database& database, Kind kind = Kind::kWrite);
  /// Rolls back an uncommitted transaction.
  ~Transaction();
  Transaction(const Transaction&) = delete;
  Transaction& operator=(const Transaction&) = delete;

  /// @throws Error (storage); the database is then unchanged, or the message states that the
  ///        outcome is unknown
  void commit();

 private:
  detail::Connection* connection_;
  bool open_ = true;
};

namespace detail {

/// Implements a Database and its Transaction.
class Connection {
 public:
  explicit Connection(std::string its_name) : name(std::move(its_name)) {}
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;
  virtual ~Connection() = default;

  virtual std::unique_ptr<Cursor> prepare(std::string_view sql) = 0;
  virtual void execute(const std::string& sql) = 0;
  virtual std::int64_t changes() const noexcept = 0;
  virtual bool in_transaction() const noexcept = 0;
  virtual void begin(Transaction::Kind kind) = 0;
  virtual void commit() = 0;
  /// Does nothing outside of a transaction.
  virtual void roll_back() noexcept = 0;

  const std::string name;
};

}  // namespace detail

/// A connection to a database, for one thread at a time. Errors name the database. Their kind is
/// input for invalid content, and storage for a failure of the operating system, server or network,
/// or a conflict with another process.
class Database {
 public:
  /// Name in messages.
  const std::string& name() const noexcept { return connection_->name; }

  /// One statement, valid for the database's lifetime.
  Statement prepare(std::string_view sql) { return Statement(connection_->prepare(sql)); }
  /// Runs any number of statements without parameters; ignores rows.
  void execute(const std::string& sql) { connection_->execute(sql); }
  /// Runs one statement to its end with these parameters.
  template <class... Values>
  void run(std::string_view sql, const Values&... values) {
    prepare(sql).run(values...);
  }
  /// First column of the first row.
  /// @throws Error (input) if there is no row or its value is not an integer
  std::int64_t integer(std::string_view sql);
  std::string text(std::string_view sql);

  /// Rows that the last INSERT, UPDATE or DELETE changed.
  std::int64_t changes() const noexcept { return connection_->changes(); }
  bool in_transaction() const noexcept { return connection_->in_transaction(); }

 protected:
  explicit Database(std::unique_ptr<detail::Connection> connection)
      : connection_(std::move(connection)) {}

 private:
  friend class Transaction;
  std::unique_ptr<detail::Connection> connection_;
};

}  // namespace cairn::storage
