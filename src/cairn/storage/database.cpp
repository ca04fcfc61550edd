// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/storage/database.hpp"

#include <array>
#include <utility>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/storage/detail/connection.hpp"

namespace cairn::storage {

std::string_view to_string(ColumnType type) {
  constexpr std::array<std::string_view, 6> kNames = {"integer", "real", "text",
                                                      "blob",    "null", "a value of another type"};
  return kNames[static_cast<std::size_t>(type)];
}

Statement::Statement(std::unique_ptr<detail::Cursor> cursor) : cursor_(std::move(cursor)) {}
Statement::Statement(Statement&&) noexcept = default;
Statement& Statement::operator=(Statement&&) noexcept = default;
Statement::~Statement() = default;

Statement& Statement::bind(int parameter, std::int64_t value) {
  cursor_->bind(parameter, value);
  return *this;
}

Statement& Statement::bind(int parameter, double value) {
  cursor_->bind(parameter, value);
  return *this;
}

Statement& Statement::bind(int parameter, std::string_view text) {
  cursor_->bind(parameter, text);
  return *this;
}

Statement& Statement::bind(int parameter, std::span<const std::byte> blob) {
  cursor_->bind(parameter, blob);
  return *this;
}

Statement& Statement::bind(int parameter, std::nullptr_t) {
  cursor_->bind(parameter, nullptr);
  return *this;
}

bool Statement::step() {
  return cursor_->step();
}

void Statement::reset() {
  cursor_->reset();
}

ColumnType Statement::type(int column) const {
  return cursor_->type(column);
}

void Statement::require(int column, ColumnType expected) const {
  const ColumnType found = type(column);
  if (found == expected) return;
  std::string shown(to_string(found));
  if (found == ColumnType::kText) shown = "text " + printable(text(column));
  if (found == ColumnType::kInteger) shown = fmt::format("integer {}", integer(column));
  if (found == ColumnType::kReal) shown = fmt::format("real {}", real(column));
  throw Error(ErrorKind::kInput,
              fmt::format("{}: {}", cursor_->database(), printable(cursor_->column_name(column))),
              shown, to_string(expected));
}

std::int64_t Statement::integer(int column) const {
  require(column, ColumnType::kInteger);
  return cursor_->integer(column);
}

std::uint64_t Statement::unsigned_integer(int column) const {
  const std::int64_t value = integer(column);
  if (value < 0) {
    throw Error(ErrorKind::kInput,
                fmt::format("{}: {}", cursor_->database(), printable(cursor_->column_name(column))),
                fmt::format("integer {}", value), "none below 0");
  }
  return static_cast<std::uint64_t>(value);
}

double Statement::real(int column) const {
  if (type(column) != ColumnType::kInteger) require(column, ColumnType::kReal);
  return cursor_->real(column);
}

std::string_view Statement::text(int column) const {
  require(column, ColumnType::kText);
  return cursor_->text(column);
}

std::span<const std::byte> Statement::blob(int column) const {
  require(column, ColumnType::kBlob);
  return cursor_->blob(column);
}

std::optional<std::int64_t> Statement::optional_integer(int column) const {
  return is_null(column) ? std::nullopt : std::optional(integer(column));
}

std::optional<double> Statement::optional_real(int column) const {
  return is_null(column) ? std::nullopt : std::optional(real(column));
}

std::optional<std::string_view> Statement::optional_text(int column) const {
  return is_null(column) ? std::nullopt : std::optional(text(column));
}

std::optional<std::span<const std::byte>> Statement::optional_blob(int column) const {
  return is_null(column) ? std::nullopt : std::optional(blob(column));
}

Database::Database(std::unique_ptr<detail::Connection> connection)
    : connection_(std::move(connection)) {}
Database::Database(Database&&) noexcept = default;
Database& Database::operator=(Database&&) noexcept = default;
Database::~Database() = default;

const std::string& Database::name() const noexcept {
  return connection_->name;
}

Statement Database::prepare(std::string_view sql) {
  return Statement(connection_->prepare(sql));
}

void Database::execute(const std::string& sql) {
  connection_->execute(sql);
}

std::int64_t Database::integer(std::string_view sql) {
  Statement statement = prepare(sql);
  reject_if(!statement.step(), name(), "no row for " + printable(sql), "one");
  return statement.integer(0);
}

std::string Database::text(std::string_view sql) {
  Statement statement = prepare(sql);
  reject_if(!statement.step(), name(), "no row for " + printable(sql), "one");
  return std::string(statement.text(0));
}

std::int64_t Database::changes() const noexcept {
  return connection_->changes();
}

bool Database::in_transaction() const noexcept {
  return connection_->in_transaction();
}

Transaction::Transaction(Database& database, Kind kind) : connection_(database.connection_.get()) {
  connection_->begin(kind);
}

Transaction::~Transaction() {
  if (open_) connection_->roll_back();
}

void Transaction::commit() {
  connection_->commit();
  open_ = false;
}

}  // namespace cairn::storage
