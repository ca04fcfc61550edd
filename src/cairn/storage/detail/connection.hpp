// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include "cairn/storage/database.hpp"

namespace cairn::storage::detail {

/// What a database system does for a Statement, whose functions these are. Columns are read only if they have
/// the type, except that real() also reads an integer.
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

/// The same of a Database and its Transaction.
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

}  // namespace cairn::storage::detail
