// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/storage/sqlite/statement.hpp"

#include <string>
#include <utility>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/storage/detail/sqlite_connection.hpp"

namespace cairn::sqlite {

namespace detail {

struct StatementHandle {
  StatementHandle(Connection& its_connection, std::string_view its_sql)
      : connection(&its_connection), sql(its_sql) {}
  ~StatementHandle() { sqlite3_finalize(statement); }
  StatementHandle(const StatementHandle&) = delete;
  StatementHandle& operator=(const StatementHandle&) = delete;

  void check(int code) const {
    if (code != SQLITE_OK) connection->fail(code, sql);
  }

  Connection* connection;
  std::string sql;
  sqlite3_stmt* statement = nullptr;
};

}  // namespace detail

namespace {

ColumnType type_of(int code) {
  switch (code) {
    case SQLITE_INTEGER:
      return ColumnType::kInteger;
    case SQLITE_FLOAT:
      return ColumnType::kReal;
    case SQLITE_TEXT:
      return ColumnType::kText;
    case SQLITE_BLOB:
      return ColumnType::kBlob;
    default:
      return ColumnType::kNull;
  }
}

}  // namespace

std::string_view to_string(ColumnType type) {
  switch (type) {
    case ColumnType::kInteger:
      return "integer";
    case ColumnType::kReal:
      return "real";
    case ColumnType::kText:
      return "text";
    case ColumnType::kBlob:
      return "blob";
    case ColumnType::kNull:
      return "null";
  }
  return "unknown";
}

Statement::Statement(detail::Connection& connection, std::string_view sql)
    : handle_(std::make_unique<detail::StatementHandle>(connection, sql)) {
  const char* rest = nullptr;
  handle_->check(sqlite3_prepare_v3(connection.handle, handle_->sql.c_str(),
                                    static_cast<int>(handle_->sql.size()) + 1, 0,
                                    &handle_->statement, &rest));
  const std::string_view left = rest == nullptr ? std::string_view() : std::string_view(rest);
  if (handle_->statement == nullptr || left.find_first_not_of(" \t\r\n;") != left.npos) {
    throw Error(ErrorKind::kMisuse, connection.name, "SQL " + printable(sql), "one statement");
  }
}

Statement::Statement(Statement&&) noexcept = default;
Statement& Statement::operator=(Statement&&) noexcept = default;
Statement::~Statement() = default;

Statement& Statement::bind(int parameter, std::int64_t value) {
  handle_->check(sqlite3_bind_int64(handle_->statement, parameter, value));
  return *this;
}

Statement& Statement::bind(int parameter, double value) {
  handle_->check(sqlite3_bind_double(handle_->statement, parameter, value));
  return *this;
}

// A null pointer would bind NULL, which an empty text or blob is not.

Statement& Statement::bind(int parameter, std::string_view text) {
  handle_->check(sqlite3_bind_text64(handle_->statement, parameter,
                                     text.data() == nullptr ? "" : text.data(), text.size(),
                                     SQLITE_TRANSIENT, SQLITE_UTF8));
  return *this;
}

Statement& Statement::bind(int parameter, std::span<const std::byte> blob) {
  handle_->check(sqlite3_bind_blob64(
      handle_->statement, parameter,
      blob.data() == nullptr ? static_cast<const void*>("") : static_cast<const void*>(blob.data()),
      blob.size(), SQLITE_TRANSIENT));
  return *this;
}

Statement& Statement::bind(int parameter, std::nullptr_t) {
  handle_->check(sqlite3_bind_null(handle_->statement, parameter));
  return *this;
}

bool Statement::step() {
  const int code = sqlite3_step(handle_->statement);
  if (code == SQLITE_ROW) return true;
  if (code != SQLITE_DONE) {
    try {
      handle_->connection->fail(code, handle_->sql);
    } catch (...) {
      // Resets after the message is made, which resetting would lose; without it, the statement would keep
      // its locks.
      sqlite3_reset(handle_->statement);
      throw;
    }
  }
  sqlite3_reset(handle_->statement);
  return false;
}

void Statement::reset() {
  sqlite3_reset(handle_->statement);
  sqlite3_clear_bindings(handle_->statement);
}

int Statement::column_count() const {
  return sqlite3_column_count(handle_->statement);
}

std::string Statement::column_name(int column) const {
  const char* const name = sqlite3_column_name(handle_->statement, column);
  return name == nullptr ? fmt::format("column {}", column) : name;
}

ColumnType Statement::type(int column) const {
  return type_of(sqlite3_column_type(handle_->statement, column));
}

void Statement::require(int column, ColumnType expected) const {
  const ColumnType found = type(column);
  if (found == expected) return;
  std::string shown(to_string(found));
  if (found == ColumnType::kText) shown = "text " + printable(text(column));
  if (found == ColumnType::kInteger) shown = fmt::format("integer {}", integer(column));
  if (found == ColumnType::kReal) shown = fmt::format("real {}", real(column));
  throw Error(ErrorKind::kInput,
              fmt::format("{}: {}", handle_->connection->name, printable(column_name(column))),
              shown, to_string(expected));
}

std::int64_t Statement::integer(int column) const {
  require(column, ColumnType::kInteger);
  return sqlite3_column_int64(handle_->statement, column);
}

std::uint64_t Statement::unsigned_integer(int column) const {
  const std::int64_t value = integer(column);
  if (value < 0) {
    throw Error(ErrorKind::kInput,
                fmt::format("{}: {}", handle_->connection->name, printable(column_name(column))),
                fmt::format("integer {}", value), "none below 0");
  }
  return static_cast<std::uint64_t>(value);
}

double Statement::real(int column) const {
  if (type(column) != ColumnType::kInteger) require(column, ColumnType::kReal);
  return sqlite3_column_double(handle_->statement, column);
}

// SQLite returns a null pointer for an empty value, but also if memory is exhausted.

std::string_view Statement::text(int column) const {
  require(column, ColumnType::kText);
  const auto* const data =
      reinterpret_cast<const char*>(sqlite3_column_text(handle_->statement, column));
  if (data == nullptr) handle_->connection->fail(SQLITE_NOMEM, handle_->sql);
  return {data, static_cast<std::size_t>(sqlite3_column_bytes(handle_->statement, column))};
}

std::span<const std::byte> Statement::blob(int column) const {
  require(column, ColumnType::kBlob);
  const auto* const data =
      static_cast<const std::byte*>(sqlite3_column_blob(handle_->statement, column));
  const int size = sqlite3_column_bytes(handle_->statement, column);
  if (data == nullptr && size > 0) handle_->connection->fail(SQLITE_NOMEM, handle_->sql);
  if (data == nullptr && sqlite3_errcode(handle_->connection->handle) == SQLITE_NOMEM) {
    handle_->connection->fail(SQLITE_NOMEM, handle_->sql);
  }
  return {data, static_cast<std::size_t>(size)};
}

std::optional<std::int64_t> Statement::optional_integer(int column) const {
  if (is_null(column)) return std::nullopt;
  return integer(column);
}

std::optional<double> Statement::optional_real(int column) const {
  if (is_null(column)) return std::nullopt;
  return real(column);
}

std::optional<std::string_view> Statement::optional_text(int column) const {
  if (is_null(column)) return std::nullopt;
  return text(column);
}

std::optional<std::span<const std::byte>> Statement::optional_blob(int column) const {
  if (is_null(column)) return std::nullopt;
  return blob(column);
}

}  // namespace cairn::sqlite
