// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/storage/database.hpp"

#include <array>

#include <fmt/format.h>

#include "cairn/core/error.hpp"

namespace cairn::storage {

std::string_view to_string(ColumnType type) {
  constexpr std::array<std::string_view, 6> kNames = {"integer", "real", "text",
                                                      "blob",    "null", "a value of another type"};
  return kNames[static_cast<std::size_t>(type)];
}

void Statement::refuse(int column, std::string_view found, std::string_view expected) const {
  throw Error(ErrorKind::kInput,
              fmt::format("{}: {}", cursor_->database(), printable(cursor_->column_name(column))),
              found, expected);
}

void Statement::require(int column, ColumnType expected) const {
  const ColumnType found = type(column);
  if (found == expected) return;
  std::string shown(to_string(found));
  if (found == ColumnType::kText) shown = "text " + printable(text(column));
  if (found == ColumnType::kInteger) shown = fmt::format("integer {}", integer(column));
  if (found == ColumnType::kReal) shown = fmt::format("real {}", real(column));
  refuse(column, shown, to_string(expected));
}

std::int64_t Statement::integer(int column) const {
  require(column, ColumnType::kInteger);
  return cursor_->integer(column);
}

std::uint64_t Statement::unsigned_integer(int column) const {
  const std::int64_t value = integer(column);
  if (value < 0) refuse(column, fmt::format("integer {}", value), "none below 0");
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
